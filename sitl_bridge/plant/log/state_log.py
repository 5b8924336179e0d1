"""The state log: a Parquet file with a row for each tick of the scenario."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from sitl_bridge.plant.log.rows import CHUNK_ROWS, WIDTH, columns, fill_row, kept_columns
from sitl_bridge.rowlog import RowLog

if TYPE_CHECKING:  # the name of the file is needed before anything is launched
    from sitl_bridge.plant.physics.world import World

FILE_NAME = "state.parquet"


class StateLog:
    """Collects rows; the same run gives the same bytes."""

    def __init__(self, path: Path, world: World) -> None:
        self.path = path
        self.table = np.zeros((CHUNK_ROWS, WIDTH))
        """Rows that are not written out yet; a compiled tick fills the next one itself, see `took_row`."""
        self.count = 0
        """How many there are; always fewer than fit."""
        self._log = RowLog(path, columns(len(world.vehicle.rotors), world.vehicle.node_count))
        self._keep = kept_columns(len(world.vehicle.rotors), world.vehicle.node_count)
        self._fill = fill_row.bind(*world.log_sources(), self.table)

    def record(self, time_s: float, world: World) -> None:
        """Keep one row."""
        self._fill(self.count, time_s)
        self.took_row()

    def took_row(self) -> None:
        """Row `count` of `table` is filled."""
        self.count += 1
        if self.count == CHUNK_ROWS:
            self._flush()

    def close(self) -> None:
        """Write out everything; raises what went wrong while writing."""
        if self.count:
            self._flush()
        self._log.close()

    def _flush(self) -> None:
        self._log.write(self.table[: self.count, self._keep])
        self.count = 0
