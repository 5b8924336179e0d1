"""Rotor commands for any layout: inverse of the allocation, limits, and what gives way first."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from controller.law.allocation import MOST_ROTORS, allocate, allocation
from controller.law.state import Array
from sitl_bridge.plant.physics import dynamics
from sitl_bridge.plant.physics.parameters import parameters
from sitl_bridge.vehicle.description import Vehicle
from tests.controller.fleet import FLEET, attributes


class Result(NamedTuple):
    controls: Array  # (16,)
    achieved: Array  # (4,)
    limited: bool


def allocated(record: Any, wrench: Array) -> Result:
    controls, achieved = np.full(MOST_ROTORS, 0.5), np.full(4, np.nan)
    limited = allocate(attributes(record), wrench, controls, achieved, np.zeros((2, MOST_ROTORS)))
    return Result(controls, achieved, bool(limited))


def layout(rotors: list[dict[str, Any]]) -> Vehicle:
    """The paper's vehicle with other rotors, light enough for them."""
    paper = FLEET["paper"].model_dump()
    lift = sum(r["thrust_coefficient"] * r["max_speed"] ** 2 for r in rotors)
    paper["airframe"]["mass"] = paper["load"]["mass"] = lift / 9.81 / 4.0
    return Vehicle.model_validate({**paper, "name": "layout", "rotors": tuple(rotors)})


def rotor(angle: float, arm: float, direction: str, size: float = 1.0) -> dict[str, Any]:
    return {
        "position": (arm * math.cos(angle), arm * math.sin(angle), 0.0),
        "direction": direction,
        "thrust_coefficient": 1e-5 * size,
        "torque_coefficient": 2e-7 * size,
        "max_speed": 1000.0,
    }


def regular(count: int, arm: float = 0.3) -> Vehicle:
    """Rotors on a circle, in alternating directions."""
    return layout([rotor(2 * math.pi * i / count, arm, ("ccw", "cw")[i % 2]) for i in range(count)])


@st.composite
def layouts(draw: st.DrawFn) -> Vehicle:
    """4 to 8 rotors, each somewhere near its place on a circle, of different sizes."""
    count = draw(st.sampled_from([4, 5, 6, 8]))
    rotors = [
        rotor(
            2 * math.pi * (i + draw(st.floats(-0.2, 0.2))) / count,
            draw(st.floats(0.2, 0.4)),
            ("ccw", "cw")[i % 2],
            draw(st.floats(0.7, 1.4)),
        )
        for i in range(count)
    ]
    try:
        return layout(rotors)
    except ValueError:
        assume(False)
        raise


def plant_wrench(vehicle: Vehicle, controls: Array) -> Array:
    """The wrench that the plant's own rotors make of these controls."""
    speeds = np.zeros(16)
    speeds[: len(vehicle.rotors)] = [
        c * rotor.max_speed for c, rotor in zip(controls, vehicle.rotors, strict=False)
    ]
    return np.array(dynamics.rotor_wrench(attributes(parameters(vehicle)), speeds))


VEHICLES = [*FLEET.values(), regular(4), regular(6), regular(8)]
share = st.floats(-1.0, 1.0).map(lambda value: round(value, 6))


@pytest.mark.parametrize("vehicle", VEHICLES, ids=[*FLEET, "quad", "hexa", "octo"])
def test_hover_takes_what_the_plant_says(vehicle: Vehicle) -> None:
    hover = np.array([vehicle.hover_thrust, 0.0, 0.0, 0.0])
    result = allocated(allocation(vehicle), hover)
    assert not result.limited
    np.testing.assert_allclose(plant_wrench(vehicle, result.controls), hover, atol=1e-12 * hover[0])
    assert np.all(result.controls[len(vehicle.rotors) :] == 0.5)  # rotors that it does not have: untouched


@given(layouts(), share, share, share, share)
def test_inverse_of_the_allocation(vehicle: Vehicle, a: float, b: float, c: float, d: float) -> None:
    record = allocation(vehicle)
    effect = record[0]["effect"][:, : len(vehicle.rotors)]
    # A wrench that fits: of thrusts near half of the largest, in the span that least squares gives back.
    scale = 0.4 * vehicle.hover_thrust * np.array([1.0, 0.05, 0.05, 0.002])
    wrench = np.array([vehicle.hover_thrust, 0, 0, 0]) + scale * np.array([a, b, c, d])
    # It has to fit without its yaw, too: yaw comes last, and nothing else relies on the room that it makes.
    thrusts = np.linalg.pinv(effect) @ np.column_stack([wrench, wrench * [1, 1, 1, 0]])
    largest = record[0]["largest_thrust"][: len(vehicle.rotors), np.newaxis]
    assume(bool(np.all(thrusts > 1e-6)) and bool(np.all(thrusts < largest - 1e-6)))
    result = allocated(record, wrench)
    assert not result.limited
    np.testing.assert_allclose(result.achieved, wrench, atol=1e-9 * vehicle.hover_thrust)
    np.testing.assert_allclose(
        plant_wrench(vehicle, result.controls), wrench, atol=1e-9 * vehicle.hover_thrust
    )


