"""Changes of model: vehicle on the ground or not, cable slack or taut, load on the ground or gone.

A surprise is not divergence.
"""

from __future__ import annotations

import math
from typing import Any

from controller.estimator.correct.live_samples import failed
from controller.estimator.correct.sensors import measured_pull, saturated
from controller.estimator.correct.update import set_part
from controller.estimator.predict.forces import cable
from controller.estimator.records import (
    ACCELEROMETER,
    ATTITUDE,
    ERROR_SIZE,
    FLYING,
    FORCE,
    GPS_POSITION,
    GPS_VELOCITY,
    GYROSCOPE,
    LOAD,
    LOAD_DROPPED,
    LOAD_ON_CABLE,
    LOAD_ON_GROUND,
    LOAD_RELEASED,
    LOAD_VELOCITY,
    POSITION,
    RATES,
    STANDING,
    VELOCITY,
    X_FORCE,
    X_LOAD,
    X_LOAD_VELOCITY,
    X_POSITION,
    X_VELOCITY,
    Filter,
)
from controller.estimator.standing import CARRIED, rests, tips
from sitl_bridge.compiled import kernel

PULL_TIME = 0.04
"""s, over which the measured pull of the cable is smoothed."""
CONFIRM_TIME = 0.06
"""s: so long the measured pull has to contradict the model."""
RELEASE_TIME = 1.5
"""s without any pull in the air: a load on its cable would have fallen into it before."""
IMPOSSIBLE_PULL = 1e3
"""Of the load's weight; a sensor that shows that, or no number, shows nothing."""
GROUND_MARGIN = 0.5
"""m, and three standard deviations: what is this low may be on the ground."""
UNKNOWN_HEIGHT = 5.0
"""m, standard deviation: whoever knows his height no better knows nothing of the ground."""
CONTACT_TIME = 0.12
"""s: so long something below has to carry vehicle or load, until they stand or lie on it."""
TIPPING_ANGLE, TIPPING_RATE = 0.03, 1.0
"""rad and rad/s, standard deviations: how far a vehicle may have tipped that was taken to stand."""
LIGHT, HANGING, LIFTING = 0.4, 0.8, 0.95
"""Shares of its weight: less than LIGHT on the cable, and a load has been set down; with more than HANGING it
hangs where it is; with LIFTING one that lay leaves the ground."""
HARDEST_BUMP = 0.5
"""m/s in one tick; a sample that shows more shows nothing."""
SET_DOWN_STD = 0.03
"""m: how far a load slides as it is set down, and how flat the ground is."""
KNOWN = 0.2
"""Of the cable's length: a load whose place is known better is not looked for anew."""
DOUBT = 0.1
"""Of the cable's length: how far a load may be from where it is thought, when forces do not fit."""
DOUBTED_SPEED = 0.5
"""m/s, likewise"""
USUAL_SWING = 0.12
"""rad, of a load's swing when what held the vehicle has let go of it. A slack cable does not swing."""
FIRST_FORCE = 3.0
"""Of what an unmodelled force usually is: what it may be as the vehicle takes off, for then a wind may blow.

Where less was expected, a sudden 12 m/s was taken for a swing of the load: `heavy` leaned by 64°, not 44."""
STRETCH_STD = 0.02
"""Of the cable's length: how well a pull shows how long the cable is."""


