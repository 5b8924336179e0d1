"""A shipped scenario's path, as fast as another vehicle than the scenario's own can go round it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from sitl.flights.scenario import (
    Circle,
    FigureEight,
    Helix,
    Overrides,
    Scenario,
    load_scenario,
    scenario_names,
    scenario_vehicle,
    with_agility,
)
from sitl_bridge.vehicle.description import Vehicle

EASILY = 0.75
"""Of the fastest rate: at that itself the load is followed on its sensors with metres of error."""


class SuitedScenario(NamedTuple):
    """A scenario for one vehicle, and what was changed for it."""

    scenario: Scenario
    notes: Sequence[str]
    """One line each, for the person who flies it."""


def scenario_for(
    name_or_file: str, vehicle: str | Vehicle | None, overrides: Overrides, agility: float | None = None
) -> SuitedScenario:
    """A scenario by shipped name or path, for a vehicle (None: its own). Raises DescriptionError.

    Another vehicle goes round a shipped path more slowly where it cannot keep up. In a file somebody has
    written what is to be flown: it stays, and may be refused.
    """
    scenario = with_agility(load_scenario(name_or_file), agility)
    name = vehicle.name if isinstance(vehicle, Vehicle) else vehicle
    if name in (None, scenario.vehicle) or name_or_file not in scenario_names():
        return SuitedScenario(scenario, ())
    if not isinstance(scenario.reference, Circle | FigureEight | Helix):
        return SuitedScenario(scenario, ())
    return slowed(scenario, scenario_vehicle(scenario, vehicle, overrides))


def slowed(scenario: Scenario, vehicle: Vehicle) -> SuitedScenario:
    """The scenario at the rate that its vehicle can go round, if that is less than the scenario's."""
    from controller.design.feasibility import fastest_rate

    reference = scenario.reference
    assert isinstance(reference, Circle | FigureEight | Helix)
    fastest, why = fastest_rate(reference.path(vehicle.initial_load_position), vehicle)
    if why is None or fastest == 0.0:
        return SuitedScenario(scenario, ())
    rate = math.copysign(float(f"{EASILY * fastest:.2g}"), reference.angular_rate)
    note = f"{vehicle.name} goes round at {rate:g} rad/s, not at {reference.angular_rate:g}: {why}"
    slower = reference.model_copy(update={"angular_rate": rate})
    return SuitedScenario(scenario.model_copy(update={"reference": slower}), (note,))
