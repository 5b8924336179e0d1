"""What your own law is given, and what it returns. SI units, world ENU (z up), body FLU."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

from controller.law.state import Array
from sitl_bridge.vehicle.description import Vehicle


class Estimate(NamedTuple):
    """The state at this tick: the plant's truth, or the estimate from its sensors."""

    time_s: float
    """s since the law took over."""
    position: Array
    """(3,), m: the vehicle, world ENU."""
    velocity: Array
    """(3,), m/s, world ENU."""
    attitude: Array
    """(3,), rad: roll, pitch, yaw; `rotation` is Rz(yaw)·Ry(pitch)·Rx(roll)."""
    rotation: Array
    """(3, 3), from body FLU to world ENU. Its last column is the direction of the thrust."""
    body_rates: Array
    """(3,), rad/s: p, q, r about the body's axes."""
    load_position: Array
    """(3,), m, world ENU."""
    load_velocity: Array
    """(3,), m/s, world ENU."""
    cable_direction: Array
    """(3,), unit vector from the vehicle to the load, world ENU; straight down if both are at one point."""
    cable_length: float
    """m, from the vehicle to the load, stretch included."""
    cable_stretch: float
    """m beyond the rest length; negative while the cable is slack."""
    cable_tension: float
    """N, of the described cable (eq. 9). Negative if the cable pushes, which only a two-way cable does."""
    state: Array
    """(18,): the same values in the order of eq. 31, for linear laws."""


class Reference(NamedTuple):
    """The load's set-point at this tick, on a smooth motion that the vehicle can follow. World ENU."""

    time_s: float
    """s since the law took over."""
    position: Array
    """(3,), m."""
    velocity: Array
    """(3,), m/s."""
    acceleration: Array
    """(3,), m/s²."""
    jerk: Array
    """(3,), m/s³."""
    snap: Array
    """(3,), m/s⁴."""
    goal: Array
    """(3,), m: the scenario's set-point itself, without a smooth motion to it. Reports measure against it."""
    yaw: float
    """rad."""
    yaw_rate: float
    """rad/s."""


class Wrench(NamedTuple):
    """Thrust and moments. The rotor commands follow from them, within the rotors' limits."""

    thrust: float
    """N, sum of all rotors, along the body's z axis."""
    moments: Array | Sequence[float]
    """(3,), N m, about the body's axes."""


Answer = Wrench | tuple[float, Array | Sequence[float]] | Array | Sequence[float]
"""`Wrench` or a plain `(thrust, moments)`; or a command for each rotor, 0..1, proportional to its speed."""


class OwnLaw(Protocol):
    """A control law. Each flight makes a new object; so does a trial before the flight."""

    def __init__(self, *, vehicle: Vehicle, rate_hz: float) -> None:
        """Take the vehicle as the controller knows it, and `rate_hz`, the calls of `step` a second."""

    def step(self, estimate: Estimate, reference: Reference) -> Answer:
        """Return what the rotors do until the next tick.

        A law that returns a wrench may also set an attribute `terms`, which is logged: a dict with the parts
        of that sum, named `feedforward`, `proportional`, `integral`, `delay`. Each is (4,), N and N m.
        """


class LawError(RuntimeError):
    """A law raised an exception, or returned what cannot be flown. Says which law, which line, and when."""
