"""`--over`: the law as a companion of a flight stack, alone (`controller`) or with the plant (`fly`)."""

from __future__ import annotations

import argparse
import json
import math
import shutil
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from controller.ground.link.ports import STATION_PEER
from sitl.command_line.argument_types import STACK_TCP_PORT, STACK_UDP_PORT
from sitl.exit_codes import FAILED, INTERRUPTED
from sitl_bridge.mavlink.links.address import parse_address, parse_stack_address
from sitl_bridge.process import Speaker, StopRequest
from sitl_bridge.vehicle.description import Vehicle
from sitl_bridge.vehicle.files import DescriptionError

if TYPE_CHECKING:
    from controller.feedback.truth import PathFrom
    from controller.over.run import LivePorts, OverOptions
    from sitl.command_line.commands import Timing
    from sitl.flights.scenario import Scenario
    from sitl_bridge.mavlink.links.address import Address

TRUTH_PORT = 19410
LOAD_TO_PORT = 19411
LOAD_PORT = 18670
"""UDP port of the load's own system, plus the instance; PX4 has 18570 for its own."""
DEFAULT_DURATION = 60.0
"""s, of a reference that has none."""


def _stack_address(arguments: argparse.Namespace) -> Address:
    return parse_stack_address(arguments.over, STACK_UDP_PORT + arguments.instance, STACK_TCP_PORT)


def _live_ports(arguments: argparse.Namespace) -> LivePorts:
    from controller.over.run import LivePorts

    if arguments.gcs is not None:
        return LivePorts(arguments.gcs.local, arguments.gcs.peer)
    return LivePorts(LOAD_PORT + arguments.instance, STATION_PEER)


def over_options(
    arguments: argparse.Namespace, vehicle: Vehicle, path_from: PathFrom, duration_s: float
) -> OverOptions:
    """What the flags of a companion ask for. Raises DescriptionError."""
    from controller.over.baseline import Baseline
    from controller.over.model import Steering
    from controller.over.run import OverOptions
    from controller.over.stack import Stack, read_stack

    truth = None
    if arguments.load == "truth" or arguments.truth_from is not None:
        truth = parse_address(arguments.truth_from or "udpin", TRUTH_PORT, TRUTH_PORT)
    return OverOptions(
        vehicle=vehicle,
        over=_stack_address(arguments),
        path_from=path_from,
        duration_s=duration_s,
        stack=Stack() if arguments.stack is None else read_stack(arguments.stack),
        load=arguments.load,
        load_link=None if arguments.load_from is None else parse_address(arguments.load_from, LOAD_TO_PORT),
        truth=truth,
        out=arguments.out,
        wait_s=arguments.wait,
        instance=arguments.instance,
        baseline=None if arguments.baseline is None else Baseline(arguments.baseline),
        steering=Steering(arguments.steer),
    )


def _check_reference(scenario: Scenario | None) -> None:
    """Raises DescriptionError for a reference that is not flown over a stack."""
    if scenario is not None and scenario.reference.kind == "points":
        raise DescriptionError(
            "--over",
            [
                "a sequence of points is not flown over a stack; expected one set-point, or the scenario "
                "hold and points sent to it live"
            ],
        )


def run_over(arguments: argparse.Namespace, vehicle: Vehicle, scenario: Scenario | None) -> int:
    """Fly one reference over a stack; exit code 1 when it did not come to its end."""
    from controller.over.run import run
    from sitl.flights.refusals import check_feasible
    from sitl.flights.scenario import GroundControl, Hover

    reference = scenario.reference if scenario else Hover(kind="hover")
    _check_reference(scenario)
    if scenario is not None:
        check_feasible(scenario, vehicle, "default")
    duration = arguments.duration or (scenario.duration if scenario else None) or DEFAULT_DURATION
    if isinstance(reference, GroundControl):
        options = over_options(arguments, vehicle, Hover(kind="hover").path, arguments.duration or math.inf)
        options = replace(options, live=_live_ports(arguments))
    else:
        if arguments.gcs is not None:
            raise DescriptionError("--gcs", ["goes with a scenario that leaves the load to it, such as hold"])
        options = over_options(arguments, vehicle, reference.path, duration)
    stop = StopRequest()
    stop.install(watch_stdin=arguments.until_eof)
    outcome = run(options, Speaker("controller", events=arguments.until_eof), stop)
    if arguments.json and not arguments.until_eof:
        print(json.dumps(outcome, indent=2))
    return 0 if outcome["completed"] else FAILED


