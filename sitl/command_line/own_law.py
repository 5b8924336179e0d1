"""`--law`: fly a control law of the user's own."""

from __future__ import annotations

import argparse
import contextlib
import os
import sys
from collections.abc import Iterator
from typing import TYPE_CHECKING, TextIO

from sitl.flights.scenario import GroundControl, Scenario
from sitl_bridge.vehicle.files import DescriptionError

if TYPE_CHECKING:
    from controller.own_law.find import ChosenLaw


def add_law(parser: argparse.ArgumentParser) -> None:
    """Declare `--law`."""
    parser.add_argument(
        "--law",
        metavar="MODULE:NAME",
        help="fly a law of your own, a Python class; also FILE.py:NAME (see docs/your-own-law.md)",
    )


def chosen_law(arguments: argparse.Namespace, scenario: Scenario | None) -> ChosenLaw | None:
    """What `--law` names. Raises DescriptionError if there is no such law, or not for such a flight."""
    if arguments.law is None:
        return None
    from controller.own_law.find import choose

    where = f"--law {arguments.law}"
    if arguments.over is not None:
        raise DescriptionError(where, ["takes the HIL link; --over flies with the stack's own laws"])
    if arguments.design != "default":
        raise DescriptionError(where, [f"instead of a design; leave out --design {arguments.design}"])
    if scenario is not None and isinstance(scenario.reference, GroundControl):
        raise DescriptionError(
            where, ["takes a scenario with a reference; this one leaves it to ground control"]
        )
    return choose(arguments.law)


@contextlib.contextmanager
def prints_to_stderr(active: bool) -> Iterator[TextIO]:
    """Send what a law prints, also from C, to standard error; gives the standard output."""
    if not active:
        yield sys.stdout
        return
    sys.stdout.flush()
    kept = os.dup(1)
    os.dup2(2, 1)
    try:
        with os.fdopen(os.dup(kept), "w") as real:
            yield real
    finally:
        sys.stdout.flush()
        os.dup2(kept, 1)
        os.close(kept)
