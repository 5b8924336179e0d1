"""Starting, stopping, killing and confusing the two processes."""

from __future__ import annotations

import json
import os
import signal
import socket
from collections.abc import Callable
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from sitl_bridge.event_log import read_events
from tests.loopback.conftest import Process, alive, children, wait_until

Start = Callable[..., Process]
WAITS_FOR_CONTROLLER = "waiting for an autopilot on udpout:127.0.0.1:"
WAITS_FOR_PLANT = "waiting for a plant on udpin:127.0.0.1:"

KEYS = {
    *("scenario", "vehicle", "design", "feedback", "seed", "clock", "rate_hz", "completed", "failure"),
    *("launch_to_first_command_s", "first_command_unix_s", "time_s", "real_time_factor", "lateness_us"),
    *("late_ticks", "resent_ticks", "unanswered_ticks", "settled", "settled_tolerance_m"),
    *("largest_error_at_end_m", "settling_time_2pct_s", "settling_time_1cm_s", "overshoot_pct"),
    *("steady_state_error_m", "tracking_rms_m", "estimate", "picture", "state_log", "state_log_sha256"),
    "tlog",
}
"""Of every summary, however the flight ended."""


def plant_arguments(port: int, *more: str) -> list[str]:
    return ["plant", "--scenario", "setpoint", "--hil", f"udpout:127.0.0.1:{port}", *more]


def controller_arguments(port: int, *more: str) -> list[str]:
    return ["controller", "--scenario", "setpoint", "--hil", f"udpin:127.0.0.1:{port}", *more]


@pytest.mark.parametrize("first", ["plant", "controller"])
def test_by_hand_in_either_order(start: Start, port: int, first: str) -> None:
    plant_line = plant_arguments(port, "--clock", "lockstep", "--duration", "3", "--json")
    if first == "plant":
        plant = start(*plant_line)
        plant.wait_for(WAITS_FOR_CONTROLLER + str(port))
        controller = start(*controller_arguments(port))
    else:
        controller = start(*controller_arguments(port))
        controller.wait_for(WAITS_FOR_PLANT + str(port))
        plant = start(*plant_line)
    code, output, _ = plant.finish()
    assert code == 0
    assert json.loads(output)["time_s"] == pytest.approx(3.0)
    controller.wait_for("no HIL_SENSOR for 1 s")
    controller.popen.send_signal(signal.SIGTERM)
    assert controller.finish()[0] == 0


def test_a_killed_controller_is_taken_back_in_lockstep(start: Start, port: int, tmp_path: Path) -> None:
    plant = start(
        *plant_arguments(port, "--clock", "lockstep", "--speed", "10", "--out", str(tmp_path), "--json")
    )
    controller = start(*controller_arguments(port, "--duration", "6"))
    controller.finish()  # gone at t = 6 s, after the first settling, without a word to the plant
    plant.wait_for("no answer from the autopilot: the world waits for it")
    again = start(*controller_arguments(port))
    plant.wait_for("autopilot answers again")
    assert plant.finish()[0] == 0
    again.close()
    log = pq.read_table(tmp_path / "state.parquet")
    end = [log[f"load_{axis}_m"].to_pylist()[-1] for axis in "xyz"]
    assert end == pytest.approx([3.0, 5.0, 2.0], abs=0.01)


def test_a_plant_at_another_rate_is_not_flown(start: Start, port: int) -> None:
    plant = start(*plant_arguments(port, "--clock", "lockstep", "--speed", "1", "--rate", "500"))
    controller = start(*controller_arguments(port))
    controller.wait_for("the plant ticks every 2 ms (500 Hz), the law is designed for 250 Hz: not armed")
    plant.popen.send_signal(signal.SIGTERM)
    _, _, said = plant.finish()
    assert "the autopilot is armed" not in said


def test_a_killed_controller_stops_the_rotors_in_real_time(start: Start, port: int) -> None:
    plant = start(*plant_arguments(port))
    controller = start(*controller_arguments(port))
    plant.wait_for("the scenario begins")
    controller.popen.kill()
    plant.wait_for("no answer from the autopilot for 0.3 s: rotors stopped")
    plant.popen.send_signal(signal.SIGTERM)
    assert plant.finish()[0] == 0


@pytest.mark.parametrize("ignored", [False, True])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signals_end_a_flight_and_leave_nothing(
    start: Start, port: int, tmp_path: Path, ignored: bool, number: signal.Signals
) -> None:
    flight = start(
        *("fly", "hover", "--hil", f"udpout:127.0.0.1:{port}", "--out", str(tmp_path), "--json"),
        ignore_sigint=ignored,
    )
    flight.wait_for("the scenario begins")
    pids = children(flight.popen.pid)
    assert len(pids) == 2
    flight.popen.send_signal(number)
    code, output, errors = flight.finish()
    assert code == 130
    assert f"stopped by {number.name}" in errors
    assert not json.loads(output)["settled"]
    assert not any(map(alive, pids))


