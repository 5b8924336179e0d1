"""Where the load is to be: set-points and circles as smooth motions with all their derivatives.

A path is one flat record, so that compiled code evaluates it at every tick. A sequence of set-points is an
array of them, one for each leg, of which a law has one at a time. `raw` gives the position that
the paper feeds to its integrator, steps and all; `feasible` leaves the start smoothly, so that a feed-forward
can follow it exactly. How it leaves is a smooth step, or a profile that was planned for the vehicle
(`design.motion`). A path can also be given moment by moment (`local_path`), by somebody who shapes it as the
flight goes on.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from controller.law.guide import DERIVATIVES as DERIVATIVES
from controller.law.guide import GUIDE
from controller.law.state import Array
from sitl_bridge.compiled import kernel

USUAL_AGILITY = 0.7

MOST_PIECES = 24
"""Of a planned profile."""
PIECE_ORDER = 8
"""Coefficients of a piece: polynomials of degree 7, which can join with six continuous derivatives."""

OTHER_LAGS = (0.5, 1.0, 2.0)
"""Of the cable's own, for which its length along a planned profile is given."""

PATH = np.dtype(
    [
        ("start", "f8", 3),  # m, where a feasible path leaves from, at rest
        ("centre", "f8", 3),  # m, the set-point, or the circle's centre
        ("radius", "f8"),  # m, 0 for a set-point
        ("angular_rate", "f8"),  # rad/s
        ("crossing", "i8"),  # 1: a figure eight instead of a circle
        ("climb", "f8"),  # m/s, of a helix
        ("ramp_time", "f8"),  # s, in which a feasible path goes over from the start to the path
        ("yaw", "f8"),  # rad
        ("yaw_rate", "f8"),  # rad/s
        ("agility", "f8"),  # 0, gentle, to 1, all there is: how fast a planned profile is to be
        ("unhurried", "i8"),  # 1: left by a gentle smooth step, not by the fastest motion
        ("begin", "f8"),  # s, when a leg of a sequence begins; inf: it has not begun
        ("hold", "f8"),  # s, that it goes on after its ramp
        ("local", "i8"),  # 1: the path is `motion`, and nothing of the above but the yaw
        ("epoch", "f8"),  # s, path time of `motion`
        ("motion", "f8", (DERIVATIVES + 1, 3)),  # position and derivatives at that time
        ("guide", GUIDE),  # who shapes it, see `approach`
        ("pieces", "i8"),  # of the planned profile, equal shares of the ramp time; 0: it is the smooth step
        (
            "profile",
            "f8",
            (MOST_PIECES, PIECE_ORDER),
        ),  # share of the way, in powers of the share of the piece
        ("departs", "i8"),  # 1: it leaves from a state that is not at rest
        ("departure", "f8", (3, MOST_PIECES, PIECE_ORDER)),  # m, on top of the profile, of x, y, z, likewise
        ("slower", "f8", (3, 2)),  # longer ramp, in shares, for what is found to be less and more, see `pace`
        ("cable_lag", "f8"),  # s, of the cable's length behind its tension; 0: `lengths` is not given
        (
            "lengths",
            "f8",
            (3, MOST_PIECES, PIECE_ORDER),
        ),  # m, of the cable, likewise, at each of `OTHER_LAGS`
    ]
)

Path = NDArray[np.void]

RAMP_DERIVATIVES = DERIVATIVES + 1
"""Derivatives of the ramp that vanish at both ends: its moments begin and end without a jump."""
SMOOTH_STEP = np.zeros(2 * RAMP_DERIVATIVES + 2)
"""Coefficients of the polynomial of degree 2N+1 from 0 to 1 whose first N derivatives vanish at both ends."""
for _k in range(RAMP_DERIVATIVES + 1):
    SMOOTH_STEP[RAMP_DERIVATIVES + 1 + _k] = (
        (-1.0) ** _k
        * math.comb(RAMP_DERIVATIVES + _k, _k)
        * math.comb(2 * RAMP_DERIVATIVES + 1, RAMP_DERIVATIVES - _k)
    )
