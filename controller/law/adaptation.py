"""What the description gets wrong, found in flight: the load's mass, the cable's stiffness and damping.

Over each tick the impulses on the bodies must add up, in the vertical, where no steady wind pushes:

    vehicle   k S + c D         = thrust's impulse - m_v (dv + g h) - drag's impulse
    load      m_p (dw + g h)    = k S + c D - drag's impulse

S and D are integrals over the tick of the stretch and of its rate, times the cable's upward share. Both are
linear in (m_p, k, c), so that a Kalman filter for constants finds these: one scalar update for each equation.
Its prior is the description. What does not move keeps its prior, what fits no load on a cable (a slack one,
contact, a fault) is left out, and what is used of it is bounded. The gains remain those of the description.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from controller.law.state import LONGEST_DELAY, Array
from sitl_bridge.compiled import kernel

MASS, STIFFNESS, DAMPING = 0, 1, 2
FOUND = 3
SEEN = 7

PRIOR = np.array([0.1, 0.2, 0.5])
"""Standard deviations of the description's load mass, stiffness and damping, over themselves."""
LEAST = np.array([-0.3, -0.5, -0.9])
MOST = np.array([0.4, 0.8, 2.0])
"""So far what is found may be from the description, likewise."""
NOISE = 0.05
"""Standard deviation, over weight, of the forces in a tick that the equations leave out; white.

On the load over its own weight, on the vehicle over the mean of both."""
RENEWAL = 1e4
"""s, in which all that is known is forgotten: what changes is followed, in some seconds."""
LARGEST_SURPRISE = 12.0
"""Over the noise; a larger residual is no load on a cable."""
LEAST_STRETCH = 0.1
"""Of the description's in hover; below it the cable may be slack."""

BEGINNING = 0.016
"""Of a planned motion, after which its pace is set"""

ADAPTATION = np.dtype(
    [
        ("found", "f8", FOUND),  # load mass, stiffness, damping over the description's, less 1
        ("pace", "f8"),  # of a planned motion, over that of its plan; 0: as planned
        ("covariance", "f8", (FOUND, FOUND)),
        ("last", "f8", SEEN),  # of the tick before, see `_observed`
        ("thrust", "f8", LONGEST_DELAY + 1),  # N, commands given, newest first
        ("rotors", "f8"),  # square root of the thrust, N, that lagging rotors give
        ("was_taut", "i8"),
        ("seen", "f8", SEEN),  # scratch
        ("mean", "f8", SEEN),  # likewise
        ("row", "f8", FOUND),  # likewise
        ("direction", "f8", FOUND),
    ]
)

_UP, _LOAD_UP, _STRETCH, _RATE, _LIFT, _DRAG, _LOAD_DRAG = range(7)


@kernel
def _observed(body: Any, estimate: Array, out: Array) -> bool:
    """What the equations need of an estimate (18,): out (7,); returns whether the cable is surely taut.

    Upward velocities (m/s) of vehicle and load, stretch and its rate (m, m/s) and the thrust's direction
    times their upward share, upward drag in still air (N) of vehicle and load.
    """
    squared, along = 0.0, 0.0
    for i in range(3):
        span = estimate[i] - estimate[3 + i]
        squared += span * span
        along += span * (estimate[6 + i] - estimate[9 + i])
    length = math.sqrt(squared)
    if length <= body.rest_length:
        return False
    upward = (estimate[2] - estimate[5]) / length
    stretch = length - body.rest_length
    out[_UP], out[_LOAD_UP] = estimate[8], estimate[11]
    out[_STRETCH], out[_RATE] = stretch * upward, along / length * upward
    out[_LIFT] = math.cos(estimate[15]) * math.cos(estimate[16])
    speed = math.sqrt(estimate[6] ** 2 + estimate[7] ** 2 + estimate[8] ** 2)
    out[_DRAG] = -(body.vehicle_drag[0] + body.vehicle_drag[1] * speed) * estimate[8]
    speed = math.sqrt(estimate[9] ** 2 + estimate[10] ** 2 + estimate[11] ** 2)
    out[_LOAD_DRAG] = -(body.load_drag[0] + body.load_drag[1] * speed) * estimate[11]
    return bool(stretch * body.stiffness > LEAST_STRETCH * body.load_mass * body.gravity)


@kernel
def _correct(a: Any, surprise: float, row: Array, noise: float) -> None:
    """One scalar measurement: `surprise` more than row·found, with noise of this standard deviation."""
    variance = noise * noise
    for i in range(FOUND):
        a.direction[i] = 0.0
        for j in range(FOUND):
            a.direction[i] += a.covariance[i, j] * row[j]
        variance += row[i] * a.direction[i]
    if abs(surprise) > LARGEST_SURPRISE * noise:
        return
    for i in range(FOUND):
        a.found[i] += a.direction[i] * surprise / variance
    for i in range(FOUND):
        for j in range(FOUND):
            a.covariance[i, j] -= a.direction[i] * a.direction[j] / variance


