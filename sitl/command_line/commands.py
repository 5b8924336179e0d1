"""The `sitl` command: what each of its commands does."""

from __future__ import annotations

import argparse
import json
import shutil
import sys
from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, TextIO

from sitl.command_line.arguments import build_parser
from sitl.command_line.completion import run_completion
from sitl.command_line.doctor import run_doctor
from sitl.command_line.export import run_export
from sitl.command_line.identify import run_identify
from sitl.command_line.own_law import chosen_law, prints_to_stderr
from sitl.command_line.sweep import run_sweep
from sitl.command_line.vehicle import run_vehicle
from sitl.command_line.view import run_view
from sitl.command_line.warmup import run_warmup
from sitl.exit_codes import FAILED, INTERRUPTED, USAGE
from sitl_bridge.ids import HIL_TCP_PORT, HIL_UDP_PORT
from sitl_bridge.process import Speaker, StopRequest
from sitl_bridge.vehicle.description import Vehicle
from sitl_bridge.vehicle.files import DescriptionError, load_vehicle

if TYPE_CHECKING:
    from controller.pilot.guided.options import GroundOptions
    from sitl.flights.scenario import Scenario
    from sitl_bridge.mavlink.links.address import Address
    from sitl_bridge.plant.clocks.lockstep import OnSilence
    from sitl_bridge.plant.faults.schedule import Faults


def _ground_options(arguments: argparse.Namespace) -> GroundOptions:
    from controller.pilot.guided.options import GroundOptions

    if arguments.signing_key is not None:
        from controller.ground.link.signing import KeyFileError, read_key

        try:
            read_key(arguments.signing_key)
        except KeyFileError as error:
            raise DescriptionError("--signing-key", [str(error)]) from None
    kept = arguments.parameters
    if kept is not None and kept.exists() and not kept.is_file():
        raise DescriptionError(
            "--parameters", [f"{kept}: no file; expected one of names and numbers, or none yet"]
        )
    return GroundOptions(
        arguments.gcs, arguments.onboard, arguments.signing_key, arguments.parameters, arguments.expose
    )


def _hil_address(arguments: argparse.Namespace, kind: str) -> Address:
    from sitl_bridge.mavlink.links.address import parse_address

    udp_port, tcp_port = HIL_UDP_PORT + arguments.instance, HIL_TCP_PORT + arguments.instance
    return parse_address(arguments.hil or kind, udp_port, tcp_port)


def _what_to_fly(arguments: argparse.Namespace, of_plant: bool = False) -> tuple[Vehicle, Scenario | None]:
    """Vehicle and scenario of `plant` or `controller`."""
    overrides, agility = _overrides(arguments), None if of_plant else arguments.agility
    if arguments.scenario is None:
        if agility is not None:
            raise DescriptionError("--agility", ["belongs to a scenario's reference; expected --scenario"])
        return load_vehicle(arguments.vehicle or "paper", overrides), None
    from sitl.flights.scenario import load_scenario, plant_vehicle, scenario_vehicle
    from sitl.flights.suited_reference import scenario_for

    if of_plant:
        scenario = load_scenario(arguments.scenario)
        return plant_vehicle(scenario, arguments.vehicle, overrides), scenario
    scenario = scenario_for(arguments.scenario, arguments.vehicle, overrides, agility).scenario
    return scenario_vehicle(scenario, arguments.vehicle, overrides), scenario


def _overrides(arguments: argparse.Namespace) -> list[str]:
    """--sensors and --set, in this order, so that single figures change the preset."""
    preset = [] if arguments.sensors is None else [f"sensors.preset={arguments.sensors}"]
    return [*preset, *arguments.set]


class Timing(NamedTuple):
    """How the plant keeps time."""

    clock: Literal["realtime", "lockstep"]
    speed: float | None
    """Times real time; None: as fast as it goes, or real time's own."""
    on_silence: OnSilence = "wait"


AS_PX4_EXPECTS = Timing("lockstep", 1.0)
"""Of who waits on TCP: its simulator waits for PX4's answer at each tick, and people steer it."""


def _timing(arguments: argparse.Namespace, usual: Timing) -> Timing:
    """What --clock, --speed and --on-silence ask for; `usual` where no clock is chosen."""
    clock: Literal["realtime", "lockstep"] = arguments.clock or usual.clock
    for flag, value in (("--speed", arguments.speed), ("--on-silence", arguments.on_silence)):
        if value is not None and clock != "lockstep":
            raise DescriptionError(
                flag, ["goes with --clock lockstep; real time runs at speed 1 and waits for nobody"]
            )
    speed = usual.speed if arguments.speed is None and arguments.clock is None else arguments.speed
    return Timing(clock, speed, arguments.on_silence or usual.on_silence)


def _faults_of(scenario: Scenario | None, vehicle: Vehicle) -> Faults:
    from sitl_bridge.plant.faults.schedule import Faults, checked

    return Faults() if scenario is None else checked(scenario.faults, vehicle)