@kernel
def watch(f: Filter, measured: Any) -> None:
    """Compare the pull that the accelerometer shows with what the model says, and change the model."""
    p, m, x = f.p, f.m, f.x
    if m.vehicle_mode == STANDING and m.grounded:
        if m.thrust > p.vehicle_mass * p.gravity:
            leave_ground(f)
        elif tips(f):
            tip(f)
    if m.vehicle_mode != FLYING or failed(f, ACCELEROMETER):
        return
    for axis in range(3):
        if saturated(f, measured[axis]):
            return
    out = f.vectors[0]
    if not measured_pull(f, measured, out) < IMPOSSIBLE_PULL * p.load_mass * p.gravity:
        return
    blend = p.period / PULL_TIME
    for axis in range(3):
        m.pull[axis] += blend * (out[axis] - m.pull[axis])
    pull = math.sqrt(m.pull[0] ** 2 + m.pull[1] ** 2 + m.pull[2] ** 2)
    weight = p.load_mass * p.gravity
    if p.has_ground:
        low = is_low(x[X_POSITION + 2], f.P[POSITION + 2, POSITION + 2], p.standing_height)
        carried = low and m.pull[2] > CARRIED * p.vehicle_mass * p.gravity
        m.contact_time = m.contact_time + p.period if carried and rests(f) else 0.0
        if m.contact_time > CONTACT_TIME:
            stand(f)
            return
        if low and m.rejected_in_row[ACCELEROMETER] > 0:
            bump(f)
    if m.rejected_in_row[ACCELEROMETER] * p.period > CONFIRM_TIME:
        # The accelerometer and the model have parted: where the load is has to be found again.
        m.rejected_in_row[ACCELEROMETER] = 0
        doubt(f)
    # What smoothing leaves of noise and unmodelled force, three standard deviations.
    noise = math.sqrt(p.sensor_std[ACCELEROMETER] ** 2 + p.force_std**2)
    floor = 3.0 * p.vehicle_mass * noise * math.sqrt(blend)
    floor = max(floor, 0.2 * weight)
    slack = pull < floor
    if 0.0 < m.swing_due <= m.time:
        m.swing_due = 0.0
        if pull > LIGHT * weight and m.load_mode == LOAD_ON_CABLE:
            doubt_swing(f)
    m.slack_time = m.slack_time + p.period if slack else 0.0
    surprising = not slack and (m.load_mode == LOAD_RELEASED or m.tension <= 0.0)
    m.pull_time = m.pull_time + p.period if surprising else 0.0
    down = -m.pull[2]
    if m.load_mode == LOAD_DROPPED:
        if m.hook_closed and m.pull_time > CONFIRM_TIME and down > floor:
            m.load_mode = LOAD_ON_GROUND
            take_up(f, pull)
        return
    if m.load_mode == LOAD_ON_GROUND:
        if m.pull_time > CONFIRM_TIME and down > floor:
            take_up(f, pull)
        if down > LIFTING * weight:
            lift_load(f, pull)
        return
    if p.two_way:
        return
    if down > HANGING * weight:
        for axis in range(2):
            m.hung[axis] = x[X_POSITION + axis] + x[X_LOAD + axis]
            m.hung_variance[axis] = f.P[LOAD + axis, LOAD + axis]
    set_down = p.has_ground and down < LIGHT * weight and _load_is_low(f)
    m.lying_time = m.lying_time + p.period if set_down else 0.0
    if m.pull_time > CONFIRM_TIME:
        m.load_mode = LOAD_ON_CABLE
        m.pull_time = 0.0
        place_load(f, pull)
    elif m.load_mode == LOAD_ON_CABLE and m.lying_time > CONTACT_TIME:
        lay_load(f)
    elif m.load_mode == LOAD_ON_CABLE and m.slack_time > RELEASE_TIME and m.tension <= 0.0:
        release(f)


@kernel
def is_low(height: float, variance: float, rest: float) -> bool:
    """Whether something may be on the ground, where it would have the height `rest`, m."""
    if variance > UNKNOWN_HEIGHT**2:
        return False
    return bool(height - 3.0 * math.sqrt(max(0.0, variance)) < rest + GROUND_MARGIN)


@kernel
def _load_is_low(f: Filter) -> bool:
    cov, x = f.P, f.x
    above = POSITION + 2
    hanging = LOAD + 2
    variance = cov[above, above] + 2.0 * cov[above, hanging] + cov[hanging, hanging]
    return is_low(x[X_POSITION + 2] + x[X_LOAD + 2], variance, f.p.lying_height)


@kernel
def lay_load(f: Filter) -> None:
    """The load lies on the ground: it moves no more, and is where it hung last.

    Since then the ground's force on it has been taken for something else, and misplaced it.
    """
    m, x = f.m, f.x
    m.load_mode = LOAD_ON_GROUND
    for axis in range(2):
        x[X_LOAD + axis] = m.hung[axis] - x[X_POSITION + axis]
        set_part(f, LOAD + axis, 1, math.sqrt(m.hung_variance[axis]) + SET_DOWN_STD)
    lie_still(f)


@kernel
def lie_still(f: Filter) -> None:
    """The load lies on the ground below where it is: it has come to rest, and pulls no more."""
    p, x = f.p, f.x
    x[X_LOAD + 2] = p.lying_height - x[X_POSITION + 2]
    lie_below(f)
    for axis in range(3):
        x[X_LOAD_VELOCITY + axis] = -x[X_VELOCITY + axis]
        x[X_FORCE + axis] = 0.0
    set_part(f, LOAD_VELOCITY, 3, 0.5)
    set_part(f, FORCE, 3, p.force_std)


@kernel
def lie_below(f: Filter) -> None:
    """The load's height is the ground's: below the vehicle it is as far as the vehicle is high."""
    cov, below, above = f.P, LOAD + 2, POSITION + 2
    set_part(f, below, 1, SET_DOWN_STD)
    for j in range(ERROR_SIZE):
        if j != below:
            cov[below, j] = cov[j, below] = -cov[above, j]
    cov[below, below] += cov[above, above]
    for k in range(f.m.clone_width):
        f.Pxz[below, k] = -f.Pxz[above, k]


