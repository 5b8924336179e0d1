"""A pilot's sticks (MANUAL_CONTROL): from their positions to a velocity of the load, and whose they are."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from controller.ground.commands.setpoints import NOTHING, Setpoint
from controller.ground.parameters.protocol import Parameters
from controller.ground.telemetry.vehicle_state import VehicleView
from sitl_bridge.frames import euler_from_quaternion

JOYSTICK = (1, 2, 3)
"""COM_RC_IN_MODE in which MANUAL_CONTROL counts"""
COASTING = 3.0
"""s, in which a velocity decays in Altitude mode once the sticks are let go"""
LIFTS = 0.2
"""Throttle above the middle (of 1) that takes off from the ground"""
_NOT_GIVEN = 0x7FFF
_SPAN = 1000.0


class Axes(NamedTuple):
    """Positions of the sticks, -1..1; right-handed about forward, left, up as everything in here."""

    forward: float
    left: float
    up: float
    turn: float
    """Anticlockwise"""


def axes_of(message: Any) -> Axes | None:
    """Of MANUAL_CONTROL; an axis that is not given is in the middle. None: there is not a single one."""
    raw = (message.x, message.y, message.z, message.r)
    if all(value == _NOT_GIVEN for value in raw):
        return None
    x, y, r = (_position(value / _SPAN, value) for value in (message.x, message.y, message.r))
    # Throttle is 0 to 1000, with 500 in the middle.
    return Axes(x, -y, _position(2.0 * message.z / _SPAN - 1.0, message.z), -r)


def _position(value: float, raw: int) -> float:
    return 0.0 if raw == _NOT_GIVEN else min(max(value, -1.0), 1.0)


class Sticks:
    """The sticks that count: one sender at a time, until it falls silent."""

    def __init__(self) -> None:
        self.axes = Axes(0.0, 0.0, 0.0, 0.0)
        self.time = -math.inf
        """When they were heard last"""
        self._sender: object = None
        self._rest = self.axes
        """Where they were when a mode without sticks began"""
        self._drift = (0.0, 0.0)
        """m/s ENU, that Altitude mode goes on with"""
        self._looked = 0.0

    def hear(self, axes: Axes, sender: object, now: float, timeout: float) -> str:
        """Take a position of the sticks; returns why not, or an empty string."""
        if self.fresh(now, timeout) and sender != self._sender:
            return "Another client has the sticks; stop its MANUAL_CONTROL first"
        if not self.fresh(now, timeout):
            self._rest = axes
        self.axes, self.time, self._sender = axes, now, sender
        return ""

    def fresh(self, now: float, timeout: float) -> bool:
        """Whether they were heard within the last `timeout` seconds."""
        return now - self.time <= timeout

    def rest(self) -> None:
        """A mode without sticks begins: what they do from here on takes over."""
        self._rest = self.axes

    def moved(self, share: float) -> bool:
        """Whether one of them was moved by a share (0..1) since `rest`."""
        return any(abs(a - b) > share for a, b in zip(self.axes, self._rest, strict=True))

    def start(self, view: VehicleView) -> None:
        """A mode with sticks begins in flight: Altitude mode goes on with the velocity that there is."""
        velocity = view.load_velocity if view.load_attached else view.velocity
        self._drift, self._looked = (velocity[0], velocity[1]), view.time

    def lifts(self) -> bool:
        """Whether the throttle asks for a take-off."""
        return self.axes.up > LIFTS

    def setpoint(self, view: VehicleView, p: Parameters, holds_position: bool) -> Setpoint:
        """What they ask for: a velocity of the load; without `holds_position` the velocity coasts."""
        dead = p["MPC_HOLD_DZ"]
        forward, left = (_curved(a, dead, p["MPC_XY_MAN_EXPO"]) for a in (self.axes.forward, self.axes.left))
        size = math.hypot(forward, left)
        if size > 1.0:  # a square of sticks is a circle of speeds
            forward, left = forward / size, left / size
        yaw = euler_from_quaternion(view.attitude)[2]
        c, s = math.cos(yaw), math.sin(yaw)
        east, north = forward * c - left * s, forward * s + left * c
        fastest = min(p["MPC_VEL_MANUAL"], p["MPC_XY_VEL_MAX"])
        if holds_position:
            self._drift = (fastest * east, fastest * north)
        else:
            step = min(max(0.0, view.time - self._looked), 0.5)
            most = min(p["MPC_ACC_HOR"], 9.81 * math.tan(math.radians(p["MPC_MAN_TILT_MAX"])))
            drift = [
                v + step * (most * a - v / COASTING) for v, a in zip(self._drift, (east, north), strict=True)
            ]
            scale = min(1.0, fastest / max(math.hypot(*drift), 1e-9))
            self._drift = (drift[0] * scale, drift[1] * scale)
        self._looked = view.time
        up = _curved(self.axes.up, dead, p["MPC_Z_MAN_EXPO"])
        climb = up * (p["MPC_Z_VEL_MAX_UP"] if up > 0.0 else p["MPC_Z_VEL_MAX_DN"])
        turn = _curved(self.axes.turn, dead, p["MPC_YAW_EXPO"]) * math.radians(p["MPC_MAN_Y_MAX"])
        return Setpoint(view.load_attached, NOTHING, (*self._drift, climb), NOTHING, math.nan, turn)


def _curved(value: float, dead: float, expo: float) -> float:
    """PX4's curve of a stick: a dead zone in the middle, and a share `expo` of a cube."""
    if abs(value) <= dead:
        return 0.0
    rest = math.copysign((abs(value) - dead) / max(1e-6, 1.0 - dead), value)
    return (1.0 - expo) * rest + expo * rest**3
