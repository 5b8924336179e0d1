"""An inertial sensor that is wrong from one sample to the next: then its bias is what is not known.

A moment changes rates over several samples, a cable changes the force along itself, and a bias wanders over
minutes. An innovation that comes at once, not along the cable, and stays as it came is the sensor's. The
filter then gives the bias the variance of the step; what the other sensors say afterwards divides it between
the bias and the motion.
"""

from __future__ import annotations

import math

from controller.estimator.predict.rotation import matrix
from controller.estimator.records import (
    ACCEL_BIAS,
    ACCELEROMETER,
    FLYING,
    GYRO_BIAS,
    GYROSCOPE,
    LOAD_ON_CABLE,
    X_LOAD,
    Filter,
)
from sitl_bridge.compiled import kernel

LASTING = 2
"""Gyroscope samples in a row that have to be refused."""
STEP_OF_RATE = 10.0
"""Standard deviations of a gyroscope sample, of the three axes together, that a step has at least."""
ALIKE = 0.35
"""Share of a step by which innovations before may differ from nothing, later ones and the jump of the
sample itself from the first: where the model is late, the innovation jumps and the sample does not."""
STEP_OF_FORCE = 30.0
"""Normalised innovation squared of the accelerometer's three axes, chi-square: by chance one in 700,000."""
USUAL_FORCE = 20.0
"""The same, of the sample before: by chance one in 6,000."""
LARGEST_FORCE = 4.0
"""m/s², of an axis; more is a blow."""
ACROSS = 0.5
"""Share of a step of force that has to be across the cable: along it, the cable snatches or snaps."""
TAUT_TIME = 0.5
"""s for which the cable has to have been taut, without another step of force."""

ALONE_TIME = 3.0
"""s after a step of the gyroscope, in which an attitude that went wrong shows in the forces, too."""


@kernel
def note_step_of_rate(f: Filter) -> None:
    """After a gyroscope sample was refused: is it a step, and the same one as in the sample before?"""
    m = f.m
    count = m.rejected_in_row[GYROSCOPE]
    size, before, change, jump = 0.0, 0.0, 0.0, 0.0
    for axis in range(3):
        now = m.innovation[GYROSCOPE, axis]
        if count == 1:
            m.first_refused[axis] = now
            m.first_jump[axis] = m.last_change[GYROSCOPE, axis]
        first = m.first_refused[axis]
        size += first**2
        before += m.last_rate[axis] ** 2
        change += (now - first) ** 2
        jump += (m.first_jump[axis] - first) ** 2
    noise = f.p.sensor_std[GYROSCOPE] ** 2
    like = ALIKE * ALIKE * size + 6.0 * noise
    lasts = count == LASTING and m.vehicle_mode == FLYING and size > STEP_OF_RATE**2 * noise
    if lasts and before < like and change < like and jump < like:
        m.step_time[GYROSCOPE] = m.time
        for axis in range(3):
            bias = GYRO_BIAS + axis
            f.P[bias, bias] += m.innovation[GYROSCOPE, axis] ** 2


@kernel
def note_usual_rate(f: Filter) -> None:
    """Remember the innovation (rad/s) of the gyroscope before it is refused."""
    m = f.m
    if m.rejected_in_row[GYROSCOPE] == 0:
        for axis in range(3):
            m.last_rate[axis] = m.innovation[GYROSCOPE, axis]


@kernel
def note_step_of_force(f: Filter) -> bool:
    """Before an accelerometer sample is taken in: if it is a step, give its bias the step's variance.

    Returns whether it is.
    """
    p, m = f.p, f.m
    squares, size = 0.0, 0.0
    for axis in range(3):
        squares += m.normalised[ACCELEROMETER, axis] ** 2
        size = max(size, abs(m.innovation[ACCELEROMETER, axis]))
    usual, m.last_force_squares = m.last_force_squares < USUAL_FORCE, squares
    steady = m.vehicle_mode == FLYING and m.load_mode == LOAD_ON_CABLE and m.taut_time > TAUT_TIME
    m.taut_time = m.taut_time + p.period if m.tension > 0.0 else 0.0
    if not squares > STEP_OF_FORCE:
        return False
    m.taut_time = 0.0
    alone = m.step_time[GYROSCOPE] == 0.0 or m.time - m.step_time[GYROSCOPE] > ALONE_TIME
    if not (steady and usual and alone and size < LARGEST_FORCE and _across_cable(f)):
        return False
    m.step_time[ACCELEROMETER] = m.time
    m.last_force_squares = 0.0
    for axis in range(3):
        bias = ACCEL_BIAS + axis
        f.P[bias, bias] += m.innovation[ACCELEROMETER, axis] ** 2
    return True


@kernel
def _across_cable(f: Filter) -> bool:
    """Whether enough of the accelerometer's innovation is across the cable."""
    x, m = f.x, f.m
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = matrix(x)
    ex, ey, ez = x[X_LOAD], x[X_LOAD + 1], x[X_LOAD + 2]
    a, b, c = (
        m.innovation[ACCELEROMETER, 0],
        m.innovation[ACCELEROMETER, 1],
        m.innovation[ACCELEROMETER, 2],
    )
    along = a * (r00 * ex + r10 * ey + r20 * ez)
    along += b * (r01 * ex + r11 * ey + r21 * ez)
    along += c * (r02 * ex + r12 * ey + r22 * ez)
    along /= math.sqrt(ex * ex + ey * ey + ez * ez) + 1e-9
    size = a * a + b * b + c * c
    return bool(size - along * along > ACROSS * ACROSS * size)
