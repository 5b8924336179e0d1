"""Gripper and winch: what the actuator controls after the rotors' do to the cable. Compiled.

Each of the controls lasts until the next command; what is not finite commands nothing.

    control after the rotors' | -1                | 0           | +1
    --------------------------+-------------------+-------------+------------------
    gripper                   | release           | as it is    | grab
    winch                     | reel in at `rate` | stand       | pay out at `rate`
    clutch                    | open: spool free  | as it is    | closed

The winch moves the cable's rest length half a step before each step of the integrator, half a step after: the
energy that it brings in is tension times rate, to second order in the step.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from sitl_bridge.compiled import kernel
from sitl_bridge.ids import CLUTCH_CONTROL, GRIPPER_CONTROL, WINCH_CONTROL
from sitl_bridge.plant.physics.cables.cable import span, tension_of
from sitl_bridge.plant.physics.state import CABLE_HOLDS, Array
from sitl_bridge.vehicle.description import Vehicle

HOIST = np.dtype(
    [
        ("has_gripper", "b1"),
        ("has_winch", "b1"),
        ("first_control", "i8"),  # the gripper's
        ("reach", "f8"),  # m
        ("release_time", "f8"),  # s
        ("min_length", "f8"),  # m, of the cable's rest length
        ("max_length", "f8"),
        ("rate", "f8"),  # m/s
        ("time_constant", "f8"),  # s
        ("stall_tension", "f8"),  # N
        ("gripper", "f8"),  # -1 release, 1 grab: the last command
        ("winch", "f8"),  # -1..1, of the rate
        ("clutch_open", "b1"),
        ("releasing", "f8"),  # s since the gripper was told to release
        ("released", "b1"),  # the gripper is without its load
    ],
    align=True,
)
"""Figures of gripper and winch, then what they do now."""


class Reel(NamedTuple):
    """A winch at one moment."""

    length: float
    """m, rest length of the cable"""
    rate: float
    """m/s, of the rest length"""
    tension: float
    """N, of the cable"""
    free: bool
    """The clutch is open"""


def hoist(vehicle: Vehicle) -> np.void:
    """The record of a vehicle's gripper and winch, the load on the hook and the winch locked."""
    record = np.zeros(1, dtype=HOIST)
    h = record[0]
    h["first_control"] = len(vehicle.rotors)
    h["gripper"] = 1.0
    if vehicle.gripper is not None:
        h["has_gripper"] = True
        h["reach"], h["release_time"] = vehicle.gripper.reach, vehicle.gripper.release_time
    if vehicle.winch is not None:
        winch, length = vehicle.winch, vehicle.cable.rest_length
        h["has_winch"] = True
        h["min_length"], h["max_length"] = min(winch.min_length, length), max(winch.max_length, length)
        h["rate"], h["time_constant"] = winch.rate, winch.time_constant
        h["stall_tension"] = winch.stall_tension
    out: np.void = h
    return out


@kernel
def take_hoist_commands(p: Any, controls: Array) -> None:
    """Take the commands for gripper and winch from controls (16,)."""
    h = p.hoist
    gripper = controls[h.first_control + GRIPPER_CONTROL]
    winch = controls[h.first_control + WINCH_CONTROL]
    clutch = controls[h.first_control + CLUTCH_CONTROL]
    if abs(gripper) > 0.5:  # false for a NaN
        h.gripper = 1.0 if gripper > 0.0 else -1.0
    if math.isfinite(winch):
        h.winch = min(max(winch, -1.0), 1.0)
    if abs(clutch) > 0.5:
        h.clutch_open = clutch < 0.0


@kernel
def hoist_rests(p: Any) -> bool:
    """Whether gripper and winch do nothing, and go on doing so while their commands are held."""
    h = p.hoist
    if h.has_winch and (p.reel_rate != 0.0 or h.winch != 0.0 or h.clutch_open):
        return False
    return not (h.has_gripper and (h.gripper < 0.0 or h.releasing != 0.0 or h.released))


@kernel
def begin_reeling(p: Any, x: Array, inner: Array, step: float) -> None:
    """The rate of a step of `step` seconds, and the first half of its change of the rest length.

    A motor follows its command with a lag, and stops reeling in above its stall tension. With the clutch open
    the cable runs out against the drum's friction: in proportion to its tension, at `rate` at the stall
    tension.
    """
    h = p.hoist
    if not h.has_winch:
        return
    wanted = h.rate * h.winch
    if h.clutch_open:
        wanted = h.rate * min(tension_of(p, x, inner) / h.stall_tension, 1.0)
    elif wanted < 0.0 and tension_of(p, x, inner) > h.stall_tension:
        wanted = 0.0
    if (wanted > 0.0 and p.rest_length >= h.max_length) or (wanted < 0.0 and p.rest_length <= h.min_length):
        wanted = 0.0
    if p.reel_rate == 0.0 and wanted == 0.0:
        return
    rate = wanted + (p.reel_rate - wanted) * math.exp(-step / h.time_constant)
    p.reel_rate = 0.0 if wanted == 0.0 and abs(rate) < 1e-6 else rate
    p.rest_length += 0.5 * step * p.reel_rate


@kernel
def end_reeling(p: Any, step: float) -> None:
    """The second half of the change; at the end of its range the drum stops."""
    h = p.hoist
    if p.reel_rate == 0.0:
        return
    p.rest_length += 0.5 * step * p.reel_rate
    if p.rest_length <= h.min_length or p.rest_length >= h.max_length:
        p.rest_length = min(max(p.rest_length, h.min_length), h.max_length)
        p.reel_rate = 0.0


@kernel
def work_gripper(p: Any, x: Array, inner: Array, step: float) -> None:
    """Let the load go, or take it: told to grab, the hook takes it as soon as it is within reach.

    The hook hangs one rest length below the vehicle, or lies on the ground there, and takes a load only on a
    slack cable. A cable that has broken holds no load again.
    """
    h = p.hoist
    if not h.has_gripper:
        return
    if h.gripper < 0.0:
        h.releasing += step
        if h.releasing >= h.release_time and inner[CABLE_HOLDS] > 0.0:
            inner[CABLE_HOLDS] = 0.0
            h.released = True
        return
    h.releasing = 0.0
    if h.released:
        _, _, _, distance = span(x)
        height = x[2] - p.rest_length
        if p.has_ground:
            height = max(height, p.ground_height + p.load_radius)
        east, north, up = x[13] - x[0], x[14] - x[1], x[15] - height
        if east * east + north * north + up * up <= h.reach * h.reach and distance <= p.rest_length:
            inner[CABLE_HOLDS] = 1.0
            h.released = False