@given(layouts(), st.floats(-1.0, 5.0), share, share, share)
def test_limits_and_what_is_achieved(vehicle: Vehicle, a: float, b: float, c: float, d: float) -> None:
    """Any wrench, also impossible ones: commands in 0..1, and the plant gives what is said to be achieved."""
    size = vehicle.hover_thrust
    wrench = np.array([a * size, b * size, c * size, d * size])
    result = allocated(allocation(vehicle), wrench)
    used = result.controls[: len(vehicle.rotors)]
    assert np.all(used >= 0.0)
    assert np.all(used <= 1.0 + 1e-12)
    np.testing.assert_allclose(plant_wrench(vehicle, used), result.achieved, atol=1e-9 * size)
    if not result.limited:
        np.testing.assert_allclose(result.achieved, wrench, atol=1e-9 * size)


@given(layouts(), st.floats(0.0, 3.0), share, share, share)
def test_roll_and_pitch_before_thrust_before_yaw(
    vehicle: Vehicle, a: float, b: float, c: float, d: float
) -> None:
    record = allocation(vehicle)
    size, arm = vehicle.hover_thrust, 0.3
    wrench = np.array([a * size, 0.5 * b * arm * size, 0.5 * c * arm * size, 0.1 * d * size])
    got = allocated(record, wrench).achieved
    tolerance = 1e-9 * size
    # Yaw changes nothing of the others, and is given in its own direction, never beyond.
    without_yaw = allocated(record, wrench * [1, 1, 1, 0]).achieved
    np.testing.assert_allclose(got[:3], without_yaw[:3], atol=tolerance)
    assert -tolerance <= got[3] * np.sign(wrench[3]) <= abs(wrench[3]) + tolerance
    # Thrust changes nothing of roll and pitch, and they are shrunk together.
    other_thrust = allocated(record, wrench * [0, 1, 1, 0] + [size, 0, 0, 0]).achieved
    np.testing.assert_allclose(got[1:3], other_thrust[1:3], atol=tolerance)
    assert abs(got[1] * wrench[2] - got[2] * wrench[1]) <= tolerance * size
    assert np.linalg.norm(got[1:3]) <= np.linalg.norm(wrench[1:3]) + tolerance
    # Roll and pitch give way only when no thrust at all could carry them.
    if np.linalg.norm(got[1:3]) < np.linalg.norm(wrench[1:3]) - tolerance:
        count = len(vehicle.rotors)
        inverse, largest = record[0]["inverse"][:count], record[0]["largest_thrust"][:count]
        for thrust in np.linspace(0.0, float(largest.sum()), 200):
            needed = inverse[:, :3] @ [thrust, wrench[1], wrench[2]]
            assert np.any(needed < -tolerance) or np.any(needed > largest + tolerance)
    # Yaw gives way only as far as it has to.
    if abs(got[3]) < abs(wrench[3]) - tolerance:
        controls = allocated(record, wrench).controls[: len(vehicle.rotors)]
        assert np.any(controls < 1e-4) or np.any(controls > 1.0 - 1e-6)


def test_what_gives_way_at_full_and_at_no_thrust() -> None:
    vehicle = regular(4)
    record = allocation(vehicle)
    most = record[0]["largest_thrust"].sum()
    flat_out = allocated(record, np.array([10 * most, 0.0, 0.0, 0.1]))
    assert flat_out.limited
    np.testing.assert_allclose(flat_out.achieved, [most, 0, 0, 0], atol=1e-9 * most)
    # A roll that takes a quarter of a rotor's thrust off one side and adds it to the other: that much
    # thrust is the least, and that much less than all the most.
    roll = 2.0 * 0.3 * most / 16.0
    up = allocated(record, np.array([most, roll, 0.0, 0.0]))
    down = allocated(record, np.array([0.0, roll, 0.0, 0.0]))
    assert up.limited
    assert down.limited
    np.testing.assert_allclose(up.achieved, [0.75 * most, roll, 0, 0], atol=1e-9 * most)
    np.testing.assert_allclose(down.achieved, [0.25 * most, roll, 0, 0], atol=1e-9 * most)


def test_layouts_that_cannot_fly_are_refused() -> None:
    with pytest.raises(ValueError, match="all three moments independently"):
        layout([rotor(math.pi / 2 * i, 0.3, "cw") for i in range(4)])
    in_line = [rotor(0.0, 0.1 * (i - 1.5), ("cw", "ccw")[i % 2]) for i in range(4)]
    with pytest.raises(ValueError, match="all three moments independently"):
        layout(in_line)
    lopsided = [rotor(0.3 * i, 0.3, ("cw", "ccw")[i % 2]) for i in range(5)]
    with pytest.raises(ValueError, match="leaves nothing to"):
        layout(lopsided)
