"""`sitl fly --over`: one flight of the load over a stack, and the report on it."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from controller.over.stack import read_stack
from sitl.flights.flight import new_folder
from sitl.flights.free_ports import free_ports
from sitl.flights.refusals import check_feasible
from sitl.flights.scenario import GroundControl, Scenario, scenario_vehicle, suited
from sitl.over.processes import Account, Children
from sitl.over.window import cut_log, shift_events, step_figures
from sitl.report.keep import keep_recording
from sitl.report.summary import OF_THE_PLANT, clear, positions, read_state_log, write_report
from sitl.terminal.display import Display
from sitl.terminal.status import Status, status_of
from sitl.terminal.summary import row
from sitl_bridge.mavlink.links.address import Address
from sitl_bridge.mavlink.links.opening import open_link
from sitl_bridge.plant.log.state_log import FILE_NAME
from sitl_bridge.process import StopRequest
from sitl_bridge.vehicle.description import Vehicle
from sitl_bridge.vehicle.files import DescriptionError, Override, load_vehicle

PLANT_FOLDER = "plant"
"""In a flight's folder: the plant's logs of everything, from arming to landing."""
WITH_SENSOR = ("tracker", "position")
"""Sources of the load's state that listen to the plant's `--load-to`."""
ON_THE_GROUND = "initial.start=ground"


@dataclass(frozen=True)
class OverFlight:
    """What `sitl fly --over` is asked for."""

    scenario_name: str
    scenario: Scenario
    vehicle: str | None
    overrides: Sequence[str]
    plant_overrides: Sequence[str]
    hil: Address
    """The plant's end of the stack's simulator link."""
    over: str
    """The stack's MAVLink, an address."""
    load: str
    baseline: str | None
    """Who flies instead of the law, for comparison; see `controller.over.baseline`."""
    steering: str
    """What the stack is given besides the thrust; see `controller.over.model.Steering`."""
    stack: Path | None
    clock: str
    speed: float | None
    on_silence: str
    rate_hz: float
    seed: int
    duration_s: float
    """Infinite: until stopped."""
    live: tuple[int, int] | None
    """UDP ports of the load's own system, where ground control moves it: our own and its peer's."""
    wait_s: float
    instance: int
    out: Path | None
    truth_to: tuple[str, int] | None = None
    """A viewer, besides the companion."""

    def check(self) -> None:
        """Raises DescriptionError or OSError for what cannot be flown, before anything is launched."""
        faults = self.scenario.faults
        if faults != type(faults)():
            raise DescriptionError(
                self.scenario_name, ["faults: expected none; over a stack nobody knows when it takes off"]
            )
        if self.stack is not None:
            read_stack(self.stack)
        if self.load == "tracker" and self.told().sensors.tracker is None:
            expected = "expected a tracker, as by --set sensors.tracker.rate=20"
            raise DescriptionError("--load tracker", [f"{self.told().name} has none; {expected}"])
        load_vehicle(self.vehicle or self.scenario.vehicle, self.of_plant())
        check_feasible(self.scenario, self.told(), "default")
        open_link(self.hil, lambda text: None).close()

    def of_plant(self) -> list[Override]:
        """Overrides of the plant's vehicle, which begins on the ground."""
        found = suited(self.scenario, self.vehicle, [*self.overrides, Override(ON_THE_GROUND, "--over")])
        own = [Override(text, "--set") for text in self.overrides]
        only_plant = [Override(text, "--plant-set") for text in self.plant_overrides]
        start = [] if any("initial.start" in text for text in self.overrides) else [ON_THE_GROUND]
        described = [o for o in found.overrides if not o.text.startswith("initial.")]
        more = [Override(text, "--over") for text in start]
        return [*described, *found.plant_overrides, *own, *only_plant, *more]

    def told(self) -> Vehicle:
        """The vehicle as the companion is told."""
        return scenario_vehicle(self.scenario, self.vehicle, self.overrides)

    def command_lines(self, out: Path, truth_port: int, load_port: int) -> tuple[list[str], list[str]]:
        """Arguments of `sitl plant` and of `sitl controller`."""
        plant = ["plant", "--vehicle", self.vehicle or self.scenario.vehicle]
        for override in self.of_plant():
            plant += ["--set", override.text]
        plant += ["--hil", str(self.hil), "--clock", self.clock, "--rate", repr(self.rate_hz)]
        plant += ["--instance", str(self.instance), "--seed", str(self.seed)]
        if self.clock == "lockstep":
            plant += ["--on-silence", self.on_silence]
        if self.speed is not None:
            plant += ["--speed", repr(self.speed)]
        plant += ["--truth-to", f"127.0.0.1:{truth_port}", "--out", str(out / PLANT_FOLDER)]
        if self.load in WITH_SENSOR:
            plant += ["--load-to", f"127.0.0.1:{load_port}"]
        if self.truth_to is not None:
            plant += ["--truth-to", "{}:{}".format(*self.truth_to)]
        companion = ["controller", "--scenario", self.scenario_name, "--instance", str(self.instance)]
        if math.isfinite(self.duration_s):
            companion += ["--duration", repr(self.duration_s)]
        if self.live is not None:
            companion += ["--gcs", "{}:{}".format(*self.live)]
        if self.vehicle is not None:
            companion += ["--vehicle", self.vehicle]
        for text in self.overrides:
            companion += ["--set", text]
        companion += ["--over", self.over, "--load", self.load, "--wait", repr(self.wait_s)]
        companion += ["--truth-from", f"udpin:127.0.0.1:{truth_port}", "--out", str(out)]
        if self.load in WITH_SENSOR:
            companion += ["--load-from", f"udpin:127.0.0.1:{load_port}"]
        if self.baseline is not None:
            companion += ["--baseline", self.baseline]
        companion += ["--steer", self.steering]
        if self.stack is not None:
            companion += ["--stack", str(self.stack)]
        return plant, companion


