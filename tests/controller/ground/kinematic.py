"""A vehicle and a load that go where they are sent: enough to turn the services' wheels, no physics."""

from __future__ import annotations

import math

from controller.ground.flight.motion.setpoint_types import (
    Attitude,
    Body,
    Follow,
    Goto,
    Idle,
    Land,
    Target,
    Terminate,
)
from controller.ground.telemetry.vehicle_state import Profile, VehicleView
from sitl_bridge.frames import LocalOrigin, Triple, quaternion_from_euler

ZURICH = (47.397742, 8.545594, 488.0)
PROFILE = Profile("kinematic", 0, LocalOrigin(*ZURICH), 1.5, 1.6, 9.81, True)
LEGS = 0.1
RADIUS = 0.05


def grounded_view(yaw: float = 0.3) -> VehicleView:
    """At rest on the ground, the load 1 m to the east."""
    return VehicleView(
        time=1.0,
        position=(0.0, 0.0, LEGS),
        velocity=(0.0, 0.0, 0.0),
        attitude=quaternion_from_euler((0.0, 0.0, yaw)),
        body_rates=(0.0, 0.0, 0.0),
        load_position=(1.0, 0.0, RADIUS),
        load_velocity=(0.0, 0.0, 0.0),
        cable_taut=False,
        vehicle_on_ground=True,
        load_on_ground=True,
        battery_voltage=16.2,
        battery_current=1.0,
        battery_remaining=0.9,
    )


def step(view: VehicleView, target: Target, dt: float, profile: Profile = PROFILE) -> None:
    """Move vehicle and load by one step towards what the machine asks for."""
    view.time += dt
    vehicle, load = view.position, view.load_position
    hanging = profile.hover_length
    if isinstance(target, Attitude):
        new_vehicle, new_load = vehicle, load
        if target.attitude is not None:
            view.attitude = target.attitude
    elif isinstance(target, Idle | Terminate):
        new_vehicle, new_load = (vehicle[0], vehicle[1], LEGS), (load[0], load[1], RADIUS)
    elif target.body is Body.LOAD:
        new_load = _moved(load, target, dt)
        new_load = (new_load[0], new_load[1], max(RADIUS, new_load[2]))
        new_vehicle = (new_load[0], new_load[1], new_load[2] + hanging)
    else:
        new_vehicle = _moved(vehicle, target, dt)
        new_vehicle = (new_vehicle[0], new_vehicle[1], max(LEGS, new_vehicle[2]))
        new_load = load
        if view.load_attached and math.dist(new_vehicle, load) > profile.rest_length:
            share = profile.rest_length / math.dist(new_vehicle, load)
            x, y, z = (v + (w - v) * share for v, w in zip(new_vehicle, load, strict=True))
            new_load = (x, y, max(RADIUS, z))
    view.velocity = _difference(new_vehicle, vehicle, dt)
    view.load_velocity = _difference(new_load, load, dt)
    view.position, view.load_position = new_vehicle, new_load
    view.vehicle_on_ground = new_vehicle[2] <= LEGS
    view.load_on_ground = new_load[2] <= RADIUS
    view.cable_taut = math.dist(new_vehicle, new_load) >= profile.rest_length - 1e-6
    yaw = getattr(target, "yaw", math.nan)
    if not math.isnan(yaw):
        view.attitude = quaternion_from_euler((0.0, 0.0, yaw))


def _moved(here: Triple, target: Goto | Follow | Land, dt: float) -> Triple:
    if isinstance(target, Land):
        return (here[0], here[1], here[2] - target.speed * dt)
    if isinstance(target, Goto):
        away = math.dist(here, target.position)
        share = 1.0 if away == 0 else min(1.0, target.speed * dt / away)
        x, y, z = (h + (t - h) * share for h, t in zip(here, target.position, strict=True))
        return (x, y, z)
    out = []
    for h, p, v in zip(here, target.position, target.velocity, strict=True):
        forward = 0.0 if math.isnan(v) else v * dt
        pull = 0.0 if math.isnan(p) else max(-3 * dt, min(3 * dt, p - h))
        out.append(h + forward + pull)
    return (out[0], out[1], out[2])


def _difference(new: Triple, old: Triple, dt: float) -> Triple:
    x, y, z = ((n - o) / dt for n, o in zip(new, old, strict=True))
    return (x, y, z)