@kernel
def adapt(design: Any, memory: Any, estimate: Array) -> None:
    """Learn from the tick that ends with this estimate (18,), and from what the rotors gave meanwhile."""
    a, body = memory.adaptation, design.body
    taut = _observed(body, estimate, a.seen)
    if memory.ticks == 0:
        hover = (body.vehicle_mass + body.load_mass) * body.gravity
        a.rotors = math.sqrt(hover)
        for age in range(design.delay):
            a.thrust[age] = hover
        for i in range(FOUND):
            a.covariance[i, i] = PRIOR[i] ** 2
    else:
        lift = _given(design, a)
        if taut and a.was_taut:
            _learn(design.body, a, lift, design.period)
    for i in range(SEEN):
        a.last[i] = a.seen[i]
    a.was_taut = 1 if taut else 0


@kernel
def _learn(body: Any, a: Any, lift: float, h: float) -> None:
    """Both equations over a tick of h (s), over the load's weight as described; lift: N, of the rotors."""
    weight = body.load_mass * body.gravity * h  # N s
    for i in range(SEEN):
        a.mean[i] = 0.5 * (a.last[i] + a.seen[i])
    pulled, damped = body.stiffness * a.mean[_STRETCH] * h / weight, body.damping * a.mean[_RATE] * h / weight
    rise = a.seen[_UP] - a.last[_UP] + body.gravity * h
    load_rise = a.seen[_LOAD_UP] - a.last[_LOAD_UP] + body.gravity * h
    carried = ((lift * a.mean[_LIFT] + a.mean[_DRAG]) * h - body.vehicle_mass * rise) / weight
    heavy, dragged = body.load_mass * load_rise / weight, a.mean[_LOAD_DRAG] * h / weight
    kept = 2.0 * h / RENEWAL
    for i in range(FOUND):
        for j in range(FOUND):
            a.covariance[i, j] *= 1.0 - kept
        a.covariance[i, i] += kept * PRIOR[i] ** 2
    pull = pulled * (1.0 + a.found[STIFFNESS]) + damped * (1.0 + a.found[DAMPING])
    a.row[MASS], a.row[STIFFNESS], a.row[DAMPING] = 0.0, pulled, damped
    _correct(a, carried - pull, a.row, NOISE * 0.5 * (1.0 + body.vehicle_mass / body.load_mass))
    pull = pulled * (1.0 + a.found[STIFFNESS]) + damped * (1.0 + a.found[DAMPING])
    a.row[MASS], a.row[STIFFNESS], a.row[DAMPING] = heavy, -pulled, -damped
    _correct(a, pull + dragged - heavy * (1.0 + a.found[MASS]), a.row, NOISE)
    for i in range(FOUND):
        a.found[i] = min(max(a.found[i], LEAST[i]), MOST[i])


@kernel
def _given(design: Any, a: Any) -> float:
    """Thrust, N, that the rotors gave on average over the last tick; lagging ones go on to its end."""
    commanded = math.sqrt(max(0.0, a.thrust[design.delay]))
    if design.rotor_lag <= 0.0:
        return commanded * commanded
    # Speeds lag: w = commanded + away·exp(-t/lag), thrust is w².
    away = a.rotors - commanded
    once = design.rotor_lag / design.period * (1.0 - design.lag_decay)
    twice = 0.5 * design.rotor_lag / design.period * (1.0 - design.lag_decay**2)
    a.rotors = commanded + away * design.lag_decay
    return float(commanded * commanded + 2.0 * commanded * away * once + away * away * twice)


@kernel
def set_pace(design: Any, memory: Any, path: Any) -> None:
    """Early on a planned motion, while the load has hardly moved: slow it down for what was found."""
    a = memory.adaptation
    if path.pieces > 0 and a.pace == 0.0 and memory.ticks * design.period >= BEGINNING * path.ramp_time:
        longer = 1.0
        for i in range(FOUND):
            longer += path.slower[i, 0 if a.found[i] < 0.0 else 1] * abs(a.found[i])
        a.pace = 1.0 / longer


@kernel
def give(design: Any, memory: Any, thrust: float) -> None:
    """After allocation: the thrust that the rotors are told to give is remembered."""
    for age in range(design.delay, 0, -1):
        memory.adaptation.thrust[age] = memory.adaptation.thrust[age - 1]
    memory.adaptation.thrust[0] = thrust


@kernel
def adapted(body: Any, adaptation: Any, out: Any) -> None:
    """The body with what was found of it."""
    found = adaptation.found
    out.pace = adaptation.pace if adaptation.pace > 0.0 else 1.0
    out.gravity, out.vehicle_mass, out.rest_length = body.gravity, body.vehicle_mass, body.rest_length
    for i in range(3):
        out.inertia[i] = body.inertia[i]
    out.load_mass = body.load_mass * (1.0 + found[MASS])
    out.stiffness = body.stiffness * (1.0 + found[STIFFNESS])
    out.damping = body.damping * (1.0 + found[DAMPING])
    out.planned_load_mass, out.planned_stiffness = body.planned_load_mass, body.planned_stiffness
    for i in range(2):
        out.vehicle_drag[i], out.load_drag[i] = body.vehicle_drag[i], body.load_drag[i]
