"""What cannot be flown is refused before anything is launched, with the reasons."""

from __future__ import annotations

from sitl.flights.scenario import GroundControl, Points, Scenario
from sitl_bridge.vehicle.description import Vehicle
from sitl_bridge.vehicle.files import DescriptionError
from sitl_bridge.vehicle.law_weights import LawWeights

FEASIBLE = ("default",)
"""Designs that follow a feasible motion; the others have the reference as it is set."""

ANY_RATE_HZ = 250.0


def check_feasible(scenario: Scenario | None, vehicle: Vehicle, design: str) -> None:
    """Raises DescriptionError, a line for each reason, when the vehicle cannot fly at all or cannot fly this.

    Under ground control motions are limited to what it can do.
    """
    from controller.design.feasibility import path_faults, vehicle_faults

    faults = vehicle_faults(vehicle) or _weight_faults(vehicle, design)
    if not faults and scenario is not None and not isinstance(scenario.reference, GroundControl):
        path = scenario.reference.path(vehicle.initial_load_position)
        for number in range(len(path)):
            key = f"positions.{number}" if isinstance(scenario.reference, Points) else "position"
            faults += path_faults(path[number : number + 1], vehicle, design in FEASIBLE, key)
    if faults:
        raise DescriptionError(f"{vehicle.name} cannot fly this", faults)


def _weight_faults(vehicle: Vehicle, design: str) -> list[str]:
    """What is wrong with the `[law]` of a description, if it changes any weight."""
    if vehicle.law == LawWeights():
        return []
    from controller.design import catalogue

    try:
        catalogue.design(design, vehicle, ANY_RATE_HZ)
    except (ValueError, ArithmeticError):  # LinAlgError is a ValueError
        return ["law: no gains can be designed with these weights; go back to factors nearer to 1"]
    return []