@pytest.mark.parametrize("victim", ["plant", "controller"])
def test_a_killed_process_ends_the_flight_with_a_word(
    start: Start, port: int, tmp_path: Path, victim: str
) -> None:
    flight = start("fly", "hover", "--hil", f"udpout:127.0.0.1:{port}", "--out", str(tmp_path))
    flight.wait_for("the scenario begins")
    pids = children(flight.popen.pid)
    commands = {pid: Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0") for pid in pids}
    os.kill(next(pid for pid in pids if victim.encode() in commands[pid]), signal.SIGKILL)
    code, _, errors = flight.finish()
    assert code == 1
    assert f"the {victim} was killed by SIGKILL" in errors
    assert "Traceback" not in errors
    assert not any(map(alive, pids))
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert set(summary) >= KEYS
    if victim == "plant":
        assert summary["real_time_factor"] is summary["lateness_us"] is summary["late_ticks"] is None


def test_a_folder_used_again_tells_nothing_of_the_flight_before(
    start: Start, port: int, tmp_path: Path
) -> None:
    notes = tmp_path / "notes.txt"
    notes.write_text("mine")
    line = ("fly", "hover", "--out", str(tmp_path), "--clock", "lockstep", "--duration", "6")
    code, output, errors = start(*line, "--hil", f"udpout:127.0.0.1:{port}").finish()
    assert code == 0, errors
    listed = {Path(word).name for word in output.split() if word.startswith(str(tmp_path))}
    assert listed == {file.name for file in tmp_path.iterdir()} - {"notes.txt"}
    assert "state.parquet" in listed
    flight = start(*line, "--hil", f"udpout:127.0.0.1:{port}")
    wait_until(lambda: len(children(flight.popen.pid)) == 2, "no plant and controller")
    for pid in children(flight.popen.pid):  # they have only just been launched, and said a word at most
        os.kill(pid, signal.SIGKILL)
    code, output, errors = flight.finish()
    assert code == 1
    assert "was killed by SIGKILL" in errors
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert not summary["settled"]
    assert summary.get("steady_state_error_m") is None
    assert output.split()[-1] == str(tmp_path / "summary.json")
    assert {file.name for file in tmp_path.iterdir()} - {"events.jsonl"} == {"notes.txt", "summary.json"}
    assert not any(event.time_s for event in read_events(tmp_path))


def test_a_killed_supervisor_leaves_nothing_running(start: Start, port: int, tmp_path: Path) -> None:
    flight = start("fly", "hover", "--hil", f"udpout:127.0.0.1:{port}", "--out", str(tmp_path))
    flight.wait_for("the scenario begins")
    pids = children(flight.popen.pid)
    flight.popen.kill()
    wait_until(lambda: not any(map(alive, pids)), "plant or controller outlive a killed `sitl fly`")


def test_garbage_on_the_hil_ports_disturbs_nobody(start: Start, port: int, tmp_path: Path) -> None:
    plant = start(*plant_arguments(port, "--clock", "lockstep", "--duration", "4", "--speed", "4", "--json"))
    controller = start(*controller_arguments(port))
    plant.wait_for("the scenario begins")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        for junk in (b"", b"\xfd", bytes(65000), b"\xfd\x10\x00" * 100, b"\xfe" * 300):
            stranger.sendto(junk, ("127.0.0.1", port))
    code, output, errors = plant.finish()
    assert code == 0, errors
    assert json.loads(output)["time_s"] == pytest.approx(4.0)
    assert controller.popen.poll() is None


def test_a_port_in_use_is_one_clear_line(start: Start, port: int) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as holder:
        holder.bind(("127.0.0.1", port))
        code, _, errors = start(*controller_arguments(port)).finish()
    assert code == 2
    assert errors == f"sitl controller: udpin:127.0.0.1:{port} cannot be opened: Address already in use\n"


@pytest.mark.parametrize("scenario", ["setpoint", "hold"])
def test_a_flight_does_not_begin_with_somebody_elses_controller(
    start: Start, port: int, tmp_path: Path, scenario: str
) -> None:
    other = start(*controller_arguments(port))
    other.wait_for("waiting for a plant")
    out = tmp_path / "out"
    arguments = ("fly", scenario, "--hil", f"udpout:127.0.0.1:{port}", "--out", str(out))
    code, output, errors = start(*arguments).finish()
    assert code == 2
    assert errors == (
        f"sitl fly: udpin:127.0.0.1:{port} cannot be opened: Address already in use; "
        "--instance N flies beside others, --hil on another port\n"
    )
    assert output == ""
    assert not out.exists()
    assert "plant connected" not in other.errors


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["fly", "setpiont"], "setpiont: no such scenario; expected one of baro-drift, circle, "),
        (["fly", "hover", "--set", "cable.stiffness=-1"], "cable.stiffness = -1"),
        (["fly", "hover", "--vehicle", "nothing.toml"], "nothing.toml: no such vehicle"),
        (["fly", "hover", "--rate", "abc"], "argument --rate: 'abc': expected ticks a second, 20 to 1000"),
        (
            ["plant", "--hil", "udp:1"],
            "argument --hil: 'udp:1': expected udpout|udpin|tcpin|tcpout:HOST:PORT",
        ),
        (
            ["plant", "--hil", "udpout:127..0.0.1:14560"],
            "argument --hil: 'udpout:127..0.0.1:14560': expected udpout|udpin|tcpin|tcpout:HOST:PORT",
        ),
        (["fly", "hover", "--hil", "udpin:127.0.0.1:0"], "expected a port that the other end can know, 1 to"),
        (["controller", "--hil", "tcpout:127.0.0.1:0"], "expected a port that the other end can know, 1 to"),
        (
            ["plant", "--load-to", "127..0.0.1:14550"],
            "argument --load-to: '127..0.0.1:14550': expected HOST:",
        ),
        (["plant", "--speed", "2"], "--speed: goes with --clock lockstep"),
        (
            ["controller", "--clock", "lockstep"],
            "sitl controller: error: unrecognized arguments: --clock lockstep",
        ),
        (["fly", "hover", "--instance", "100"], "expected an instance, 0 to 99"),
    ],
)
def test_a_wrong_command_line_is_one_clear_line(start: Start, arguments: list[str], expected: str) -> None:
    code, output, errors = start(*arguments).finish()
    assert code == 2
    assert output == ""
    assert expected in errors
    assert len(errors.splitlines()) == 1
