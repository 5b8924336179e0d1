"""Gains of a vehicle under ground control for commands that act later than told."""

from __future__ import annotations

from controller.design.catalogue import on_cable
from controller.design.later import acting_later
from controller.ground.flight.motion.setpoint_types import Body
from controller.law.control_law import Design
from sitl_bridge.vehicle.description import Vehicle

Designs = dict[Body, Design]


class LateGains:
    """The designs as they were made, for the delay that was told, and the delay that was found."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle = vehicle
        self._made: Designs = {}
        self._rest_length = vehicle.cable.rest_length
        self._ticks = 0

    def made(self, designs: Designs, rest_length: float) -> None:
        """Other gains have been designed, for a cable of this length, m: they become those for the delay."""
        self._made = {body: design.copy() for body, design in designs.items()}
        self._rest_length = rest_length
        self.act_late(designs, self._ticks)

    def act_late(self, designs: Designs, ticks: int) -> None:
        """Commands act so many ticks late; what the designs know of the body stays."""
        self._ticks = ticks
        vehicle = on_cable(self._vehicle, self._rest_length)
        for body, design in designs.items():
            later = acting_later(self._made[body], vehicle, ticks, body is Body.LOAD)
            later["body"] = design["body"]
            design[:] = later
