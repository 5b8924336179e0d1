"""Completion scripts: bash's is run in a bash, the others are looked through."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from sitl.command_line.commands import COMMANDS, main
from sitl.command_line.completion import SHELLS
from sitl.flights.scenario import scenario_names
from sitl_bridge.vehicle.files import vehicle_names

BASH = shutil.which("bash")


def _script(shell: str, capsys: pytest.CaptureFixture[str]) -> str:
    assert main(["completion", shell]) == 0
    return capsys.readouterr().out


@pytest.mark.parametrize("shell", SHELLS)
def test_every_command_is_completed(shell: str, capsys: pytest.CaptureFixture[str]) -> None:
    script = _script(shell, capsys)
    assert [name for name in (*COMMANDS, *scenario_names()) if name not in script] == []


def test_an_unknown_shell_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["completion", "csh"])
    assert ended.value.code == 2
    assert "'bash'" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["sitl", "fl"], {"fly"}),
        (["sitl", "fly", "--clo"], {"--clock"}),
        (["sitl", "fly", "--clock", ""], {"realtime", "lockstep"}),
        (["sitl", "fly", "--vehicle", ""], set(vehicle_names())),
        (["sitl", "fly", "setp"], {"setpoint"}),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_bash_completes(
    words: list[str], expected: set[str], capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    script = tmp_path / "completion.bash"
    script.write_text(_script("bash", capsys), encoding="utf-8")
    quoted = " ".join(f"'{word}'" for word in words)
    commands = (
        f"source {script}; COMP_WORDS=({quoted}); COMP_CWORD={len(words) - 1}; "
        "$(complete -p sitl | sed 's/.*-F \\([^ ]*\\).*/\\1/'); printf '%s\\n' \"${COMPREPLY[@]}\""
    )
    assert BASH is not None
    done = subprocess.run([BASH, "-c", commands], capture_output=True, text=True, cwd=tmp_path, check=True)
    assert expected <= set(done.stdout.split()), done.stdout + done.stderr
