"""The estimate's log: Parquet files with the estimate and its covariance at one tick in so many.

Values are in single precision, but for time and counts. Time is that of the plant's state log: 0 at the first
armed tick.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from controller.law.state import STATE_SIZE
from sitl_bridge.log_amount import Logs
from sitl_bridge.rowlog import RowLog

if TYPE_CHECKING:  # the names of the files are needed before anything is launched
    from controller.estimator.filter import Estimator

ESTIMATE_NAME = "estimate.parquet"
COVARIANCE_NAME = "estimate_covariance.parquet"
EVERY: dict[Logs, tuple[int, int]] = {"usual": (5, 50), "all": (1, 10)}
"""Ticks between two rows of the estimate, and of its covariance."""
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
_COUNTS = ("time_s", "innovations_seen", "innovations_in_bounds")
UPPER = np.triu_indices(STATE_SIZE)
COVARIANCE_COLUMNS = ("time_s", *(f"covariance_{row}_{column}" for row, column in zip(*UPPER, strict=True)))
"""The covariance's upper triangle, rows and columns counted from 0 in the order of STATE_COLUMNS."""


class EstimateLog:
    """Collects rows of both files."""

    def __init__(self, folder: Path, logs: Logs = "all") -> None:
        """logs: how much is kept of it, see `EVERY`."""
        folder.mkdir(parents=True, exist_ok=True)
        self._every, covariance_every = EVERY[logs]
        self._covariance_every = covariance_every // self._every
        """Rows of the estimate"""
        self._estimates = RowLog(folder / ESTIMATE_NAME, COLUMNS, set(COLUMNS) - set(_COUNTS))
        self._covariances = RowLog(folder / COVARIANCE_NAME, COVARIANCE_COLUMNS, COVARIANCE_COLUMNS[1:])
        self._rows = np.zeros((CHUNK_ROWS, len(COLUMNS)))
        self._covariance_rows = np.zeros((CHUNK_ROWS // self._covariance_every, len(COVARIANCE_COLUMNS)))
        self._count = self._covariance_count = 0
        self._ticks = -1

    def record(self, time_s: float, estimator: Estimator) -> None:
        """Keep the estimate of one tick, if it is one that is kept."""
        self._ticks += 1
        if self._ticks % self._every:
            return
        row = self._rows[self._count]
        row[0] = time_s
        row[1:-2] = estimator.state()
        row[-2] = estimator.memory["seen"].sum()
        row[-1] = estimator.memory["within"].sum()
        if self._count % self._covariance_every == 0:
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