_BINOMIAL = np.array(
    [[math.comb(n, k) for k in range(DERIVATIVES + 1)] for n in range(DERIVATIVES + 1)], dtype=np.float64
)


def _peak(order: int) -> float:
    """Largest magnitude of a derivative of the smooth step over 0..1."""
    polynomial = np.polynomial.Polynomial(SMOOTH_STEP).deriv(order)
    return float(np.max(np.abs(polynomial(np.linspace(0.0, 1.0, 2001)))))


PEAK_SPEED = _peak(1)
PEAK_ACCELERATION = _peak(2)


def setpoint(position: tuple[float, float, float], start: tuple[float, float, float]) -> Path:
    """A path that goes to `position` (m, world) and stays; `start` is where the load is now."""
    return circle(position, 0.0, 0.0, start)


def points(
    positions: Sequence[tuple[float, float, float]], hold: float, start: tuple[float, float, float]
) -> Path:
    """Paths (n,) from point to point (m, world), each held for some s; `start` is where the load is now."""
    starts = (start, *positions[:-1])
    legs = [setpoint(position, before) for position, before in zip(positions, starts, strict=True)]
    path = np.concatenate(legs)
    path["hold"], path["begin"][1:] = hold, math.inf
    return path


def circle(
    centre: tuple[float, float, float],
    radius: float,
    angular_rate: float,
    start: tuple[float, float, float],
) -> Path:
    """The paper's circle: centre + radius·(sin wt, cos wt, 0), w in rad/s (section V.C). Shape (1,)."""
    path = np.zeros(1, dtype=PATH)
    path["start"], path["centre"] = start, centre
    path["radius"], path["angular_rate"] = radius, angular_rate
    path["agility"] = USUAL_AGILITY
    path["ramp_time"] = _ramp_time(path)
    return path


def figure_eight(
    centre: tuple[float, float, float],
    radius: float,
    angular_rate: float,
    start: tuple[float, float, float],
) -> Path:
    """Gerono's lemniscate: centre + radius·(sin wt, sin(2wt)/2, 0), w in rad/s. Shape (1,)."""
    path = circle(centre, radius, angular_rate, start)
    path["crossing"] = 1
    path["ramp_time"] = _ramp_time(path)
    return path


def helix(
    centre: tuple[float, float, float],
    radius: float,
    angular_rate: float,
    climb: float,
    start: tuple[float, float, float],
) -> Path:
    """A circle that climbs (m/s) for as long as the flight lasts: centre is that of its lowest turn."""
    path = circle(centre, radius, angular_rate, start)
    path["climb"] = climb
    return path


def local_path() -> Path:
    """A path (1,) that is the Taylor polynomial of `motion` around `epoch`, which its owner writes."""
    path = np.zeros(1, dtype=PATH)
    path["local"] = 1
    return path


LARGEST_SPEED = 5.0
"""m/s, of the ramp's own share of a feasible motion."""
LARGEST_ACCELERATION = 2.5
"""m/s², likewise: a tilt of some 15 degrees."""
SHORTEST_RAMP = 2.0
"""s"""


def _ramp_time(path: Path) -> float:
    """How long a feasible path takes from its start to the path itself, s."""
    begin = np.array([0.0, 0.0 if path["crossing"][0] else path["radius"][0], 0.0])
    distance = float(np.linalg.norm(path["centre"][0] + begin - path["start"][0]))
    return max(
        SHORTEST_RAMP,
        distance * PEAK_SPEED / LARGEST_SPEED,
        math.sqrt(distance * PEAK_ACCELERATION / LARGEST_ACCELERATION),
    )


@kernel
def _taylor(motion: Array, t: float, out: Array) -> None:
    """The motion whose derivatives at 0 are motion (6, 3), and its derivatives at time t (s)."""
    for i in range(3):
        for n in range(DERIVATIVES + 1):
            value = 0.0
            for k in range(DERIVATIVES, n - 1, -1):
                value = motion[k, i] + value * t / (k - n + 1)
            out[n, i] = value


