"""The files that FTP serves: a table of paths. What is not in it does not exist."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

from controller.ground.files import metadata
from controller.ground.files.logs import LogProtocol
from controller.ground.files.param_pck import pack
from controller.ground.parameters.protocol import Parameters

PARAMETERS = "/@PARAM/param.pck"
LOG_FOLDER = "/log"


class Content(NamedTuple):
    """A file that is open: its size does not change."""

    size: int
    """Bytes"""
    read: Callable[[int, int], bytes]
    """(offset, size) to bytes, less at the end"""


class Entry(NamedTuple):
    """A line of a folder."""

    name: str
    size: int | None
    """None: a folder"""


class VirtualFiles:
    """Parameters, metadata, logs."""

    def __init__(self, parameters: Parameters, logs: LogProtocol) -> None:
        self._parameters = parameters
        self._logs = logs

    def open(self, path: str) -> Content | None:
        """A file's content as it is now; None if there is no such file."""
        name, _, query = path.partition("?")
        plain = _normal(name)
        if plain == PARAMETERS:
            defaults = self._parameters.defaults() if "withdefaults=1" in query.split("&") else None
            return _of_bytes(pack(self._parameters.values(), defaults))
        found = metadata.files().get(plain or "")
        if found is not None:
            return _of_bytes(found)
        for log in self._logs.logs():
            if plain == f"{LOG_FOLDER}/{log.name}":
                return Content(log.size, partial(self._logs.read, log.name))
        return None

    def entries(self, path: str) -> list[Entry] | None:
        """What is in a folder; None if there is no such folder."""
        plain = _normal(path)
        if plain is None:
            return None
        folder = plain.rstrip("/") + "/"
        found: dict[str, Entry] = {}
        for name, size in self._sizes().items():
            if name.startswith(folder):
                first, _, more = name[len(folder) :].partition("/")
                found[first] = Entry(first, None if more else size)
        return sorted(found.values()) if found or folder in ("/", LOG_FOLDER + "/") else None

    def _sizes(self) -> dict[str, int]:
        sizes = {path: len(content) for path, content in metadata.files().items()}
        sizes[PARAMETERS] = len(pack(self._parameters.values()))
        return sizes | {f"{LOG_FOLDER}/{log.name}": log.size for log in self._logs.logs()}


def is_packed_parameters(path: str) -> bool:
    """Whether a path is that of the packed parameters."""
    return _normal(path.partition("?")[0]) == PARAMETERS


def _of_bytes(content: bytes) -> Content:
    return Content(len(content), lambda offset, size: content[offset : offset + size])


def _normal(path: str) -> str | None:
    """With one leading slash and no empty or `.` parts; None for one that goes up."""
    parts = [part for part in path.split("/") if part not in ("", ".")]
    return None if ".." in parts else "/" + "/".join(parts)