@kernel
def take_up(f: Filter, pull: float) -> None:
    """The cable is taut although the model says slack: it is as long as the pull shows, `pull` in N.

    Whether vehicle or load is higher than believed is all that this is about. To the side the load stays
    where it is known to be: the slope of the cable's length over that place, taken for decimetres, would
    move it by decimetres for a centimetre of cable. The squares of what is unknown there widen the height.
    """
    p, x, cov = f.p, f.x, f.P
    length = p.rest_length + pull / p.stiffness
    across = x[X_LOAD] ** 2 + x[X_LOAD + 1] ** 2
    height = math.sqrt(max(length * length - across, 0.01 * length * length))
    lower = (cov[LOAD, LOAD] + cov[LOAD + 1, LOAD + 1]) / (2.0 * height)
    x[X_LOAD + 2] = -height
    set_part(f, LOAD + 2, 1, math.hypot(STRETCH_STD * p.rest_length, math.sqrt(2.0) * lower))
    x[X_FORCE + 2] = 0.0  # all that pulls has been taken for the cable
    set_part(f, FORCE + 2, 1, p.force_std)


@kernel
def lift_load(f: Filter, pull: float) -> None:
    """The load leaves the ground."""
    p, m = f.p, f.m
    m.load_mode = LOAD_ON_CABLE
    known = (KNOWN * p.rest_length) ** 2
    if f.P[LOAD, LOAD] > known or f.P[LOAD + 1, LOAD + 1] > known:
        place_load(f, pull)
        return
    take_up(f, pull)
    for i in range(LOAD_VELOCITY, LOAD_VELOCITY + 3):
        f.P[i, i] += 0.2**2


@kernel
def leave_ground(f: Filter) -> None:
    """What held or carried the vehicle is gone: forces, rates and load start anew."""
    f.m.vehicle_mode = FLYING
    f.m.grounded = False
    f.m.contact_time = 0.0
    set_part(f, FORCE, 3, FIRST_FORCE * f.p.force_std)
    if f.m.load_mode in (LOAD_ON_GROUND, LOAD_DROPPED):
        return
    for part in (LOAD, LOAD_VELOCITY):
        for i in range(part, part + 3):
            f.P[i, i] += f.p.initial_std[i] ** 2
    f.m.swing_due = f.m.time + CONFIRM_TIME


@kernel
def tip(f: Filter) -> None:
    """The vehicle does not stand: what it turned while that was believed is not known."""
    leave_ground(f)
    f.m.rejected_in_row[GYROSCOPE] = 0
    for axis in range(3):
        f.P[ATTITUDE + axis, ATTITUDE + axis] += TIPPING_ANGLE**2
        f.P[RATES + axis, RATES + axis] += TIPPING_RATE**2


@kernel
def doubt_swing(f: Filter) -> None:
    """A load that hangs on a taut cable may swing: its velocity across the cable is not known."""
    p, x = f.p, f.x
    cable(f, f.vectors[0])
    if f.m.tension <= 0.0:
        return
    square = x[X_LOAD] ** 2 + x[X_LOAD + 1] ** 2 + x[X_LOAD + 2] ** 2
    variance = USUAL_SWING**2 * p.gravity * math.sqrt(square)
    for i in range(3):
        f.P[LOAD_VELOCITY + i, LOAD_VELOCITY + i] += variance
        for j in range(3):
            f.P[LOAD_VELOCITY + i, LOAD_VELOCITY + j] -= variance * x[X_LOAD + i] * x[X_LOAD + j] / square


@kernel
def stand(f: Filter) -> None:
    """The vehicle stands on the ground: whatever it did before, it is at rest now.

    What was believed of its velocity is forgotten and not found wrong: that would move its place by metres,
    under a law that is still at work.
    """
    f.m.vehicle_mode = STANDING
    f.m.grounded = True
    f.m.contact_time = 0.0
    set_part(f, VELOCITY, 3, 0.1)
    for axis in range(3):
        f.x[X_FORCE + axis] = 0.0
        f.x[X_VELOCITY + axis] = 0.0
        f.P[ATTITUDE + axis, ATTITUDE + axis] += 0.01**2