@kernel
def path_derivatives(path: Any, t: float, out: Array) -> None:
    """The path itself at time t (s): row k of out (6, 3) is its k-th derivative."""
    if path.local:
        _taylor(path.motion, t - path.epoch, out)
        return
    quarter = 0.5 * math.pi
    power, doubled = path.radius, 0.5 * path.radius
    for k in range(DERIVATIVES + 1):
        phase = path.angular_rate * t + k * quarter
        out[k, 0] = power * math.sin(phase)
        if path.crossing:
            out[k, 1] = doubled * math.sin(2.0 * path.angular_rate * t + k * quarter)
        else:
            out[k, 1] = power * math.cos(phase)
        out[k, 2] = 0.0
        power *= path.angular_rate
        doubled *= 2.0 * path.angular_rate
    out[0, 2] = path.climb * t
    out[1, 2] = path.climb
    for i in range(3):
        out[0, i] += path.centre[i]


@kernel
def smooth_step(s: float, out: Array) -> None:
    """The smooth step at s in 0..1: out (6,) are its value and its derivatives with respect to s.

    Its second half is the first one mirrored: near 1 the polynomial itself would lose its last digits.
    """
    mirrored = s > 0.5
    x = 1.0 - s if mirrored else s
    for k in range(DERIVATIVES + 1):
        value = 0.0
        for power in range(2 * RAMP_DERIVATIVES + 1, k - 1, -1):
            factor = SMOOTH_STEP[power]
            for j in range(k):
                factor *= power - j
            value = value * x + factor
        out[k] = -value if mirrored and k % 2 == 0 else value
    if mirrored:
        out[0] += 1.0


@kernel
def piece_at(pieces: int, share: float) -> int:
    """Which of equal pieces of 0..1 a share lies in."""
    return min(pieces - 1, int(share * pieces))


@kernel
def derivative(coefficients: Array, x: float, order: int) -> float:
    """A derivative of a polynomial; coefficients: (PIECE_ORDER,), of rising powers."""
    value = 0.0
    for power in range(PIECE_ORDER - 1, order - 1, -1):
        factor = coefficients[power]
        for j in range(order):
            factor *= power - j
        value = value * x + factor
    return value


@kernel
def profile(path: Any, share: float, out: Array) -> None:
    """The planned profile at a share (0..1) of the ramp time, and its derivatives by the share: out (6,)."""
    piece = piece_at(path.pieces, share)
    x = share * path.pieces - piece
    scale = 1.0
    for k in range(DERIVATIVES + 1):
        out[k] = scale * derivative(path.profile[piece], x, k)
        scale *= path.pieces


@kernel
def _add_departure(path: Any, share: float, out: Array) -> None:
    """Add what is left of the initial state at a share of the ramp time, a little below 0 too: out (6, 3)."""
    piece = piece_at(path.pieces, share)
    x = share * path.pieces - piece
    for i in range(3):
        scale = 1.0
        for k in range(DERIVATIVES + 1):
            out[k, i] += scale * derivative(path.departure[i, piece], x, k)
            scale *= path.pieces / path.ramp_time


@kernel
def feasible(path: Any, t: float, out: Array, scratch: Array) -> None:
    """The path, left smoothly from its start: row k of out (6, 3) is the k-th derivative at time t (s).

    r = start + w(t)·(path - start), with w from 0 to 1 over the ramp time (Leibniz for its derivatives).
    scratch: (6,).
    """
    path_derivatives(path, t, out)
    if path.local or t >= path.ramp_time:
        return
    share = max(0.0, t) / path.ramp_time
    if path.pieces > 0:
        profile(path, share, scratch)
    else:
        smooth_step(share, scratch)
    scale = 1.0
    for k in range(DERIVATIVES + 1):
        scratch[k] *= scale
        scale /= path.ramp_time
    for i in range(3):
        out[0, i] -= path.start[i]
        for n in range(DERIVATIVES, -1, -1):
            value = 0.0
            for k in range(n + 1):
                value += _BINOMIAL[n, k] * scratch[k] * out[n - k, i]
            out[n, i] = value
        out[0, i] += path.start[i]
    if path.departs:
        _add_departure(path, t / path.ramp_time, out)
