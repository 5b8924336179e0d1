"""The control law: integral LQR on the load's position (or the vehicle's, alone), one pure step.

u = u* - K·[x - x*; v] - sum of K_past·(u_past - u*_past), v = the integral of (p_p - p_ref): eqs. 54 to 56,
corrected, with the loop's delay; where rotors lag, also - K_lag·(what they give now - u*). It knows nothing
of HIL: an estimate and a reference go in, thrust and moments come out.

The reference enters through the integrator alone, x* staying where the vehicle was when the law was engaged
(the paper's integral LQR: with a raw step that moved x* it would diverge), as a feasible motion that moves x*
and u*, or, without an integrator, as x* itself.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from controller.law.adaptation import ADAPTATION, adapted
from controller.law.flatness import BODY, STENCIL, flat_motion
from controller.law.reference import path_derivatives
from controller.law.rotations import into, out_of, set_frame
from controller.law.schedule import GAINS, SIZED, SOFT, schedule
from controller.law.state import (
    BODY_RATES,
    EULER_ANGLES,
    LONGEST_DELAY,
    STATE_SIZE,
    WRENCH_SIZE,
    Array,
)
from controller.law.terms import DELAY, FEEDFORWARD_TERM, INTEGRAL, PROPORTIONAL, SATURATED, TERMS
from sitl_bridge.compiled import kernel
from sitl_bridge.ids import ACTUATOR_CONTROLS

FIRST_RATE, FIRST_ANGLE = BODY_RATES.start, EULER_ANGLES.start
"""Indices of the state."""
INTEGRATOR, FEEDFORWARD, STATE = 0, 1, 2
"""How the reference enters: through the integrator alone, as a feasible motion, or as x* itself."""

DESIGN = np.dtype(
    [
        ("entry", "i8"),
        ("controlled", "i8"),  # where in the state the position is that the reference is for: load or vehicle
        ("period", "f8"),  # s
        ("state_gain", "f8", (WRENCH_SIZE, STATE_SIZE)),
        ("lag_gain", "f8", (WRENCH_SIZE, WRENCH_SIZE)),  # on the wrench that lagging rotors give
        ("integral_gain", "f8", (WRENCH_SIZE, 3)),
        ("past_gain", "f8", (LONGEST_DELAY, WRENCH_SIZE, WRENCH_SIZE)),
        ("delay", "i8"),  # ticks
        ("lead_time", "f8"),  # s from a command to the middle of its effect, the rotors' lag not counted
        ("rotor_lag", "f8"),  # s
        ("lag_decay", "f8"),  # share of the rotors' lag that is left after a period
        ("anti_windup", "f8", (3, WRENCH_SIZE)),
        ("largest_lean", "f8"),  # rad, that everything but tilt and rates may ask for; 0: no limit
        ("hover_state", "f8", STATE_SIZE),  # hover with the load at the origin
        ("hover_wrench", "f8", WRENCH_SIZE),
        ("geometric", "i8"),  # 1: the errors are those of `geometric`, with the same gains
        ("soft", SOFT),  # the gains far from the reference, see `schedule`
        ("adapts", "i8"),  # 1: it finds out what the description gets wrong
        ("body", BODY),
    ]
)

MEMORY = np.dtype(
    [
        ("integral", "f8", 3),  # v, m s
        ("last_error", "f8", 3),  # m, of the tick before
        ("anchor", "f8", 3),  # m, where the load was when the law was engaged
        ("past", "f8", (LONGEST_DELAY, WRENCH_SIZE)),  # deviations from u*, newest first
        ("rotors", "f8", WRENCH_SIZE),  # deviation that lagging rotors give now
        ("ticks", "i8"),  # steps since the law was engaged
        ("adaptation", ADAPTATION),
    ]
)

WORK = np.dtype(
    [
        ("reference", "f8", 3),  # p_ref, m
        ("deviation", "f8", STATE_SIZE),  # x - x*
        ("desired", "f8", STATE_SIZE),  # x*
        ("integral", "f8", 3),  # v, m s, in the frame
        ("feedforward", "f8", WRENCH_SIZE),  # u*
        ("wrench", "f8", WRENCH_SIZE),  # u, as the law wants it
        ("held_back", "f8", 2),  # of the moments about x and y, N m: what would lean beyond the limit
        ("achieved", "f8", WRENCH_SIZE),  # what the limited rotors give of it
        ("terms", "f8", (len(TERMS), WRENCH_SIZE)),  # what `achieved` is the sum of
        ("rotors", "f8", (2, ACTUATOR_CONTROLS)),
        ("heading", "f8", 2),  # cosine and sine of the reference's yaw
        ("frame", "f8", (3, 3)),  # rows: x, y, z axes, in the world, of the model that the gains are for
        ("lines", "f8", (4, 3)),  # vectors of the world and the body
        ("turns", "f8", (3, 3, 3)),  # attitudes: as it is, of the reference, as commanded
        ("moving", "f8", SIZED),  # the reference's own motion, as a deviation
        ("gains", GAINS),  # for deviation and motion
        ("integral_rate", "f8", 3),  # at which it is built up, over the usual one
        ("body", BODY),  # with what was found of it
        ("stencil", STENCIL),
    ]
)
"""Scratch and results of one step."""

Design = NDArray[np.void]
Memory = NDArray[np.void]
Work = NDArray[np.void]
Law = tuple[Design, NDArray[np.void], NDArray[np.void], Memory, Work]
"""A law in flight: design, allocation, reference path, memory and scratch."""


def engaged_memory(load_position: Array) -> Memory:
    """Memory (1,) of a law that takes over now, the load being at `load_position` (m)."""
    memory = np.zeros(1, dtype=MEMORY)
    memory["anchor"] = load_position
    return memory


@kernel
def _thrust_error(desired: Array, estimate: Array, out: Array) -> None:
    """Roll and pitch of the deviation out (18,): the angle (rad) from the thrust of x* (18,) to the thrust.

    A rotation about body axes; at small tilt its parts are the differences of the angles.
    """
    roll, away = desired[15], estimate[16] - desired[16]
    s_roll, c_roll = math.sin(estimate[15]), math.cos(estimate[15])
    about_x = math.cos(roll) * s_roll - math.sin(roll) * math.cos(away) * c_roll
    about_y = math.sin(away) * c_roll
    sine = math.sqrt(about_x**2 + about_y**2)
    cosine = math.sin(roll) * s_roll + math.cos(roll) * math.cos(away) * c_roll
    scale = math.atan2(sine, cosine) / sine if sine > 1e-9 else 1.0
    out[15], out[16] = scale * about_x, scale * about_y


@kernel
def deviation(design: Any, memory: Any, path: Any, t: float, estimate: Array, work: Any) -> None:
    """work.deviation = x - x*, work.feedforward = u*, work.reference = p_ref, at time t (s).

    The model is linear about hover at a yaw of zero: its x axis is the heading, its z axis the vertical.
    Along a circle or a planned profile its z axis is the cable's: an accelerated load hangs in its cable as
    one at rest does, only aslant and heavier. Deviations are turned into that frame. Roll and pitch are
    towards the heading anyway.
    """
    work.heading[0], work.heading[1] = math.cos(path.yaw), math.sin(path.yaw)
    if design.entry == FEEDFORWARD:
        # What is commanded now acts after the delay and the rotors' lag, held for a period.
        adapted(design.body, memory.adaptation, work.body)
        flat_motion(
            work.body,
            path,
            t,
            design.lead_time,
            design.rotor_lag,
            work.heading,
            work.stencil,
            work.desired,
            work.feedforward,
        )
        for axis in range(3):
            work.reference[axis] = work.desired[design.controlled + axis]
    else:
        path_derivatives(path, t, work.stencil.derivatives)
        for i in range(STATE_SIZE):
            work.desired[i] = design.hover_state[i]
        for k in range(WRENCH_SIZE):
            work.feedforward[k] = design.hover_wrench[k]
        for axis in range(3):
            work.reference[axis] = work.stencil.derivatives[0, axis]
            origin = work.reference[axis] if design.entry == STATE else memory.anchor[axis]
            work.desired[axis] += origin
            work.desired[3 + axis] += origin
        work.desired[17] = path.yaw
    for i in range(STATE_SIZE):
        work.deviation[i] = estimate[i] - work.desired[i]
    if design.entry == FEEDFORWARD and (path.pieces > 0 or path.radius > 0.0):
        _thrust_error(work.desired, estimate, work.deviation)
        upward = work.stencil.pull[2] if work.body.load_mass > 0.0 else work.stencil.force[2]
        set_frame(work.heading, upward, work.frame)
    else:
        work.frame[2, 0], work.frame[2, 1], work.frame[2, 2] = 0.0, 0.0, 1.0
        set_frame(work.heading, work.frame[2], work.frame)
    for i in range(0, 12, 3):  # both positions, both velocities
        into(work.frame, work.deviation[i : i + 3])
    yaw = STATE_SIZE - 1
    work.deviation[yaw] -= 2.0 * math.pi * math.floor(work.deviation[yaw] / (2.0 * math.pi) + 0.5)


@kernel
def step(design: Any, memory: Any, path: Any, estimate: Array, work: Any) -> None:
    """One step: work.wrench = u for this estimate (18,), eq. 31; integrates the load's error into memory.

    path: the reference, see `reference`; time runs from the step that engaged the law.
    """
    deviation(design, memory, path, memory.ticks * design.period, estimate, work)
    schedule(design, work)
    integrate(design, memory, estimate, work)
    for k in range(WRENCH_SIZE):
        u = work.feedforward[k]
        work.terms[FEEDFORWARD_TERM, k] = u
        for i in range(STATE_SIZE):
            u -= work.gains.state_gain[k, i] * work.deviation[i]
        work.terms[PROPORTIONAL, k] = u - work.feedforward[k]
        without_integral = u
        for axis in range(3):
            u -= work.gains.integral_gain[k, axis] * work.integral[axis]
        work.terms[INTEGRAL, k] = u - without_integral
        work.wrench[k] = u
    count_under_way(design, memory, work)
    work.held_back[0] = work.held_back[1] = 0.0
    if design.largest_lean > 0.0:
        _limit_lean(design, work)


@kernel
def integrate(design: Any, memory: Any, estimate: Array, work: Any) -> None:
    """The load's error into memory, and into work.integral in the frame; a tick is over."""
    for axis in range(3):
        error = estimate[design.controlled + axis] - work.reference[axis]
        if memory.ticks > 0:  # trapezoidal rule between the samples
            memory.integral[axis] += (
                work.integral_rate[axis] * 0.5 * design.period * (error + memory.last_error[axis])
            )
        memory.last_error[axis] = error
        work.integral[axis] = memory.integral[axis]
    into(work.frame, work.integral)
    memory.ticks += 1