def _audience(
    arguments: argparse.Namespace, vehicle: Vehicle, more: Sequence[Address] = ()
) -> AbstractContextManager[tuple[str, int] | None]:
    """The viewer that --view asks for, while a flight lasts: the host and port where it hears the truth."""
    if not arguments.view:
        return nullcontext()
    from sitl.view.launch import check_installed, viewer

    if getattr(arguments, "in_process", False):
        raise DescriptionError("--in-process", ["--view takes a plant in a process of its own"])
    check_installed()
    return viewer(vehicle, more, arguments.scenario)


def _ground_piloted(scenario: Scenario) -> bool:
    from sitl.flights.scenario import GroundControl

    return isinstance(scenario.reference, GroundControl)


def _plant(arguments: argparse.Namespace) -> int:
    vehicle, scenario = _what_to_fly(arguments, of_plant=True)
    hil = _hil_address(arguments, "udpout")
    timing = _timing(arguments, AS_PX4_EXPECTS if hil.kind == "tcpin" else Timing("realtime", None))
    from sitl_bridge.plant.run import PlantOptions, run
    from sitl_bridge.rowlog import write_apart

    write_apart()
    speaker = Speaker("plant", events=arguments.until_eof)
    stop = StopRequest()
    stop.install(watch_stdin=arguments.until_eof)
    options = PlantOptions(
        vehicle=vehicle,
        hil=hil,
        clock=timing.clock,
        rate_hz=arguments.rate,
        seed=arguments.seed,
        instance=arguments.instance,
        speed=timing.speed,
        duration_s=arguments.duration or (scenario.duration if scenario else None),
        drop_percent=arguments.drop,
        on_silence=timing.on_silence,
        out=None if arguments.logs == "none" else arguments.out,
        logs=arguments.logs,
        faults=_faults_of(scenario, vehicle),
        end_when_lost=arguments.until_eof and scenario is not None and not _ground_piloted(scenario),
        load_to=arguments.load_to,
        truth_to=arguments.truth_to,
    )
    with _audience(arguments, vehicle) as viewer:
        seers = options.truth_to if viewer is None else [*options.truth_to, viewer]
        outcome = run(replace(options, truth_to=seers), speaker, stop)
    if arguments.json and not arguments.until_eof:
        print(json.dumps(outcome, indent=2))
    return FAILED if outcome["failure"] else 0


def _controller(arguments: argparse.Namespace) -> int:
    vehicle, scenario = _what_to_fly(arguments)
    with prints_to_stderr(arguments.law is not None) as stream:
        outcome = _control(arguments, vehicle, scenario, stream)
    if isinstance(outcome, int):
        return outcome
    if arguments.json and not arguments.until_eof:
        print(json.dumps(outcome, indent=2))
    return FAILED if outcome["failure"] else 0


def _control(
    arguments: argparse.Namespace, vehicle: Vehicle, scenario: Scenario | None, events: TextIO
) -> dict[str, Any] | int:
    """Run a controller; what there is to report of it, or over a flight stack the exit code."""
    from controller.design.kept import keep_on_disk
    from controller.run import ControllerOptions, run
    from sitl.flights.hold import check_design
    from sitl.flights.refusals import check_feasible
    from sitl.flights.scenario import GroundControl, Hover, usual_feedback
    from sitl_bridge.rowlog import write_apart

    law = chosen_law(arguments, scenario)
    if arguments.over is not None:
        from sitl.command_line.over import run_over

        return run_over(arguments, vehicle, scenario)
    keep_on_disk()
    write_apart()
    check_feasible(scenario, vehicle, arguments.design)
    if law is not None:
        from controller.own_law.find import make

        make(law, vehicle, arguments.rate)
    speaker = Speaker("controller", events=arguments.until_eof, stream=events)
    stop = StopRequest()
    stop.install(watch_stdin=arguments.until_eof)
    reference = scenario.reference if scenario else Hover(kind="hover")
    if isinstance(reference, GroundControl):
        check_design(arguments.design)
    options = ControllerOptions(
        vehicle=vehicle,
        hil=_hil_address(arguments, "udpin"),
        design=arguments.design,
        rate_hz=arguments.rate,
        path_from=None if isinstance(reference, GroundControl) else reference.path,
        instance=arguments.instance,
        duration_s=arguments.duration,
        drop_percent=arguments.drop,
        seed=arguments.seed,
        ground=_ground_options(arguments),
        feedback=arguments.feedback or usual_feedback(scenario, vehicle),
        out=None if arguments.logs == "none" else arguments.out,
        logs=arguments.logs,
        law=law,
    )
    return run(options, speaker, stop)


