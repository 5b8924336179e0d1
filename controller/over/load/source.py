"""What a source of the load's state is, and the plant's truth as one.

Each source makes the law's state (18,), eq. 31, from the stack's telemetry and what it hears itself.
"""

from __future__ import annotations

import math
from typing import Any, Protocol

import numpy as np
from pymavlink.dialects.v20 import common as mavlink

from controller.law.state import (
    BODY_RATES,
    EULER_ANGLES,
    LOAD_POSITION,
    LOAD_VELOCITY,
    STATE_SIZE,
    VEHICLE_POSITION,
    VEHICLE_VELOCITY,
    Array,
)
from controller.over.ages import LONGEST_STANDSTILL
from controller.over.telemetry import Telemetry, VehicleState
from sitl_bridge.frames import (
    attitude_to_enu_flu,
    enu_to_ned,
    euler_from_quaternion,
    flu_to_frd,
    rotate,
)
from sitl_bridge.ids import COMPONENT_LOAD
from sitl_bridge.mavlink.framing import Frame, decode

MOST_TRUTH_AGE = 0.2
"""s, by which the stack's time may go on without a new truth."""


class LoadSource(Protocol):
    """Knows the load beside the stack's vehicle."""

    in_world: bool
    """Whether the state is in the scenario's frame; else it is in the stack's local one."""

    def hear(self, frame: Frame, now: float) -> None:
        """Anything that a link brings, the truth's link included."""

    def state(self, telemetry: Telemetry, now: float) -> Array | None:
        """The law's state (18,) at the stack's newest state; None while there is none to fly on."""

    def missing(self, telemetry: Telemetry, now: float, hanging: bool = True) -> str | None:
        """What has to come before there is a state, in words; None: nothing.

        hanging: whether the load does, so that a camera sees it.
        """


def law_state(vehicle: VehicleState) -> Array:
    """The vehicle's part of eq. 31 (18,)."""
    out = np.zeros(STATE_SIZE)
    out[VEHICLE_POSITION], out[VEHICLE_VELOCITY] = vehicle.position, vehicle.velocity
    out[BODY_RATES] = vehicle.rates
    out[EULER_ANGLES] = euler_from_quaternion(vehicle.attitude)
    return out


class TruthSource:
    """The plant's ODOMETRY of vehicle and load (`sitl plant --truth-to`)."""

    in_world = True

    def __init__(self) -> None:
        self._vehicle: VehicleState | None = None
        self._load: tuple[tuple[float, ...], tuple[float, ...]] | None = None
        self._at = -math.inf
        self._stack_time: float | None = None
        """s, of the stack's newest state when the truth was used first; None: it was not yet."""

    def hear(self, frame: Frame, now: float) -> None:
        """ODOMETRY of the load, and of the vehicle by the plant's own component."""
        if frame.message_id != mavlink.MAVLINK_MSG_ID_ODOMETRY:
            return
        message: Any = decode(frame)
        place = enu_to_ned((message.x, message.y, message.z))
        if frame.component == COMPONENT_LOAD:
            self._load = (place, enu_to_ned((message.vx, message.vy, message.vz)))
        elif frame.component == mavlink.MAV_COMP_ID_ONBOARD_COMPUTER:
            attitude = attitude_to_enu_flu(tuple(message.q))
            velocity = rotate(attitude, flu_to_frd((message.vx, message.vy, message.vz)))
            rates = flu_to_frd((message.rollspeed, message.pitchspeed, message.yawspeed))
            self._vehicle = VehicleState(message.time_usec * 1e-6, place, velocity, attitude, rates)
            self._at, self._stack_time = now, None

    @property
    def time_s(self) -> float | None:
        """The plant's time of the newest state, s; None: there is none."""
        return None if self._vehicle is None else self._vehicle.time_s

    def missing(self, telemetry: Telemetry, now: float, hanging: bool = True) -> str | None:
        """ODOMETRY of both bodies."""
        if self._vehicle is None or self._load is None:
            return "the plant's ODOMETRY of vehicle and load (`sitl plant --truth-to`)"
        if self._old(telemetry, now):
            return "new ODOMETRY from the plant"
        return None

    def _old(self, telemetry: Telemetry, now: float) -> bool:
        """By the stack's time: where a plant gets no turn, on a busy machine, its stack stands still too."""
        stack_time = 0.0 if telemetry.vehicle is None else telemetry.vehicle.time_s
        if self._stack_time is None:
            self._stack_time = stack_time
        return stack_time - self._stack_time > MOST_TRUTH_AGE or now - self._at > LONGEST_STANDSTILL

    def state(self, telemetry: Telemetry, now: float) -> Array | None:
        """Vehicle and load as the plant has them."""
        if self._vehicle is None or self._load is None or self._old(telemetry, now):
            return None
        out = law_state(self._vehicle)
        out[LOAD_POSITION], out[LOAD_VELOCITY] = self._load
        return out
