"""Equations of motion of vehicle and load (eqs. 3 and 10), and the integrator that advances them.

Compiled; pure functions of their arguments, except that results are written into arrays that the caller
gives, so that a step allocates nothing.

One step of h seconds: rotor speeds at its start, middle and end from the exact solution of their lag; classic
Runge-Kutta on the state with the cable held taut or slack; where the cable changes over within the step,
the step is split there; then contacts slip that have to, and an overloaded cable breaks.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sitl_bridge.compiled import Buffer, entry_point, kernel
from sitl_bridge.plant.physics.air import drag_force
from sitl_bridge.plant.physics.cables.cable import (
    break_overloaded,
    goes_slack,
    is_taut,
    taut_force,
    taut_margin_of,
    tension_of,
)
from sitl_bridge.plant.physics.cables.flexible_cable import LINEAR, flexible_cable
from sitl_bridge.plant.physics.cables.hoist import (
    begin_reeling,
    end_reeling,
    hoist_rests,
    take_hoist_commands,
    work_gripper,
)
from sitl_bridge.plant.physics.ground import LOOSE, ground_on_load, ground_on_vehicle, move_anchors
from sitl_bridge.plant.physics.parameters import PARAMETERS
from sitl_bridge.plant.physics.rotors import rotor_decay, rotor_wrench, spin_up
from sitl_bridge.plant.physics.state import (
    ANGULAR_ACCELERATION,
    CABLE_HOLDS,
    CABLE_STATE,
    INNER_SIZE,
    LOAD_GROUND_FORCE,
    MOST_CABLE_STATES,
    MOST_ROTORS,
    STATE_SIZE,
    TENSION,
    VEHICLE_GROUND_FORCE,
    Array,
)

WORK_ROWS = 12
WORK_SHAPE = (WORK_ROWS, STATE_SIZE + MOST_CABLE_STATES)
"""Rows of the scratch array: 0 to 4 Runge-Kutta, 5 ground, 6 state at the start of the step, 7 decays, 8 to
10 rotor speeds in the middle and at the end of a step, and at the start of a split one, 11 forces on the
bodies with those of a flexible cable. Its states follow those of the bodies."""
_GROUND, _START, _DECAY, _MIDDLE, _END, _SPLIT, _ACTING = 5, 6, 7, 8, 9, 10, 11
_PROBE = 4
_FIRST_ANGULAR: int = ANGULAR_ACCELERATION.start


@kernel
def state_derivative(
    p: Any,
    x: Array,
    inner: Array,
    wrench: tuple[float, float, float, float],
    cable_taut: bool,
    force: Array,
    wind: Array,
    ground: Array,
    out: Array,
) -> None:
    """Time derivative of the state.

    p: parameter record; x: state (19,), see `state`; inner: inner state (149,), of which anchors are read;
    wrench: of the rotors; cable_taut: whether the cable exerts its force; force: (6,) external force on
    vehicle and on load, N, world; wind: (6,) air velocity at vehicle and at load, m/s, world; ground: (7,) or
    more, scratch; out: (19,), written.
    """
    vx, vy, vz = x[3], x[4], x[5]
    qw, qx, qy, qz = x[6], x[7], x[8], x[9]
    rate_p, rate_q, rate_r = x[10], x[11], x[12]
    wx, wy, wz = x[16], x[17], x[18]
    thrust, roll, pitch, yaw = wrench

    # Forces on vehicle and load: the body's z axis in the world carries the thrust (eqs. 3 and 7).
    force_x = force[0] + 2.0 * (qx * qz + qw * qy) * thrust
    force_y = force[1] + 2.0 * (qy * qz - qw * qx) * thrust
    force_z = force[2] + (1.0 - 2.0 * (qx * qx + qy * qy)) * thrust
    load_x, load_y, load_z = force[3], force[4], force[5]
    if cable_taut:
        cx, cy, cz = taut_force(p, x)
        force_x, force_y, force_z = force_x + cx, force_y + cy, force_z + cz
        load_x, load_y, load_z = load_x - cx, load_y - cy, load_z - cz
    if p.has_drag:
        dx, dy, dz = drag_force(p.vehicle_drag[0], p.vehicle_drag[1], vx, vy, vz, wind[0], wind[1], wind[2])
        force_x, force_y, force_z = force_x + dx, force_y + dy, force_z + dz
        dx, dy, dz = drag_force(p.load_drag[0], p.load_drag[1], wx, wy, wz, wind[3], wind[4], wind[5])
        load_x, load_y, load_z = load_x + dx, load_y + dy, load_z + dz
    if p.has_ground:
        if x[2].real - p.ground_height < p.leg_reach:
            ground_on_vehicle(p, x, inner, ground)
            force_x, force_y, force_z = force_x + ground[0], force_y + ground[1], force_z + ground[2]
            roll, pitch, yaw = roll + ground[3], pitch + ground[4], yaw + ground[5]
        if x[15].real - p.ground_height < p.load_radius:
            gx, gy, gz = ground_on_load(p, x, inner)
            load_x, load_y, load_z = load_x + gx, load_y + gy, load_z + gz
    # Translation.
    lightness = 1.0 / p.vehicle_mass
    out[0], out[1], out[2] = vx, vy, vz
    out[3], out[4], out[5] = force_x * lightness, force_y * lightness, force_z * lightness - p.gravity
    lightness = 1.0 / p.load_mass
    out[13], out[14], out[15] = wx, wy, wz
    out[16], out[17], out[18] = load_x * lightness, load_y * lightness, load_z * lightness - p.gravity
    # Attitude: q' = q (0, p, q, r) / 2.
    out[6] = -0.5 * (qx * rate_p + qy * rate_q + qz * rate_r)
    out[7] = 0.5 * (qw * rate_p + qy * rate_r - qz * rate_q)
    out[8] = 0.5 * (qw * rate_q + qz * rate_p - qx * rate_r)
    out[9] = 0.5 * (qw * rate_r + qx * rate_q - qy * rate_p)
    # Rotation (eq. 10).
    inertia_x, inertia_y, inertia_z = p.inertia[0], p.inertia[1], p.inertia[2]
    out[10] = (roll - (inertia_z - inertia_y) * rate_q * rate_r) / inertia_x
    out[11] = (pitch - (inertia_x - inertia_z) * rate_p * rate_r) / inertia_y
    out[12] = (yaw - (inertia_y - inertia_x) * rate_p * rate_q) / inertia_z


@kernel
def runge_kutta_4(
    p: Any,
    x: Array,
    inner: Array,
    cable_taut: bool,
    force: Array,
    wind: Array,
    step: float,
    work: Array,
) -> None:
    """Advance the state by one step of the classic fourth-order Runge-Kutta method, in place.

    Rotor speeds at the start are those of `inner`, those in the middle and at the end are in `work`.
    step: s; work: scratch. The quaternion is brought back to unit length afterwards.
    """
    k1, k2, k3, k4, probe, ground = work[0], work[1], work[2], work[3], work[_PROBE], work[_GROUND]
    half, sixth = 0.5 * step, step / 6.0
    end = rotor_wrench(p, work[_END])
    start = middle = end
    if p.has_lag:
        start, middle = rotor_wrench(p, inner), rotor_wrench(p, work[_MIDDLE])
    for i in range(STATE_SIZE):
        probe[i] = x[i]
    for i in range(p.cable_states):
        probe[STATE_SIZE + i] = inner[CABLE_STATE + i]
    acting = work[_ACTING]
    for i in range(6):
        acting[i] = force[i]
    # One call for all four stages, so that the compiler can put `state_derivative` in its place.
    for stage in range(4):
        rate = work[stage]
        wrench = start if stage == 0 else middle
        if stage == 3:
            wrench = end
        if p.cable_kind != LINEAR:
            flexible_cable(p, probe, inner[CABLE_HOLDS] > 0.0, force, wind, rate, acting)
        state_derivative(p, probe, inner, wrench, cable_taut, acting, wind, ground, rate)
        ahead = step if stage == 2 else half
        for i in range(STATE_SIZE):
            probe[i] = x[i] + ahead * rate[i]
        for i in range(p.cable_states):
            probe[STATE_SIZE + i] = inner[CABLE_STATE + i] + ahead * rate[STATE_SIZE + i]
    for i in range(STATE_SIZE):
        x[i] += sixth * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i])
    for i in range(STATE_SIZE, STATE_SIZE + p.cable_states):
        inner[CABLE_STATE - STATE_SIZE + i] += sixth * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i])
    norm = math.sqrt(x[6] * x[6] + x[7] * x[7] + x[8] * x[8] + x[9] * x[9])
    for i in range(6, 10):
        x[i] /= norm


@kernel
def partial_step(
    p: Any,
    x: Array,
    inner: Array,
    command: Array,
    cable_taut: bool,
    force: Array,
    wind: Array,
    step: float,
    work: Array,
) -> None:
    """Runge-Kutta step of any length from the state saved in `work`, with the rotors' lag worked out for it.

    Leaves the rotor speeds at its end in `work`.
    """
    for i in range(STATE_SIZE):
        x[i] = work[_START, i]
    rotor_decay(p, 0.5 * step, work[_SPLIT])
    spin_up(p, inner, command, work[_SPLIT], work[_MIDDLE])
    spin_up(p, work[_MIDDLE], command, work[_SPLIT], work[_END])
    runge_kutta_4(p, x, inner, cable_taut, force, wind, step, work)


MOST_CHANGES = 4
"""Changes of the cable between slack and taut that one step looks for; a mode of the cable takes ten
steps."""


@kernel
def split_step(
    p: Any,
    x: Array,
    inner: Array,
    command: Array,
    cable_taut: bool,
    force: Array,
    wind: Array,
    step: float,
    work: Array,
) -> None:
    """Repeat, from the state saved in `work`, a step in which the cable goes slack or taut, split where it
    does.

    The instant is found by false position (Illinois) to 1e-12 of a second, from the side past the change.
    """
    left = step
    sign = 1.0 if cable_taut else -1.0
    for _ in range(MOST_CHANGES):
        before, after = 0.0, left
        for i in range(STATE_SIZE):
            x[i] = work[_START, i]
        value_before = sign * taut_margin_of(p, x)
        partial_step(p, x, inner, command, cable_taut, force, wind, left, work)
        value_after = sign * taut_margin_of(p, x)
        if value_after > 0.0:
            break  # no change in what is left of the step: done
        for _ in range(60):
            if after - before <= 1e-12:
                break
            middle = 0.5 * (before + after)
            if value_before > value_after:
                guess = before + (after - before) * value_before / (value_before - value_after)
                if before < guess < after:
                    middle = guess
            partial_step(p, x, inner, command, cable_taut, force, wind, middle, work)
            value = sign * taut_margin_of(p, x)
            if value > 0.0:
                before, value_before = middle, value
                value_after *= 0.5
            else:
                after, value_after = middle, value
                value_before *= 0.5
        partial_step(p, x, inner, command, cable_taut, force, wind, after, work)
        for i in range(p.rotor_count):
            inner[i] = work[_END, i]
        for i in range(STATE_SIZE):
            work[_START, i] = x[i]
        left -= after
        sign, cable_taut = -sign, not cable_taut
        if left <= 0.0:
            break
    else:
        partial_step(p, x, inner, command, cable_taut, force, wind, left, work)
    for i in range(p.rotor_count):
        inner[i] = work[_END, i]


@kernel
def whole_step(
    p: Any, x: Array, inner: Array, command: Array, force: Array, wind: Array, step: float, work: Array
) -> None:
    """Advance state and inner state by one step, in place; the decays of half a step are in `work`."""
    work[_GROUND, LOOSE] = 0.0
    cable_taut = is_taut(p, x, inner)
    watched = goes_slack(p, inner)
    if watched:
        for i in range(STATE_SIZE):
            work[_START, i] = x[i]
    spin_up(p, inner, command, work[_DECAY], work[_MIDDLE])
    spin_up(p, work[_MIDDLE], command, work[_DECAY], work[_END])
    runge_kutta_4(p, x, inner, cable_taut, force, wind, step, work)
    if watched and (taut_margin_of(p, x) > 0.0) != cable_taut:
        split_step(p, x, inner, command, cable_taut, force, wind, step, work)
    else:
        for i in range(p.rotor_count):
            inner[i] = work[_END, i]
    if p.has_ground:
        move_anchors(p, x, inner, work[_GROUND, LOOSE] > 0.0)
    if p.breaking_tension < math.inf:
        break_overloaded(p, x, inner)


@kernel
def fill_reactions(
    p: Any, x: Array, inner: Array, force: Array, wind: Array, work: Array, reactions: Array
) -> None:
    """What acts on the bodies in this state, see `state` for the elements of `reactions` (9,), written."""
    rate = work[0]
    cable_taut = is_taut(p, x, inner)
    acting = work[_ACTING]
    for i in range(6):
        acting[i] = force[i]
    if p.cable_kind != LINEAR:
        probe = work[_PROBE]
        for i in range(STATE_SIZE):
            probe[i] = x[i]
        for i in range(p.cable_states):
            probe[STATE_SIZE + i] = inner[CABLE_STATE + i]
        flexible_cable(p, probe, inner[CABLE_HOLDS] > 0.0, force, wind, rate, acting)
    state_derivative(p, x, inner, rotor_wrench(p, inner), cable_taut, acting, wind, work[_GROUND], rate)
    qw, qx, qy, qz = x[6], x[7], x[8], x[9]
    ax, ay, az = rate[3], rate[4], rate[5] + p.gravity
    reactions[0] = (
        (1 - 2 * (qy * qy + qz * qz)) * ax + 2 * (qx * qy + qw * qz) * ay + 2 * (qx * qz - qw * qy) * az
    )
    reactions[1] = (
        2 * (qx * qy - qw * qz) * ax + (1 - 2 * (qx * qx + qz * qz)) * ay + 2 * (qy * qz + qw * qx) * az
    )
    reactions[2] = (
        2 * (qx * qz + qw * qy) * ax + 2 * (qy * qz - qw * qx) * ay + (1 - 2 * (qx * qx + qy * qy)) * az
    )
    for i in range(3):
        reactions[_FIRST_ANGULAR + i] = rate[10 + i]
    reactions[TENSION] = tension_of(p, x, inner)
    reactions[VEHICLE_GROUND_FORCE] = 0.0
    reactions[LOAD_GROUND_FORCE] = 0.0
    if p.has_ground:
        if x[2] - p.ground_height < p.leg_reach:
            ground_on_vehicle(p, x, inner, work[_GROUND])
            reactions[VEHICLE_GROUND_FORCE] = work[_GROUND, 2]
        _, _, reactions[LOAD_GROUND_FORCE] = ground_on_load(p, x, inner)


TABLE_ROWS = 1024
"""Rows of the tables of held forces and winds that `advance` reads."""


@entry_point(
    Buffer(PARAMETERS, (1,)),
    Buffer(np.float64, (STATE_SIZE,)),
    Buffer(np.float64, (INNER_SIZE,)),
    Buffer(np.float64, (MOST_ROTORS,)),
    Buffer(np.float64, (TABLE_ROWS, 6)),
    Buffer(np.float64, (TABLE_ROWS, 6)),
    Buffer(np.float64, WORK_SHAPE),
    int,
    int,
    int,
    int,
    int,
    float,
)
def advance(
    record: Any,
    x: Array,
    inner: Array,
    command: Array,
    forces: Array,
    winds: Array,
    work: Array,
    first_force: int,
    first_wind: int,
    force_hold: int,
    wind_hold: int,
    steps: int,
    step: float,
) -> int:
    """Advance state and inner state by `steps` steps of `step` seconds with the commands held, in place.

    command: rotor speeds, rad/s; forces: N, world, on vehicle and load, row k acts from step k·force_hold on;
    winds: m/s, world, at vehicle and load, row k from step k·wind_hold on; work: scratch; first_force,
    first_wind: number of the first step, counted from row 0 of each table.
    """
    p = record[0]
    rotor_decay(p, 0.5 * step, work[_DECAY])
    force_row, force_age = first_force // force_hold, first_force % force_hold
    wind_row, wind_age = first_wind // wind_hold, first_wind % wind_hold
    hoist_works = p.has_hoist and not hoist_rests(p)
    for _ in range(steps):
        if hoist_works:
            begin_reeling(p, x, inner, step)
        whole_step(p, x, inner, command, forces[force_row], winds[wind_row], step, work)
        if hoist_works:
            end_reeling(p, step)
            work_gripper(p, x, inner, step)
        force_age, wind_age = force_age + 1, wind_age + 1
        if force_age == force_hold:
            force_row, force_age = force_row + 1, 0
        if wind_age == wind_hold:
            wind_row, wind_age = wind_row + 1, 0
    return steps


@kernel
def derivative(p: Any, x: Array, rotor_speed: Array, force: Array, out: Array) -> None:
    """Time derivative of the state in still air off the ground, the rotors at these speeds.

    p: parameter record; x: state (19,); rotor_speed: (n,) in rad/s; force: (6,), N, world; out: (19,),
    written. Real parts decide whether the cable is taut, so that it can be differentiated with complex
    numbers.
    """
    taut = p.two_way or taut_margin_of(p, x.real) > 0.0
    anchored = np.zeros(INNER_SIZE)
    state_derivative(p, x, anchored, rotor_wrench(p, rotor_speed), taut, force, np.zeros(6), np.zeros(7), out)


@entry_point(
    Buffer(PARAMETERS, (1,)),
    Buffer(np.float64, (MOST_ROTORS,)),
    Buffer(np.float64, (MOST_ROTORS,)),
    Buffer(np.float64, (MOST_ROTORS,)),
)
def set_rotors(record: Any, controls: Array, speed_share: Array, rotor_speed: Array) -> int:
    """Commanded rotor speeds (n,), rad/s, from controls of 0..1; what is not finite means stopped.

    Controls after the rotors' are for gripper and winch, see `hoist`.

    speed_share: what each rotor gives of its commanded speed, 1 for a sound one.
    """
    for i in range(MOST_ROTORS):
        control = controls[i]
        within = min(max(control, 0.0), 1.0) if math.isfinite(control) else 0.0
        rotor_speed[i] = within * record[0].max_speed[i] * speed_share[i]
    if record[0].has_hoist:
        take_hoist_commands(record[0], controls)
    return 0