NOT_OVER_A_STACK = {
    "in_process": "the stack is a process of its own",
    "design": "the companion has a design of its own",
    "agility": "a stack is flown gently",
    "feedback": "--load says where the load is known from",
    "onboard": "--over is the link to the stack",
    "signing_key": "the link to the stack is not signed",
    "parameters": "the stack has the parameters",
    "no_report": "its flights are always reported",
    "expose": "the stack has the link to ground control",
}
"""Flags of `fly` that mean nothing here, and why."""
USUAL: dict[str, Any] = {"in_process": False, "design": "default", "expose": False, "no_report": False}


def fly_over_stack(
    arguments: argparse.Namespace,
    hil: Address,
    timing: Timing,
    overrides: Sequence[str],
    audience: Callable[[argparse.Namespace, Vehicle], AbstractContextManager[tuple[str, int] | None]],
) -> int:
    """`sitl fly --over`: launch plant and companion, and report; exit code 1 when the load did not settle.

    A live flight ends when it is stopped, with exit code 0.
    """
    from sitl.flights.scenario import GroundControl
    from sitl.flights.suited_reference import scenario_for
    from sitl.over.flight import OverFlight, fly_over
    from sitl.over.flight import table as table_of_step
    from sitl.report.summary import written
    from sitl.terminal.summary import is_complete, table

    for name, why in NOT_OVER_A_STACK.items():
        if getattr(arguments, name) != USUAL.get(name):
            raise DescriptionError(f"--{name.replace('_', '-')}", [f"does not go with --over: {why}"])
    scenario = scenario_for(arguments.scenario, arguments.vehicle, overrides).scenario  # `fly` has told
    _check_reference(scenario)
    live = _live_ports(arguments) if isinstance(scenario.reference, GroundControl) else None
    if live is None and arguments.gcs is not None:
        raise DescriptionError("--gcs", ["goes with a scenario that leaves the load to it, such as hold"])
    options = OverFlight(
        scenario_name=arguments.scenario,
        scenario=scenario,
        vehicle=arguments.vehicle,
        overrides=overrides,
        plant_overrides=arguments.plant_set,
        hil=hil,
        over=str(_stack_address(arguments)),
        load=arguments.load,
        baseline=arguments.baseline,
        steering=arguments.steer,
        stack=arguments.stack,
        clock=timing.clock,
        speed=timing.speed,
        on_silence=timing.on_silence,
        rate_hz=arguments.rate,
        seed=arguments.seed,
        duration_s=arguments.duration or scenario.duration or (math.inf if live else DEFAULT_DURATION),
        live=None if live is None else (live.local, live.peer),
        wait_s=arguments.wait,
        instance=arguments.instance,
        out=arguments.out,
    )
    for flag in ("truth_from", "load_from"):
        if getattr(arguments, flag) is not None:
            name = f"--{flag.replace('_', '-')}"
            raise DescriptionError(name, ["`fly` arranges it; expected with `controller` only"])
    stop = StopRequest()
    stop.install()
    with audience(arguments, options.told()) as viewer:
        summary, out = fly_over(replace(options, truth_to=viewer), stop)
    if arguments.json:
        print(json.dumps(summary, indent=2))
    else:
        width = shutil.get_terminal_size((1000, 24)).columns
        print(table(summary, width))
        if is_complete(summary):
            print(table_of_step(summary, width))
        for file in written(out):
            print(f"  {file}")
    if live is not None:  # ends when it is stopped, as under our own autopilot
        return 0 if stop or summary["completed"] else FAILED
    if stop:
        return INTERRUPTED
    return 0 if summary["settled"] else FAILED
