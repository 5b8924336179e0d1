"""A row of the state log, as compiled code fills it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from sitl_bridge.compiled import Buffer, entry_point
from sitl_bridge.plant.physics.cables.cable import span, tension_of
from sitl_bridge.plant.physics.cables.chain import NODE_STATES
from sitl_bridge.plant.physics.cables.flexible_cable import CHAIN
from sitl_bridge.plant.physics.parameters import PARAMETERS
from sitl_bridge.plant.physics.state import (
    CABLE_STATE,
    COLUMNS,
    INNER_SIZE,
    MOST_ROTORS,
    STATE_SIZE,
    Array,
)
from sitl_bridge.vehicle.chain import MOST_SEGMENTS

CHUNK_ROWS = 4096
"""Rows that are kept before they are written out."""

MOST_NODES = MOST_SEGMENTS - 1
_TIME, _STATE, _LENGTH, _TENSION = 0, 1, 1 + STATE_SIZE, 2 + STATE_SIZE
_ROTORS = _TENSION + 1
_FORCE = _ROTORS + MOST_ROTORS
_NODES = _FORCE + 6
WIDTH = _NODES + 3 * MOST_NODES


def columns(rotor_count: int, node_count: int = 0) -> list[str]:
    """Names of the log's columns, with their units. node_count: of a chain, from the top."""
    forces = [f"force_{body}_{axis}_N" for body in ("vehicle", "load") for axis in "xyz"]
    rotors = [f"rotor_{i + 1}_rad_s" for i in range(rotor_count)]
    nodes = [f"node_{i + 1}_{axis}_m" for i in range(node_count) for axis in "xyz"]
    return ["time_s", *COLUMNS, "cable_length_m", "cable_tension_N", *rotors, *forces, *nodes]


@entry_point(
    Buffer(PARAMETERS, (1,)),
    Buffer(np.float64, (STATE_SIZE,)),
    Buffer(np.float64, (INNER_SIZE,)),
    Buffer(np.float64, (MOST_ROTORS,)),
    Buffer(np.float64, (6,)),
    Buffer(np.float64, (CHUNK_ROWS, WIDTH)),
    int,
    float,
)
def fill_row(
    record: Any,
    x: Array,
    inner: Array,
    command: Array,
    force: Array,
    rows: Array,
    index: int,
    time_s: float,
) -> int:
    """Write one row of the log. Rotors without lag have the speed that is commanded now."""
    p, row = record[0], rows[index]
    row[_TIME] = time_s
    for i in range(STATE_SIZE):
        row[_STATE + i] = x[i]
    _, _, _, row[_LENGTH] = span(x)
    row[_TENSION] = tension_of(p, x, inner)
    for i in range(MOST_ROTORS):
        row[_ROTORS + i] = inner[i] if p.time_constant[i] > 0.0 else command[i]
    for i in range(6):
        row[_FORCE + i] = force[i]
    if p.cable_kind == CHAIN:
        for node in range(p.segments - 1):
            for i in range(3):
                row[_NODES + 3 * node + i] = inner[CABLE_STATE + NODE_STATES * node + i]
    return index + 1


def kept_columns(rotor_count: int, node_count: int = 0) -> NDArray[np.int64]:
    """Which elements of a row belong to `columns`: without those of rotors and nodes that do not exist."""
    return np.array([*range(_ROTORS + rotor_count), *range(_FORCE, _NODES + 3 * node_count)])
