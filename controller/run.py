"""The controller's process: the HIL link and one loop that waits for the next datagram or deadline."""

from __future__ import annotations

import gc
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from controller.design.names import FOR_ESTIMATES
from controller.feedback.truth import Feedback, PathFrom, TruthFeedback, estimates
from controller.hil.backlog import Inlet
from controller.hil.session import HilSession, Pilot, new_session
from controller.pilot.autopilot import Autopilot
from controller.pilot.stall_clock import StallFreeClock
from controller.pilot.terms_log import TermsLog
from sitl_bridge.event_log import EventLog
from sitl_bridge.log_amount import Logs
from sitl_bridge.mavlink.links.address import Address
from sitl_bridge.mavlink.links.link import Link
from sitl_bridge.mavlink.links.lossy import LossyLink
from sitl_bridge.mavlink.links.opening import open_link
from sitl_bridge.process import Speaker, StopRequest
from sitl_bridge.vehicle.cable_law import linearised
from sitl_bridge.vehicle.description import Vehicle

if TYPE_CHECKING:
    from controller.feedback.assessment import Assessor
    from controller.feedback.delay_watch import DelayWatch
    from controller.feedback.log import EstimateLog
    from controller.law.state import Array
    from controller.own_law.find import ChosenLaw
    from controller.own_law.pilot import OwnLawPilot
    from controller.pilot.guided.options import GroundOptions
    from controller.pilot.guided.session import Guided
    from controller.pilot.legs import Legs


@dataclass(frozen=True)
class ControllerOptions:
    """What a controller is started with."""

    vehicle: Vehicle
    hil: Address
    design: str
    rate_hz: float
    path_from: PathFrom | None
    """None: ground control says when to arm and where to go."""
    instance: int = 0
    duration_s: float | None = None
    drop_percent: float = 0.0
    seed: int = 0
    ground: GroundOptions | None = None
    """With `path_from` None: how ground control reaches the vehicle."""
    feedback: str = "truth"
    out: Path | None = None
    """Where the logs of estimate and law go."""
    logs: Logs = "usual"
    """How much goes there."""
    law: ChosenLaw | None = None
    """A law of the user's own, instead of the design."""


class Session(NamedTuple):
    """The autopilot's side of the HIL link without the link; the caller closes logs and guided."""

    hil: HilSession
    logs: tuple[EstimateLog | TermsLog, ...]
    guided: Guided | None
    """What ground control needs of it."""
    own_law: OwnLawPilot | None
    legs: Legs | None
    """Of the reference; None under ground control."""

    def close_logs(self) -> None:
        """Write out everything; raises what went wrong while writing."""
        for log in self.logs:
            log.close()


def run(options: ControllerOptions, speaker: Speaker, stop: StopRequest) -> dict[str, Any]:
    """Run a controller until it is asked to stop, or has flown its duration; returns what to report of it.

    Raises OSError when the link cannot be opened.
    """
    link = open_link(options.hil, speaker.say)
    if options.drop_percent:
        link = LossyLink(link, options.drop_percent, options.seed)
    session = open_session(options, speaker)
    if options.out is not None:
        speaker.keep(EventLog(options.out), lambda: session.hil.scenario_time)
    own_law = session.own_law
    flies = f"{options.design} design" if options.law is None else f"law {options.law.name}"
    speaker.say(
        f"{options.vehicle.name}, {flies} on {options.feedback} at {options.rate_hz:g} Hz, "
        f"waiting for a plant on {options.hil} (system {options.instance + 1})"
    )
    most_steps = None if options.duration_s is None else round(options.duration_s * options.rate_hz)
    try:
        _loop(session, link, most_steps, stop, speaker)
    finally:
        if session.guided is not None:
            session.guided.close()
        link.close()
        session.close_logs()
    failure = own_law.failure if own_law is not None else None
    if failure is not None:
        speaker.say(str(failure))
    if stop:
        speaker.say(f"stopped by {stop.reason}")
    outcome = {
        "stopped_by": stop.reason,
        "control_steps": session.hil.steps,
        "law": None if own_law is None else own_law.cost,
        "legs_began_s": [] if session.legs is None else session.legs.began_s,
        "failure": None if failure is None else str(failure),
    }
    speaker.event("end", **outcome)
    return outcome


