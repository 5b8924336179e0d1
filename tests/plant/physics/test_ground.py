"""The ground: rest is rest, friction sticks and slips by Coulomb's law, impacts take energy."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from sitl_bridge.plant.physics.parameters import step_count
from sitl_bridge.plant.physics.state import (
    BODY_RATES,
    LOAD_GROUND_FORCE,
    LOAD_POSITION,
    LOAD_VELOCITY,
    SPECIFIC_FORCE,
    VEHICLE_GROUND_FORCE,
    VEHICLE_VELOCITY,
)
from sitl_bridge.vehicle.files import DescriptionError, load_vehicle
from tests.plant.flying import Flight, energy, flight, flight_without_cable, plain_vehicle


@pytest.mark.parametrize("name", ["iris", "heavy"])
def test_rest_stays_at_rest_for_a_minute(name: str) -> None:
    """On the legs, the load beside it, a steady wind pulling at both: no creep, no jitter."""
    plant = flight(name)
    plant.winds[0] = 3.0, 2.0, 0.0, 3.0, 2.0, 0.0
    plant.run(2.0)
    settled = plant.x.copy()
    states = plant.path(60.0, 0.1)
    assert np.abs(states - settled).max() < 1e-9
    assert np.abs(states[:, VEHICLE_VELOCITY]).max() < 1e-10
    assert np.abs(states[:, LOAD_VELOCITY]).max() < 1e-10
    assert np.abs(states[:, BODY_RATES]).max() < 1e-10


stands = st.fixed_dictionaries(
    {
        "legs": st.integers(3, 8),
        "turned": st.floats(0.0, 6.3),
        "spread": st.floats(0.1, 1.0),
        "below": st.floats(0.05, 0.5),
        "mass": st.floats(0.5, 20.0),
        "load": st.floats(0.1, 20.0),
        "second_moments": st.tuples(*[st.floats(0.01, 1.0)] * 3),
        "sink": st.floats(1e-3, 1e-2),
        "friction": st.floats(0.2, 1.0),
        "stiffness": st.floats(50.0, 1e4),
    }
)


@settings(max_examples=10, deadline=None)
@given(stands)
def test_any_vehicle_rests_for_a_minute(stand: dict[str, Any]) -> None:
    """On three to eight legs, light or heavy, on hard ground or soft, its load beside it: nothing moves."""
    # Tilted by a, the legs push back with m g a r² / 2 sink, and the weight tips with m g a h.
    assume(stand["spread"] ** 2 / (2.0 * stand["sink"]) > 2.0 * stand["below"])
    angles = stand["turned"] + 2 * math.pi * np.arange(stand["legs"]) / stand["legs"]
    legs = [(stand["spread"] * math.cos(a), stand["spread"] * math.sin(a), -stand["below"]) for a in angles]
    east, north, up = stand["second_moments"]  # kg m²
    inertia = (north + up, east + up, east + north)
    vehicle = plain_vehicle(
        airframe={"mass": stand["mass"], "inertia": inertia, "legs": legs},
        load={"mass": stand["load"], "radius": 0.05},
        cable={"stiffness": stand["stiffness"], "rest_length": 2.0},
        ground={"sink": stand["sink"], "friction": stand["friction"]},
        initial={"start": "ground", "load_position": [1.0, 0.5, 0.0]},
    )
    plant = Flight(vehicle)
    steps = step_count(vehicle, 0.1)
    start = plant.x.copy()
    states = plant.path(60.0, 0.1, step=0.1 / steps)
    assert np.abs(states - start).max() < 1e-9
    assert np.abs(states[:, [3, 4, 5, 10, 11, 12, 16, 17, 18]]).max() < 1e-9


@pytest.mark.parametrize("name", ["iris", "heavy"])
def test_starts_in_balance(name: str) -> None:
    """Without wind nothing moves from the first step on, and the accelerometer reads g."""
    plant = flight(name)
    start = plant.x.copy()
    plant.run(1.0)
    np.testing.assert_allclose(plant.x, start, rtol=0, atol=1e-12)
    np.testing.assert_allclose(plant.reactions[SPECIFIC_FORCE], [0, 0, 9.81], rtol=0, atol=1e-9)
    v = plant.vehicle
    assert plant.reactions[VEHICLE_GROUND_FORCE] == pytest.approx(v.airframe.mass * 9.81, rel=1e-9)
    assert plant.reactions[LOAD_GROUND_FORCE] == pytest.approx(v.load.mass * 9.81, rel=1e-9)


@pytest.mark.parametrize("share", [0.5, 0.95])
def test_friction_holds_what_it_can(share: float) -> None:
    """A steady push below mu N moves the load by its contact's stretch and no further, however long."""
    plant = flight("iris")
    weight = plant.vehicle.load.mass * 9.81
    plant.forces[0, 3] = share * 0.5 * weight
    plant.run(2.0)
    stuck = plant.x[LOAD_POSITION].copy()
    plant.run(60.0)
    np.testing.assert_allclose(plant.x[LOAD_POSITION], stuck, rtol=0, atol=1e-9)
    if share < 0.8:  # else the jolt of the sudden push made it slip a little, once
        plant.forces[0, 3] = 0.0
        plant.run(2.0)
        assert plant.x[13] == pytest.approx(1.0, abs=1e-9)