@kernel
def count_under_way(design: Any, memory: Any, work: Any) -> None:
    """Take out of work.wrench what commands and rotors under way are going to do."""
    for k in range(WRENCH_SIZE):
        u = work.wrench[k]
        for j in range(WRENCH_SIZE):
            u -= work.gains.lag_gain[k, j] * memory.rotors[j]
            for age in range(design.delay):
                u -= work.gains.past_gain[age, k, j] * memory.past[age, j]
        work.terms[DELAY, k] = u - work.wrench[k]
        work.wrench[k] = u


@kernel
def _limit_lean(design: Any, work: Any) -> None:
    """Take out of the moments what asks for a lean beyond the limit: for errors that the gains are not for.

    Places, velocities and the integral ask for a lean, which tilt and rates then follow: a cascade, written
    as one gain. The model is linear, and metres of the estimate's error would ask for more than 90 degrees.
    """
    asked = work.held_back
    for axis in range(2):
        k, tilt = 1 + axis, FIRST_ANGLE + axis
        moment = 0.0
        for i in range(FIRST_RATE):
            moment -= work.gains.state_gain[k, i] * work.deviation[i]
        for i in range(3):
            moment -= work.gains.integral_gain[k, i] * work.integral[i]
        asked[axis] = moment / work.gains.state_gain[k, tilt]
    size = math.sqrt(asked[0] ** 2 + asked[1] ** 2)
    beyond = max(0.0, 1.0 - design.largest_lean / size) if size > 0.0 else 0.0
    for axis in range(2):
        k, tilt = 1 + axis, FIRST_ANGLE + axis
        asked[axis] *= beyond * work.gains.state_gain[k, tilt]
        work.wrench[k] -= asked[axis]


@kernel
def remember(design: Any, memory: Any, work: Any) -> None:
    """After allocation: what the rotors really give is remembered, and the integrator does not wind up.

    Anti-windup by back-calculation: the part of u that did not fit is taken out of the integral.
    """
    oldest = design.delay - 1
    for k in range(WRENCH_SIZE):
        under_way = work.achieved[k] - work.feedforward[k]
        acting = memory.past[oldest, k] if design.delay > 0 else under_way
        memory.rotors[k] = design.lag_decay * memory.rotors[k] + (1.0 - design.lag_decay) * acting
        for age in range(LONGEST_DELAY - 1, 0, -1):  # all of it: the delay may be found to be longer
            memory.past[age, k] = memory.past[age - 1, k]
        memory.past[0, k] = under_way
        work.terms[SATURATED, k] = work.achieved[k] - work.wrench[k]
        if k == 1 or k == 2:
            work.terms[SATURATED, k] -= work.held_back[k - 1]
    for axis in range(3):
        for k in range(WRENCH_SIZE):
            work.integral[axis] += work.gains.anti_windup[axis, k] * work.terms[SATURATED, k]
    out_of(work.frame, work.integral)
    for axis in range(3):
        memory.integral[axis] = work.integral[axis]
