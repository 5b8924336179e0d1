"""Progress of a flight: what is shown, on terminals of every width, and where there is none."""

from __future__ import annotations

import fcntl
import io
import os
import pty
import re
import signal
import struct
import sys
import termios
from pathlib import Path

import pyte
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from sitl.flights.free_ports import free_ports
from sitl.terminal.display import Display, live_table
from sitl.terminal.status import Status, cells, plain_text
from sitl.terminal.summary import table

FLYING = Status(12.34, (3.0, -5.123, 2.0), 0.0123, 98.1, "setpoint", 1.0)
statuses = st.builds(
    Status,
    st.none() | st.floats(0, 1e5),
    st.none() | st.tuples(*[st.floats(-1e4, 1e4)] * 3),
    st.none() | st.floats(0, 1e4),
    st.none() | st.floats(0, 1e4),
    st.none() | st.sampled_from(["setpoint", "Follow Me", "taking the swing out", "disarmed"]),
    st.none() | st.floats(0, 300),
    st.none() | st.sampled_from(["crashed", "upside down", "load lost"]),
)


def _words(text: str) -> list[str]:
    return re.findall(r"\S+", text)


@given(status=statuses, width=st.integers(30, 200))
def test_every_figure_fits_on_every_terminal(status: Status, width: int) -> None:
    plain = plain_text(status, width)
    console = Console(file=io.StringIO(), width=width, color_system=None)
    with console.capture() as captured:
        console.print(live_table(status, width))
    for shown in (plain, captured.get()):
        assert all(len(line.rstrip()) <= width for line in shown.splitlines())
        expected = [word for cell in cells(status) for text in cell for word in _words(text)]
        assert sorted(_words(shown)) == sorted(expected)


def test_what_happened_is_said_once_and_stands_for_the_mode(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "120")  # the line of figures in one
    stream = io.StringIO()
    with Display(stream) as display:
        for condition in (None, "load lost", "load lost", "upside down"):
            display.show(Status(4.0, (0, 0, 0), 1.0, 0.0, "circle", 1.0, condition))
    lines = stream.getvalue().splitlines()
    assert lines[1:] == ["fly: load lost at t = 4.0 s", "fly: upside down at t = 4.0 s"]
    assert ("mode", "crashed") in cells(Status(mode="circle", condition="crashed"))


@pytest.mark.parametrize("outcome", ["interrupted", "turned over", "hit the ground"])
def test_a_flight_that_ended_early_has_no_figures_of_its_motion(outcome: str) -> None:
    figures = {"settling_time_2pct_s": 3.0, "overshoot_pct": 1.0, "tracking_rms_m": 0.1}
    ended = {"settled": False, "outcome": outcome, "outcome_time_s": 2.0, "time_s": 2.0, **figures}
    shown = table(ended)
    assert "flown" in shown
    assert not re.search("settling|overshoot|rms", shown)
    assert re.search("settling.*overshoot.*rms", table({"settled": True, **figures}), re.DOTALL)


def test_the_table_says_how_near_the_sensors_let_a_load_settle() -> None:
    near = {"settled": True, "settled_tolerance_m": 0.44, "settling_time_2pct_s": None}
    assert "settled within 0.44 m" in table(near)
    assert "within" not in table({**near, "settling_time_2pct_s": 3.0})
    assert "within" not in table({**near, "settled_tolerance_m": 0.3})


def test_the_table_says_which_point_of_a_sequence_its_figures_are_for() -> None:
    points = [
        {"set_at_s": 0.0, "overshoot_pct": 3.14},
        {"set_at_s": 5.5, "overshoot_pct": None},
        {"set_at_s": None, "overshoot_pct": None},
    ]
    shown = table({"settled": False, "outcome": "did not settle", "points": points})
    assert "2 of 3 set, overshoot up to 3.1 %; figures below count from 5.50 s on" in shown
    assert "overshoot up to" not in table({"settled": True, "points": None})


def test_the_table_is_as_narrow_as_the_terminal() -> None:
    summary = {"settled": False, "outcome": "did not settle", "outcome_cause": "up to 1.36 m off " * 3}
    assert max(map(len, table(summary, 40).splitlines())) <= 40


def _on_terminal(columns: int, *arguments: str, until: str = "", interrupt: bool = False) -> tuple[str, int]:
    """What a terminal shows in the end, and the exit code; Ctrl-C when it shows `until`."""
    screen = pyte.Screen(columns, 200)
    stream = pyte.ByteStream(screen)
    child, terminal = pty.fork()
    if child == 0:
        environment = {**os.environ, "TERM": "xterm"}
        environment.pop("COLUMNS", None)
        os.execve(sys.executable, [sys.executable, "-m", "sitl", *arguments], environment)
    fcntl.ioctl(terminal, termios.TIOCSWINSZ, struct.pack("HHHH", 200, columns, 0, 0))
    try:
        while True:
            try:
                data = os.read(terminal, 65536)
            except OSError:  # Linux: the other end is closed
                break
            if not data:
                break
            stream.feed(data)
            if interrupt and until in "\n".join(screen.display):
                os.write(terminal, b"\x03")
                interrupt = False
    finally:
        os.close(terminal)
        if interrupt:
            os.kill(child, signal.SIGKILL)
        _, status = os.waitpid(child, 0)
    return "\n".join(line.rstrip() for line in screen.display).rstrip(), os.waitstatus_to_exitcode(status)


@pytest.mark.parametrize("columns", [40, 79, 120])
def test_a_flight_on_a_terminal_leaves_one_table_and_whole_messages(columns: int, tmp_path: Path) -> None:
    command = ["fly", "setpoint", "--in-process", "--duration", "6", "--out", str(tmp_path)]
    shown, code = _on_terminal(columns, *command)
    assert code == 1  # six seconds: it has not settled yet
    lines = shown.splitlines()
    assert sum("tension" in line for line in lines) == 1
    assert sum(line.lstrip().startswith("outcome") for line in lines) == 1
    assert any(line.startswith("fly: ") for line in lines)
    assert "real-time factor" in shown


def test_ctrl_c_between_two_processes_leaves_whole_messages_and_no_empty_figures(tmp_path: Path) -> None:
    [port] = free_ports(1)
    command = ["fly", "setpoint", "--clock", "lockstep", "--speed", "5", "--out", str(tmp_path)]
    shown, code = _on_terminal(
        100, *command, "--hil", f"udpout:127.0.0.1:{port}", until="tension", interrupt=True
    )
    lines = shown.splitlines()
    assert code == 130
    assert sum("tension" in line for line in lines) == 1
    assert any(line.startswith("plant: stopped by ") for line in lines)
    assert any(line.startswith("  outcome") and "INTERRUPTED" in line for line in lines)
    assert not re.search(r"settling|overshoot|steady|\brms", shown)
