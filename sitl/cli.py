"""The `sitl` command: `plant`, `controller`, `fly SCENARIO`, `bench`. A flag means the same everywhere."""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from sitl_bridge.description import DescriptionError, load_vehicle, preset_names, vehicle_names
from sitl_bridge.ids import HIL_TCP_PORT, HIL_UDP_PORT, MOST_INSTANCES
from sitl_bridge.process import Speaker, StopRequest
from sitl_bridge.vehicle import Vehicle

if TYPE_CHECKING:
    from controller.ground_link import GroundOptions, Ports
    from sitl.scenario import Scenario
    from sitl_bridge.mavlink.links import Address
    from sitl_bridge.plant.faults import Faults

DEFAULT_RATE_HZ = 250.0
DESIGNS = ("default", "paper", "paper-lqr")

EXIT_FAILED = 1
EXIT_USAGE = 2
EXIT_INTERRUPTED = 130


def number(low: float, high: float, what: str) -> Callable[[str], float]:
    """An argument type: a finite number within limits."""

    def parse(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not low <= value <= high:
            raise argparse.ArgumentTypeError(f"{text!r}: expected {what}, {low:g} to {high:g}")
        return value

    return parse


def whole(low: int, high: int, what: str) -> Callable[[str], int]:
    """An argument type: a whole number within limits."""

    def parse(text: str) -> int:
        if not text.lstrip("-").isdigit() or not low <= int(text) <= high:
            raise argparse.ArgumentTypeError(f"{text!r}: expected {what}, {low} to {high}")
        return int(text)

    return parse


def link_address(text: str) -> str:
    """An argument type: the address of a link, the port perhaps left out."""
    from sitl_bridge.mavlink.links import parse_address

    try:
        parse_address(text, HIL_UDP_PORT, HIL_TCP_PORT)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None
    return text


def host_and_port(text: str) -> tuple[str, int]:
    """An argument type: HOST:PORT."""
    host, _, port = text.rpartition(":")
    if not host or not port.isdigit() or not 0 < int(port) <= 65535:
        raise argparse.ArgumentTypeError(f"{text!r}: expected HOST:PORT, as in 127.0.0.1:14550")
    return host, int(port)


def build_parser() -> argparse.ArgumentParser:
    """The whole command line."""
    parser = argparse.ArgumentParser(
        prog="sitl",
        description="A quadrotor with a load on an elastic cable, simulated by one process (the plant) and "
        "flown by another (the controller) over standard MAVLink on UDP.",
        epilog="Two terminals, in either order: `sitl plant --scenario setpoint` and "
        "`sitl controller --scenario setpoint`. Both at once, with a report: `sitl fly setpoint`.",
    )
    parser.add_argument("--version", action="version", version=f"%(prog)s {_version()}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")

    fly = commands.add_parser(
        "fly",
        help="launch plant and controller, fly a scenario, report on it",
        description="Launch plant and controller as two processes, fly a scenario and report on it. "
        "Exit code 0: the load settled; 1: it did not, or a process failed; 2: the command line is wrong.",
    )
    fly.add_argument("scenario", metavar="SCENARIO", help="a scenario's name (see below) or .toml file")
    fly.epilog = f"Scenarios: {', '.join(_scenario_names())}. Vehicles: {', '.join(vehicle_names())}."
    for add in (_vehicle, _link, _clock, _loop, _control, _run, _ground, _output):
        add(fly)
    fly.add_argument(
        "--plant-set",
        metavar="KEY=VALUE",
        action="append",
        default=[],
        help="like --set, but only in the plant: the controller is not told",
    )
    fly.set_defaults(run=_fly)

    plant = commands.add_parser(
        "plant",
        help="simulate vehicle, cable and load",
        description="Simulate vehicle, cable and load, and speak PX4's simulator API on the HIL link.",
    )
    for add in (_scenario, _vehicle, _link, _clock, _loop, _run, _output, _supervised):
        add(plant)
    plant.add_argument(
        "--load-to",
        metavar="HOST:PORT",
        type=host_and_port,
        help="show the load to a ground station directly, for an autopilot that does not (PX4)",
    )
    plant.set_defaults(run=_plant)

    controller = commands.add_parser(
        "controller",
        help="fly the vehicle",
        description="Be the autopilot: answer the plant's ticks with rotor commands.",
    )
    for add in (_scenario, _vehicle, _link, _loop, _control, _run, _ground, _supervised):
        add(controller)
    controller.add_argument(
        "--json", action="store_true", help="one JSON object on standard output at the end"
    )
    controller.add_argument("--out", metavar="DIR", type=Path, help="where to write the estimate's log")
    controller.set_defaults(run=_controller)

    bench = commands.add_parser(
        "bench",
        help="measure speed, and print ratios against the bare round trip",
        description="Measure the physics step, the control step, the lockstep tick, the real-time factor and "
        "the launch, beside the bare round trip of such datagrams between two Python processes.",
    )
    bench.add_argument("--json", action="store_true", help="one JSON object on standard output")
    bench.add_argument(
        "--repeats", type=whole(1, 100, "a number"), default=5, help="measurements of each, for the median"
    )
    bench.set_defaults(run=_bench)

    paper = commands.add_parser(
        "paper",
        help="run every experiment of the paper, and write a page with a verdict on each",
        description="Run every experiment of the paper, over the real link where a controller flies; write "
        "DIR/index.html and DIR/paper.json: what the paper shows, what we get, and a verdict on each claim. "
        "Exit code 1 when a number is out of its tolerance.",
    )
    paper.add_argument(
        "--out", metavar="DIR", type=Path, required=True, help="where to write page and numbers"
    )
    paper.add_argument("--quick", action="store_true", help="coarser sweeps, shorter flights: under a minute")
    paper.set_defaults(run=_paper)
    return parser


def _version() -> str:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("sitl-bridge")
    except PackageNotFoundError:  # run from a source tree that nobody has installed
        return "unknown"


def _scenario_names() -> list[str]:
    from sitl.scenario import scenario_names

    return scenario_names()


def _scenario(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--scenario",
        metavar="NAME|FILE",
        help="take vehicle, overrides, duration and reference from a scenario (without one: hover)",
    )


def _vehicle(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--vehicle", metavar="NAME|FILE", help="vehicle description (default: the scenario's, or paper)"
    )
    parser.add_argument(
        "--set",
        metavar="KEY=VALUE",
        action="append",
        default=[],
        help="override one value of the vehicle description, as in cable.rest_length=10 (repeatable)",
    )
    parser.add_argument(
        "--sensors",
        metavar="PRESET",
        help=f"what its sensors are like: {', '.join(preset_names())}; as --set sensors.preset=PRESET",
    )


def _link(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--hil",
        metavar="ADDRESS",
        type=link_address,
        help="HIL link: udpout:HOST:PORT, udpin:…, tcpin:… or tcpout:…; for `fly` the plant's end of it "
        f"(default: UDP 127.0.0.1:{HIL_UDP_PORT}+N, where the controller waits and the plant sends first; "
        f"an address may leave out its port, {HIL_TCP_PORT}+N for TCP, and host)",
    )
    parser.add_argument(
        "--instance",
        metavar="N",
        type=whole(0, MOST_INSTANCES - 1, "an instance"),
        default=0,
        help="number of this vehicle: shifts ports and MAVLink ids (default: 0)",
    )
    parser.add_argument(
        "--drop",
        metavar="PERCENT",
        type=number(0, 90, "a percentage"),
        default=0.0,
        help="lose so many HIL datagrams each way, seeded",
    )


def _clock(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--clock",
        choices=("realtime", "lockstep"),
        default="realtime",
        help="against the wall clock, or tick by tick with the controller (default: realtime)",
    )
    parser.add_argument(
        "--speed",
        metavar="X",
        type=number(1e-3, 1e4, "a factor"),
        help="with lockstep: at most X times real time (default: as fast as it goes)",
    )
    parser.add_argument(
        "--on-silence",
        choices=("wait", "continue"),
        default="wait",
        help="with lockstep: what to do when a tick stays unanswered after three repeats (default: wait)",
    )


def _loop(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--rate",
        metavar="HZ",
        type=number(20, 1000, "ticks a second"),
        default=DEFAULT_RATE_HZ,
        help=f"ticks a second; the controller is designed for it (default: {DEFAULT_RATE_HZ:g})",
    )


def _control(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--design",
        choices=DESIGNS,
        default="default",
        help="gain design: re-weighted for margins, the paper's integral LQR, or its LQR without integrator",
    )
    parser.add_argument(
        "--feedback",
        choices=("truth", "estimate"),
        help="what the law flies on: the plant's truth, or the estimate from its sensors (default: truth for "
        "vehicle paper in the paper's scenarios, else estimate)",
    )


def _ports(text: str) -> Ports:
    """An argument type: LOCAL:PEER."""
    from controller.ground_link import Ports

    local, colon, peer = text.partition(":")
    numbers = [int(part) for part in (local, peer) if part.isdigit() and 0 < int(part) < 65536]
    if not colon or len(numbers) != 2:
        raise argparse.ArgumentTypeError(f"{text!r}: expected two UDP ports LOCAL:PEER, as in 18570:14550")
    return Ports(*numbers)


def _ground(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("ground control", "with a scenario that leaves the flight to it (hold)")
    for flag, whom, local, peer in (
        ("--gcs", "ground stations", "18570+N", "14550"),
        ("--onboard", "MAVSDK and companion computers", "14580+N", "14540+N"),
    ):
        group.add_argument(
            flag,
            metavar="LOCAL:PEER",
            type=_ports,
            help=f"UDP ports of the link for {whom}: its own, and whom it speaks to first "
            f"(default: {local}:{peer})",
        )
    group.add_argument(
        "--signing-key",
        metavar="FILE",
        type=Path,
        help="take and send only MAVLink 2 signed with this key (64 hexadecimal digits)",
    )
    group.add_argument(
        "--parameters", metavar="FILE", type=Path, help="where parameters are kept when they are stored"
    )
    group.add_argument(
        "--expose",
        action="store_true",
        help="open the links to the network, not to this machine alone; better with a key",
    )


def _ground_options(arguments: argparse.Namespace) -> GroundOptions:
    from controller.ground.signing import KeyFileError, read_key
    from controller.ground_link import GroundOptions

    if arguments.signing_key is not None:
        try:
            read_key(arguments.signing_key)
        except KeyFileError as error:
            raise DescriptionError("--signing-key", [str(error)]) from None
    return GroundOptions(
        arguments.gcs, arguments.onboard, arguments.signing_key, arguments.parameters, arguments.expose
    )


def _run(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--seed",
        type=whole(0, 2**31 - 1, "a seed"),
        default=0,
        help="seed of everything random (default: 0)",
    )
    parser.add_argument(
        "--duration",
        metavar="S",
        type=number(0.01, 1e6, "seconds"),
        help="how long to fly (default: the scenario's, or until stopped)",
    )


def _output(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--out", metavar="DIR", type=Path, help="where to write logs and results")
    parser.add_argument("--json", action="store_true", help="one JSON object on standard output at the end")


def _supervised(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--until-eof",
        action="store_true",
        help="stop when standard input ends, and write events (for programs)",
    )


def _hil_address(arguments: argparse.Namespace, kind: str) -> Address:
    from sitl_bridge.mavlink.links import parse_address

    udp_port, tcp_port = HIL_UDP_PORT + arguments.instance, HIL_TCP_PORT + arguments.instance
    return parse_address(arguments.hil or kind, udp_port, tcp_port)


def _what_to_fly(arguments: argparse.Namespace, of_plant: bool = False) -> tuple[Vehicle, Scenario | None]:
    """Vehicle and scenario of `plant` or `controller`."""
    overrides = _overrides(arguments)
    if arguments.scenario is None:
        return load_vehicle(arguments.vehicle or "paper", overrides), None
    from sitl.scenario import load_scenario, plant_vehicle, scenario_vehicle

    scenario = load_scenario(arguments.scenario)
    its_vehicle = plant_vehicle if of_plant else scenario_vehicle
    return its_vehicle(scenario, arguments.vehicle, overrides), scenario


def _overrides(arguments: argparse.Namespace) -> list[str]:
    """--sensors and --set, in this order, so that single figures change the preset."""
    preset = [] if arguments.sensors is None else [f"sensors.preset={arguments.sensors}"]
    return [*preset, *arguments.set]


def _faults_of(scenario: Scenario | None, vehicle: Vehicle) -> Faults:
    from sitl_bridge.plant.faults import Faults, checked

    return Faults() if scenario is None else checked(scenario.faults, vehicle)


def _plant(arguments: argparse.Namespace) -> int:
    if arguments.speed is not None and arguments.clock != "lockstep":
        raise DescriptionError("--speed", ["goes with --clock lockstep; real time runs at speed 1"])
    vehicle, scenario = _what_to_fly(arguments, of_plant=True)
    from sitl_bridge.plant.run import PlantOptions, run

    speaker = Speaker("plant", events=arguments.until_eof)
    stop = StopRequest()
    stop.install(watch_stdin=arguments.until_eof)
    options = PlantOptions(
        vehicle=vehicle,
        hil=_hil_address(arguments, "udpout"),
        clock=arguments.clock,
        rate_hz=arguments.rate,
        seed=arguments.seed,
        instance=arguments.instance,
        speed=arguments.speed,
        duration_s=arguments.duration or (scenario.duration if scenario else None),
        drop_percent=arguments.drop,
        on_silence=arguments.on_silence,
        out=arguments.out,
        faults=_faults_of(scenario, vehicle),
        load_to=arguments.load_to,
    )
    outcome = run(options, speaker, stop)
    if arguments.json and not arguments.until_eof:
        print(json.dumps(outcome, indent=2))
    return 0


def _controller(arguments: argparse.Namespace) -> int:
    vehicle, scenario = _what_to_fly(arguments)
    from controller.run import ControllerOptions, run
    from sitl.hold import check_design
    from sitl.scenario import GroundControl, Hover, usual_feedback

    speaker = Speaker("controller", events=False)
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
        out=arguments.out,
    )
    outcome = run(options, speaker, stop)
    if arguments.json:
        print(json.dumps(outcome, indent=2))
    return 0


def _fly(arguments: argparse.Namespace) -> int:
    from sitl.flight import FlightOptions, fly
    from sitl.hold import check_design, ground_arguments, hold
    from sitl.report import table
    from sitl.scenario import GroundControl, load_scenario

    if arguments.speed is not None and arguments.clock != "lockstep":
        raise DescriptionError("--speed", ["goes with --clock lockstep; real time runs at speed 1"])
    scenario = load_scenario(arguments.scenario)
    options = FlightOptions(
        scenario_name=arguments.scenario,
        scenario=scenario,
        vehicle=arguments.vehicle,
        overrides=_overrides(arguments),
        plant_overrides=arguments.plant_set,
        hil=_hil_address(arguments, "udpout"),
        clock=arguments.clock,
        speed=arguments.speed,
        on_silence=arguments.on_silence,
        rate_hz=arguments.rate,
        seed=arguments.seed,
        design=arguments.design,
        feedback=arguments.feedback,
        duration_s=arguments.duration,
        drop_percent=arguments.drop,
        instance=arguments.instance,
        out=arguments.out
        or Path("runs") / f"{Path(arguments.scenario).stem}-{time.strftime('%Y%m%d-%H%M%S')}",
    )
    stop = StopRequest()
    stop.install()
    if isinstance(scenario.reference, GroundControl):
        check_design(arguments.design)
        options = replace(options, out=arguments.out, ground=ground_arguments(_ground_options(arguments)))
        failure = hold(options, stop)
        if failure:
            print(f"fly: {failure}", file=sys.stderr, flush=True)
        return EXIT_FAILED if failure else 0
    summary = fly(options, stop)
    if arguments.json:
        print(json.dumps(summary, indent=2))
    else:
        print(table(summary))
        assert options.out is not None
        for name in sorted(options.out.iterdir()):
            print(f"  {name}")
    if stop:
        return EXIT_INTERRUPTED
    return 0 if summary["settled"] else EXIT_FAILED


def _bench(arguments: argparse.Namespace) -> int:
    from sitl.bench import bench, table

    results = bench(arguments.repeats)
    print(json.dumps(results, indent=2) if arguments.json else table(results))
    return 0


def _paper(arguments: argparse.Namespace) -> int:
    from sitl.paper.run import main as paper

    return paper(arguments.out, arguments.quick)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    arguments = build_parser().parse_args(argv)
    try:
        code: int = arguments.run(arguments)
    except DescriptionError as error:
        print(error, file=sys.stderr)
        return EXIT_USAGE
    except OSError as error:
        print(f"sitl {arguments.command}: {error}", file=sys.stderr)
        return EXIT_USAGE
    return code
