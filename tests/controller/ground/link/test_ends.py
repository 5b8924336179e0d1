"""Disarming, termination, a lost load, a vehicle without ground."""

from __future__ import annotations

import dataclasses

import pytest
from pymavlink.dialects.v20 import common as mavlink

from controller.ground.flight.motion.setpoint_types import Body, Goto, Idle, Land, Terminate
from controller.ground.telemetry.vehicle_state import Profile
from sitl_bridge.frames import LocalOrigin
from tests.controller.ground.in_flight import ACCEPTED, DENIED, REJECTED, flying
from tests.controller.ground.kinematic import ZURICH, grounded_view
from tests.controller.ground.rig import NAN, Rig


def test_disarming_in_flight_needs_force() -> None:
    rig, client = flying()
    assert client.command(400, 0).result == DENIED
    assert "21196" in client.texts()[-1]
    assert rig.station.armed
    assert client.command(400, 0, 21196).result == ACCEPTED
    assert rig.target == Idle(False)


def test_termination_is_for_good() -> None:
    rig, client = flying()
    assert client.command(185, 0).result == DENIED
    assert client.command(185, 1).result == ACCEPTED
    assert rig.target == Terminate()
    rig.run(1.2)
    beat = [m for m in client.got("HEARTBEAT") if m.get_srcSystem() == 1][-1]
    assert beat.system_status == mavlink.MAV_STATE_FLIGHT_TERMINATION
    assert beat.custom_mode == 10 << 16
    assert client.command(176, 1, 4, 3).result == DENIED
    assert client.command(22).result == DENIED
    assert client.command(192, -1, 1, 0, NAN, NAN, NAN, 492.0).result == DENIED
    assert client.command(400, 1).result == REJECTED
    assert all("terminated; disarm first" in text for text in client.texts()[-4:]), client.texts()
    assert client.command(400, 0).result == ACCEPTED
    assert client.command(400, 1).result == ACCEPTED


def test_a_vehicle_without_ground_is_in_the_air_when_armed() -> None:
    profile = Profile("paper", 0, LocalOrigin(*ZURICH), 1.0, 1.981, 9.81, False)
    view = dataclasses.replace(
        grounded_view(), position=(0.0, 0.0, 1.981), load_position=(0.0, 0.0, 0.0), cable_taut=True,
        vehicle_on_ground=False, load_on_ground=False,
    )  # fmt: skip
    rig = Rig(profile, view=view)
    client = rig.client()
    rig.frozen = True
    rig.run(0.1)
    assert client.command(400, 1).result == ACCEPTED
    assert rig.target == Goto(Body.LOAD, (0.0, 0.0, 0.0), pytest.approx(0.3), 3.0)
    assert client.command(21).result == DENIED
    assert "no ground" in client.texts()[-1]
    assert client.command(22).result == REJECTED
    assert client.command(192, -1, 1, 0, NAN, NAN, NAN, 487.0).result == ACCEPTED


def test_armed_again_in_the_air_home_is_on_the_ground() -> None:
    """Killed, and caught before it falls fast: heights above home are not above where that happened."""
    rig, client = flying()
    rig.frozen = True
    rig.view.velocity = rig.view.load_velocity = (0.0, 0.0, 0.0)
    above = rig.view.position[2]
    assert client.command(400, 0, 21196).result == ACCEPTED
    assert client.command(400, 1).result == ACCEPTED
    rig.run(0.1)
    assert isinstance(rig.target, Goto)  # it holds
    x, y, _ = rig.view.position
    assert rig.station.machine.home == (x, y, rig.station.profile.ground_height)
    home_altitude = rig.station.machine.home_geodetic().altitude
    assert client.command(192, -1, 1, 0, NAN, NAN, NAN, home_altitude + above).result == ACCEPTED


def test_a_lost_load_leaves_the_vehicle_to_itself() -> None:
    rig, client = flying()
    rig.view.load_attached = False
    rig.view.cable_taut = False
    rig.run(0.1)
    assert rig.target.body is Body.VEHICLE
    assert client.command(21).result == ACCEPTED
    rig.run_until(lambda: isinstance(rig.target, Land))
    rig.run_until(lambda: not rig.station.armed)
