"""The flags of the `sitl` command. The same flag means the same everywhere."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any, NoReturn

from controller.design.names import DESIGNS
from controller.ground.link.ports import ONBOARD_LOCAL, ONBOARD_PEER, STATION_LOCAL, STATION_PEER
from sitl.command_line.argument_types import (
    host_and_port,
    link_address,
    number,
    ports,
    stack_address,
    whole,
)
from sitl.command_line.completion import add_completion
from sitl.command_line.doctor import add_doctor
from sitl.command_line.export import add_export
from sitl.command_line.identify import add_identify
from sitl.command_line.own_law import add_law
from sitl.command_line.sweep import add_sweep
from sitl.command_line.vehicle import add_vehicle
from sitl.command_line.view import add_view
from sitl.command_line.warmup import add_warmup
from sitl_bridge.ids import HIL_TCP_PORT, HIL_UDP_PORT, MOST_INSTANCES
from sitl_bridge.log_amount import LOGS
from sitl_bridge.vehicle.files import preset_names, vehicle_names

DEFAULT_RATE_HZ = 250.0


class _Parser(argparse.ArgumentParser):
    """Says in one line what is wrong, and where there is more; the usage of a command is long."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{self.prog}: error: {message} (`{self.prog} --help` shows what there is)\n")

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """A command has no unknown arguments that another parser could know."""
        known, unknown = super().parse_known_args(args, namespace)
        if unknown:
            self.error(f"unrecognized arguments: {' '.join(unknown)}")
        return known, unknown


