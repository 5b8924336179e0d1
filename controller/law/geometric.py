"""The design `geometric`: feedback of errors on R³ x S² x R x SO(3), for a load on an elastic cable.

After Sreenath, Lee, Kumar (CDC 2013): the load's place, the cable's direction q on the sphere, and the
attitude on SO(3), each with an error that is one for large angles, too. As in Goodarzi, Lee, Lee (2015) the
gains of load and cable are those of the linearised equations, here the LQ gains of the sampled and delayed
loop, and the load's error is integrated. The cable's length is a coordinate of its own: l* is what the
tension of the flat motion stretches it to (`flatness`).

    e_p = p - p*, e_v, and the integral of e_p
    e_q = P q*, P = 1 - q q': the cable's direction; its rate's error is q' - (q* x q*') x q
    e_l = l - l*, l' - l*'
    F   = F* + |F*| times the lean that the errors ask for across the cable - (k e) n along it; n = -q
    b_c = F/|F|; R_c is R* turned the shortest way there
    f   = u*_f + F·b - |F*|, b the thrust's axis as it is
    M   = u*_M - k_R e_R - k_W (W - R'R_c W*) + W x I W - W* x I W*

Lagging rotors, delay and anti-windup are those of `control_law`. At hover the two have the same
linearisation, hence the same margins. They differ where angles are large: a swinging cable is not taken for
a stretched one, thrust is given only as far as it points where it should, and no attitude is singular but
the opposite of the wanted one. Of the logged terms the integral's is that of the linear law, and the
proportional one is what is left.
"""

from __future__ import annotations

import math
from typing import Any

from controller.law.control_law import FIRST_ANGLE, FIRST_RATE, count_under_way, deviation, integrate
from controller.law.rotations import cross, dot, from_angles, seen_from, set_frame, swung, turn_between
from controller.law.schedule import schedule
from controller.law.state import STATE_SIZE, WRENCH_SIZE, Array
from controller.law.terms import DELAY, FEEDFORWARD_TERM, INTEGRAL, PROPORTIONAL
from sitl_bridge.compiled import kernel

LEAST_LENGTH = 1e-3
"""m, below which a cable has no direction, and the reference's is taken."""
LEAST_FORCE = 0.2
"""Of the reference's force, along it, below which no error takes the commanded one."""


@kernel
def _cable_errors(estimate: Array, work: Any) -> None:
    """Deviations of places and velocities, work.deviation[:12]: two across the cable, one along it.

    Sets the frame: its third axis is n, from load to vehicle.
    """
    wanted, lines, frame = work.desired, work.lines, work.frame
    n, away, rate, turning = lines[0], lines[1], lines[2], lines[3]
    length, planned = 0.0, 0.0
    for i in range(3):
        n[i], away[i] = estimate[i] - estimate[3 + i], wanted[i] - wanted[3 + i]
        length, planned = length + n[i] * n[i], planned + away[i] * away[i]
    length, planned = math.sqrt(length), math.sqrt(planned)
    taut = length > LEAST_LENGTH
    for i in range(3):
        away[i] /= planned
        n[i] = n[i] / length if taut else away[i]
        rate[i] = wanted[6 + i] - wanted[9 + i]  # of planned·away
    lengthening, planned_lengthening = 0.0, dot(rate, away)
    for i in range(3):
        lengthening += (estimate[6 + i] - estimate[9 + i]) * n[i]
        rate[i] -= planned_lengthening * away[i]  # planned·n*'
    # (n* x n*') x n: the reference's turn, carried over to where the cable is.
    cross(away, rate, turning)
    cross(turning, n, rate)
    set_frame(work.heading, n, frame)
    for axis in range(2):
        place, speed, load_place, load_speed = 0.0, 0.0, 0.0, 0.0
        for i in range(3):
            across = frame[axis, i]
            load_place += across * (estimate[3 + i] - wanted[3 + i])
            load_speed += across * (estimate[9 + i] - wanted[9 + i])
            place -= across * planned * away[i]
            speed += across * (estimate[6 + i] - estimate[9 + i] - rate[i] - planned_lengthening * away[i])
        work.deviation[3 + axis], work.deviation[9 + axis] = load_place, load_speed
        work.deviation[axis], work.deviation[6 + axis] = load_place + place, load_speed + speed
    height, climb = 0.0, 0.0
    for i in range(3):
        height += n[i] * (estimate[3 + i] - wanted[3 + i])
        climb += n[i] * (estimate[9 + i] - wanted[9 + i])
    work.deviation[5], work.deviation[11] = height, climb
    work.deviation[2], work.deviation[8] = (
        height + length - planned,
        climb + lengthening - planned_lengthening,
    )


@kernel
def _asked(design: Any, work: Any, k: int) -> float:
    """What places, velocities and the integral ask of an input."""
    out = 0.0
    for i in range(FIRST_RATE):
        out -= work.gains.state_gain[k, i] * work.deviation[i]
    for i in range(3):
        out -= work.gains.integral_gain[k, i] * work.integral[i]
    return out


