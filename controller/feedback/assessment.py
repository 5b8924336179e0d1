"""What the autopilot makes of its feedback besides the state: what touches what, and what can be trusted."""

from __future__ import annotations

import math
from typing import NamedTuple, Protocol

from controller.ground.telemetry.vehicle_state import VehicleView
from controller.law.state import Array
from sitl_bridge.vehicle.description import Vehicle
from sitl_bridge.vehicle.rotors import full_thrust

CONTACT_MARGIN = 0.02
"""m, above rest, up to which a body that is seen exactly counts as on the ground."""
LIFTED = 0.05
"""m, above rest, from which on such a load counts as lifted."""

LOST_LOAD = 1.1
"""Of the longest that the cable can be, distance at which the load is not on it any more."""


class Contact(NamedTuple):
    """What vehicle and load touch."""

    vehicle_on_ground: bool
    load_on_ground: bool
    load_lifted: bool
    """It hangs, clear of the ground, so that its law can take over"""
    cable_taut: bool
    load_attached: bool
    in_flight: bool
    """Found flying: not held at its start, nor standing"""


class Assessor(Protocol):
    """Judges a feedback, for an autopilot under ground control."""

    feels_hook: bool
    """Whether only a pull shows that the hook has taken a load: where it lies is not known well enough"""

    def contact(self, estimate: Array) -> Contact:
        """What touches what at an estimate (18,), eq. 31."""

    def attached(self, estimate: Array) -> bool:
        """Whether the load is still on the cable: `load_attached` of `contact`, which takes longer."""

    def load_released(self) -> None:
        """The gripper has let the load go."""

    def hook(self, closed: bool) -> None:
        """Whether the gripper is to grab."""

    def reeled(self, rest_length: float, rate: float) -> None:
        """The winch has made the cable so long (m), and goes on at a rate, m/s."""

    def give_up(self) -> None:
        """The vehicle fell over: what the sensors show from now on is no flight."""

    def assess(self, view: VehicleView) -> list[str]:
        """Write the health of sensors and estimate into the view; what there is to say."""


class ExactAssessor:
    """For feedback that is the truth: geometry says what touches what, and all is well."""

    feels_hook = False

    def __init__(self, vehicle: Vehicle) -> None:
        cable = vehicle.cable
        # A cable that is stretched by all that the rotors can pull is as long as one can be.
        pull = full_thrust(vehicle.rotors)
        self._most_stretch = pull / cable.stiffness
        self.reeled(cable.rest_length, 0.0)
        ground = vehicle.ground
        self._vehicle_rest = self._load_rest = -math.inf
        if ground is not None:
            self._vehicle_rest = ground.height - min(leg[2] for leg in vehicle.airframe.legs)
            self._load_rest = ground.height + vehicle.load.radius

    def contact(self, estimate: Array) -> Contact:
        """By the distances of the bodies from each other and from the ground."""
        x = estimate.tolist()
        length = math.dist(x[0:3], x[3:6])
        taut = length >= self._rest_length
        grounded = x[2] < self._vehicle_rest + CONTACT_MARGIN
        return Contact(
            vehicle_on_ground=grounded,
            load_on_ground=x[5] < self._load_rest + CONTACT_MARGIN,
            load_lifted=taut and x[5] > self._load_rest + LIFTED,
            cable_taut=taut,
            load_attached=length <= self._lost_length,
            in_flight=not grounded and any(x[6:12]),  # held by the plant it would be at rest
        )

    def attached(self, estimate: Array) -> bool:
        """By the distance of the bodies."""
        x = estimate.tolist()
        return math.dist(x[0:3], x[3:6]) <= self._lost_length

    def load_released(self) -> None:
        """Truth does not need to know."""

    def give_up(self) -> None:
        """Truth stays true."""

    def hook(self, closed: bool) -> None:
        """Truth does not need to know."""

    def reeled(self, rest_length: float, rate: float) -> None:
        """Taut and lost are judged by the cable's length of now."""
        self._rest_length = rest_length
        self._lost_length = LOST_LOAD * (rest_length + self._most_stretch)

    def assess(self, view: VehicleView) -> list[str]:
        """Nothing to say."""
        return []
