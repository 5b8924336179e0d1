"""Faults of the link, by scenario: in lockstep they change how long a flight takes, and nothing else."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from sitl_bridge.plant.faults.impaired_link import FaultyLink
from sitl_bridge.plant.faults.schedule import LinkFault

Fly = Callable[..., dict[str, Any]]

SCENARIO = """
vehicle = "paper"
duration = 2.0
[reference]
kind = "setpoint"
position = [1.0, 0.0, 0.0]
"""
FAULTS = """
[[faults.link]]
failure = "drop"
at = 0.0
share = 0.05
[[faults.link]]
failure = "jitter"
at = 0.0
share = 0.1
delay = 0.002
[[faults.link]]
failure = "duplicate"
at = 0.0
share = 0.1
delay = 0.003
[[faults.link]]
failure = "reorder"
at = 0.0
share = 0.05
delay = 0.005
[[faults.link]]
failure = "stall"
at = 0.2
duration = 0.5
direction = "to_plant"
[[faults.rotor]]
rotor = 1
thrust = 0.95
at = 1.0
duration = 0.5
"""


def test_link_faults_change_how_long_a_lockstep_flight_takes_and_nothing_else(
    fly: Fly, tmp_path: Path
) -> None:
    link_at, rotor_at = FAULTS.index("[[faults.link]]"), FAULTS.index("[[faults.rotor]]")
    logs = {}
    for name, faults in (
        ("no faults", ""),
        ("rotor", FAULTS[rotor_at:]),
        ("rotor and link", FAULTS[link_at:]),
    ):
        file = tmp_path / f"{name}.toml"
        file.write_text(SCENARIO + faults)
        summary = fly(str(file), "--no-report", expect=1)  # too short to settle
        assert summary["completed"]
        logs[name] = Path(summary["state_log"]).read_bytes()
        if name == "rotor and link":
            assert summary["resent_ticks"] > 10
            assert 2.0 / summary["real_time_factor"] > 0.5  # the stall at least, s
    assert logs["rotor"] == logs["rotor and link"]
    assert logs["rotor"] != logs["no faults"]


class Wire:
    """A link in memory."""

    reliable = True

    def __init__(self) -> None:
        self.sent: list[tuple[float, bytes]] = []
        self.incoming: list[bytes] = []

    def send(self, datagram: bytes) -> None:
        self.sent.append((time.monotonic(), datagram))

    def receive(self, until: float) -> bytes | None:
        if self.incoming:
            return self.incoming.pop(0)
        time.sleep(max(0.0, min(until - time.monotonic(), 0.1)))
        return None

    def close(self) -> None:
        pass


def test_nothing_happens_before_the_scenario_begins_and_a_delay_from_then_on() -> None:
    wire, began = Wire(), None
    link = FaultyLink(wire, [LinkFault(failure="delay", at=0.0, delay=0.05)], 0, lambda: began)
    assert not link.reliable
    link.send(b"before")
    assert [datagram for _, datagram in wire.sent] == [b"before"]
    began = time.monotonic()
    link.send(b"after")
    wire.incoming.append(b"answer")
    assert len(wire.sent) == 1
    answer = None
    while answer is None:
        answer = link.receive(began + 10.0)
        assert time.monotonic() < began + 10.0
    assert answer == b"answer"
    assert wire.sent[1][1] == b"after"
    assert wire.sent[1][0] - began >= 0.05
    assert time.monotonic() - began >= 0.05


@pytest.mark.parametrize(("share", "kept"), [(1.0, 0), (0.5, 100)])
def test_a_drop_draws_for_each_datagram(share: float, kept: int) -> None:
    wire = Wire()
    link = FaultyLink(wire, [LinkFault(failure="drop", at=0.0, share=share)], 1, time.monotonic)
    for _ in range(200):
        link.send(b"tick")
    assert len(wire.sent) == pytest.approx(kept, abs=25 if kept else 0)
