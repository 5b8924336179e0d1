"""`--truth-to`: the true state of vehicle and load for a viewer, at the pace of the wall clock. No I/O.

For each body HIL_STATE_QUATERNION, which PX4's viewers draw, and ODOMETRY, which is finer. Rotor speeds as
HIL_ACTUATOR_CONTROLS, and what `figures` says. The vehicle is system N+1, the load a system of its own.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pymavlink.dialects.v20 import common

from sitl_bridge.frames import (
    CENTIMETRES_PER_METRE,
    DEG_E7_PER_DEG,
    MILLI_G_PER_METRE_PER_SECOND_SQUARED,
    MILLIMETRES_PER_METRE,
    LocalOrigin,
    Quaternion,
    Triple,
    attitude_to_ned_frd,
    enu_to_ned,
    flu_to_frd,
    rotate_inverse,
)
from sitl_bridge.ids import ACTUATOR_CONTROLS, COMPONENT_LOAD, COMPONENT_TRUTH, load_system, vehicle_system
from sitl_bridge.mavlink.fields import whole
from sitl_bridge.mavlink.framing import Packer
from sitl_bridge.mavlink.hil import FRAME_BODY_FRD, FRAME_LOCAL_NED, MODE_FLAG_ARMED
from sitl_bridge.plant.physics.state import (
    ATTITUDE,
    BODY_RATES,
    LOAD_POSITION,
    LOAD_VELOCITY,
    SPECIFIC_FORCE,
    VEHICLE_POSITION,
    VEHICLE_VELOCITY,
    Array,
)
from sitl_bridge.plant.physics.world import World
from sitl_bridge.plant.wire.figures import moving, weather
from sitl_bridge.plant.wire.slow_frames import load_heartbeat

if TYPE_CHECKING:
    from sitl_bridge.plant.simulation import Simulation

INTERVAL = 1.0 / 125.0
"""s between two datagrams: a companion flies on them."""
HEARTBEAT_EVERY = 125
"""Datagrams, likewise the next two."""
FIGURES_EVERY = 3
WEATHER_EVERY = 25
_LEVEL: Quaternion = (1.0, 0.0, 0.0, 0.0)
_NAN21 = [float("nan")] + [0.0] * 20
"""A covariance that is not known."""


class TruthTo:
    """Datagrams for a viewer."""

    def __init__(self, instance: int, origin: LocalOrigin) -> None:
        self._origin = origin
        self._vehicle = Packer(vehicle_system(instance), COMPONENT_TRUTH)
        self._load = Packer(load_system(instance), COMPONENT_LOAD)
        self._next = 0.0
        self._count = 0

    def to_send(self, now: float, simulation: Simulation) -> bytes | None:
        """What is due at `now`, s."""
        if now < self._next:
            return None
        self._next = now + INTERVAL
        time_usec, world = simulation.time_usec, simulation.world
        x = world.state
        vehicle = _Pose(x[VEHICLE_POSITION], x[VEHICLE_VELOCITY], x[ATTITUDE], x[BODY_RATES])
        load = _Pose(x[LOAD_POSITION], x[LOAD_VELOCITY])
        force = _triple(world.reactions[SPECIFIC_FORCE])
        out = self._vehicle.pack(self._state(time_usec, vehicle, force))
        out += self._vehicle.pack(_odometry(time_usec, vehicle, FRAME_BODY_FRD))
        out += self._vehicle.pack(_controls(time_usec, world))
        out += self._load.pack(self._state(time_usec, load, (0.0, 0.0, world.vehicle.gravity)))
        out += self._load.pack(_odometry(time_usec, load, FRAME_LOCAL_NED))
        if self._count % HEARTBEAT_EVERY == 0:
            out += self._load.pack(load_heartbeat())
        if self._count % FIGURES_EVERY == 0:
            out += b"".join(self._vehicle.pack(message) for message in moving(simulation))
        if self._count % WEATHER_EVERY == 0:
            out += b"".join(self._vehicle.pack(message) for message in weather(simulation))
        self._count += 1
        return out

    def _state(self, time_usec: int, pose: _Pose, specific_force: Triple) -> Any:
        point = self._origin.geodetic(pose.position)
        roll, pitch, yaw = flu_to_frd(pose.rates)
        velocity = (whole(v * CENTIMETRES_PER_METRE, 16) for v in enu_to_ned(pose.velocity))
        force = flu_to_frd(specific_force)
        return common.MAVLink_hil_state_quaternion_message(
            time_usec,
            attitude_to_ned_frd(pose.attitude),
            *(roll, pitch, yaw),
            whole(point.latitude * DEG_E7_PER_DEG, 32),
            whole(point.longitude * DEG_E7_PER_DEG, 32),
            whole(point.altitude * MILLIMETRES_PER_METRE, 32),
            *velocity,
            *(0, 0),
            *(whole(a * MILLI_G_PER_METRE_PER_SECOND_SQUARED, 16) for a in force),
        )


class _Pose:
    """Of a body, world ENU and body FLU."""

    def __init__(
        self, position: Array, velocity: Array, attitude: Array | None = None, rates: Array | None = None
    ) -> None:
        self.position, self.velocity = _triple(position), _triple(velocity)
        self.attitude: Quaternion = _LEVEL
        if attitude is not None:
            w, x, y, z = attitude.tolist()
            self.attitude = (w, x, y, z)
        self.rates: Triple = (0.0, 0.0, 0.0) if rates is None else _triple(rates)


def _odometry(time_usec: int, pose: _Pose, child_frame: int) -> Any:
    """ODOMETRY: LOCAL_NED, velocities in the child's frame."""
    velocity = pose.velocity
    if child_frame == FRAME_BODY_FRD:
        velocity = flu_to_frd(rotate_inverse(pose.attitude, velocity))
    else:
        velocity = enu_to_ned(velocity)
    return common.MAVLink_odometry_message(
        time_usec,
        FRAME_LOCAL_NED,
        child_frame,
        *enu_to_ned(pose.position),
        attitude_to_ned_frd(pose.attitude),
        *velocity,
        *flu_to_frd(pose.rates),
        _NAN21,
        _NAN21,
    )


def _controls(time_usec: int, world: World) -> Any:
    """HIL_ACTUATOR_CONTROLS: what each rotor turns now, of its largest speed."""
    rotors = world.vehicle.rotors
    speeds = [
        world.inner[i] if rotor.time_constant > 0.0 else world.rotor_speed[i]
        for i, rotor in enumerate(rotors)
    ]
    shares = [float(speed) / rotor.max_speed for speed, rotor in zip(speeds, rotors, strict=True)]
    shares += [0.0] * (ACTUATOR_CONTROLS - len(shares))
    return common.MAVLink_hil_actuator_controls_message(time_usec, shares, MODE_FLAG_ARMED, 0)


def _triple(vector: Array) -> Triple:
    x, y, z = vector.tolist()
    return (x, y, z)