def test_friction_yields_to_more() -> None:
    """Above mu N the load slides, and slows down, as Coulomb says."""
    plant = flight("iris", "load.drag.quadratic=0", "cable.rest_length=50")
    plant.forces[0, 3] = 2.0 * 0.5 * plant.vehicle.load.mass * 9.81
    plant.run(1.0)
    speed = plant.x[16]
    assert speed == pytest.approx(0.5 * 9.81, rel=0.02)
    plant.forces[0, 3] = 0.0
    plant.run(0.5)
    assert speed - plant.x[16] == pytest.approx(0.5 * 9.81 * 0.5, rel=1e-3)
    plant.run(5.0)
    assert abs(plant.x[16]) < 1e-10


impacts = st.tuples(
    st.floats(0.0, 2.0), st.floats(-2.0, 2.0), st.floats(-0.5, 0.5), st.floats(-0.5, 0.5), st.floats(0.0, 3.0)
)


@settings(max_examples=25, deadline=None)
@given(st.sampled_from(["iris", "heavy"]), impacts)
def test_impacts_never_gain_energy(name: str, case: tuple[float, ...]) -> None:
    """Dropped on any leg at any speed: energy outside the ground never exceeds the start's."""
    height, sideways, roll, pitch, spin = case
    plant = flight(
        name,
        "initial.start=hover",
        "cable.rest_length=100",
        "initial.load_position=[2, 0, 1]",
        f"initial.vehicle_position=[0, 0, {1.0 + height}]",
        f"initial.attitude=[{roll}, {pitch}, 0.3]",
        f"initial.vehicle_velocity=[{sideways}, 0.5, -1]",
        f"initial.body_rates=[{spin}, 0, {spin}]",
    )
    plant.inner[:4] = 0.0
    steps = step_count(plant.vehicle, 0.01)
    states = plant.path(3.0, 0.01, step=0.01 / steps)
    total = energy(plant.vehicle, states)
    assert np.isfinite(states).all()
    assert total.max() <= total[0] + 1e-6
    assert np.linalg.norm(states[-1, VEHICLE_VELOCITY]) < 0.5 * math.sqrt(2 * 9.81 * (1 + height))


def test_load_alone_settles_on_the_ground() -> None:
    plant = flight_without_cable("iris", "initial.start=hover", "initial.load_position=[0, 0, 2]")
    plant.run(5.0)
    assert plant.x[15] == pytest.approx(0.05 - 0.003, abs=1e-9)
    assert np.abs(plant.x[LOAD_VELOCITY]).max() < 1e-9


@pytest.mark.parametrize(
    ("overrides", "fault"),
    [
        (["initial.load_position=[2, 0, 0]"], "further than cable.rest_length"),
        (["airframe.legs=[[0.1, 0, -0.1]]"], "three or more"),
    ],
)
def test_impossible_stands_are_refused(overrides: list[str], fault: str) -> None:
    with pytest.raises(DescriptionError, match=fault):
        load_vehicle("iris", overrides)


def test_no_ground_no_stand() -> None:
    with pytest.raises(DescriptionError, match="no \\[ground\\] table"):
        load_vehicle("paper", ["initial.start=ground"])
