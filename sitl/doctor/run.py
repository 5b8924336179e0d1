"""Runs every check and prints the findings."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator

from sitl.doctor import installation, machine
from sitl.doctor.finding import Finding

CHECKS: tuple[Callable[[], Finding], ...] = (
    installation.python,
    installation.packages,
    installation.extras,
    installation.cache,
    installation.output,
    machine.system,
    machine.cores,
    machine.clock,
    machine.loopback,
    machine.hil_port,
    machine.ports,
    machine.display,
)


def findings() -> Iterator[Finding]:
    """The result of each check, as soon as it is known."""
    for check in CHECKS:
        yield check()


def examine(as_json: bool = False) -> bool:
    """Print every finding; returns whether nothing prevents a flight."""
    found = []
    for finding in findings():
        found.append(finding)
        if not as_json:
            print(finding.line(), flush=True)
    if as_json:
        print(json.dumps([finding._asdict() for finding in found], indent=2))
    return all(finding.level != "fail" for finding in found)
