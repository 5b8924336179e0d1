"""`sitl controller --over`: the law as a companion of a flight stack."""

from __future__ import annotations

import argparse
import json
from typing import TYPE_CHECKING

from sitl.exit_codes import FAILED
from sitl_bridge.mavlink.links import parse_address
from sitl_bridge.process import Speaker, StopRequest
from sitl_bridge.vehicle.description import Vehicle
from sitl_bridge.vehicle.files import DescriptionError

if TYPE_CHECKING:
    from sitl.flights.scenario import Scenario

TRUTH_PORT = 19410
DEFAULT_DURATION = 60.0
"""s, of a reference that has none."""


def run_over(arguments: argparse.Namespace, vehicle: Vehicle, scenario: Scenario | None) -> int:
    """Fly one reference over a stack; exit code 1 when it did not come to its end."""
    from controller.over.run import OverOptions, run
    from controller.over.stack import Stack, read_stack
    from sitl.flights.scenario import GroundControl, Hover

    reference = scenario.reference if scenario else Hover(kind="hover")
    if isinstance(reference, GroundControl):
        raise DescriptionError(
            "--over", ["flies a reference; expected a scenario with one, such as setpoint"]
        )
    if arguments.truth_from is not None and arguments.load != "truth":
        raise DescriptionError("--truth-from", ["goes with --load truth"])
    truth = None
    if arguments.load == "truth":
        truth = parse_address(arguments.truth_from or "udpin", TRUTH_PORT, TRUTH_PORT)
    stop = StopRequest()
    stop.install(watch_stdin=arguments.until_eof)
    outcome = run(
        OverOptions(
            vehicle=vehicle,
            over=parse_address(arguments.over, 14540, 5760),
            path_from=reference.path,
            duration_s=arguments.duration or (scenario.duration if scenario else None) or DEFAULT_DURATION,
            stack=Stack() if arguments.stack is None else read_stack(arguments.stack),
            load=arguments.load,
            truth=truth,
            out=arguments.out,
        ),
        Speaker("controller", events=False),
        stop,
    )
    if arguments.json:
        print(json.dumps(outcome, indent=2))
    return 0 if outcome["completed"] else FAILED