def _fly(arguments: argparse.Namespace) -> int:
    from controller.design.kept import keep_on_disk
    from controller.ground.link.ports import STATION_LOCAL
    from sitl.flights.flight import FlightOptions, fly
    from sitl.flights.hold import check_design, ground_arguments, hold
    from sitl.flights.scenario import GroundControl
    from sitl.flights.suited_reference import scenario_for
    from sitl.report.summary import written
    from sitl.terminal.summary import table
    from sitl_bridge.mavlink.links.address import Address

    scenario, notes = scenario_for(
        arguments.scenario, arguments.vehicle, _overrides(arguments), arguments.agility
    )
    for note in notes:
        print(f"fly: {note}", file=sys.stderr, flush=True)
    with prints_to_stderr(arguments.law is not None):
        law = chosen_law(arguments, scenario)
    if arguments.over is not None:
        from sitl.command_line.over import fly_over_stack

        hil = _hil_address(arguments, "tcpin")
        kept = _timing(arguments, AS_PX4_EXPECTS if hil.kind == "tcpin" else Timing("realtime", None))
        return fly_over_stack(arguments, hil, kept, _overrides(arguments), _audience)
    timing = _timing(arguments, Timing("lockstep" if arguments.in_process else "realtime", None))
    options = FlightOptions(
        scenario_name=arguments.scenario,
        scenario=scenario,
        vehicle=arguments.vehicle,
        overrides=_overrides(arguments),
        plant_overrides=arguments.plant_set,
        hil=_hil_address(arguments, "udpout"),
        clock=timing.clock,
        speed=timing.speed,
        on_silence=timing.on_silence,
        rate_hz=arguments.rate,
        seed=arguments.seed,
        design=arguments.design,
        agility=arguments.agility,
        feedback=arguments.feedback,
        duration_s=arguments.duration,
        drop_percent=arguments.drop,
        instance=arguments.instance,
        out=arguments.out,
        logs=arguments.logs,
        report=not arguments.no_report,
        in_process=arguments.in_process,
        law=law,
    )
    keep_on_disk()
    stop = StopRequest()
    stop.install()
    if isinstance(scenario.reference, GroundControl):
        if arguments.in_process:
            raise DescriptionError("--in-process", ["ground control takes processes of its own"])
        check_design(arguments.design)
        if arguments.json:
            raise DescriptionError("--json", ["under ground control a flight has no summary to print"])
        options = replace(options, ground=ground_arguments(_ground_options(arguments)))
        stations = STATION_LOCAL + arguments.instance if arguments.gcs is None else arguments.gcs.local
        more = [Address("udpout", "127.0.0.1", stations)]
        with _audience(arguments, options.checked_vehicle(), more) as viewer:
            failure = hold(replace(options, truth_to=viewer), stop)
        if failure:
            print(f"fly: {failure}", file=sys.stderr, flush=True)
        return FAILED if failure else 0
    with prints_to_stderr(law is not None), _audience(arguments, options.checked_vehicle()) as viewer:
        summary, out = fly(replace(options, truth_to=viewer), stop)
    if arguments.json:
        print(json.dumps(summary, indent=2))
    else:
        print(table(summary, shutil.get_terminal_size((1000, 24)).columns))
        for file in written(out):
            print(f"  {file}")
    if stop:
        return INTERRUPTED
    return 0 if summary["settled"] else FAILED


def _bench(arguments: argparse.Namespace) -> int:
    from sitl.benchmark.bench import bench, medians, table
    from sitl.benchmark.limits import check_all, check_table
    from sitl.flights.launch import FlightError
    from sitl.warmup import warm_up

    try:
        warm_up()
        samples = bench(arguments.repeats)
    except (FlightError, RuntimeError) as error:
        print(f"bench: {error}", file=sys.stderr)
        return FAILED
    if not arguments.check:
        results = medians(samples)
        print(json.dumps(results, indent=2) if arguments.json else table(results))
        return 0
    checked = check_all(samples)
    if arguments.json:
        print(json.dumps({row.limit.key: row.to_json() for row in checked}, indent=2))
    else:
        print(check_table(checked))
    return FAILED if any(row.verdict == "missed" for row in checked) else 0


def _paper(arguments: argparse.Namespace) -> int:
    from sitl.studies.paper.run import main as paper

    return paper(arguments.out, arguments.quick)


COMMANDS = {
    "fly": _fly,
    "plant": _plant,
    "controller": _controller,
    "bench": _bench,
    "paper": _paper,
    "export": run_export,
    "view": run_view,
    "sweep": run_sweep,
    "vehicle": run_vehicle,
    "warmup": run_warmup,
    "doctor": run_doctor,
    "completion": run_completion,
    "identify": run_identify,
}


def help_as_flag(argv: Sequence[str]) -> list[str]:
    """Return the arguments with `help [COMMAND]` as `[COMMAND] --help`; no arguments ask for help, too."""
    if not argv:
        return ["--help"]
    return [*argv[1:], "--help"] if argv[0] == "help" else list(argv)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    arguments = build_parser().parse_args(help_as_flag(sys.argv[1:] if argv is None else argv))
    try:
        code = COMMANDS[arguments.command](arguments)
    except DescriptionError as error:
        print(error, file=sys.stderr)
        return USAGE
    except OSError as error:
        what = f"{error.filename}: {error.strerror}" if error.filename else error
        print(f"sitl {arguments.command}: {what}", file=sys.stderr)
        return USAGE
    return code
