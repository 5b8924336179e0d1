"""Flights of the command `sitl fly --in-process`, in the tests' own process."""

from __future__ import annotations

import contextlib
import io
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from sitl.command_line.commands import main
from sitl_bridge.process import StopRequest


@pytest.fixture
def fly(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., dict[str, Any]]:
    """Fly a scenario to its end; its summary. `expect`: the exit code, None: as the summary has `settled`."""
    monkeypatch.setattr(StopRequest, "install", lambda *_, **__: None)  # Ctrl-C is pytest's
    flights = iter(range(1000))

    def run(scenario: str, *arguments: str, expect: int | None = 0) -> dict[str, Any]:
        out = tmp_path / f"flight{next(flights)}"
        said = io.StringIO()
        with contextlib.redirect_stdout(said):
            code = main(["fly", scenario, "--in-process", "--json", "--out", str(out), *arguments])
        summary: dict[str, Any] = json.loads(said.getvalue())  # nothing else on standard output
        assert code == (expect if expect is not None else 0 if summary["settled"] else 1)
        assert summary == json.loads((out / "summary.json").read_text())
        return summary

    return run