@kernel
def bump(f: Filter) -> None:
    """Something low was hit, which the accelerometer's gate took for an outlier: the velocity has changed.

    Left with the velocity that it had before the touch-down, the filter would refuse what GPS says of it.
    """
    m, squares = f.m, 0.0
    for axis in range(3):
        squares += m.innovation[ACCELEROMETER, axis] ** 2
    change = min(squares * f.p.period**2, HARDEST_BUMP**2)
    for axis in range(3):
        f.P[VELOCITY + axis, VELOCITY + axis] += change
        f.P[LOAD_VELOCITY + axis, LOAD_VELOCITY + axis] += change
        f.P[VELOCITY + axis, LOAD_VELOCITY + axis] -= change
        f.P[LOAD_VELOCITY + axis, VELOCITY + axis] -= change


@kernel
def doubt(f: Filter) -> None:
    """The accelerometer and the model have parted: a force acts that is not known, or the load is elsewhere.

    Which of them the next samples show; a load that was put where everything that pulls points would be
    metres off whenever it was the wind, or a rotor that is weaker than its command.
    """
    m, p, cov = f.m, f.p, f.P
    squares = 0.0
    for axis in range(3):
        squares += m.innovation[ACCELEROMETER, axis] ** 2
    for axis in range(3):
        cov[FORCE + axis, FORCE + axis] += squares
        if m.load_mode == LOAD_ON_CABLE:
            cov[LOAD + axis, LOAD + axis] += (DOUBT * p.rest_length) ** 2
            cov[LOAD_VELOCITY + axis, LOAD_VELOCITY + axis] += DOUBTED_SPEED**2


LOST_ACCELERATION = 1.0
"""Of gravity: what a vehicle that nothing was heard of may have had, its rotors stopped by then."""
LOST_RATE = 0.3
"""rad/s, at which it may have turned meanwhile"""


@kernel
def lose_track(f: Filter, gap: float) -> None:
    """Nothing was heard for `gap` seconds: vehicle and load may be anywhere that a fall could take them."""
    m, p, cov = f.m, f.p, f.P
    if m.vehicle_mode != FLYING:
        return
    for sensor in (GPS_POSITION, GPS_VELOCITY):
        # No outage of GPS, whose correction would reach the law by and by: of a fall it has to know at once.
        m.last_used[sensor] = min(m.time, m.last_used[sensor] + gap)
    speed = LOST_ACCELERATION * p.gravity * gap
    way = 0.5 * speed * gap
    apart = min(way, 0.5 * p.rest_length)
    for axis in range(3):
        place, velocity = POSITION + axis, VELOCITY + axis
        cov[place, place] += way * way
        cov[velocity, velocity] += speed * speed
        cov[place, velocity] += way * speed
        cov[velocity, place] += way * speed
        cov[ATTITUDE + axis, ATTITUDE + axis] += (LOST_RATE * gap) ** 2
        if m.load_mode == LOAD_ON_CABLE:
            cov[LOAD + axis, LOAD + axis] += apart * apart
            cov[LOAD_VELOCITY + axis, LOAD_VELOCITY + axis] += (apart / gap) ** 2


@kernel
def place_load(f: Filter, pull: float) -> None:
    """Put the load where the measured pull points, with an honest uncertainty; `pull`: its size in N."""
    p, m, x = f.p, f.m, f.x
    m.load_resets += 1
    length = math.sqrt(x[X_LOAD] ** 2 + x[X_LOAD + 1] ** 2 + x[X_LOAD + 2] ** 2)
    across = along = 0.15 * p.rest_length
    if pull > 0.2 * p.load_mass * p.gravity:
        length = p.rest_length + pull / p.stiffness
        for axis in range(3):
            x[X_LOAD + axis] = m.pull[axis] / pull * length
            x[X_LOAD_VELOCITY + axis] = 0.0
        along = STRETCH_STD * p.rest_length
    elif length > p.rest_length and not p.two_way:
        for axis in range(3):
            x[X_LOAD + axis] *= 0.98 * p.rest_length / length
    set_part(f, LOAD, 3, across)
    for i in range(3):
        for j in range(3):
            part = x[X_LOAD + i] * x[X_LOAD + j] / (length * length)
            f.P[LOAD + i, LOAD + j] += (along * along - across * across) * part
    set_part(f, LOAD_VELOCITY, 3, 1.5)
    for axis in range(3):
        x[X_FORCE + axis] = 0.0  # all that pulls has been taken for the cable
    set_part(f, FORCE, 3, p.force_std)


@kernel
def release(f: Filter) -> None:
    """The load is gone: nothing pulls any more, and nothing is known of it."""
    f.m.load_mode = LOAD_RELEASED
    length = f.p.rest_length + f.p.load_mass * f.p.gravity / f.p.stiffness
    for axis in range(3):
        f.x[X_LOAD + axis] = -length if axis == 2 else 0.0
        f.x[X_LOAD_VELOCITY + axis] = 0.0
    set_part(f, LOAD, 3, length)
    set_part(f, LOAD_VELOCITY, 3, 1.0)