def open_session(options: ControllerOptions, speaker: Speaker) -> Session:
    """A session with the autopilot, feedback and logs that the options ask for.

    Whatever the cable is, the controller takes it for the linear one that
    it acts as about hover.

    Raises DescriptionError for a law of the user's own that cannot be flown.
    """
    options = replace(options, vehicle=linearised(options.vehicle))
    log: EstimateLog | None = None
    feedback: Feedback | None = None
    design = options.design
    assessor: Assessor | None = None
    if options.feedback == "estimate":
        log, feedback, assessor = _estimating(options, speaker)
        design = FOR_ESTIMATES.get(design, design)
    elif None not in (options.path_from, options.out) and estimates(options.feedback, options.vehicle):
        log, feedback = _estimating_beside(options)
    elif options.feedback == "truth":
        feedback = TruthFeedback(_delay_watch(options))
    terms_log = None if options.out is None else TermsLog(options.out, options.logs)
    logs = tuple(each for each in (log, terms_log) if each is not None)
    instance, say, rate = options.instance, speaker.say, options.rate_hz
    if options.path_from is None:
        from controller.pilot.guided.session import Guided

        guided = Guided(
            *(options.vehicle, rate, instance, _ground(options), say, assessor),
            on_statustext=lambda text: speaker.note("statustext", text),
        )
        hil = new_session(guided.autopilot, instance, say, feedback, rate, terms_log)
        return Session(hil, logs, guided, None, None)
    path_from = options.path_from if feedback is None else feedback.path_from(options.path_from)

    own_law: OwnLawPilot | None = None
    legs: Legs | None = None

    def on_leg(number: int, count: int, began_s: float) -> None:
        speaker.event("leg", number=number, began_s=began_s)
        if number > 1:
            speaker.note("mode", f"to point {number} of {count}")

    def autopilot(controls: Array) -> Pilot:
        nonlocal own_law, legs
        if options.law is None:
            pilot = Autopilot(options.vehicle, design, rate, path_from, controls, on_leg)
            legs = pilot.legs
            return pilot
        from controller.own_law.pilot import OwnLawPilot

        own_law = OwnLawPilot(options.law, options.vehicle, rate, path_from, controls, on_leg)
        legs = own_law.legs
        return own_law

    hil = new_session(autopilot, instance, say, feedback, rate, terms_log)
    return Session(hil, logs, None, own_law, legs)


def _ground(options: ControllerOptions) -> GroundOptions:
    """With the flight's folder, whose logs clients may read."""
    from controller.pilot.guided.options import GroundOptions

    return replace(options.ground or GroundOptions(), logs=options.out)


def _estimating(
    options: ControllerOptions, speaker: Speaker
) -> tuple[EstimateLog | None, Feedback, Assessor]:
    """The estimator, its log and what judges it; imported only where they are flown on."""
    from controller.feedback.estimate import EstimateFeedback
    from controller.feedback.health import EstimateAssessor
    from controller.feedback.log import EstimateLog

    log = None if options.out is None else EstimateLog(options.out, options.logs)
    alone = options.path_from is not None
    feedback = EstimateFeedback(options.vehicle, options.rate_hz, log, speaker.say, only_good=alone)
    return log, feedback, EstimateAssessor(feedback)


def _estimating_beside(options: ControllerOptions) -> tuple[EstimateLog, Feedback]:
    """The estimator beside the truth, and its log."""
    from controller.feedback.estimate import EstimateFeedback, TruthBesideEstimate
    from controller.feedback.log import EstimateLog

    assert options.out is not None
    log = EstimateLog(options.out, options.logs)
    beside = EstimateFeedback(options.vehicle, options.rate_hz, log)
    return log, TruthBesideEstimate(beside, options.rate_hz, _delay_watch(options))


def _delay_watch(options: ControllerOptions) -> DelayWatch | None:
    """On truth; the paper's designs and laws of the user's own stay what they are, whatever the loop does."""
    if options.law is not None or (options.path_from is not None and options.design not in FOR_ESTIMATES):
        return None
    from controller.feedback.delay_watch import DelayWatch

    return DelayWatch(options.vehicle, options.rate_hz)


def _loop(
    opened: Session,
    link: Link,
    most_steps: int | None,
    stop: StopRequest,
    speaker: Speaker,
) -> None:
    session, guided, own_law = opened.hil, opened.guided, opened.own_law
    gc.freeze()  # what was built at start-up stays; collections in flight have little to look at
    clock = StallFreeClock(time.monotonic())
    inlet = Inlet(link)
    now = time.monotonic()
    mode = ""
    while stop.reason is None and (most_steps is None or session.steps < most_steps):
        deadline = session.next_deadline()
        if guided is None:
            received = inlet.receive(deadline)
            now = time.monotonic()
        else:
            until = clock.monotonic(min(deadline, guided.next_deadline(now)))
            received = inlet.receive(until)
            now = clock.now(time.monotonic(), until)
        if received is not None:
            session.expect(inlet.found())
            session.receive(received, now)
        for datagram in session.to_send(now):
            link.send(datagram)
        if own_law is not None and own_law.failure is not None:  # the plant has been told: rotors stopped
            return
        # After the answer: the plant does not wait for ground control.
        if guided is not None and guided.serve(now, heard=received is not None):
            for datagram in guided.to_plant(now):
                link.send(datagram)
            if guided.mode_title != mode:
                mode = guided.mode_title
                speaker.event("mode", mode=mode)
                speaker.note("mode", mode)
            if guided.shut_down:
                stop.reason = "a client's command to shut down"
