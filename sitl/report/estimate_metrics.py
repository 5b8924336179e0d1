"""How good the estimate was: pure functions of the plant's state log and the controller's estimate log."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from controller.feedback.log import COLUMNS, STATE_COLUMNS, UPPER
from controller.law.state import (
    BODY_RATES,
    EULER_ANGLES,
    LOAD_POSITION,
    LOAD_VELOCITY,
    STATE_SIZE,
    VEHICLE_POSITION,
    VEHICLE_VELOCITY,
)
from sitl.report.metrics import steady
from sitl_bridge.frames import euler_from_quaternion

Array = NDArray[np.float64]
Log = dict[str, Array]

NEES_STATES = np.delete(np.arange(STATE_SIZE), BODY_RATES)
"""15 of the 18 states. Body rates are left out: the filter allows for unknown moments, the plant has none."""


def true_states(log: Log) -> Array:
    """The state log's rows in the order of eq. 31: (n, 18)."""

    def columns(*names: str) -> Array:
        return np.stack([log[name] for name in names], axis=1)

    out = np.zeros((len(log["time_s"]), STATE_SIZE))
    for body, position, velocity in (
        ("vehicle", VEHICLE_POSITION, VEHICLE_VELOCITY),
        ("load", LOAD_POSITION, LOAD_VELOCITY),
    ):
        out[:, position] = columns(*(f"{body}_{axis}_m" for axis in "xyz"))
        out[:, velocity] = columns(*(f"{body}_v{axis}_m_s" for axis in "xyz"))
    out[:, BODY_RATES] = columns(*(f"body_rate_{axis}_rad_s" for axis in "pqr"))
    quaternions = columns(*(f"attitude_q{part}" for part in "wxyz"))
    out[:, EULER_ANGLES] = [euler_from_quaternion((w, x, y, z)) for w, x, y, z in quaternions.tolist()]
    return out


def covariances(log: Log) -> Array:
    """The covariance log's rows as matrices (n, 18, 18)."""
    out = np.zeros((len(log["time_s"]), STATE_SIZE, STATE_SIZE))
    for row, column in zip(*UPPER, strict=True):
        out[:, row, column] = out[:, column, row] = log[f"covariance_{row}_{column}"]
    return out


def errors(truth: Array, estimate: Array) -> Array:
    """True minus estimated (n, 18), angles the short way round."""
    out = truth - estimate
    out[:, EULER_ANGLES] = np.remainder(out[:, EULER_ANGLES] + np.pi, 2.0 * np.pi) - np.pi
    return out


def rows_at(times: Array, wanted: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Indices (n,) into both of the rows whose times are the same to a microsecond."""
    _, first, second = np.intersect1d(
        np.rint(times * 1e6), np.rint(wanted * 1e6), assume_unique=True, return_indices=True
    )
    return first.astype(np.int64), second.astype(np.int64)


def rms(values: Array) -> list[float] | None:
    """Root mean square, about zero, of each column; None without rows."""
    if not len(values):
        return None
    return [float(value) for value in np.sqrt(np.mean(values**2, axis=0))]


def estimate_metrics(
    state_log: Log, estimate_log: Log, covariance_log: Log, reference: Array, since: float = 0.0
) -> dict[str, Any]:
    """`estimate` of summary.json, but for the bound; reference (n, 3) of the load at the state log's rows.

    since: when the last set-point was set, s.

    Judged over the steady part of the flight, where both logs have a row; None is what no row tells.
    """
    times, logged = state_log["time_s"], np.stack([estimate_log[name] for name in COLUMNS], axis=1)
    late = steady(times, since)
    truth = true_states(state_log)
    row, at = rows_at(times[late], logged[:, 0])
    error = errors(truth[late][row], logged[at, 1 : 1 + len(STATE_COLUMNS)])
    # Both count from the alignment on: what they had counted when the steady part began is not of it.
    judgements, within = logged[at[-1], -2:] - logged[at[0], -2:] if len(at) else (0.0, 0.0)
    row, at = rows_at(logged[at, 0], covariance_log["time_s"])
    judged = error[row][:, NEES_STATES]
    cov = covariances(covariance_log)[at][:, NEES_STATES[:, None], NEES_STATES]
    nees = np.einsum("ni,ni->n", judged, np.linalg.solve(cov, judged[:, :, None])[:, :, 0]) / len(NEES_STATES)
    return {
        "load_relative_rms_m": rms(error[:, LOAD_POSITION] - error[:, VEHICLE_POSITION]),
        "load_rms_m": rms((truth[:, LOAD_POSITION] - reference)[late]),
        "nees_mean": float(np.mean(nees)) if len(nees) else None,
        "innovations_in_bounds": float(within / judgements) if judgements else None,
    }
