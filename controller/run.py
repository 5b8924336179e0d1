"""The controller's process: the HIL link and one loop that waits for the next datagram or deadline."""

from __future__ import annotations

import gc
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from controller.autopilot import Autopilot, PathFrom
from controller.designs import ON_ESTIMATE
from controller.estimate_log import EstimateLog
from controller.feedback import EstimateFeedback
from controller.hil.session import HilSession, new_session
from sitl_bridge.mavlink.links import Address, Link, open_link
from sitl_bridge.mavlink.loss import LossyLink
from sitl_bridge.process import Speaker, StopRequest
from sitl_bridge.vehicle import Vehicle


@dataclass(frozen=True)
class ControllerOptions:
    """What a controller is started with."""

    vehicle: Vehicle
    hil: Address
    design: str
    rate_hz: float
    path_from: PathFrom
    instance: int = 0
    duration_s: float | None = None
    drop_percent: float = 0.0
    seed: int = 0
    feedback: str = "truth"
    out: Path | None = None
    """Where the estimate's log goes."""


def run(options: ControllerOptions, speaker: Speaker, stop: StopRequest) -> dict[str, Any]:
    """Run a controller until it is asked to stop, or has flown its duration; returns what to report of it.

    Raises OSError when the link cannot be opened.
    """
    link = open_link(options.hil, speaker.say)
    if options.drop_percent:
        link = LossyLink(link, options.drop_percent, options.seed)
    log, feedback, design = None, None, options.design
    if options.feedback == "estimate":
        log = None if options.out is None else EstimateLog(options.out)
        feedback = EstimateFeedback(options.vehicle, options.rate_hz, log)
        design = ON_ESTIMATE if design == "default" else design
    session = new_session(
        lambda controls: Autopilot(options.vehicle, design, options.rate_hz, options.path_from, controls),
        options.instance,
        speaker.say,
        feedback,
    )
    speaker.say(
        f"{options.vehicle.name}, {options.design} design on {options.feedback} at {options.rate_hz:g} Hz, "
        f"waiting for a plant on {options.hil} (system {options.instance + 1})"
    )
    most_steps = None if options.duration_s is None else round(options.duration_s * options.rate_hz)
    try:
        _loop(session, link, most_steps, stop)
    finally:
        link.close()
        if log is not None:
            log.close()
    if stop:
        speaker.say(f"stopped by {stop.reason}")
    outcome = {"stopped_by": stop.reason, "control_steps": session.steps}
    speaker.event("end", **outcome)
    return outcome


def _loop(session: HilSession, link: Link, most_steps: int | None, stop: StopRequest) -> None:
    gc.freeze()  # what was built at start-up stays; collections in flight have little to look at
    while not stop and (most_steps is None or session.steps < most_steps):
        received = link.receive(session.next_deadline())
        now = time.monotonic()
        if received is not None:
            session.receive(received, now)
        for datagram in session.to_send(now):
            link.send(datagram)
