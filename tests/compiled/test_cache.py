"""Which files of machine code are believed, and where they are kept."""

import ctypes
import os
import tempfile
from collections.abc import Callable
from pathlib import Path

import pytest

from sitl_bridge.compiled import cache as caching
from sitl_bridge.compiled import machine_code
from tests.compiled.sample import NAME, Sample, code_files, loaded, put


def test_a_second_load_compiles_nothing(cache: Path, compilations: list[str]) -> None:
    loaded()
    loaded()
    assert compilations == []


@pytest.mark.parametrize(
    "damage",
    [
        lambda content: b"",
        lambda content: content[:-1],
        lambda content: content + b"\n",
        lambda content: content[:1000] + bytes([content[1000] ^ 1]) + content[1001:],
        lambda content: content[:-1] + bytes([content[-1] ^ 1]),
    ],
    ids=["empty", "cut", "longer", "code", "digest"],
)
def test_a_damaged_file_is_replaced(
    cache: Path, compilations: list[str], damage: Callable[[bytes], bytes]
) -> None:
    (file,) = code_files(cache)
    put(file, damage(file.read_bytes()))
    loaded()
    loaded()
    assert compilations == [NAME]


def test_code_is_loaded_only_from_directories_that_others_cannot_write(cache: Path, sample: Sample) -> None:
    key = "0" * 64
    file = caching.store(NAME, key, ".so", b"code", [cache])
    assert caching.find(NAME, key, [cache]) == file
    assert caching.takes_files(cache)
    cache.chmod(0o777)
    assert caching.find(NAME, key, [cache]) is None
    assert not caching.takes_files(cache)


def test_a_link_or_another_users_directory_is_not_trusted(
    cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert caching.takes_files(cache)
    link = tmp_path / "link"
    link.symlink_to(cache)
    assert not caching.takes_files(link)
    monkeypatch.setattr(os, "getuid", lambda: cache.stat().st_uid + 1)
    assert not caching.takes_files(cache)


def test_the_temporary_directory_itself_is_no_cache(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", "relative")  # to be ignored, says the specification
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    assert caching.directories() == [tmp_path / f"sitl-bridge-{os.getuid()}"]


def test_the_next_directory_serves_where_the_first_cannot_be_written(
    compilations: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, cache: Path
) -> None:
    (tmp_path / "file").touch()
    second = tmp_path / "new" / "cache"
    monkeypatch.setattr(caching, "directories", lambda: [tmp_path / "file" / "cache", second])
    loaded()
    loaded()
    assert compilations == [NAME]
    assert len(code_files(second)) == 1


def test_what_was_not_used_for_long_is_deleted(cache: Path) -> None:
    used, unused = (caching.store(NAME, digit * 64, ".so", b"code", [cache]) for digit in "12")
    for file, days in ((used, 20), (unused, 40)):
        os.utime(file, (file.stat().st_atime, file.stat().st_mtime - days * 86_400))
    others = cache / "notes.txt"
    others.touch()
    os.utime(others, (0, 0))
    assert caching.find(NAME, "1" * 64, [cache]) == used
    assert used.stat().st_mtime > unused.stat().st_mtime + 30 * 86_400, "a load counts as use"
    caching.forget_unused([cache])
    assert used.exists()
    assert not unused.exists()
    assert others.exists(), "only machine code is deleted"


def test_a_shared_library_is_loaded_where_nothing_can_be_executed(
    cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (file,) = code_files(cache)
    load = ctypes.CDLL

    def refuses(name: str, *mode: int) -> ctypes.CDLL:
        if name == str(file):
            raise OSError(f"{file}: failed to map segment from shared object")
        return load(name, *mode)

    monkeypatch.setattr(machine_code.ctypes, "CDLL", refuses)
    loaded()
    loaded()