def fly_over(options: OverFlight, stop: StopRequest) -> tuple[dict[str, Any], Path]:
    """Fly; returns the summary and the output folder. Raises DescriptionError, OSError."""
    options.check()
    if options.out is None:
        name = f"{Path(options.scenario_name).stem}-over-{time.strftime('%Y%m%d-%H%M%S')}"
        options = replace(options, out=new_folder(Path("runs") / name))
    assert options.out is not None
    out = options.out
    out.mkdir(parents=True, exist_ok=True)
    clear(out)
    truth_port, load_port = free_ports(2)
    account = Account()
    with Display() as display:
        children = Children(*options.command_lines(out, truth_port, load_port), display.messages)
        display.forward()
        children.watch(account, stop, lambda event: display.show(status(event)))
    if account.failure:
        print(f"fly: {account.failure}", file=sys.stderr, flush=True)
    return report(options, out, account), out


def status(event: dict[str, Any]) -> Status:
    """How the flight goes, from a progress event of the companion."""
    load, reference = event["load_m"], event["reference_m"]
    error = None if load is None else math.dist(load, reference)
    return status_of({**event, "mode": event["doing"]}, error)


def report(options: OverFlight, out: Path, account: Account) -> dict[str, Any]:
    """Cut the log to what the law flew, and write summary, picture and recording."""
    failure = account.failure
    begin, end = (account.scenario_time(phase) for phase in ("flying", "handing_back"))
    flown = False
    if begin is not None:
        until = begin + options.duration_s if end is None else end
        try:
            flown = cut_log(out / PLANT_FOLDER / FILE_NAME, out / FILE_NAME, begin, until)
        except (OSError, ValueError) as error:
            failure = f"{failure}; {error}" if failure else str(error)
    if flown and begin is not None:
        shift_events(out / PLANT_FOLDER, out, begin)
    facts = _facts(options, account, failure)
    reference = options.scenario.reference
    path = None
    if flown and not isinstance(reference, GroundControl):
        log = read_state_log(out / FILE_NAME)
        x, y, z = positions(log, "load")[0].tolist()
        path = reference.path((x, y, z))
        facts["over"] |= _figures(log, path)
        facts["time_s"] = float(log["time_s"][-1])
    summary = write_report(out, facts, path, None, options.told())
    if path is not None:
        keep_recording(out, options.told(), path)
    return summary


def _facts(options: OverFlight, account: Account, failure: str | None) -> dict[str, Any]:
    took_over = account.phases.get("flying", {}).get("unix_time_s")
    return {
        "scenario": options.scenario_name,
        "vehicle": options.told().name,
        "design": "companion",
        "feedback": options.load,
        "seed": options.seed,
        "clock": options.clock,
        "rate_hz": options.rate_hz,
        "completed": bool(account.companion_end.get("completed")) and not failure,
        "failure": failure,
        "launch_to_first_command_s": None if took_over is None else took_over - account.launched_at,
        "first_command_unix_s": took_over,
        **{key: account.plant_end[key] for key in OF_THE_PLANT if key in account.plant_end},
        "over": {
            "address": options.over,
            "load": options.load,
            "baseline": options.baseline,
            "steering": options.steering,
            "took_over_at_s": account.scenario_time("flying"),
            "handed_back_at_s": account.scenario_time("handing_back"),
            "control_steps": account.companion_end.get("control_steps"),
        },
    }


def _figures(log: dict[str, Any], path: Any) -> dict[str, Any]:
    from sitl.report.metrics import reference_positions

    times = log["time_s"]
    return step_figures(
        times, positions(log, "load"), positions(log, "vehicle"), reference_positions(path, times)
    )


def table(summary: dict[str, Any], width: int = 1000) -> str:
    """The lines at the end of a flight that a step over a stack adds; width: of the terminal, in columns."""
    over = summary["over"]
    rows = [
        ("within 10 % / 5 %", _pair(over.get("within_10pct_s"), over.get("within_5pct_s"), "s")),
        ("overshoot", _one(over.get("overshoot_m"), "m", 3)),
        ("largest swing", _one(over.get("largest_swing_deg"), "°", 1)),
        ("residual swing, rms", _one(over.get("residual_swing_rms_deg"), "°", 2)),
        ("residual error, rms", _one(over.get("residual_error_rms_m"), "m", 3)),
    ]
    return "\n".join(row(name, value, width) for name, value in rows if value)


def _one(value: float | None, unit: str, digits: int) -> str:
    return "" if value is None else f"{value:.{digits}f} {unit}"


def _pair(first: float | None, second: float | None, unit: str) -> str:
    texts = ["-" if value is None else f"{value:.2f}" for value in (first, second)]
    return "" if texts == ["-", "-"] else f"{' / '.join(texts)} {unit}"
