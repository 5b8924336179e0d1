"""What follows from a vehicle's description, before it is flown. Pure functions."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from controller.design.catalogue import design
from controller.design.margins import delay_margin
from controller.design.model import actuated_model, linear_model
from sitl_bridge.plant.physics.parameters import step_count
from sitl_bridge.vehicle.description import Vehicle, hover_rotor_speeds
from sitl_bridge.vehicle.rotors import full_thrust

Array = NDArray[np.float64]


class Mode(NamedTuple):
    """A motion of vehicle and load on the cable, in hover."""

    frequency: float
    """Hz, undamped."""
    damping: float
    """Ratio."""


class Figures(NamedTuple):
    """What follows from a description."""

    hover_thrust_N: float
    hover_thrust_share: float
    """Of what all rotors give at full speed."""
    hover_control: float
    """Largest of the rotors' controls in hover: speed over `max_speed`."""
    thrust_to_weight: float
    static_stretch_m: float
    static_stretch_pct: float
    """Of the cable's rest length."""
    bounce_frequency_Hz: float
    bounce_damping: float
    pendulum_frequency_Hz: float
    pendulum_damping: float
    integration_step_s: float
    integration_steps: int
    """In each tick."""
    delay_margin_s: float
    """Extra delay at all inputs up to which the default design is stable; 0.2 stands for that or more."""


def figures(vehicle: Vehicle, rate_hz: float) -> Figures:
    """All figures of a vehicle and a loop of this rate."""
    full, weight = full_thrust(vehicle.rotors), vehicle.hover_thrust
    pairs = zip(hover_rotor_speeds(vehicle), vehicle.rotors, strict=True)
    stretch = vehicle.hover_length - vehicle.cable.rest_length
    bounce, pendulum = modes(vehicle)
    steps = step_count(vehicle, 1.0 / rate_hz)
    margin = delay_margin(actuated_model(vehicle), design("default", vehicle, rate_hz))
    return Figures(
        hover_thrust_N=weight,
        hover_thrust_share=weight / full,
        hover_control=max(speed / rotor.max_speed for speed, rotor in pairs),
        thrust_to_weight=full / weight,
        static_stretch_m=stretch,
        static_stretch_pct=100.0 * stretch / vehicle.cable.rest_length,
        bounce_frequency_Hz=bounce.frequency,
        bounce_damping=bounce.damping,
        pendulum_frequency_Hz=pendulum.frequency,
        pendulum_damping=pendulum.damping,
        integration_step_s=1.0 / rate_hz / steps,
        integration_steps=steps,
        delay_margin_s=margin,
    )


def modes(vehicle: Vehicle) -> tuple[Mode, Mode]:
    """Bounce along the cable, and swing of the load below the vehicle, with thrust and attitude held."""
    a = linear_model(vehicle).A
    bounce, pendulum = (_fastest_pair(a[np.ix_(axis, axis)]) for axis in ([2, 5, 8, 11], [0, 3, 6, 9]))
    return bounce, pendulum


def _fastest_pair(a: Array) -> Mode:
    """The two eigenvalues that are furthest from 0; the others are of both bodies moving together."""
    values = np.linalg.eigvals(a)
    first, second = values[np.argsort(-np.abs(values))[:2]]
    frequency = math.sqrt(abs(first * second))
    return Mode(frequency / (2.0 * math.pi), max(0.0, float(-(first + second).real / (2.0 * frequency))))