@kernel
def _commanded_direction(design: Any, work: Any, direction: Array) -> float:
    """The unit vector (3,) along F, with what exceeds the largest lean in work.held_back; returns |F|."""
    frame, turns, force = work.frame, work.turns, work.stencil.force[2]
    size = math.sqrt(dot(force, force))
    along = _asked(design, work, 0)
    # A moment about y that tilts the thrust by pitch leans it to x; one about x leans it to -y.
    lean_x = _asked(design, work, 2) / work.gains.state_gain[2, FIRST_ANGLE + 1]
    lean_y = -_asked(design, work, 1) / work.gains.state_gain[1, FIRST_ANGLE]
    forward = 0.0
    for i in range(3):
        direction[i] = (
            size * (turns[1, i, 2] + frame[0, i] * lean_x + frame[1, i] * lean_y) + along * frame[2, i]
        )
        forward += direction[i] * turns[1, i, 2]
    sideways = 0.0
    for i in range(3):
        direction[i] -= forward * turns[1, i, 2]
        sideways += direction[i] * direction[i]
    forward = max(forward, LEAST_FORCE * size)
    room = forward * math.tan(design.largest_lean)
    sideways = math.sqrt(sideways)
    share = room / sideways if sideways > room else 1.0
    work.held_back[0] = (share - 1.0) * lean_y * work.gains.state_gain[1, FIRST_ANGLE]
    work.held_back[1] = (1.0 - share) * lean_x * work.gains.state_gain[2, FIRST_ANGLE + 1]
    commanded = math.sqrt(forward * forward + (share * sideways) ** 2)
    for i in range(3):
        direction[i] = (share * direction[i] + forward * turns[1, i, 2]) / commanded
    return commanded


@kernel
def _turning_moment(inertia: Array, rates: Array, out: Array) -> None:
    """W x I W, N m."""
    x, y, z = rates[0], rates[1], rates[2]
    out[0] = (inertia[2] - inertia[1]) * y * z
    out[1] = (inertia[0] - inertia[2]) * z * x
    out[2] = (inertia[1] - inertia[0]) * x * y


@kernel
def geometric_step(design: Any, memory: Any, path: Any, estimate: Array, work: Any) -> None:
    """One step: work.wrench = u for this estimate (18,), eq. 31; integrates the load's error into memory."""
    deviation(design, memory, path, memory.ticks * design.period, estimate, work)
    _cable_errors(estimate, work)
    schedule(design, work)
    integrate(design, memory, estimate, work)
    actual, planned, commanded = work.turns[0], work.turns[1], work.turns[2]
    from_angles(estimate[15], estimate[16], estimate[17], actual)
    from_angles(work.desired[15], work.desired[16], work.desired[17], planned)
    direction, rates, gyro = work.lines[0], work.lines[2], work.lines[3]
    force = _commanded_direction(design, work, direction)
    swung(planned, direction, commanded)
    turn_between(commanded, actual, work.deviation[FIRST_ANGLE:STATE_SIZE])
    seen_from(actual, commanded, work.desired[FIRST_RATE:FIRST_ANGLE], rates)
    for i in range(3):
        work.deviation[FIRST_RATE + i] = estimate[FIRST_RATE + i] - rates[i]
    projected = 0.0
    for i in range(3):
        projected += force * direction[i] * actual[i, 2]
    reference = work.stencil.force[2]
    for k in range(WRENCH_SIZE):
        work.wrench[k] = work.feedforward[k]
    count_under_way(design, memory, work)
    work.wrench[0] += projected - math.sqrt(dot(reference, reference))
    for k in range(1, WRENCH_SIZE):
        for i in range(FIRST_RATE, STATE_SIZE):
            work.wrench[k] -= work.gains.state_gain[k, i] * work.deviation[i]
    _turning_moment(design.body.inertia, estimate[FIRST_RATE:FIRST_ANGLE], gyro)
    for i in range(3):
        work.wrench[1 + i] += gyro[i]
    _turning_moment(design.body.inertia, work.desired[FIRST_RATE:FIRST_ANGLE], gyro)
    for i in range(3):
        work.wrench[1 + i] -= gyro[i]
    for k in range(WRENCH_SIZE):
        terms = work.terms
        terms[FEEDFORWARD_TERM, k], terms[INTEGRAL, k] = work.feedforward[k], 0.0
        for i in range(3):
            terms[INTEGRAL, k] -= work.gains.integral_gain[k, i] * work.integral[i]
        asked = work.wrench[k] + (work.held_back[k - 1] if k == 1 or k == 2 else 0.0)
        terms[PROPORTIONAL, k] = asked - terms[FEEDFORWARD_TERM, k] - terms[INTEGRAL, k] - terms[DELAY, k]
