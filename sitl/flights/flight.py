"""One flight: two processes, their progress, and the report."""

from __future__ import annotations

import contextlib
import errno
import itertools
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from controller.feedback.truth import estimates
from controller.own_law.find import ChosenLaw, make
from sitl.flights.launch import Outcome, Pair, watch
from sitl.flights.refusals import check_feasible
from sitl.flights.scenario import (
    GroundControl,
    Scenario,
    plant_vehicle,
    scenario_vehicle,
    suited,
    usual_feedback,
)
from sitl.report.keep import keep_recording
from sitl.report.points import as_flown
from sitl.report.summary import OF_THE_PLANT, clear, without_files, write_report, write_summary
from sitl.terminal.display import Display
from sitl.terminal.status import Status, status_of
from sitl_bridge.log_amount import Logs
from sitl_bridge.mavlink.links.address import Address
from sitl_bridge.mavlink.links.opening import open_link
from sitl_bridge.plant.faults.schedule import checked
from sitl_bridge.process import StopRequest
from sitl_bridge.vehicle.description import Vehicle
from sitl_bridge.vehicle.files import DescriptionError, Override

DEFAULT_DURATION = 60.0
"""s, of a flight in one process whose scenario has none."""
MIRRORED: dict[str, Any] = {"udpout": "udpin", "udpin": "udpout", "tcpin": "tcpout", "tcpout": "tcpin"}
"""Kind of the other end of a link."""


@dataclass(frozen=True)
class FlightOptions:
    """What `sitl fly` is asked for."""

    scenario_name: str
    scenario: Scenario
    vehicle: str | None
    overrides: Sequence[str]
    plant_overrides: Sequence[str]
    hil: Address
    """The plant's end of the link."""
    clock: str
    speed: float | None
    on_silence: str
    rate_hz: float
    seed: int
    design: str
    feedback: str | None
    """None: as usual, see `scenario.usual_feedback`."""
    duration_s: float | None
    drop_percent: float
    instance: int
    out: Path | None
    """None: a new folder under runs/; under ground control, no logs."""
    logs: Logs = "usual"
    """How much is left there."""
    report: bool = True
    """Whether picture, page and MCAP are made of it."""
    truth_to: tuple[str, int] | None = None
    """Host and port of a viewer that is shown the truth."""
    in_process: bool = False
    """Plant and controller joined in this process, without sockets."""
    law: ChosenLaw | None = None
    """A law of the user's own, instead of the design."""
    agility: float | None = None
    """Of the reference, which the scenario has already; None: the scenario's own."""
    ground: Sequence[str] = ()
    """Arguments of the controller for its ground-control links."""

    def command_lines(self) -> tuple[list[str], list[str]]:
        """Arguments of `sitl plant` and of `sitl controller`."""
        common = ["--scenario", self.scenario_name, "--rate", repr(self.rate_hz)]
        common += ["--instance", str(self.instance), "--seed", str(self.seed)]
        if self.vehicle is not None:
            common += ["--vehicle", self.vehicle]
        for override in self.overrides:
            common += ["--set", override]
        plant = [*common, "--hil", str(self.hil), "--clock", self.clock]
        if self.clock == "lockstep":
            plant += ["--on-silence", self.on_silence]
        for override in self.plant_overrides:
            plant += ["--set", override]
        if self.speed is not None:
            plant += ["--speed", repr(self.speed)]
        if self.duration_s is not None:
            plant += ["--duration", repr(self.duration_s)]
        plant += ["--drop", repr(self.drop_percent)]
        if self.truth_to is not None:
            plant += ["--truth-to", "{}:{}".format(*self.truth_to)]
        if self.out is not None:
            plant += ["--out", str(self.out), "--logs", self.written]
        controller = [*common, "--hil", str(self.other_end), "--design", self.design]
        if self.law is not None:
            controller += ["--law", self.law.name]
        if self.agility is not None:
            controller += ["--agility", repr(self.agility)]
        if self.feedback is not None:
            controller += ["--feedback", self.feedback]
        if self.out is not None:
            controller += ["--out", str(self.out), "--logs", self.written]
        return plant, [*controller, *self.ground]

    @property
    def written(self) -> Logs:
        """How much is written while it flies: a summary is made from logs, even if they are not kept."""
        return "usual" if self.logs == "none" else self.logs

    @property
    def other_end(self) -> Address:
        """The controller's end of the link."""
        return self.hil._replace(kind=MIRRORED[self.hil.kind])

    def check_port(self) -> None:
        """Raises OSError, before anything is launched, when somebody has the port of the end that waits.

        A plant would else fly with whoever that is.
        """
        waiting = self.hil if self.hil.kind.endswith("in") else self.other_end
        try:
            open_link(waiting, lambda text: None).close()
        except OSError as error:
            in_use = getattr(error.__context__, "errno", None) == errno.EADDRINUSE
            advice = "; --instance N flies beside others, --hil on another port" if in_use else ""
            raise OSError(f"{error}{advice}") from None

    def check_in_process(self) -> None:
        """Raises DescriptionError for what takes two processes."""
        for flag, given in (
            ("--drop", bool(self.drop_percent)),
            ("--speed", self.speed is not None),
            ("--clock realtime", self.clock != "lockstep"),
            ("faults.link", bool(self.scenario.faults.link)),
        ):
            if given:
                raise DescriptionError(
                    "--in-process", [f"{flag} takes two processes with a link between them"]
                )

    def checked_vehicle(self) -> Vehicle:
        """The vehicle as the controller is told, once it is sure that it can fly what it is given.

        Raises DescriptionError, before anything is launched.
        """
        only_plant = [Override(text, "--plant-set") for text in self.plant_overrides]
        flown = plant_vehicle(self.scenario, self.vehicle, [*self.overrides, *only_plant])
        checked(self.scenario.faults, flown)
        told = scenario_vehicle(self.scenario, self.vehicle, self.overrides)
        check_feasible(self.scenario, told, self.design)
        if self.law is not None:
            make(self.law, told, self.rate_hz)
        return told


