"""From any motion to a target that is said moment by moment: smooth, and within limits; compiled.

The motion is the sum of two: a *base*, which is what the target says by itself (a moving set-point with its
velocity and acceleration; nothing for a point to go to), and the *gap* to it, which is closed within limits.
A *carrot* with bounded speed and acceleration closes the gap, and the gap follows it through a chain of five
integrators (a reference model with all its poles in one place). When the base jumps, gap and carrot jump the
other way: so whatever a client sends, the motion has the derivatives that a flat output needs, without a
jump, and a set-point that moves smoothly is followed without a lag.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from controller.law.guide import BASE, DERIVATIVES, LANDING, MOVING
from controller.law.reference import PATH
from controller.law.state import Array
from sitl_bridge.compiled import Buffer, entry_point, kernel
from sitl_bridge.frames import Triple

APPROACH = 1.5
"""1/s, with which the carrot's last bit of way to a point decays"""
CLOSING = 5.0
"""1/s, likewise for the gap to a moving set-point"""
BRAKING_SHARE = 0.7
"""Of the acceleration limit, that an approach to a point is planned with"""
LEAST_CLOSING_SPEED = 0.3
"""Of the speed limit, that is left to close the gap to a set-point that moves fast itself"""
COASTING = 0.6
"""s after which a set-point that has not been renewed goes on without its acceleration"""
YAW_RATE = 0.6
"""rad/s, largest"""
YAW_ACCELERATION = 0.5
"""rad/s²: yaw is what rotors are worst at"""


@kernel
def _size(vector: Triple) -> float:
    return math.sqrt(vector[0] * vector[0] + vector[1] * vector[1] + vector[2] * vector[2])


@kernel
def _shortened(vector: Triple, most: float) -> Triple:
    """The vector, or the longest of its direction that is allowed."""
    size = _size(vector)
    if size <= most:
        return vector
    share = most / size
    return (vector[0] * share, vector[1] * share, vector[2] * share)


@kernel
def _approach_speed(away: float, braking: float, decay: float) -> float:
    """Speed at a distance (m) from the point to stop at: braking as planned, then decaying."""
    linear = braking / (decay * decay)
    if away < linear:
        return decay * away
    return math.sqrt(2.0 * braking * (away - 0.5 * linear))


@kernel
def _towards(way: Triple, speed: float, climb: float, limits: Any, decay: float) -> Triple:
    """Velocity along a way (m) that is left, at most `speed`.

    climb: m/s upwards, at which the target moves itself; the limits are for both together.
    """
    away = _size(way)
    if away == 0.0:
        return (0.0, 0.0, 0.0)
    vertical, own = (limits.up, climb) if way[2] > 0.0 else (limits.down, -climb)
    vertical = min(vertical, max(vertical - own, LEAST_CLOSING_SPEED * vertical))
    most = min(speed, vertical * away / max(abs(way[2]), 1e-9))
    share = min(most, _approach_speed(away, BRAKING_SHARE * limits.acceleration, decay)) / away
    return (way[0] * share, way[1] * share, way[2] * share)


@kernel
def _wanted(guide: Any) -> Triple:
    """Velocity that the carrot is to have now, m/s."""
    target, here, limits = guide.target, guide.carrot[0], guide.limits
    if guide.kind == MOVING:
        x = 0.0 if math.isnan(target[0]) else -here[0]
        y = 0.0 if math.isnan(target[1]) else -here[1]
        z = 0.0 if math.isnan(target[2]) else -here[2]
        own = _size((guide.base[1, 0], guide.base[1, 1], guide.base[1, 2]))
        speed = max(limits.speed - own, LEAST_CLOSING_SPEED * limits.speed)
        return _towards((x, y, z), speed, guide.base[1, 2], limits, CLOSING)
    x, y, z = target[0] - here[0], target[1] - here[1], target[2] - here[2]
    if guide.kind == LANDING:
        x, y, _ = _towards((x, y, 0.0), limits.speed, 0.0, limits, APPROACH)
        return (x, y, -guide.speed)
    return _towards((x, y, z), guide.speed, 0.0, limits, APPROACH)


@kernel
def _kept_above(guide: Any, step: float) -> float:
    """The upward change of the carrot's velocity (m/s) in a period, raised so that the floor is kept.

    The motion is seen through a positive window from the whole carrot, that of the base and that of the gap:
    it stays above the floor where the whole carrot does. So this one brakes in time, whatever is asked for.
    """
    height, climb, driven = guide.carrot[0, 2] - guide.limits.floor, guide.carrot[1, 2], 0.0
    for k in range(BASE):
        height += guide.ahead[k] * guide.base[k, 2]
        climb += guide.ahead[k] * guide.base[k + 1, 2] if k + 1 < BASE else 0.0
        driven += guide.ahead[k] * guide.base[k + 2, 2] if k + 2 < BASE else 0.0
    braking = BRAKING_SHARE * guide.limits.acceleration
    least = -_approach_speed(max(0.0, height), braking, APPROACH)
    planned = climb + guide.period * driven + step
    return float(step + max(0.0, min(least, climb + guide.period * guide.limits.total) - planned))


