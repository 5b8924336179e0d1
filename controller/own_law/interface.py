"""What a law of one's own is given and returns. SI units, world ENU (z up), body FLU."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

from controller.law.state import Array
from sitl_bridge.vehicle.description import Vehicle


class Estimate(NamedTuple):
    """Where everything is at this tick: the plant's truth, or the estimate from its sensors."""

    time_s: float
    """s since the law took over."""
    position: Array
    """(3,), m: the vehicle, world ENU."""
    velocity: Array
    """(3,), m/s, world ENU."""
    attitude: Array
    """(3,), rad: roll, pitch, yaw; `rotation` is Rz(yaw)·Ry(pitch)·Rx(roll)."""
    rotation: Array
    """(3, 3), body FLU to world ENU; its last column is where the thrust points."""
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
    """N, with which the cable pulls by its description, eq. 9; negative where a two-way cable pushes."""
    state: Array
    """(18,): the same in the order of eq. 31, for linear laws."""


class Reference(NamedTuple):
    """Where the load is to be at this tick: a smooth motion that the vehicle can follow, world ENU."""

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
    """(3,), m: the point that the scenario sets, without the smooth way there; a flight is judged by it."""
    yaw: float
    """rad."""
    yaw_rate: float
    """rad/s."""


class Wrench(NamedTuple):
    """Thrust and moments, from which the rotor commands are allocated within the rotors' limits."""

    thrust: float
    """N, of all rotors together, along the body's z axis."""
    moments: Array | Sequence[float]
    """(3,), N m, about the body's axes."""


Answer = Wrench | tuple[float, Array | Sequence[float]] | Array | Sequence[float]
"""`Wrench` or a plain `(thrust, moments)`; or a command for each rotor, 0..1, proportional to its speed."""


class OwnLaw(Protocol):
    """A law. A new object is made for each flight, and for a trial before it."""

    def __init__(self, *, vehicle: Vehicle, rate_hz: float) -> None:
        """vehicle: as the controller is told; rate_hz: calls of `step` a second."""

    def step(self, estimate: Estimate, reference: Reference) -> Answer:
        """What the rotors are to do until the next tick.

        A law that returns a wrench may keep what it is the sum of in an attribute `terms`: wrenches (4,), N
        and N m, by the names `feedforward`, `proportional`, `integral`, `delay`. They are logged.
        """


class LawError(RuntimeError):
    """A law raised an exception or returned what cannot be flown: which law, where in its file, and when."""
