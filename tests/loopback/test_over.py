"""The companion over our own autopilot: plant, stack and companion as real processes, and what goes wrong."""

from __future__ import annotations

import json
import math
import signal
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from controller.over.stack import read_stack
from sitl.flights.free_ports import free_ports
from sitl.flights.report import positions, read_state_log
from sitl_bridge.vehicle.files import load_vehicle
from tests.loopback.conftest import Process
from tests.loopback.over_stack import IRIS, SerialLine, StandIn
from tests.loopback.pymav import HOLD, PyMav
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
    assert code == 0, errors
    summary = json.loads(output)
    assert summary == json.loads((out / "summary.json").read_text())
    assert summary.keys() >= KEYS
    assert summary["completed"]
    assert summary["settled"]
    over = summary["over"]
    assert over["within_5pct_s"] < 2.8
    assert over["overshoot_m"] < 0.05
    assert over["residual_swing_rms_deg"] < 0.5
    assert over["residual_error_rms_m"] < 0.02
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
    for words in ("PX4 is there", "took over", "handing back", "landed and disarmed"):
        assert words in errors


def test_a_killed_companion_is_replaced_and_an_operator_is_obeyed(start: Start, tmp_path: Path) -> None:
    stand_in = StandIn(start, tmp_path)
    stand_in.start_plant()
    stack = stand_in.start_stack()
    operator = PyMav(f"udpin:127.0.0.1:{stand_in.gcs_peer}")
    line = None
    try:
        first = stand_in.start_companion("--duration", "60")
        first.wait_for("flying the load")
        first.popen.kill()
        operator.wait_for_text("No offboard set-point")
        operator.wait_for("HEARTBEAT")
        line = SerialLine(stand_in.onboard_peer)
        second = stand_in.start_companion("--duration", "60", over=f"serial:{line.device}:921600")
        second.wait_for("flying the load")
        assert "arming" not in second.errors  # it flew already
        operator.command(176, 1, *HOLD)
        code, _, errors = second.finish()
        assert code == 1
        assert "took another mode: nothing is sent any more" in errors
        line.close()
        line = None
        third = stand_in.start_companion("--duration", "60")
        third.wait_for("flying the load")
        stack.popen.send_signal(signal.SIGSTOP)
        code, _, errors = third.finish()
        stack.popen.send_signal(signal.SIGCONT)
        assert code == 1
        assert "state is older than 0.2 s: nothing is sent any more" in errors
    finally:
        operator.close()
        if line is not None:
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


def test_identify_finds_the_rotors_lag_and_thrust(start: Start, tmp_path: Path) -> None:
    """One and a half times the usual lag of the rotors, of which autopilot and companion know nothing."""
    stand_in = StandIn(start, tmp_path)
    slow = [flag for i in range(4) for flag in ("--set", f"rotors.{i}.time_constant=0.03")]
    stand_in.start_plant(*slow)
    stand_in.start_stack()
    file = tmp_path / "stack.toml"
    code, output, errors = start(
        *("identify", *IRIS, "--over", stand_in.over, "--load", "truth", "--json", "--out", str(file)),
        *("--truth-from", f"udpin:127.0.0.1:{stand_in.truth}", "--duration", "30"),
    ).finish()
    assert code == 0, errors
    found = json.loads(output)
    assert found["responses"]["thrust"]["lag"] == pytest.approx(0.03, rel=0.15)
    rotors = load_vehicle("iris").rotors
    full = sum(rotor.thrust_coefficient * rotor.max_speed**2 for rotor in rotors)
    assert found["full_thrust"] == pytest.approx(full, rel=0.05)
    assert found["rate_lag"] + found["delay"] > 0.06
    stack = read_stack(file)
    assert stack.model_dump() == {key: found[key] for key in stack.model_dump()}


def test_the_load_is_moved_live_while_the_stack_flies(start: Start, tmp_path: Path) -> None:
    stand_in = StandIn(start, tmp_path)
    stand_in.start_plant()
    stand_in.start_stack()
    local, peer = free_ports(2)
    client = PyMav(f"udpin:127.0.0.1:{peer}")
    try:
        companion = stand_in.start_companion("--gcs", f"{local}:{peer}", scenario="hold")
        companion.wait_for("flying the load")
        here = client.wait_for("LOCAL_POSITION_NED", system=101)
        mask = 0b1101_1111_1000
        client.link.mav.set_position_target_local_ned_send(
            0, 101, 35, 1, mask, here.x + 2.0, here.y, here.z - 1.0, *(0.0,) * 8
        )
        client.wait(
            lambda m: (
                m.get_type() == "LOCAL_POSITION_NED"
                and m.get_srcSystem() == 101
                and math.dist((m.x, m.y, m.z), (here.x + 2.0, here.y, here.z - 1.0)) < 0.1
            ),
            "the load at its point",
        )
        place = client.wait_for("GLOBAL_POSITION_INT", system=101)
        client.link.mav.command_int_send(
            101, 35, 5, 192, 0, 0, -1.0, 0, 0, math.nan, place.lat, place.lon, 1e-3 * place.alt + 1.0
        )
        client.wait(
            lambda m: (
                m.get_type() == "GLOBAL_POSITION_INT"
                and m.get_srcSystem() == 101
                and abs(m.alt - place.alt - 1000) < 100
            ),
            "the load a metre higher",
        )
    finally:
        client.close()
