"""Laws of one's own: the shipped examples fly, and what is wrong with a law is one line."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import sitl
from controller.own_law.interface import LawError
from sitl.flights.free_ports import free_ports
from sitl_bridge.vehicle.files import DescriptionError
from tests.patience import LONG_PATIENCE, PATIENCE

TOP = Path(__file__).parents[3]
EXAMPLES = {
    "cascaded_pid.py": "CascadedPid",
    "geometric.py": "Geometric",
    "linear_mpc.py": "LinearMpc",
}
HOVERING = """
class Law:
    def __init__(self, *, vehicle, rate_hz):
        self.weight = vehicle.hover_thrust
    def step(self, estimate, reference):
        {body}
        return self.weight, (0.0, 0.0, 0.0)
"""


def law_file(folder: Path, body: str = "pass", text: str = HOVERING) -> str:
    file = folder / "mine.py"
    file.write_text(text.format(body=body))
    return f"{file}:Law"


def command(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "sitl", *arguments],
        capture_output=True,
        text=True,
        check=False,
        timeout=LONG_PATIENCE,
    )


ONE_PROCESS = ("--in-process", "--no-report")


def two_processes() -> tuple[str, ...]:
    [port] = free_ports(1)
    return "--clock", "lockstep", "--hil", f"udpout:127.0.0.1:{port}", "--no-report"


@pytest.mark.parametrize("vehicle", ["paper", "iris"])
@pytest.mark.parametrize("file", EXAMPLES)
def test_an_example_settles(file: str, vehicle: str) -> None:
    law = f"{TOP / 'examples/laws' / file}:{EXAMPLES[file]}"
    flight = sitl.fly("setpoint", law=law, vehicle=vehicle, feedback="truth")
    assert flight.summary["settled"], flight.summary
    assert flight.summary["outcome"] == "settled"
    cost = flight.summary["law"]
    assert cost["name"] == law
    assert cost["steps"] == 7500
    assert 0.0 < cost["mean_us"] <= cost["worst_us"]


def test_examples_are_short_enough_to_read() -> None:
    texts = {file.name: file.read_text() for file in (TOP / "examples/laws").glob("*.py")}
    assert texts.keys() == EXAMPLES.keys()
    assert all(30 <= sum(map(bool, text.splitlines())) <= 60 for text in texts.values())


@pytest.mark.parametrize("feedback", ["truth", "estimate"])
def test_one_process_or_two_it_is_the_same_flight(feedback: str, tmp_path: Path) -> None:
    law = f"{TOP / 'examples/laws/cascaded_pid.py'}:CascadedPid"
    common = (
        "fly",
        "circle",
        "--law",
        law,
        "--duration",
        "4",
        "--seed",
        "3",
        "--json",
        "--feedback",
        feedback,
    )
    common += ("--vehicle", "iris", "--set", "load.mass=0.2")
    here = command(*common, *ONE_PROCESS, "--out", str(tmp_path / "here"))
    apart = command(*common, *two_processes(), "--out", str(tmp_path / "apart"))
    one, two = json.loads(here.stdout), json.loads(apart.stdout)
    assert one["completed"], here.stderr
    assert two["completed"], apart.stderr
    assert one["state_log_sha256"] == two["state_log_sha256"]
    assert one["law"]["steps"] == two["law"]["steps"] > 900
    assert one.keys() == two.keys()
    assert one["design"] is None


@pytest.mark.parametrize("where", ["here", "apart"])
@pytest.mark.parametrize(
    ("body", "says"),
    [
        ("if estimate.time_s > 0.1: [][1]", ("IndexError", "mine.py, line 6", "t = 0.104 s")),
        ("return None", ("returned None", "mine.py, line 5", "t = 0.000 s")),
        ("return self.weight, (0.0, float('nan'), 0.0)", ("not finite", "mine.py, line 5")),
        ("import sys; sys.exit(0)", ("SystemExit", "mine.py, line 6")),
    ],
)
def test_a_failing_law_is_one_message(body: str, says: tuple[str, ...], where: str, tmp_path: Path) -> None:
    law = law_file(tmp_path, body)
    how = ONE_PROCESS if where == "here" else two_processes()
    ended = command(
        "fly", "hover", "--law", law, "--duration", "2", "--json", "--out", str(tmp_path / "o"), *how
    )
    assert ended.returncode == 1
    failure = json.loads(ended.stdout)["failure"]
    assert f"law {law} " in failure
    assert "the rotors were stopped" in failure
    for text in says:
        assert text in failure
    assert f"fly: {failure}" in ended.stderr
    assert "Traceback" not in ended.stderr


def test_what_a_law_prints_does_not_get_into_the_way(tmp_path: Path) -> None:
    law = law_file(tmp_path, "import os; print('from Python'); os.write(1, b'from C\\n')")
    for how in (ONE_PROCESS, two_processes()):
        ended = command(
            "fly", "hover", "--law", law, "--duration", "0.2", "--json", "--out", str(tmp_path), *how
        )
        assert json.loads(ended.stdout)["completed"], ended.stderr
        assert "from Python" in ended.stderr
        assert "from C" in ended.stderr


@pytest.mark.parametrize(
    ("law", "says"),
    [
        ("mine", "expected MODULE:NAME or FILE.py:NAME"),
        ("nothing.py:Law", "there is no file nothing.py"),
        ("no_such_module:Law", "ModuleNotFoundError"),
        ("mine.py:Lwa", "there is no Lwa in mine.py; it has Law"),
        ("mine:Lwa", "there is no Lwa in mine; it has Law"),
        ("broken.py:Law", "SyntaxError: "),
        ("wrong.py:NoRate", "rate_hz"),
        ("wrong.py:NoStep", "no method step"),
        ("wrong.py:ShortStep", "expected (estimate, reference)"),
        ("wrong.py:Raises", "the constructor raised KeyError: 'arm' (wrong.py, line 13)"),
        ("wrong.py:number", "is not a class"),
    ],
)
def test_a_law_that_cannot_be_flown_is_one_line(law: str, says: str, tmp_path: Path) -> None:
    law_file(tmp_path)
    (tmp_path / "broken.py").write_text("class Law\n")
    (tmp_path / "wrong.py").write_text(
        "class NoRate:\n    def __init__(self, *, vehicle): pass\n    def step(self, e, r): pass\n"
        "class NoStep:\n    def __init__(self, **given): pass\n"
        "class ShortStep:\n    def __init__(self, vehicle, rate_hz): pass\n    def step(self, e): pass\n"
        "number = 3\n"
        "class Raises:\n    def __init__(self, vehicle, rate_hz):\n"
        "        given = {}\n        given['arm']\n    def step(self, e, r): pass\n"
    )
    for name in ("fly", "controller"):
        ended = subprocess.run(
            [sys.executable, "-m", "sitl", name, "--law", law],
            cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": f"{TOP}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"},
            capture_output=True,
            text=True,
            check=False,
            timeout=PATIENCE,
        )
        assert ended.returncode == 2, ended.stderr
        assert says in ended.stderr
        assert ended.stderr.startswith(f"--law {law}: ")
        assert ended.stderr.count("\n") == 1
        assert not (tmp_path / "runs").exists()


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("hold",), "ground control"),
        (("hover", "--design", "paper"), "--design paper"),
        (("hover", "--over", "udpin:127.0.0.1:14540"), "--over"),
    ],
)
def test_where_no_own_law_flies(arguments: tuple[str, ...], says: str, tmp_path: Path) -> None:
    ended = command("fly", *arguments, "--law", law_file(tmp_path))
    assert ended.returncode == 2
    assert says in ended.stderr
    assert ended.stderr.count("\n") == 1


class Hover:
    """Returns hover thrust for a while."""

    def __init__(self, *, vehicle: Any, rate_hz: float) -> None:
        self.weight = vehicle.hover_thrust

    def step(self, estimate: Any, reference: Any) -> Any:
        if estimate.time_s > 0.5:
            raise ArithmeticError("enough")
        return self.weight, (0.0, 0.0, 0.0)


def test_from_python_a_law_is_a_class() -> None:
    flight = sitl.fly("hover", law=Hover, duration_s=0.4)
    assert flight.summary["law"]["name"] == "Hover"
    with pytest.raises(LawError, match="ArithmeticError: enough") as raised:
        sitl.fly("hover", law=Hover, duration_s=1.0)
    assert isinstance(raised.value.__cause__, ArithmeticError)
    with pytest.raises(DescriptionError, match="paper"):
        sitl.fly("hover", law=Hover, design="paper")
