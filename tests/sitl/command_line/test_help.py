"""Help is shown by every spelling that people try."""

from __future__ import annotations

import pytest

from sitl.command_line.commands import COMMANDS, main


def _shown(argv: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    with pytest.raises(SystemExit) as ended:
        main(argv)
    assert ended.value.code == 0
    return capsys.readouterr().out


def test_no_arguments_and_help_list_every_command(capsys: pytest.CaptureFixture[str]) -> None:
    shown = _shown([], capsys)
    first_words = {line.split()[0] for line in shown.splitlines() if line.strip()}
    assert first_words >= COMMANDS.keys()
    assert shown == _shown(["help"], capsys) == _shown(["--help"], capsys)


@pytest.mark.parametrize("command", COMMANDS)
def test_help_of_a_command_is_its_flag(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert _shown(["help", command], capsys) == _shown([command, "--help"], capsys)


def test_help_of_an_unknown_command_names_the_known_ones(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["help", "fyl"])
    assert ended.value.code == 2
    assert "'fly'" in capsys.readouterr().err
