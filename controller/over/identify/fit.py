"""Lag, delay and thrust curve from what was sent and what came of it. Pure functions.

The law flies all the time, so that noise goes from the output to the input. At the frequencies of the sines
the ratio of output to input is what it is with an open loop: the sines are known and independent of noise.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy import optimize

from controller.law.state import Array

LEAST_LAG, LARGEST_LAG = 5e-3, 1.0
LARGEST_DELAY = 0.5
"""s"""


class Response(NamedTuple):
    """How an output follows its set-point."""

    gain: float
    """Output over set-point for slow changes, in their units."""
    lag: float
    """s, of the first order."""
    delay: float
    """s"""
    misfit: float
    """What the model leaves, as a share of the response: 0 is a perfect fit."""


def response_at(times: Array, values: Array, frequencies_hz: Array) -> Array:
    """Complex amplitudes (k,) of sines in unevenly sampled values (n,), with an offset and a drift beside."""
    t = times - times.mean()
    columns = [np.ones_like(t), t / max(1e-9, float(np.ptp(t)))]
    for frequency in frequencies_hz:
        angle = 2.0 * math.pi * frequency * times
        columns += [np.cos(angle), np.sin(angle)]
    solution, *_ = np.linalg.lstsq(np.stack(columns, axis=1), values, rcond=None)
    pairs = solution[2:].reshape(-1, 2)
    return np.asarray(pairs[:, 0] - 1j * pairs[:, 1])


def first_order(frequencies_hz: Array, gain: float, lag: float, delay: float, hold: float) -> Array:
    """Response (k,) of a lag behind a delay, to set-points that are held for `hold` s each."""
    w = 2.0 * math.pi * frequencies_hz
    held = np.exp(-0.5j * w * hold) * np.sinc(frequencies_hz * hold)
    return np.asarray(gain * held * np.exp(-1j * w * delay) / (1.0 + 1j * w * lag))


class Series(NamedTuple):
    """Samples (n,) with their times (n,), s."""

    times: Array
    values: Array


def fit_response(
    sent: Series,
    came: Series,
    frequencies_hz: Array,
    known_gain: float | None = None,
) -> Response:
    """The first-order response that fits best.

    sent: set-points at the times of the states that they were made for; came: what followed; known_gain:
    where theory tells it, as of rates over their set-points. Raises ValueError when there is nothing to fit.
    """
    least_samples = 4 * len(frequencies_hz) + 4
    if min(len(sent.times), len(came.times)) < least_samples:
        raise ValueError(f"{len(sent.times)} samples, expected {least_samples} at least")
    inputs = response_at(*sent, frequencies_hz)
    if not np.all(np.isfinite(inputs)) or np.min(np.abs(inputs)) <= 0.0:
        raise ValueError("the set-points contain no sine waves")
    measured = response_at(*came, frequencies_hz) / inputs
    hold, size = float(np.median(np.diff(sent.times))), float(np.mean(np.abs(measured)))

    def misfit(x: Array) -> Array:
        model = first_order(frequencies_hz, x[0], x[1], x[2], hold)
        away = (measured - model) / size
        return np.concatenate((away.real, away.imag))

    gain = float(np.abs(measured[0])) if known_gain is None else known_gain
    least, most = (0.0, math.inf) if known_gain is None else (known_gain - 1e-9, known_gain + 1e-9)
    best = min(
        (
            optimize.least_squares(
                misfit,
                (gain, *start),
                bounds=((least, LEAST_LAG, 0.0), (most, LARGEST_LAG, LARGEST_DELAY)),
            )
            for start in ((0.02, 0.01), (0.02, 0.1), (0.1, 0.01), (0.1, 0.1))
        ),
        key=lambda found: float(found.cost),
    )
    fitted_gain, lag, delay = (float(v) for v in best.x)
    share = math.sqrt(2.0 * float(best.cost) / len(frequencies_hz))
    return Response(fitted_gain, lag, delay, share)


class ThrustCurve(NamedTuple):
    """As in `Stack`."""

    full: float
    """N"""
    curve: float


def fit_thrust(hover_force: float, hover_setpoint: float, slope: float) -> ThrustCurve:
    """Curve through the hover's point with a slope there: N, set-point 0 to 1, N for a set-point of 1.

    force = full·s² and set-point = f·s² + (1 - f)·s. Where noise asks for more than f = 0 to 1 allows, it is
    the nearer of both.
    """

    def of(f: float) -> tuple[float, float]:
        root = hover_setpoint if f == 0.0 else _share(hover_setpoint, f)
        return root, 2.0 * hover_force / (root * (2.0 * f * root + 1.0 - f))

    def away(f: float) -> float:
        return of(f)[1] - slope

    if away(0.0) * away(1.0) > 0.0:
        f = 0.0 if abs(away(0.0)) < abs(away(1.0)) else 1.0
    else:
        f = float(optimize.brentq(away, 0.0, 1.0))
    root = of(f)[0]
    return ThrustCurve(hover_force / root**2, f)


def _share(setpoint: float, f: float) -> float:
    """s of set-point = f·s² + (1 - f)·s."""
    return (-(1.0 - f) + math.sqrt((1.0 - f) ** 2 + 4.0 * f * setpoint)) / (2.0 * f)
