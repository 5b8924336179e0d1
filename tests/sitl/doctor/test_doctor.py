"""`sitl doctor` names what prevents a flight, and what to do."""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from sitl.command_line.commands import main
from sitl.doctor import installation, machine, run
from sitl.doctor.finding import Finding
from sitl_bridge.ids import HIL_UDP_PORT, MOST_INSTANCES


def test_one_line_for_each_check(capsys: pytest.CaptureFixture[str]) -> None:
    code = main(["doctor"])
    lines = capsys.readouterr().out.splitlines()
    checks = {"python", "packages", "cache", "cores", "clock", "display"}
    assert len(lines) == len(run.CHECKS)
    assert checks <= {line[5:].split()[0] for line in lines}
    assert code == int(any(line.startswith("fail") for line in lines))


def test_json_has_the_same_findings(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    bad = Finding("fail", "python", "2.7", "install a newer one")
    monkeypatch.setattr(run, "CHECKS", (lambda: bad, lambda: Finding("ok", "cores", "8")))
    assert main(["doctor", "--json"]) == 1
    assert json.loads(capsys.readouterr().out)[0] == bad._asdict()
    assert main(["doctor"]) == 1
    assert capsys.readouterr().out.splitlines()[0] == "fail python    2.7: install a newer one"


def test_notes_prevent_no_flight(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run, "CHECKS", (lambda: Finding("note", "cores", "1", "use lockstep"),))
    assert main(["doctor"]) == 0


def test_a_port_in_use_is_a_failure_with_an_instance_that_is_free() -> None:
    instance, taken = _take_port()
    with taken:
        found = machine.hil_port(instance)
    assert found.level == "fail"
    assert f"UDP {HIL_UDP_PORT + instance} is in use" in found.found
    assert "--instance" in found.advice
    assert machine.hil_port(instance).level == "ok"


def _take_port() -> tuple[int, socket.socket]:
    for instance in range(MOST_INSTANCES - 1, 0, -1):
        taken = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            taken.bind(("127.0.0.1", HIL_UDP_PORT + instance))
        except OSError:
            taken.close()
        else:
            return instance, taken
    raise AssertionError("no HIL port is free")


def test_a_package_that_is_missing_or_too_old_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    wanted = {"": ["numpy>=2.0", "numpy>=999", "no-such-package>=1"]}
    monkeypatch.setattr(installation, "requirements", lambda: wanted)
    found = installation.packages()
    assert found.level == "fail"
    assert "numpy>=999" in found.advice
    assert '"no-such-package>=1"' in found.advice
    assert "numpy>=2.0" not in found.advice


def test_a_cache_that_nothing_can_be_kept_in_is_a_failure(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    file = tmp_path / "file"
    file.write_text("")
    monkeypatch.setattr("sitl_bridge.compiled.cache.directories", lambda: [file / "sitl-bridge"])
    found = installation.cache()
    assert found.level == "fail"
    assert "XDG_CACHE_HOME" in found.advice


def test_an_output_folder_that_cannot_be_written_is_a_failure(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "access", lambda *arguments: False)
    found = installation.output()
    assert found.level == "fail"
    assert "--out DIR" in found.advice


@pytest.mark.parametrize(("count", "level"), [(1, "note"), (1000, "ok")])
def test_one_core_is_worth_a_note(count: int, level: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: set(range(count)), raising=False)
    assert machine.cores().level == level


def _without_pydantic(*argv: str) -> subprocess.CompletedProcess[str]:
    script = (
        "import sys\n"
        "sys.modules['pydantic'] = None\n"
        "from sitl import entry\n"
        f"sys.argv[1:] = {list(argv)!r}\n"
        "sys.exit(entry.main())\n"
    )
    return subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)


def test_a_missing_package_is_one_line_and_the_doctor_still_works() -> None:
    flown = _without_pydantic("fly")
    assert flown.returncode == 2
    [line] = flown.stderr.splitlines()
    assert "pydantic" in line
    assert "sitl doctor" in line
    examined = _without_pydantic("doctor")
    assert examined.returncode == 1
    assert len(examined.stdout.splitlines()) == len(run.CHECKS)
