"""Between a point of the vehicle and one of the load below it, and the limits of what set-points may ask."""

from __future__ import annotations

import math

from controller.ground.flight.motion.setpoint_types import Body
from controller.ground.flight.motion.trajectory import stopping_distance
from controller.ground.parameters.protocol import Parameters
from controller.ground.telemetry.vehicle_state import Profile, VehicleView
from sitl_bridge.frames import Triple


def below(vehicle: Triple, hanging: float) -> Triple:
    """The load's place for the vehicle's, m."""
    return (vehicle[0], vehicle[1], vehicle[2] - hanging)


def above(load: Triple, hanging: float) -> Triple:
    """The vehicle's place for the load's, m."""
    return (load[0], load[1], load[2] + hanging)


def hanging_load(view: VehicleView, profile: Profile) -> Triple:
    """Where the load is; a lost one counts as where it would hang, m."""
    return view.load_position if view.load_attached else below(view.position, profile.hover_length)


def controlled_body(view: VehicleView | None) -> Body:
    """Whose position is controlled in flight: the load's, for as long as there is one."""
    return Body.LOAD if view is None or view.load_attached else Body.VEHICLE


def controlled_point(vehicle: Triple, view: VehicleView, profile: Profile) -> Triple:
    """The controlled body's point for a vehicle's point, m."""
    return below(vehicle, profile.hover_length) if controlled_body(view) is Body.LOAD else vehicle


def filled(asked: Triple, here: Triple) -> Triple:
    """What is NaN stays as it is."""
    x, y, z = (old if math.isnan(new) else new for new, old in zip(asked, here, strict=True))
    return (x, y, z)


def hanging_under(acceleration: Triple, profile: Profile) -> Triple:
    """From the load to the vehicle for a steady acceleration (m/s², NaN: none), m."""
    pull = [0.0 if math.isnan(a) else a for a in acceleration]
    pull[2] += profile.gravity
    size = math.hypot(*pull)
    if size < 1e-3:
        return (0.0, 0.0, profile.hover_length)
    scale = profile.hover_length / size
    return (pull[0] * scale, pull[1] * scale, pull[2] * scale)


def limited_velocity(velocity: Triple, p: Parameters) -> Triple:
    """A set-point's velocity within the envelope, m/s."""
    flat = math.hypot(*(0.0 if math.isnan(v) else v for v in velocity[:2]))
    scale = min(1.0, p["MPC_XY_VEL_MAX"] / flat) if flat > 0 else 1.0
    z = velocity[2]
    up = z if math.isnan(z) else max(-p["MPC_Z_VEL_MAX_DN"], min(p["MPC_Z_VEL_MAX_UP"], z))
    return (velocity[0] * scale, velocity[1] * scale, up)


def too_deep(asked: float, own: float, room: float, p: Parameters, pole: float) -> bool:
    """Whether a body that is `room` (m) above a floor has to stop now.

    Upwards: `asked`, its set-point's velocity (m/s, NaN: none), and `own`, which it has. pole: 1/s, of the
    motion.
    """
    return asked < 0.0 and room <= stopping_distance(-min(asked, own), p["MPC_ACC_HOR"], pole)


def limited_speed(speed: float, p: Parameters) -> float:
    """A speed that was asked for (m/s; NaN or not positive: the default) within the envelope."""
    return min(speed if speed > 0 else p["MPC_XY_CRUISE"], p["MPC_XY_VEL_MAX"])


def stopping_point(view: VehicleView, p: Parameters, pole: float) -> Triple:
    """Where the controlled body comes to rest if it brakes now, m. pole: of the motion, 1/s."""
    position, velocity = (
        (view.load_position, view.load_velocity) if view.load_attached else (view.position, view.velocity)
    )
    speed = math.hypot(*velocity)
    if speed == 0.0:
        return position
    share = stopping_distance(speed, p["MPC_ACC_HOR"], pole) / speed
    x, y, z = (place + v * share for place, v in zip(position, velocity, strict=True))
    return (x, y, z)
