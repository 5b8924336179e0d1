"""The plant against a formulation that shares neither frame, nor attitude, nor integrator with it."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sitl.studies.paper import independent_simulation
from sitl_bridge.plant.physics.parameters import parameters
from sitl_bridge.plant.physics.state import ATTITUDE, LOAD_POSITION, VEHICLE_POSITION, initial_state
from sitl_bridge.vehicle.files import load_vehicle
from tests.plant.physics.stepping import Array, fly, rotor_speeds

DURATION = 10.0
SAMPLE_STEPS = 100

Moment = tuple[float, float, float]

# Smooth cases: the cable never changes between taut and slack, and pitch stays below 90 degrees.
# Overrides of `paper`, thrust as a multiple of hover's, moment in N m: 1e-4 turns the vehicle by 29° in 10 s.
CASES: dict[str, tuple[list[str], float, Moment]] = {
    "fall": (["initial.vehicle_position=[0, 0, 1.4]"], 0.0, (0, 0, 0)),
    "bounce, undamped": (["cable.damping=0", "initial.vehicle_position=[0, 0, 2.6]"], 1.0, (0, 0, 0)),
    "bounce": (["initial.vehicle_position=[0, 0, 2.6]"], 1.0, (0, 0, 0)),
    "bounce across the rest length": (
        ["initial.vehicle_position=[0, 0, 0.5]", "initial.load_velocity=[0, 0, 0.3]"],
        1.0,
        (0, 0, 0),
    ),
    "pendulum": (["initial.vehicle_position=[0.9, -0.5, 1.7]"], 1.0, (0, 0, 0)),
    "spherical pendulum on 10 m": (
        [
            "cable.rest_length=10",
            "initial.vehicle_position=[3, 1, 9.5]",
            "initial.load_velocity=[-0.5, 1.5, 0.2]",
        ],
        1.05,
        (0, 0, 0),
    ),
    "roll moment": ([], 1.0, (-1e-4, 0, 0)),
    "pitch moment": ([], 1.0, (0, 1e-4, 0)),
    "yaw moment": ([], 1.0, (0, 0, -5e-4)),
    "tumbling about unequal axes": (
        [
            "airframe.inertia=[0.1, 0.2, 0.25]",
            "initial.body_rates=[1.5, 0.1, 0.2]",
            "initial.attitude=[0.4, -0.3, 2]",
        ],
        0.9,
        (0, 0, 1e-3),
    ),
    "moments about all axes, tension-only": (
        ["airframe.inertia=[0.1, 0.2, 0.25]", "cable.model=tension-only", "initial.attitude=[0, 0, 1]"],
        1.0,
        (1e-3, -1e-3, 2e-2),
    ),
}


@pytest.mark.parametrize(("overrides", "thrust", "moment"), CASES.values(), ids=CASES.keys())
def test_both_formulations_agree_to_a_micrometre(overrides: list[str], thrust: float, moment: Moment) -> None:
    compare(overrides, thrust, moment, np.zeros(6))


def test_they_agree_under_external_forces() -> None:
    compare(*CASES["pendulum"], np.array([0.7, -0.4, 0.2, -0.3, 0.6, -0.1]))


def compare(overrides: list[str], thrust: float, moment: Moment, force: Array) -> None:
    """Fly one case both ways; force: (6,) N, ENU, on vehicle and load."""
    vehicle = load_vehicle("paper", overrides)
    speeds = rotor_speeds(vehicle, thrust * vehicle.hover_thrust, moment)
    states = fly(
        parameters(vehicle), initial_state(vehicle), speeds, DURATION, every=SAMPLE_STEPS, force=force
    )
    times = np.linspace(0, DURATION, len(states))
    east, north, up, load_east, load_north, load_up = force.tolist()
    second = independent_simulation.simulate(
        vehicle,
        (thrust * vehicle.hover_thrust, *moment),
        times,
        (east, north, up),
        (load_east, load_north, load_up),
    )

    assert not second.diverged
    assert np.abs(states[:, VEHICLE_POSITION] - second.vehicle).max() < 1e-6
    assert np.abs(states[:, LOAD_POSITION] - second.load).max() < 1e-6
    attitude = Rotation.from_quat(states[:, ATTITUDE], scalar_first=True).as_matrix()
    second_attitude = Rotation.from_euler("ZYX", second.states[:, [17, 16, 15]]).as_matrix()
    assert np.abs(attitude - second_attitude).max() < 1e-6

    # The case shows something: it is not the equilibrium, and the world is not upside down.
    travelled = np.ptp(states[:, LOAD_POSITION], axis=0).max() + np.ptp(attitude[:, 0, 1])
    assert travelled > 0.1
