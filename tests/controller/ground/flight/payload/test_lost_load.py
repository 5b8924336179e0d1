"""A load that is lost in the air: the vehicle stays at its own height and goes on with what it was told."""

from __future__ import annotations

import pytest

from controller.ground.flight.motion.setpoint_types import Body, Goto
from tests.controller.ground.flown import Flown
from tests.controller.ground.in_flight import ACCEPTED, HOME_HEIGHT, flying, local_setpoint, mode, stream
from tests.controller.ground.kinematic import ZURICH
from tests.controller.ground.missions.test_missions import Uploader, other, waypoint
from tests.controller.ground.rig import NAN, Rig


def lose_load(rig: Rig) -> None:
    rig.view.load_attached = rig.view.cable_taut = False
    rig.view.load_on_ground = True
    x, y, _ = rig.view.load_position
    rig.view.load_position = (x, y, 0.05)


def test_a_take_off_goes_on_straight_up() -> None:
    rig = Rig()
    client = rig.client()
    rig.run(0.1)
    client.command(400, 1)
    client.command(22, *(NAN,) * 6, ZURICH[2] + HOME_HEIGHT + 5.0)
    rig.run_until(lambda: isinstance(rig.target, Goto) and rig.target.body is Body.LOAD)
    rig.run(0.5)
    x, y, _ = rig.view.position
    lose_load(rig)
    rig.run(0.02)
    assert rig.target.body is Body.VEHICLE
    assert rig.target.position == pytest.approx((x, y, 5.0 + HOME_HEIGHT), abs=0.05)
    rig.run_until(lambda: mode(rig) == "HOLD")
    rig.run(2.0)
    assert rig.view.position == pytest.approx((x, y, 5.0 + HOME_HEIGHT), abs=0.05)


def test_a_take_off_whose_load_is_lost_before_it_hangs_goes_up_all_the_same() -> None:
    rig = Rig()
    client = rig.client()
    rig.run(0.1)
    client.command(400, 1)
    client.command(22)
    rig.run(0.5)
    lose_load(rig)
    rig.run_until(lambda: mode(rig) == "HOLD")
    rig.run(2.0)
    assert rig.view.position[2] == pytest.approx(2.5 + HOME_HEIGHT, abs=0.05)


def test_hold_keeps_the_vehicles_place() -> None:
    rig, _ = flying()
    rig.run(3.0)
    before = rig.view.position
    lose_load(rig)
    rig.run(5.0)
    assert rig.view.position == pytest.approx(before, abs=0.01)


def test_a_point_asked_for_after_the_loss_and_before_the_next_look_is_not_raised() -> None:
    rig, client = flying()
    rig.run(3.0)
    lose_load(rig)
    assert client.command(192, -1, 1, 0, NAN, *ZURICH[:2], ZURICH[2] + 6.0).result == ACCEPTED
    rig.run(5.0)
    assert rig.view.position[2] == pytest.approx(6.0, abs=0.01)


def test_a_wait_in_a_mission_keeps_the_vehicles_place() -> None:
    rig, client = flying()
    assert Uploader(client, [waypoint(4, 0, 6), other(93, 20.0), waypoint(0, 0, 6)]).run() == ACCEPTED
    assert client.command(300, 0, 0).result == ACCEPTED
    rig.run_until(lambda: rig.station.machine.mission.current == 1)
    rig.run(3.0)
    before = rig.view.position
    lose_load(rig)
    rig.run(5.0)
    assert rig.station.machine.mission.current == 1
    assert rig.view.position == pytest.approx(before, abs=0.01)
    rig.run_until(lambda: rig.station.machine.mission.current == 2)
    rig.run(3.0)
    assert rig.view.position == pytest.approx((0.0, 0.0, 6.0 + HOME_HEIGHT), abs=0.05)


def test_return_goes_on_at_the_vehicles_height_and_to_its_own_home() -> None:
    rig, client = flying()
    assert client.command(192, -1, 1, 0, NAN, ZURICH[0] + 2e-4, ZURICH[1], ZURICH[2] + 3.0).result == ACCEPTED
    rig.run_until(lambda: rig.view.position[1] > 20)
    assert client.command(20).result == ACCEPTED
    rig.run_until(lambda: rig.view.position[1] < 15)
    cruising = rig.view.position[2]
    lose_load(rig)
    while rig.view.position[1] > 1.0:
        rig.run(0.02)
        assert rig.view.position[2] == pytest.approx(cruising, abs=0.4)
    rig.run_until(lambda: not rig.station.armed)
    assert rig.view.position[:2] == pytest.approx((0.0, 0.0), abs=0.5)


def test_return_is_climbing_when_the_load_is_lost() -> None:
    rig, client = flying()
    assert client.command(192, -1, 1, 0, NAN, ZURICH[0] + 2e-4, ZURICH[1], ZURICH[2] + 3.0).result == ACCEPTED
    rig.run_until(lambda: rig.view.position[1] > 20)
    assert client.command(20).result == ACCEPTED
    rig.run(0.3)
    lose_load(rig)
    lowest = rig.view.position[2]
    while rig.view.position[1] > 10.0:
        rig.run(0.02)
        assert rig.view.position[2] >= lowest - 0.01
        lowest = rig.view.position[2]
    assert lowest == pytest.approx(6.0 + HOME_HEIGHT, abs=0.6)


@pytest.mark.parametrize(("component", "height"), [((1, 1), 5.0), ((101, 35), 3.0 + 1.6)])
def test_set_points_keep_the_vehicle_above_where_the_load_would_be(
    component: tuple[int, int], height: float
) -> None:
    rig, client = flying()
    up = 5.0 if component == (1, 1) else 3.0
    message = local_setpoint(0, 0, -up, system=component[0], component=component[1])
    stream(rig, client, message, 0.3)
    assert client.command(176, 1, 6, 0).result == ACCEPTED
    stream(rig, client, message, 4.0)
    assert rig.view.position[2] == pytest.approx(height, abs=0.01)
    lose_load(rig)
    stream(rig, client, message, 3.0)
    assert mode(rig) == "OFFBOARD"
    assert rig.view.position[2] == pytest.approx(height, abs=0.01)
    rig.run(4.0)  # no more set-points: hold
    assert mode(rig) == "HOLD"
    assert rig.view.position[2] == pytest.approx(height, abs=0.05)


@pytest.mark.parametrize("vehicle", ["iris", "heavy"])
def test_the_real_plants_vehicle_stays_at_its_height(vehicle: str) -> None:
    flight = Flown(vehicle=vehicle)
    client = flight.client()
    flight.take_off(client)
    flight.run(4.0)
    height = flight.flown(0.1).vehicle[-1, 2]
    flight.simulation.world.release_cable()
    flight.run(15.0)
    assert any("The load is lost" in text for text in client.texts())
    assert flight.flown(1.0).vehicle[:, 2] == pytest.approx(height, abs=0.15)


def test_the_real_plants_vehicle_takes_off_without_the_load_that_it_loses() -> None:
    flight = Flown()
    client = flight.client()
    flight.run(0.5)
    assert client.command(400, 1).result == 0
    assert client.command(22, *(NAN,) * 6, ZURICH[2] + 6.0).result == 0
    flight.run_until(lambda: not flight.station.machine.view.load_on_ground)  # type: ignore[union-attr]
    flight.run(0.5)
    flight.simulation.world.release_cable()
    flight.run_until(lambda: flight.station.machine.mode.name == "HOLD")
    flight.run(5.0)
    assert flight.flown(1.0).vehicle[:, 2] == pytest.approx(6.0, abs=0.15)
