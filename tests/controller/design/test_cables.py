"""Any vehicle on any cable: the law that is designed on what the cable acts as flies it."""

import pytest

from controller.design.catalogue import design
from controller.design.motion.ramp import planned
from controller.law.reference import circle, setpoint
from sitl_bridge.vehicle.cable_law import linear_cable, linearised
from sitl_bridge.vehicle.description import Vehicle
from sitl_bridge.vehicle.files import load_vehicle
from tests.controller.closed_loop import fly

RATE = 250.0
CHAIN = "chain"
HANDFUL = [
    ("paper", CHAIN),
    ("iris", CHAIN),
    ("heavy", CHAIN),
    ("paper", "nylon"),
    ("paper", "dyneema"),
    ("paper", "rubber"),
    ("iris", "polyester"),
    ("iris", "rubber"),
    ("heavy", "nylon"),
]
flown = pytest.mark.parametrize(("name", "cable"), HANDFUL)


def on_cable(name: str, cable: str) -> Vehicle:
    return load_vehicle(
        name,
        [
            *(
                ["cable.model=chain"]
                if cable == CHAIN
                else ["cable.model=progressive", f"cable.material={cable}"]
            ),
            "initial.start=hover",
            "initial.load_position=[0, 0, 20]",
        ],
    )


@flown
def test_a_set_point_is_reached(name: str, cable: str) -> None:
    vehicle = on_cable(name, cable)
    start = vehicle.initial_load_position
    path = planned(setpoint((3.0, 3.0, 24.0), start), vehicle)
    flight = fly(vehicle, design("default", vehicle, RATE), path, float(path["ramp_time"][0]) + 12.0, RATE)
    assert flight.metrics["settled"]
    overshoot, error = flight.metrics["overshoot_pct"], flight.metrics["steady_state_error_m"]
    assert overshoot is None or overshoot < 5.0
    assert error is not None
    assert error < 0.01


@flown
def test_a_circle_is_followed(name: str, cable: str) -> None:
    vehicle = on_cable(name, cable)
    start = vehicle.initial_load_position
    path = planned(circle((0.0, 0.0, 20.0), 5.0, 0.5, start), vehicle)
    flight = fly(vehicle, design("default", vehicle, RATE), path, float(path["ramp_time"][0]) + 20.0, RATE)
    assert flight.metrics["settled"]


def test_the_controller_is_told_a_linear_cable_that_hangs_as_long() -> None:
    vehicle = on_cable("iris", "nylon")
    told = linearised(vehicle)
    assert told.cable.model == "tension-only"
    assert told.hover_length == pytest.approx(vehicle.hover_length, rel=1e-12)
    assert told.initial_vehicle_position == pytest.approx(vehicle.initial_vehicle_position)
    assert linearised(told) is told
    paper = load_vehicle("paper")
    assert linear_cable(paper) is paper.cable


def test_vehicle_and_load_are_told_to_carry_half_a_chain_each() -> None:
    vehicle = on_cable("heavy", CHAIN)
    told = linearised(vehicle)
    assert told.hover_thrust == pytest.approx(vehicle.hover_thrust, rel=1e-12)
    assert told.hover_length == pytest.approx(vehicle.hover_length, rel=1e-12)
    assert told.load.mass == pytest.approx(1.05 * vehicle.load.mass)
    assert told.cable_mass == 0.0