def new_folder(folder: Path) -> Path:
    """Make a folder that was not there before, numbered if need be; returns it."""
    for name in itertools.chain([folder.name], (f"{folder.name}-{n}" for n in itertools.count(2))):
        made = folder.with_name(name)
        with contextlib.suppress(FileExistsError):
            made.mkdir(parents=True)
            return made
    raise AssertionError("numbers do not end")


def _fly_here(
    options: FlightOptions,
    stop: StopRequest,
    show: Callable[[dict[str, Any]], None],
    say: Callable[[str], None],
) -> Outcome:
    """Fly in this process; the outcome as two processes would leave it."""
    from sitl.flights.in_process import InProcessFlight, fly_in_process

    scenario, told = options.scenario, options.checked_vehicle()
    only_plant = [Override(text, "--plant-set") for text in options.plant_overrides]
    assert not isinstance(scenario.reference, GroundControl)
    ended = fly_in_process(
        InProcessFlight(
            told=told,
            flown=plant_vehicle(scenario, options.vehicle, [*options.overrides, *only_plant]),
            path_from=scenario.reference.path,
            duration_s=options.duration_s or scenario.duration or DEFAULT_DURATION,
            rate_hz=options.rate_hz,
            seed=options.seed,
            design=options.design,
            feedback=options.feedback or usual_feedback(scenario, told),
            instance=options.instance,
            faults=checked(scenario.faults, told),
            law=options.law,
            out=options.out,
            logs=options.written,
        ),
        stop,
        show,
        lambda text: say(f"fly: {text}"),
    )
    failure = ended.account.pop("failure")
    stopped = f"stopped by {stop.reason}" if stop else None
    given_up = f"the plant gave up: {failure}" if failure else None
    of_law = str(ended.law_failure) if ended.law_failure is not None else None
    return Outcome(
        end=ended.account,
        failure=of_law or stopped or given_up,
        first_command_unix_s=ended.began_at,
        law=ended.law,
        legs_began_s=ended.legs_began_s,
    )


