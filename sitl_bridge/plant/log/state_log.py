"""The state log: a Parquet file with a row for each tick of the scenario."""

from __future__ import annotations

from abc import ABC, abstractmethod
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from sitl_bridge.plant.log.rows import CHUNK_ROWS, WIDTH, columns, fill_row, kept_columns
from sitl_bridge.plant.physics.state import Array
from sitl_bridge.rowlog import RowLog

if TYPE_CHECKING:  # the name of the file is needed before anything is launched
    from sitl_bridge.plant.physics.world import World

FILE_NAME = "state.parquet"


class RowTable(ABC):
    """Collects rows, and hands them over in chunks; see `plant.simulation.Recorder`."""

    def __init__(self, world: World) -> None:
        rotors, nodes = len(world.vehicle.rotors), world.vehicle.node_count
        self.names = columns(rotors, nodes)
        self.table = np.zeros((CHUNK_ROWS, WIDTH))
        """Rows that are not handed over yet; a compiled tick fills the next one itself, see `took_row`."""
        self.count = 0
        """How many there are; always fewer than fit."""
        self._keep = kept_columns(rotors, nodes)
        self._fill = fill_row.bind(*world.log_sources(), self.table)

    def record(self, time_s: float, world: World) -> None:
        """Keep one row."""
        self._fill(self.count, time_s)
        self.took_row()

    def took_row(self) -> None:
        """Row `count` of `table` is filled."""
        self.count += 1
        if self.count == CHUNK_ROWS:
            self.flush()

    def flush(self) -> None:
        """Hand over what there is."""
        if self.count:
            self.keep(self.table[: self.count, self._keep])
            self.count = 0

    @abstractmethod
    def keep(self, rows: Array) -> None:
        """Keep a chunk of rows (n, columns); nobody else has it."""


class StateLog(RowTable):
    """Rows in a file; the same run gives the same bytes."""

    def __init__(self, path: Path, world: World) -> None:
        super().__init__(world)
        self.path = path
        self._log = RowLog(path, self.names)

    def keep(self, rows: Array) -> None:
        """Write a chunk in the background."""
        self._log.write(rows)

    def close(self) -> None:
        """Write out everything; raises what went wrong while writing."""
        self.flush()
        self._log.close()