@kernel
def _move_carrot(guide: Any) -> None:
    """Acceleration, velocity and position of the carrot, a period on."""
    dt, carrot, own = guide.period, guide.carrot, guide.base[2]
    wanted = _wanted(guide)
    x, y, z = wanted[0] - carrot[1, 0], wanted[1] - carrot[1, 1], wanted[2] - carrot[1, 2]
    wish = _shortened((x / dt, y / dt, z / dt), guide.limits.acceleration)
    both = _shortened(
        (wish[0] + own[0], wish[1] + own[1], wish[2] + own[2]),
        max(guide.limits.total, _size((own[0], own[1], own[2]))),
    )
    for i in range(3):
        step = dt * (both[i] - own[i])
        if i == 2 and guide.kind != LANDING:
            step = _kept_above(guide, step)
        carrot[2, i] = step / dt
        carrot[0, i] += dt * (carrot[1, i] + 0.5 * step)
        carrot[1, i] += step


@kernel
def _turn(path: Any) -> None:
    """The yaw, a period on."""
    guide = path.guide
    rate = 0.0
    if not math.isnan(guide.yaw):
        away = guide.yaw - path.yaw
        away -= 2.0 * math.pi * math.floor(away / (2.0 * math.pi) + 0.5)
        rate = math.copysign(_approach_speed(abs(away), BRAKING_SHARE * YAW_ACCELERATION, APPROACH), away)
    if guide.kind == MOVING and not math.isnan(guide.yaw_rate):
        rate += guide.yaw_rate
    rate = max(-YAW_RATE, min(YAW_RATE, rate))
    step = YAW_ACCELERATION * guide.period
    rate = max(path.yaw_rate - step, min(path.yaw_rate + step, rate))
    yaw = path.yaw + rate * guide.period
    path.yaw = yaw - 2.0 * math.pi * math.floor(yaw / (2.0 * math.pi) + 0.5)
    path.yaw_rate = rate


@kernel
def rebase(guide: Any, row: int, i: int, value: float) -> None:
    """Another value of the base, in a row and axis; the motion and its derivatives stay as they are."""
    jump = value - guide.base[row, i]
    guide.base[row, i] = value
    guide.gap[row, i] -= jump
    guide.carrot[0, i] -= guide.ahead[row] * jump
    if row > 0:
        guide.carrot[1, i] -= guide.ahead[row - 1] * jump


@kernel
def advance(path: Any, time: float) -> None:
    """Go on by one period towards the guide's target; `time` (s) is that of the law's step to come."""
    guide = path.guide
    base, gap, carrot, following = guide.base, guide.gap, guide.carrot, guide.scratch
    for i in range(3):
        if guide.age > COASTING:
            for row in range(2, BASE):
                rebase(guide, row, i, 0.0)
        for row in range(DERIVATIVES):  # the carrot is a parabola in a period, from where it was
            value = guide.pull[row, 0] * carrot[0, i] + guide.pull[row, 1] * carrot[1, i]
            for k in range(DERIVATIVES):
                value += guide.own[row, k] * gap[k, i]
            following[row, i] = value
    _move_carrot(guide)
    for i in range(3):
        last = guide.feedback[0] * carrot[0, i]
        for row in range(DERIVATIVES):
            gap[row, i] = following[row, i] + guide.pull[row, 2] * carrot[2, i]
            last -= guide.feedback[row] * gap[row, i]
        gap[DERIVATIVES, i] = last
        for row in range(BASE):  # upper triangular: what is below has not moved on yet
            value = 0.0
            for k in range(row, BASE):
                value += guide.coast[row, k] * base[k, i]
            base[row, i] = value
        for row in range(DERIVATIVES + 1):
            path.motion[row, i] = gap[row, i] + (base[row, i] if row < BASE else 0.0)
    path.motion[1, 2] -= guide.sinking
    _turn(path)
    path.epoch = time
    guide.age += guide.period


@entry_point(Buffer(PATH, (1,)), float)
def advance_path(paths: Any, time: float) -> int:
    """`advance`, for who flies no control step with it."""
    advance(paths[0], time)
    return 0


@entry_point(Buffer(PATH, (1,)), Buffer(np.float64, (BASE, 3)))
def rebase_path(paths: Any, base: Array) -> int:
    """Go over to another base (4, 3); the motion and its derivatives stay as they are."""
    guide = paths[0].guide
    for row in range(BASE):
        for i in range(3):
            rebase(guide, row, i, base[row, i])
    return 0
