"""Files of machine code, in a directory of the user's that all checkouts and environments share.

The name of a file has the key of what it was compiled from. A file appears whole or not at all, and ends with
a digest of key and contents. Code is loaded only from directories that belong to the user and that nobody
else can write.
"""

from __future__ import annotations

import fcntl
import hashlib
import os
import stat
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from pathlib import Path
from typing import TextIO

SHARED_LIBRARY, OBJECT, TRANSLATION = ".so", ".o", ".bc"
RESULT = ".npy"
"""An array that was computed from a description: not code, but kept in the same way."""
_DIGEST_SIZE = hashlib.sha256().digest_size
_DAY = 86_400.0
_KEPT = 30 * _DAY
"""s; what was not loaded for longer is deleted when something is compiled."""


def directories() -> list[Path]:
    """Where machine code may be, the preferred place first."""
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    temporary = Path(tempfile.gettempdir()) / f"sitl-bridge-{os.getuid()}"
    return [directory for directory in (Path(home) / "sitl-bridge", temporary) if directory.is_absolute()]


def find(
    module: str, key: str, places: Sequence[Path], kinds: Sequence[str] = (SHARED_LIBRARY, OBJECT)
) -> Path | None:
    """A sound file of this module and key, or None."""
    for directory in places:
        for kind in kinds:
            file = directory / _file_name(module, key, kind)
            try:
                if not _trusted(directory) or not _sound(file.read_bytes(), key):
                    continue
                _mark_used(file)
            except OSError:
                continue
            return file
    return None


def takes_files(directory: Path) -> bool:
    """Whether machine code can be kept there; creates the directory."""
    try:
        directory.mkdir(mode=0o755, parents=True, exist_ok=True)
        return _trusted(directory) and os.access(directory, os.W_OK)
    except OSError:
        return False


def store(module: str, key: str, kind: str, code: bytes, places: Sequence[Path]) -> Path:
    """Put a file in the first place that takes it; several processes may do so at once.

    Raises OSError where no place does.
    """
    refusal = OSError(f"no directory to keep the machine code of {module}")
    for directory in places:
        file = directory / _file_name(module, key, kind)
        temporary = directory / f".{file.name}.{os.getpid()}"
        try:
            temporary.write_bytes(code + _digest(code, key))
            temporary.chmod(0o644)
            temporary.replace(file)
        except OSError as error:
            refusal = error
            with suppress(OSError):
                temporary.unlink()
            continue
        return file
    raise refusal


def forget_unused(places: Sequence[Path]) -> None:
    """Delete what was not loaded for long, of all modules."""
    oldest = time.time() - _KEPT
    for directory in places:
        with suppress(OSError):
            for entry in os.scandir(directory):
                is_code = Path(entry.name).suffix in (SHARED_LIBRARY, OBJECT, TRANSLATION)
                if is_code and entry.stat().st_mtime < oldest:
                    os.unlink(entry)


def keep_newest(kind: str, most: int, places: Sequence[Path]) -> None:
    """Delete files of this kind but for so many in each place, those that were used longest ago."""
    for directory in places:
        with suppress(OSError):
            files = [entry for entry in os.scandir(directory) if Path(entry.name).suffix == kind]
            for entry in sorted(files, key=lambda entry: entry.stat().st_mtime)[:-most]:
                os.unlink(entry)


def code_of(file: Path) -> bytes:
    """What was stored in a file, without the digest at its end."""
    return file.read_bytes()[:-_DIGEST_SIZE]


@contextmanager
def locked(module: str, places: Sequence[Path]) -> Iterator[None]:
    """While this is held no other process compiles the module; where no place takes a lock there is none."""
    with _lock_file(module, places) as lock:
        if lock is not None:
            with suppress(OSError):  # a file system without locks
                fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def _lock_file(module: str, places: Sequence[Path]) -> AbstractContextManager[TextIO | None]:
    for directory in places:
        with suppress(OSError):
            return (directory / f"{module}.lock").open("w")
    return nullcontext()


def _file_name(module: str, key: str, kind: str) -> str:
    return f"{module}.{key[:24]}{kind}"


def _trusted(directory: Path) -> bool:
    """Whether nobody but this user can have put code there."""
    status = directory.lstat()
    shared = status.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
    return stat.S_ISDIR(status.st_mode) and status.st_uid == os.getuid() and not shared


def _digest(code: bytes, key: str) -> bytes:
    return hashlib.sha256(key.encode() + code).digest()


def _sound(content: bytes, key: str) -> bool:
    return content[-_DIGEST_SIZE:] == _digest(content[:-_DIGEST_SIZE], key)


def _mark_used(file: Path) -> None:
    now = time.time()
    if now - file.stat().st_mtime > _DAY:
        os.utime(file)
