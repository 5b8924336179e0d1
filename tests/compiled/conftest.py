"""Fixtures of the compiled sample."""

import sys
from collections.abc import Iterator, Mapping
from pathlib import Path

import pytest

from sitl_bridge.compiled import cache as caching
from sitl_bridge.compiled import machine_code, request
from tests.compiled.sample import NAME, Sample


@pytest.fixture(scope="session")
def sample(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Sample]:
    """Compiled once, by two processes at the same time."""
    folder = tmp_path_factory.mktemp("sample")
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(folder)
        patch.setattr(sys, "dont_write_bytecode", True)
        yield Sample(folder)


@pytest.fixture
def cache(monkeypatch: pytest.MonkeyPatch, sample: Sample, tmp_path: Path) -> Iterator[Path]:
    """A private copy of the sample's cache, the only one that is looked at."""
    directory = tmp_path / "sitl-bridge"
    directory.mkdir(mode=0o755)
    (directory / sample.file().name).write_bytes(sample.file().read_bytes())
    monkeypatch.setattr(caching, "directories", lambda: [directory])
    monkeypatch.setattr(
        machine_code, "declaring_modules", lambda: [NAME]
    )  # what pytest imported is no matter
    yield directory
    for name in [name for name in sys.modules if name.startswith("native_")]:
        del sys.modules[name]


@pytest.fixture
def compilations(monkeypatch: pytest.MonkeyPatch, sample: Sample) -> list[str]:
    """The modules compiled so far; compiling gives what compiling the sample gave, for today's source."""
    done: list[str] = []
    code = caching.code_of(sample.file())

    def compile_again(keys: Mapping[str, str], say: request.Say) -> dict[str, request.Outcome]:
        done.extend(keys)
        places = [place for place in caching.directories() if caching.takes_files(place)]
        kind = sample.file().suffix
        return {
            module: request.Outcome(caching.store(module, key, kind, code, places))
            for module, key in keys.items()
        }

    monkeypatch.setattr(request, "compile_modules", compile_again)
    return done
