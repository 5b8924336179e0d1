"""Gains and motions on disk, beside machine code: a second flight of a vehicle neither plans nor takes scipy.

The key is of the inputs, to the last bit, of the sources that make the result, of versions and CPU: what is
kept is what would be computed now.
"""

from __future__ import annotations

import hashlib
import io
from contextlib import suppress
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from sitl_bridge.compiled import cache as files
from sitl_bridge.compiled.key import machine

MOST = 500
"""Results that are kept, those used last; some 10 kB each."""
_DECIDING = ("controller/design", "controller/law", "sitl_bridge/vehicle")

_on_disk = False


def keep_on_disk() -> None:
    """From now on results of this process are kept on disk, and looked for there.

    For the commands that fly. A study remembers within its workers: its thousand vehicles are flown once.
    """
    global _on_disk
    _on_disk = True


def find(function: str, inputs: object) -> Any:
    """The array that was kept for these inputs, whose `repr` has every bit of them; or None."""
    if not _on_disk or not sources():
        return None
    file = files.find(function, _key(inputs), files.directories(), [files.RESULT])
    if file is None:
        return None
    with suppress(OSError, ValueError):
        return np.load(io.BytesIO(files.code_of(file)), allow_pickle=False)
    return None


def keep(function: str, inputs: object, found: Any) -> None:
    """Keep an array, if it can be."""
    if not _on_disk or not sources():
        return
    content = io.BytesIO()
    np.save(content, found, allow_pickle=False)
    places = [place for place in files.directories() if files.takes_files(place)]
    with suppress(OSError):
        files.store(function, _key(inputs), files.RESULT, content.getvalue(), places)
        files.keep_newest(files.RESULT, MOST, places)


def _key(inputs: object) -> str:
    return hashlib.sha256(f"{sources()} {machine()} {inputs!r}".encode()).hexdigest()


@cache
def sources() -> str:
    """Digest of all that decides a result beside its inputs; empty where sources are not installed."""
    digest = hashlib.sha256(f"scipy {metadata.version('scipy')}".encode())
    root = Path(__file__).parents[2]
    found = [file for name in _DECIDING for file in sorted((root / name).rglob("*.py"))]
    for file in found:
        digest.update(file.read_bytes())
    return digest.hexdigest() if found else ""
