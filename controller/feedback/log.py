"""The estimate's log: Parquet files with the estimate at each tick and its covariance at every tenth.

Time is that of the plant's state log: 0 at the first armed tick.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from controller.law.state import STATE_SIZE
from sitl_bridge.rowlog import RowLog

if TYPE_CHECKING:  # the names of the files are needed before anything is launched
    from controller.estimator.filter import Estimator

ESTIMATE_NAME = "estimate.parquet"
COVARIANCE_NAME = "estimate_covariance.parquet"
COVARIANCE_EVERY = 10
"""Ticks."""
CHUNK_ROWS = 4000

STATE_COLUMNS = (
    *(f"vehicle_{axis}_m" for axis in "xyz"),
    *(f"load_{axis}_m" for axis in "xyz"),
    *(f"vehicle_v{axis}_m_s" for axis in "xyz"),
    *(f"load_v{axis}_m_s" for axis in "xyz"),
    *(f"body_rate_{axis}_rad_s" for axis in "pqr"),
    *(f"{angle}_rad" for angle in ("roll", "pitch", "yaw")),
)
"""Column of each element of the estimate, eq. 31."""
COLUMNS = ("time_s", *STATE_COLUMNS, "innovations_seen", "innovations_in_bounds")
"""Innovations are counted since the alignment: axes, and those within their 95 % bounds."""
UPPER = np.triu_indices(STATE_SIZE)
COVARIANCE_COLUMNS = ("time_s", *(f"covariance_{row}_{column}" for row, column in zip(*UPPER, strict=True)))
"""The covariance's upper triangle, rows and columns counted from 0 in the order of STATE_COLUMNS."""


class EstimateLog:
    """Collects rows of both files."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._estimates = RowLog(folder / ESTIMATE_NAME, COLUMNS)
        self._covariances = RowLog(folder / COVARIANCE_NAME, COVARIANCE_COLUMNS)
        self._rows = np.zeros((CHUNK_ROWS, len(COLUMNS)))
        self._covariance_rows = np.zeros((CHUNK_ROWS // COVARIANCE_EVERY, len(COVARIANCE_COLUMNS)))
        self._count = self._covariance_count = 0

    def record(self, time_s: float, estimator: Estimator) -> None:
        """Keep the estimate of one tick."""
        row = self._rows[self._count]
        row[0] = time_s
        row[1:-2] = estimator.state()
        row[-2] = estimator.memory["seen"].sum()
        row[-1] = estimator.memory["within"].sum()
        if self._count % COVARIANCE_EVERY == 0:
            covariance = self._covariance_rows[self._covariance_count]
            covariance[0] = time_s
            covariance[1:] = estimator.covariance()[UPPER]
            self._covariance_count += 1
        self._count += 1
        if self._count == CHUNK_ROWS:
            self._flush()

    def close(self) -> None:
        """Write out everything; raises what went wrong while writing."""
        self._flush()
        self._estimates.close()
        self._covariances.close()

    def _flush(self) -> None:
        self._estimates.write(self._rows[: self._count].copy())
        self._covariances.write(self._covariance_rows[: self._covariance_count].copy())
        self._count = self._covariance_count = 0
