"""The companion over our own autopilot: plant, stack and companion as real processes, and what goes wrong."""

from __future__ import annotations

import json
import math
import signal
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from sitl.flights.free_ports import free_ports
from sitl.report.summary import positions, read_state_log
from sitl_bridge.event_log import read_events
from tests.loopback.conftest import Process
from tests.loopback.over_stack import IRIS, SerialLine, StandIn
from tests.loopback.pymav import PyMav
from tests.loopback.test_processes import KEYS

Start = Callable[..., Process]


def test_fly_over_a_stack_that_somebody_else_starts(start: Start, tmp_path: Path) -> None:
    stand_in = StandIn(start, tmp_path)
    out = tmp_path / "flight"
    flight = start(
        *("fly", str(stand_in.step), *IRIS, "--over", stand_in.over, "--load", "truth", "--json"),
        *("--hil", f"tcpin:127.0.0.1:{stand_in.hil}", "--out", str(out)),
    )
    flight.wait_for("waiting for a flight stack")
    stand_in.start_stack()
    code, output, errors = flight.finish()
    assert code == 0, output + errors
    summary = json.loads(output)
    assert summary == json.loads((out / "summary.json").read_text())
    assert summary.keys() >= KEYS
    assert summary["completed"]
    assert summary["settled"]
    assert summary["over"]["within_5pct_s"] is not None  # how well it is flown: tests/over/test_flown.py
    over = summary["over"]
    log, whole = read_state_log(out / "state.parquet"), read_state_log(out / "plant" / "state.parquet")
    assert log["time_s"][0] == 0.0
    assert log["time_s"][-1] == pytest.approx(12.0, abs=0.1)
    assert summary["time_s"] == log["time_s"][-1]
    away = np.linalg.norm(positions(log, "load")[0] - [3.0, 0.0, 2.5])
    assert away > 1.5  # times count from where the step begins
    assert whole["time_s"][-1] > over["handed_back_at_s"] + 2.0
    assert whole["vehicle_z_m"][-1] < 0.3  # landed
    for name in ("flight.png", "flight.html", "companion.parquet", "reference.parquet"):
        assert (out / name).exists(), name
    diary = read_events(out)
    assert {"plant", "controller"} == {event.source for event in diary}
    modes = [event.text for event in diary if event.kind == "mode"]
    assert modes.index("flying the load") < modes.index("handing back") < modes.index("landing")
    for words in ("PX4 is there", "took over", "handing back", "landed and disarmed"):
        assert words in errors


def test_a_companion_on_a_serial_line_arms_the_stack(start: Start, tmp_path: Path) -> None:
    stand_in = StandIn(start, tmp_path)
    stand_in.start_plant()
    stand_in.start_stack()
    line = SerialLine(stand_in.onboard_peer)
    try:
        companion = stand_in.start_companion(f"serial:{line.device}:921600")
        companion.wait_for("the stack says: Armed")
        companion.popen.send_signal(signal.SIGTERM)
        code, _, errors = companion.finish()
        assert code == 1
        assert "stopped by SIGTERM: nothing more is sent" in errors
    finally:
        line.close()


def test_without_a_stack_it_says_so_and_ends(start: Start, tmp_path: Path) -> None:
    [port, hil] = free_ports(2)
    out = tmp_path / "flight"
    code, output, errors = start(
        *("fly", "setpoint", *IRIS, "--over", f"udpin:127.0.0.1:{port}", "--wait", "1"),
        *("--hil", f"tcpin:127.0.0.1:{hil}", "--out", str(out), "--json"),
    ).finish()
    assert code == 1
    assert "fly: waited 1 s for a HEARTBEAT of an autopilot" in errors
    assert json.loads(output).keys() >= KEYS


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("gps-jump",), "faults"),
        (("setpoint", "--in-process"), "--in-process: does not go with --over"),
        (("setpoint", "--feedback", "truth"), "--load says"),
        (("setpoint", "--gcs", "1:2"), "--gcs: goes with a scenario that leaves the load to it"),
        (("setpoint", "--stack", "no-such-file.toml"), "no-such-file.toml"),
        (("setpoint", "--truth-from", "udpin"), "--truth-from"),
    ],
)
def test_what_does_not_go_together_is_one_line(start: Start, arguments: tuple[str, ...], words: str) -> None:
    [port, hil] = free_ports(2)
    code, output, errors = start(
        "fly", *arguments, "--over", f"udpin:127.0.0.1:{port}", "--hil", f"tcpin:127.0.0.1:{hil}"
    ).finish()
    assert code == 2, errors
    assert output == ""
    assert words in errors
    assert "Traceback" not in errors


def test_the_load_is_a_system_on_a_link_of_its_own(start: Start) -> None:
    """It answers before there is a stack."""
    local, peer, nobody = free_ports(3)
    client = PyMav(f"udpin:127.0.0.1:{peer}")
    try:
        live = ("--gcs", f"{local}:{peer}", "--load", "none")
        start("controller", "--scenario", "hold", *IRIS, "--over", f"udpin:127.0.0.1:{nobody}", *live)
        assert client.wait_for("HEARTBEAT", system=101).autopilot == 8
        client.link.mav.command_int_send(101, 35, 5, 192, 0, 0, -1.0, 0, 0, math.nan, 1, 1, 10.0)
        assert client.wait_for("COMMAND_ACK", system=101).result == 2
        client.wait_for_text("does not fly yet")
    finally:
        client.close()
