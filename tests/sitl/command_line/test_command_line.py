"""What `sitl` says before anything flies: one line for each fault, and exit code 2."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from controller.ground.parameters.file import ParameterFile
from sitl.benchmark import bench
from sitl.command_line import commands as cli
from sitl.command_line.arguments import build_parser
from sitl.flights.flight import new_folder
from sitl.flights.launch import FlightError
from sitl.flights.refusals import check_feasible
from sitl.flights.scenario import load_scenario
from sitl.report.summary import PROMISED, write_report
from sitl.terminal.summary import table
from sitl_bridge.vehicle.files import load_vehicle
from tests.patience import PATIENCE


def test_flying_alone_is_the_papers_experiment_whatever_options_stand_before() -> None:
    parser = build_parser()
    assert parser.parse_args(["fly"]).scenario == "setpoint"
    assert parser.parse_args(["fly", "--json"]).scenario == "setpoint"
    assert parser.parse_args(["fly", "--json", "hover"]).scenario == "hover"


SCENARIO = """
vehicle = "iris"
set = ["cable.rest_length=1.2"]
[reference]
kind = "{kind}"
"""


def refused(*arguments: str, cwd: Path | None = None) -> list[str]:
    """Lines on standard error of a command that has to be refused."""
    done = subprocess.run(
        [sys.executable, "-m", "sitl", *arguments],
        capture_output=True,
        text=True,
        cwd=cwd,
        timeout=PATIENCE,
        check=False,
    )
    assert done.returncode == 2, done.stderr
    assert not done.stdout
    return done.stderr.splitlines()


@pytest.mark.parametrize("command", ["fly", "controller"])
def test_what_cannot_be_flown_is_refused_in_a_line(command: str, tmp_path: Path) -> None:
    file = tmp_path / "fast.toml"
    file.write_text(
        'vehicle = "iris"\n[reference]\nkind = "circle"\ncentre = [0, 0, 9]\nradius = 5\nangular_rate = 2\n'
    )
    scenario = ["fly", str(file)] if command == "fly" else ["controller", "--scenario", str(file)]
    (line,) = refused(*scenario)
    assert line.startswith("iris cannot fly this: reference.angular_rate = 2 rad/s on a radius of 5 m: ")
    slower = re.search(r"expected angular_rate up to ([0-9.]+) rad/s", line)
    assert slower is not None
    file.write_text(file.read_text().replace("angular_rate = 2\n", f"angular_rate = {slower[1]}\n"))
    check_feasible(load_scenario(str(file)), load_vehicle("iris"), "default")


def test_a_setpoint_in_the_ground_and_rotors_too_slow_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "low.toml"
    file.write_text('vehicle = "iris"\n[reference]\nkind = "setpoint"\nposition = [0, 0, -1]\n')
    (low,) = refused("fly", str(file))
    assert "reference.position.2 = -1 m" in low
    (slow,) = refused("fly", "hold", "--vehicle", "iris", "--set", "rotors.0.time_constant=9")
    assert "time_constant = 9 s" in slow


@pytest.mark.parametrize("flag", ["--set", "--plant-set"])
def test_a_faulty_override_is_reported_under_its_flag(flag: str) -> None:
    [line] = refused("fly", "setpoint", flag, "cable")
    assert line.startswith(f"{flag}: 'cable': expected KEY=VALUE")


@pytest.mark.parametrize("key", ["set", "plant_set"])
def test_a_faulty_override_is_reported_under_the_scenarios_key(key: str, tmp_path: Path) -> None:
    text = SCENARIO.format(kind="hover").replace("\n[", f'\n{key} = ["load.mass=0.4", "cable"]\n[')
    file = tmp_path / "mine.toml"
    file.write_text(text if key != "set" else text.replace('set = ["cable.rest_length=1.2"]\n', "", 1))
    [line] = refused("fly", str(file))
    assert line.startswith(f"scenario: {key}.1: 'cable': expected KEY=VALUE")


@pytest.mark.parametrize("command", [("fly", "hover"), ("controller",), ("plant",)])
def test_rotors_that_give_no_yaw_are_refused_before_launch(command: tuple[str, ...]) -> None:
    changes = [f"rotors.{i}.{change}" for i in range(4) for change in ("torque_coefficient=0",)]
    [line] = refused(*command, "--vehicle", "iris", *(word for text in changes for word in ("--set", text)))
    assert line.startswith("iris: rotors: they cannot give thrust and all three moments")


@pytest.mark.parametrize("kind", ["hover", "ground-control"])
def test_a_fault_that_the_vehicle_cannot_have_is_refused_before_launch(kind: str, tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(SCENARIO.format(kind=kind) + "[[faults.rotor]]\nrotor = 5\nat = 1.0\n")
    [line] = refused("fly", str(file), cwd=tmp_path)
    assert line == "faults: faults.rotor.0.rotor = 5: iris has rotors 1 to 4"
    assert not (tmp_path / "runs").exists()


def test_a_folder_for_parameters_is_refused_and_stays(tmp_path: Path) -> None:
    folder = tmp_path / "mine"
    folder.mkdir()
    [line] = refused("fly", "hold", "--parameters", str(folder))
    assert line.startswith(f"--parameters: {folder}: no file")
    values, fault = ParameterFile(folder).load()
    assert (values, "no file" in fault) == ({}, True)
    assert [path.name for path in tmp_path.iterdir()] == ["mine"]


def test_another_instance_is_no_help_where_an_address_is_not_this_machines() -> None:
    [line] = refused("fly", "--hil", "udpin:192.0.2.1:5")
    assert "cannot be opened" in line
    assert "--instance" not in line


def test_no_summary_of_a_flight_that_is_left_to_ground_control() -> None:
    [line] = refused("fly", "hold", "--json")
    assert line.startswith("--json: under ground control")


def test_a_controller_has_no_duration_of_its_scenario(capsys: pytest.CaptureFixture[str]) -> None:
    for command, says in (("controller", "(default: until stopped)"), ("plant", "the scenario's, or until")):
        with pytest.raises(SystemExit):
            cli.main([command, "--help"])
        assert says in " ".join(capsys.readouterr().out.split())


def test_a_failed_flight_of_the_bench_is_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fails(repeats: int) -> None:
        raise FlightError("the plant ended with exit code 2; the controller was stopped")

    monkeypatch.setattr(bench, "bench", fails)
    assert cli.main(["bench", "--repeats", "1"]) == 1
    assert capsys.readouterr().err == "bench: the plant ended with exit code 2; the controller was stopped\n"


def test_two_flights_in_one_second_get_a_folder_each(tmp_path: Path) -> None:
    wanted = tmp_path / "runs" / "hover-20260101-120000"
    made = [new_folder(wanted) for _ in range(3)]
    assert [folder.name for folder in made] == [wanted.name, f"{wanted.name}-2", f"{wanted.name}-3"]
    assert all(folder.is_dir() for folder in made)


def test_the_table_leaves_out_what_a_failed_flight_does_not_tell() -> None:
    said = table({"settled": False, "failure": "the plant was killed by SIGKILL"})
    assert "None" not in said
    assert "late" not in said
    assert "late ticks                0" in table({"settled": True, "late_ticks": 0})


def test_a_summary_is_json_whatever_happened(tmp_path: Path) -> None:
    def no_constant(name: str) -> None:
        raise AssertionError(name)

    facts = {"completed": False, "real_time_factor": float("nan"), "bound": np.array([1.0, np.inf])}
    write_report(tmp_path, facts, None)
    summary = json.loads((tmp_path / "summary.json").read_text(), parse_constant=no_constant)
    assert summary == dict.fromkeys(PROMISED) | {"completed": False, "bound": [1.0, None], "settled": False}


@pytest.mark.parametrize("flag", [("--speed", "2"), ("--on-silence", "continue")])
@pytest.mark.parametrize("command", ["fly", "plant"])
def test_what_only_lockstep_has_is_refused_in_real_time(
    command: str, flag: tuple[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main([command, *flag]) == 2
    complaint = capsys.readouterr().err
    assert complaint.splitlines()[0].startswith(flag[0])
    assert "--clock lockstep" in complaint


@pytest.mark.parametrize("command", ["bench", "paper --out unused", "plant", "controller", "fly hover"])
def test_an_interrupt_while_it_starts_is_one_line(command: str) -> None:
    """Wherever it strikes, also where SIGINT was inherited as ignored: exit code 130 and no traceback."""
    script = (
        "import os, signal, sys\n"
        "signal.signal(signal.SIGINT, signal.SIG_IGN)\n"
        "from sitl import entry\n"
        "class Strikes:\n"
        "    def find_spec(self, name, *rest):\n"
        "        if name == 'sitl.command_line.commands':\n"
        "            os.kill(os.getpid(), signal.SIGINT)\n"
        "sys.meta_path.insert(0, Strikes())\n"
        f"sys.argv[1:] = {command.split()!r}\n"
        "sys.exit(entry.main())\n"
    )
    ended = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stderr) == (130, "sitl: interrupted\n")
