"""DO_WINCH, flown on the real plant: the vehicle hovers, the load goes up and down below it."""

from __future__ import annotations

import numpy as np
import pytest
from pymavlink.dialects.v20 import common as mavlink

from sitl_bridge.vehicle.files import load_vehicle
from tests.controller.ground.flight.payload.test_gripper import ACCEPTED, DENIED, UNSUPPORTED, hovering
from tests.controller.ground.flown import Designer
from tests.controller.ground.rig import NAN, Rig
from tests.estimator.guided import GuidedFlight

DO_WINCH = 42600
RELAX, LENGTH, RATE, LOCK, DELIVER, HOLD, RETRACT = 0, 1, 2, 3, 4, 5, 6


@pytest.mark.parametrize(("vehicle", "height"), [("iris", 9.0), ("heavy", 36.0)])
def test_the_whole_range_is_reeled_below_a_hovering_vehicle(vehicle: str, height: float) -> None:
    flight, client = hovering(vehicle, height)
    winch = flight.vehicle.winch
    assert winch is not None
    before = flight.flown(0.1).vehicle[-1].copy()
    for length in (winch.max_length, winch.min_length):
        start = flight.simulation.world.reel().length
        assert client.command(DO_WINCH, 1, LENGTH, length - start, winch.rate).result == ACCEPTED
        duration = abs(length - start) / winch.rate + 8.0
        flight.run(duration)
        way = flight.flown(duration)
        assert flight.simulation.world.reel().length == pytest.approx(length, abs=0.03)
        assert np.abs(way.vehicle - before).max() < 0.5
        hanging = way.vehicle[-1, 2] - way.load[-1, 2]
        assert not [text for text in client.texts() if "lost" in text]
        stretch = flight.vehicle.hover_length - flight.vehicle.cable.rest_length
        assert hanging == pytest.approx(length + stretch, abs=0.05)


def test_rate_hold_lock_and_retract() -> None:
    flight, client = hovering("iris", 9.0)
    assert client.command(DO_WINCH, 1, RATE, 0, 0.3).result == ACCEPTED
    flight.run(3.0)
    assert flight.simulation.world.reel().rate == pytest.approx(0.3, abs=1e-3)
    assert client.command(DO_WINCH, 1, HOLD).result == ACCEPTED
    flight.run(2.0)
    assert flight.simulation.world.reel().rate == 0.0
    assert client.command(DO_WINCH, 1, RATE, 0, -0.3).result == ACCEPTED
    flight.run(1.0)
    assert client.command(DO_WINCH, 1, LOCK).result == ACCEPTED
    flight.run(2.0)
    assert flight.simulation.world.reel().rate == 0.0
    assert client.command(DO_WINCH, 1, RETRACT).result == ACCEPTED
    flight.run(8.0)
    assert flight.vehicle.winch is not None
    assert flight.simulation.world.reel().length == pytest.approx(flight.vehicle.winch.min_length, abs=0.03)


def test_relaxed_the_load_runs_out_until_it_lies() -> None:
    flight, client = hovering("iris", 5.0)
    before = flight.flown(0.1).vehicle[-1].copy()
    assert client.command(DO_WINCH, 1, RELAX).result == ACCEPTED
    flight.run(40.0)
    way = flight.flown(40.0)
    assert way.load[-1, 2] < 0.1
    assert np.abs(way.vehicle - before).max() < 0.5


@pytest.mark.parametrize(("vehicle", "height", "preset"), [("iris", 9.0, "consumer"), ("heavy", 20.0, "rtk")])
def test_on_estimates_the_filter_follows_the_cable(vehicle: str, height: float, preset: str) -> None:
    described = load_vehicle(vehicle, [f"sensors.preset={preset}"])
    flight = GuidedFlight(described, 1, redesigner=Designer(described))
    flight.arm_and_take_off(height)
    flight.wait(3.0)
    winch = flight.machine.payload.winch
    assert winch is not None
    for way in (2.0, -2.0):
        first, length = len(flight.rows), winch.length
        winch.go_by(way, 0.0)
        flight.wait(abs(way) / winch.description.rate + 6.0)
        assert flight.simulation.world.reel().length == pytest.approx(length + way, abs=0.03)
        errors = flight.errors()[first:]
        assert np.abs(errors[:, 3:6] - errors[:, 0:3]).max() < 0.3
        estimates = np.array([row[2][0:3] for row in flight.rows[first:]])
        assert np.abs(estimates - estimates[0]).max() < 0.4
    assert flight.feedback.estimator.memory["load_resets"] == 0
    assert not [text for text in flight.said if "lost" in text]


def test_what_is_no_action_is_denied() -> None:
    flight, client = hovering()
    for action in (-1, 0.5, 10, NAN):
        assert client.command(DO_WINCH, 1, action, 0, 0).result == DENIED
    assert client.command(DO_WINCH, 1, LENGTH, NAN, 0).result == DENIED
    assert client.command(DO_WINCH, 1, RATE, 0, NAN).result == DENIED
    flight.run(1.0)
    assert flight.simulation.world.reel().rate == 0.0


def test_the_winch_answers_as_a_component_of_its_own() -> None:
    """MAVSDK's plug-in addresses MAV_COMP_ID_WINCH, and waits for an answer from there."""
    flight, client = hovering()
    client.clear()
    for number in (DO_WINCH, 400):
        client.send(mavlink.MAVLink_command_long_message(1, 169, number, 0, 1, RETRACT, 0, 0, 0, 0, 0))
        flight.run(0.1)
    assert [ack.result for ack in client.got("COMMAND_ACK")] == [ACCEPTED, UNSUPPORTED]
    assert {ack.get_srcComponent() for ack in client.got("COMMAND_ACK")} == {169}
    flight.run(3.0)
    status = client.got("WINCH_STATUS")[-1]
    assert status.status & 256  # it is retracting
    assert status.tension == pytest.approx(flight.vehicle.load.mass, abs=0.05)  # kg
    winch = flight.vehicle.winch
    assert winch is not None
    assert winch.min_length - 0.1 < status.line_length < flight.vehicle.cable.rest_length


def test_a_vehicle_without_a_winch_says_so() -> None:
    assert Rig().client().command(DO_WINCH, 1, RELAX).result == UNSUPPORTED
