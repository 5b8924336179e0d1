"""What the mode machine wants of the control law: one small value at a time.

World ENU, SI units; yaw in rad, anticlockwise from east. The machine hands out the same object for as long
as nothing changes, so `is` tells whether a new reference has to be planned.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from sitl_bridge.frames import Quaternion, Triple


class Body(Enum):
    """The body whose position is controlled."""

    VEHICLE = "vehicle"
    """The vehicle alone: the cable is slack, or there is no load."""
    LOAD = "load"
    """The load on a taut cable; the vehicle goes where that takes it."""


@dataclass(frozen=True, slots=True)
class Idle:
    """Stay on the ground: rotors stopped, or turning without lift when armed."""

    armed: bool


@dataclass(frozen=True, slots=True)
class Goto:
    """Go to a point and stay there."""

    body: Body
    position: Triple
    """m, of `body`."""
    yaw: float
    """rad"""
    speed: float
    """m/s, largest on the way."""


@dataclass(frozen=True, slots=True)
class Follow:
    """Follow a set-point that somebody else moves. An entry that is not asked for is NaN.

    Each axis has a position or a velocity; with both, the velocity (and the acceleration) is feed-forward.
    """

    body: Body
    position: Triple
    """m"""
    velocity: Triple
    """m/s"""
    acceleration: Triple
    """m/s²"""
    yaw: float
    """rad; NaN with a finite yaw_rate turns, NaN alone keeps the heading."""
    yaw_rate: float
    """rad/s, anticlockwise"""


@dataclass(frozen=True, slots=True)
class Attitude:
    """Fly an attitude or body rates with a thrust, as somebody else steers: no position is controlled."""

    attitude: Quaternion | None
    """FLU to ENU; None: the rates alone count"""
    body_rates: Triple
    """rad/s, FLU; beside an attitude a feed-forward; NaN: none, or as it is"""
    thrust: float
    """0..1; MPC_THR_HOVER carries vehicle and load"""


@dataclass(frozen=True, slots=True)
class Land:
    """Sink above a point until the machine sees contact: the height has no lower end."""

    body: Body
    position: Triple
    """m; only x and y count."""
    yaw: float
    """rad"""
    speed: float
    """m/s, downwards"""


@dataclass(frozen=True, slots=True)
class Terminate:
    """Rotors stopped, wherever the vehicle is."""


Target = Idle | Goto | Follow | Attitude | Land | Terminate