def build_parser() -> argparse.ArgumentParser:
    """The whole command line."""
    parser = _Parser(
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
    fly.add_argument(
        "scenario",
        metavar="SCENARIO",
        nargs="?",
        default="setpoint",
        help="a scenario's name (see below) or .toml file (default: %(default)s)",
    )
    fly.add_argument(
        "--no-report",
        action="store_true",
        help="leave the logs only: no picture, page or MCAP",
    )
    fly.epilog = f"Scenarios: {', '.join(_scenario_names())}. Vehicles: {', '.join(vehicle_names())}."
    for add in (_vehicle, _link, _clock, _loop, _control, _seed, _ground, _view, _output):
        add(fly)
    _duration(fly, "the scenario's, or until stopped")
    fly.add_argument(
        "--in-process",
        action="store_true",
        help="join plant and controller in one process, without sockets: the same state log, faster",
    )
    _over(fly)
    fly.add_argument(
        "--plant-set",
        metavar="KEY=VALUE",
        action="append",
        default=[],
        help="like --set, but only in the plant: the controller is not told",
    )

    plant = commands.add_parser(
        "plant",
        help="simulate vehicle, cable and load",
        description="Simulate vehicle, cable and load, and speak PX4's simulator API on the HIL link.",
    )
    for add in (_scenario, _vehicle, _link, _clock, _loop, _seed, _view, _output, _supervised):
        add(plant)
    _duration(plant, "the scenario's, or until stopped")
    plant.add_argument(
        "--truth-to",
        metavar="HOST:PORT",
        type=host_and_port,
        action="append",
        default=[],
        help="show the true state of vehicle and load to a viewer or companion: HIL_STATE_QUATERNION and "
        "ODOMETRY (PX4's viewers listen on 127.0.0.1:19410; repeatable)",
    )
    plant.add_argument(
        "--load-to",
        metavar="HOST:PORT",
        type=host_and_port,
        help="show the load to a ground station directly, for an autopilot that does not (PX4)",
    )

    controller = commands.add_parser(
        "controller",
        help="fly the vehicle",
        description="Be the autopilot: answer the plant's ticks with rotor commands.",
    )
    for add in (_scenario, _vehicle, _link, _loop, _control, _seed, _ground, _supervised):
        add(controller)
    _duration(controller, "until stopped")
    controller.add_argument(
        "--json", action="store_true", help="one JSON object on standard output at the end"
    )
    controller.add_argument("--out", metavar="DIR", type=Path, help="where to write the estimate's log")
    _logs(controller)
    _over(controller)

    add_export(commands)
    add_view(commands)
    add_sweep(commands)
    add_vehicle(commands)
    add_warmup(commands)
    add_doctor(commands)
    add_completion(commands)
    add_identify(commands, (_vehicle, _instance, _over))
    bench = commands.add_parser(
        "bench",
        help="measure speed, and print ratios against the bare round trip",
        description="Measure the physics step, the control step, the lockstep tick, the real-time factor and "
        "the launch, beside the bare round trip of such datagrams between two Python processes.",
    )
    bench.add_argument("--json", action="store_true", help="one JSON object on standard output")
    bench.add_argument(
        "--check",
        action="store_true",
        help="print the figures that have a limit, with it and the measured spread; exit code 1 where one is "
        "missed by more than its spread",
    )
    bench.add_argument(
        "--repeats", type=whole(1, 100, "a number"), default=5, help="measurements of each, for the median"
    )

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
    return parser


def _version() -> str:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("sitl-bridge")
    except PackageNotFoundError:  # run from a source tree that nobody has installed
        return "unknown"


def _scenario_names() -> list[str]:
    from sitl.flights.scenario import scenario_names

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
    _instance(parser)
    parser.add_argument(
        "--drop",
        metavar="PERCENT",
        type=number(0, 90, "a percentage"),
        default=0.0,
        help="lose so many HIL datagrams each way, seeded",
    )


def _instance(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--instance",
        metavar="N",
        type=whole(0, MOST_INSTANCES - 1, "an instance"),
        default=0,
        help="number of this vehicle: shifts ports and MAVLink ids (default: 0)",
    )


def _clock(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--clock",
        choices=("realtime", "lockstep"),
        help="against the wall clock, or tick by tick with the controller (default: realtime; for a plant "
        "that waits on TCP, as PX4 wants it, lockstep at speed 1)",
    )
    parser.add_argument(
        "--speed",
        metavar="X",
        type=number(1e-3, 1e4, "a factor"),
        help="with lockstep: at most X times real time (default: as fast as both manage)",
    )
    parser.add_argument(
        "--on-silence",
        choices=("wait", "continue"),
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


def _over(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group(
        "over a flight stack", "fly the load while PX4 or ArduPilot flies the vehicle"
    )
    group.add_argument(
        "--over",
        metavar="ADDRESS",
        type=stack_address,
        help="the stack's MAVLink, as udpin:127.0.0.1:14540 or serial:/dev/ttyACM0:921600; for `controller` "
        "instead of the HIL link",
    )
    group.add_argument(
        "--load",
        choices=("truth", "tracker", "position", "none"),
        default="none",
        help="where the load is known from: the plant's truth, LANDING_TARGET of a tracker, its own "
        "GLOBAL_POSITION_INT, or no sensor (default: none)",
    )
    group.add_argument(
        "--load-from",
        metavar="ADDRESS",
        type=link_address,
        help="where a load sensor's messages come, besides the stack's link (`fly` arranges it for the "
        "plant's)",
    )
    group.add_argument(
        "--truth-from",
        metavar="ADDRESS",
        type=link_address,
        help="where the plant's --truth-to sends, for --load truth (default: udpin:127.0.0.1:19410; `fly` "
        "arranges it)",
    )
    group.add_argument("--stack", metavar="FILE", type=Path, help="lags, delay and thrust of the stack, TOML")
    group.add_argument(
        "--steer",
        choices=("rates", "attitude"),
        default="rates",
        help="what the stack is given besides the thrust: body rates, or an attitude (default: rates)",
    )
    group.add_argument(
        "--baseline",
        choices=("point", "motion"),
        help="for comparison: let the stack's own position control fly the vehicle, to the raw set-point or "
        "along the smooth motion",
    )
    group.add_argument(
        "--wait",
        metavar="S",
        type=number(1, 1e6, "seconds"),
        default=60.0,
        help="how long to wait for the stack, and then for its state (default: %(default)g)",
    )


def _control(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--design",
        choices=DESIGNS,
        default="default",
        help="law and gains: re-weighted for margins, the paper's integral LQR, its LQR without integrator, "
        "or geometric control",
    )
    add_law(parser)
    parser.add_argument(
        "--agility",
        metavar="A",
        type=number(0, 1, "an agility"),
        help="how fast the load goes to its reference: 0, gentle, to 1, all that the vehicle can do "
        "(default: the scenario's, else 0.7)",
    )
    parser.add_argument(
        "--feedback",
        choices=("truth", "estimate"),
        help="what the law flies on: the plant's truth, or the estimate from its sensors (default: truth for "
        "vehicle paper in the paper's scenarios, else estimate)",
    )


def _ground(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("ground control", "with a scenario that leaves the flight to it (hold)")
    for flag, whom, local, peer in (
        ("--gcs", "ground stations", f"{STATION_LOCAL}+N", f"{STATION_PEER}"),
        ("--onboard", "MAVSDK and companion computers", f"{ONBOARD_LOCAL}+N", f"{ONBOARD_PEER}+N"),
    ):
        group.add_argument(
            flag,
            metavar="LOCAL:PEER",
            type=ports,
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


def _seed(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--seed",
        type=whole(0, 2**31 - 1, "a seed"),
        default=0,
        help="seed of everything random (default: 0)",
    )


def _duration(parser: argparse.ArgumentParser, default: str) -> None:
    parser.add_argument(
        "--duration",
        metavar="S",
        type=number(0.01, 1e6, "seconds"),
        help=f"how long to fly (default: {default})",
    )


def _view(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--view", action="store_true", help="show it in the browser while it flies; needs the extra [view]"
    )


def _output(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--out", metavar="DIR", type=Path, help="where to write logs and results")
    _logs(parser)
    parser.add_argument("--json", action="store_true", help="one JSON object on standard output at the end")


def _logs(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--logs",
        choices=LOGS,
        default="usual",
        help="how much is written: none, only the summary; usual, every state, but only some of the link's "
        "messages and estimates; all of them (default: %(default)s)",
    )


def _supervised(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--until-eof",
        action="store_true",
        help="stop when standard input ends, and write events (for programs)",
    )
