"""Component metadata, which QGroundControl reads: what there is, the parameters' meanings, the events."""

from __future__ import annotations

import json
import zlib
from functools import cache
from typing import Any

from controller.ground.parameters.parameter import Parameter
from controller.ground.parameters.table import TABLE

GENERAL = "/etc/extras/component_general.json"
PARAMETERS = "/etc/extras/parameters.json"
EVENTS = "/etc/extras/all_events.json"
_PARAMETER_TYPE, _EVENTS_TYPE = 1, 4
"""COMP_METADATA_TYPE"""


@cache
def files() -> dict[str, bytes]:
    """Contents by path."""
    parts = {PARAMETERS: _json(_parameters()), EVENTS: _json(_events())}
    kinds = ((_PARAMETER_TYPE, PARAMETERS), (_EVENTS_TYPE, EVENTS))
    general = {
        "version": 1,
        "metadataTypes": [
            {"type": kind, "uri": uri(path), "fileCrc": zlib.crc32(parts[path])} for kind, path in kinds
        ],
    }
    return {GENERAL: _json(general), **parts}


def uri(path: str) -> str:
    """Of a file that is read by MAVLink FTP."""
    return f"mftp:{path}"


def general_crc() -> int:
    """CRC-32 of the general file: a client that has it needs not read it again."""
    return zlib.crc32(files()[GENERAL])


def _json(content: Any) -> bytes:
    return json.dumps(content, separators=(",", ":")).encode()


def _parameters() -> dict[str, Any]:
    return {"version": 1, "parameters": [_parameter(p) for p in TABLE]}


def _parameter(p: Parameter) -> dict[str, Any]:
    entry: dict[str, Any] = {
        "name": p.name,
        "type": "Int32" if p.is_integer else "Float",
        "group": p.name.split("_")[0],
        "category": "Standard" if p.used else "Developer",
        "shortDesc": p.description,
        "default": p.default,
        "min": p.minimum,
        "max": p.maximum,
        "units": p.unit,
    }
    if p.choices:
        entry["values"] = [{"value": value, "description": text} for value, text in p.choices]
    return entry


def _events() -> dict[str, Any]:
    """There are none: what happens is said by STATUSTEXT."""
    return {"version": 1, "components": {"1": {"namespace": "sitl", "enums": {}, "event_groups": {}}}}