def fly(options: FlightOptions, stop: StopRequest) -> tuple[dict[str, Any], Path]:
    """Fly; returns the summary and the output folder, where it is too. Raises DescriptionError, OSError."""
    scenario = options.scenario
    vehicle = options.checked_vehicle()
    for note in suited(scenario, options.vehicle, options.overrides).notes:
        print(f"fly: {note}", file=sys.stderr, flush=True)
    if options.in_process:
        options.check_in_process()
    else:
        options.check_port()
    if options.out is None:
        name = f"{Path(options.scenario_name).stem}-{time.strftime('%Y%m%d-%H%M%S')}"
        options = replace(options, out=new_folder(Path("runs") / name))
    assert options.out is not None
    options.out.mkdir(parents=True, exist_ok=True)
    clear(options.out)
    if options.logs != "none":
        return _fly_into(options, options.out, vehicle, stop), options.out
    with tempfile.TemporaryDirectory(prefix="sitl-fly-") as folder:
        summary = without_files(_fly_into(options, Path(folder), vehicle, stop))
    write_summary(options.out, summary)
    return summary, options.out


def _fly_into(options: FlightOptions, out: Path, vehicle: Vehicle, stop: StopRequest) -> dict[str, Any]:
    """Fly; logs go to a folder that is empty. Returns the summary."""
    options, scenario = replace(options, out=out), options.scenario
    assert not isinstance(scenario.reference, GroundControl)  # see `sitl.flights.hold`
    path_from = scenario.reference.path
    start = vehicle.initial_load_position
    reference: list[Any] = []  # made at the first progress event: it needs the autopilot's imports

    def status(event: dict[str, Any]) -> Status:
        import numpy as np

        from sitl.report.metrics import reference_positions

        if not reference:
            reference.append(path_from(start))
        load = np.array(event["load_m"])
        began = event.pop("legs_began_s", [])
        target = reference_positions(as_flown(reference[0], began), np.array([event["time_s"]]))[0]
        count = len(reference[0])
        event["mode"] = scenario.reference.kind if count == 1 else f"to point {len(began) or 1} of {count}"
        return status_of(event, float(np.linalg.norm(load - target)))

    with Display() as display:
        if options.in_process:
            outcome = _fly_here(options, stop, lambda event: display.show(status(event)), display.say)
        else:
            pair = Pair(*options.command_lines(), display.messages, forked=options.law is None)
            display.forward()
            outcome = watch(pair, stop, lambda event: display.show(status(event)))
    if outcome.failure:
        print(f"fly: {outcome.failure}", file=sys.stderr, flush=True)
    facts = flight_facts(options, vehicle, outcome)
    path = as_flown(path_from(start), outcome.legs_began_s)
    estimating = vehicle if estimates(facts["feedback"], vehicle) else None
    kept = options.logs != "none"
    summary = write_report(out, facts, path, estimating, vehicle, picture=kept and options.report)
    if kept:
        keep_recording(out, vehicle, path, options.logs, options.report)
    return summary


def flight_facts(options: FlightOptions, vehicle: Vehicle, outcome: Outcome) -> dict[str, Any]:
    """What is known of a flight besides its logs: keys of the summary."""
    return {
        "scenario": options.scenario_name,
        "vehicle": vehicle.name,
        "design": options.design if options.law is None else None,
        "law": outcome.law,
        "feedback": options.feedback or usual_feedback(options.scenario, vehicle),
        "seed": options.seed,
        "clock": options.clock,
        "rate_hz": options.rate_hz,
        "completed": bool(outcome.end.get("completed")) and not outcome.failure,
        "failure": outcome.failure,
        "launch_to_first_command_s": outcome.launch_to_first_command_s,
        "first_command_unix_s": outcome.first_command_unix_s,
        **{key: outcome.end[key] for key in OF_THE_PLANT if key in outcome.end},
    }
