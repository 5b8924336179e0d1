"""Set-points and sticks of whoever steers now: taken or refused, and whether they are fresh."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from controller.ground.commands.setpoints import Setpoint
from controller.ground.flight.motion.geometry import filled, hanging_load
from controller.ground.flight.motion.setpoint_types import Attitude
from controller.ground.flight.motion.sticks import JOYSTICK, Axes
from controller.ground.flight.px4_modes import BY_STICKS, Mode
from controller.ground.telemetry.vehicle_state import VehicleView
from sitl_bridge.frames import Triple

if TYPE_CHECKING:
    from controller.ground.flight.modes import Machine

_LIFTS = 0.3
"""m, above a vehicle on the ground, from which on a set-point asks for a take-off"""


def offer(machine: Machine, setpoint: Setpoint, sender: object, now: float) -> str:
    """An offboard set-point; returns why it is not taken, or an empty string."""
    fence = machine.fence
    if fence is None or machine.view is None:
        return "Set-point denied: no position yet; start the plant"
    here = hanging_load(machine.view, machine.profile) if setpoint.of_load else machine.view.position
    point = machine.vehicle_point(filled(setpoint.position, here), setpoint.of_load)
    asked = any(not math.isnan(x) for x in setpoint.position)
    fault = fence.outside(point) if asked else ""
    if fault:
        return f"Set-point denied: {fault}"
    return machine.offboard.offer(setpoint, sender, now, machine.parameters["COM_OF_LOSS_T"])


def offer_attitude(machine: Machine, setpoint: Attitude, sender: object, now: float) -> str:
    """An offboard set-point of attitude or rates; returns why it is not taken, or an empty string."""
    return machine.offboard.offer(setpoint, sender, now, machine.parameters["COM_OF_LOSS_T"])


def move_sticks(machine: Machine, axes: Axes, sender: object, now: float) -> str:
    """Positions of a pilot's sticks; returns why they are not taken, or an empty string."""
    source = machine.parameters.integer("COM_RC_IN_MODE")
    if source not in JOYSTICK:
        return f"Sticks ignored: COM_RC_IN_MODE is {source}; set it to 1"
    return machine.sticks.hear(axes, sender, now, machine.parameters["COM_RC_LOSS_T"])


def hear_target(machine: Machine, position: Triple, velocity: Triple) -> None:
    """Where somebody is who may be followed, m and m/s ENU."""
    if machine.view is not None:
        machine.guidance.in_flight.followed.hear(position, velocity, machine.view.time)


def setpoint_fresh(machine: Machine, now: float) -> bool:
    return machine.offboard.fresh(now, machine.parameters["COM_OF_LOSS_T"])


def sticks_fresh(machine: Machine, now: float) -> bool:
    return machine.sticks.fresh(now, machine.parameters["COM_RC_LOSS_T"])


def setpoint_lifts(machine: Machine, view: VehicleView, now: float) -> bool:
    """Whether pilot or offboard client want the vehicle off the ground, by the axes that PX4 looks at."""
    if machine.mode in BY_STICKS:
        return sticks_fresh(machine, now) and machine.sticks.lifts()
    asked = machine.offboard.latest
    if machine.mode is not Mode.OFFBOARD or not setpoint_fresh(machine, now):
        return False
    if asked is None or isinstance(asked, Attitude):
        return False
    height = machine.vehicle_point(asked.position, asked.of_load)[2]
    return height > view.position[2] + _LIFTS or asked.velocity[2] > 0.0 or asked.acceleration[2] > 0.0
