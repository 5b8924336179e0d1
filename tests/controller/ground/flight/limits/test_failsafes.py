"""The failsafes condition by condition, without a vehicle that flies."""

from __future__ import annotations

import math
from typing import Any

import pytest

from controller.ground.commands.result import CRITICAL, EMERGENCY, WARNING
from controller.ground.flight.limits.failsafes import SLOW_CHECKS, Failsafes, Reaction, Situation, Trigger
from controller.ground.flight.limits.fence import Fence
from controller.ground.flight.limits.fence_zones import Zone
from controller.ground.flight.px4_modes import Mode
from controller.ground.parameters.protocol import Parameters
from controller.ground.telemetry.vehicle_state import VehicleView
from sitl_bridge.frames import quaternion_from_euler
from tests.controller.ground.kinematic import grounded_view

NOW = 1000.0
ARMED_AT = 900.0


class Watched:
    """Failsafes, what they look at, and the parameters that rule them."""

    def __init__(self, **parameters: float) -> None:
        self.failsafes = Failsafes()
        self.view: VehicleView = grounded_view()
        self.situation = Situation(Mode.HOLD, True, -math.inf, None, ARMED_AT)
        self.parameters = Parameters()
        self.fence = Fence((0.0, 0.0, 0.0), 0.0, 0.0, 0.0)
        for name, value in parameters.items():
            assert self.parameters.set(name, value) == ""

    def check(self, now: float = NOW, **situation: Any) -> list[Trigger]:
        self.situation = self.situation._replace(**situation)
        return self.failsafes.check(self.view, now, self.situation, self.parameters, self.fence)

    def one(self, now: float = NOW, **situation: Any) -> Trigger:
        (trigger,) = self.check(now, **situation)
        return trigger


def test_nothing_is_wrong_with_a_good_vehicle() -> None:
    watched = Watched()
    assert watched.check() == []
    assert watched.failsafes.active == set()


# Once, when it comes up


def test_a_condition_is_reacted_to_once_and_again_after_it_was_gone() -> None:
    watched = Watched()
    watched.view.health.position = False
    assert watched.one().text == "Position estimate lost: landing"
    assert watched.failsafes.active == {"estimate"}
    assert watched.check(NOW + 1) == []
    watched.view.health.position = True
    assert watched.check(NOW + 2) == []
    assert watched.failsafes.active == set()
    watched.view.health.attitude = False
    assert watched.one(NOW + 3) == Trigger(Reaction.LAND, CRITICAL, "Position estimate lost: landing")


def test_two_conditions_at_once_are_two_reactions() -> None:
    watched = Watched()
    watched.view.health.position = False
    watched.view.battery_remaining = 0.14
    assert [trigger.severity for trigger in watched.check()] == [CRITICAL, WARNING]


def test_disarmed_everything_is_forgotten() -> None:
    watched = Watched()
    watched.view.battery_remaining = 0.14
    assert len(watched.check()) == 1
    watched.failsafes.reset()
    assert watched.failsafes.active == set()
    assert len(watched.check()) == 1  # at once, and not only when the next look is due


def test_battery_stations_and_fence_are_looked_at_less_often() -> None:
    watched = Watched()
    watched.check()
    watched.view.battery_remaining = 0.14
    assert watched.check(NOW + 0.9 * SLOW_CHECKS) == []
    assert len(watched.check(NOW + SLOW_CHECKS)) == 1
    watched.view.battery_remaining = 0.9
    watched.check(NOW + 1.5 * SLOW_CHECKS)
    assert watched.failsafes.active == {"battery low"}
    watched.check(NOW + 2.0 * SLOW_CHECKS)
    assert watched.failsafes.active == set()


# The link to the plant


@pytest.mark.parametrize(
    ("action", "lost", "back"),
    [
        (0, Reaction.NONE, Reaction.NONE),
        (1, Reaction.NONE, Reaction.HOLD),
        (4, Reaction.TERMINATE, Reaction.NONE),
    ],
)
def test_the_link_to_the_plant_is_lost_and_comes_back(action: int, lost: Reaction, back: Reaction) -> None:
    watched = Watched(COM_HIL_LOSS_ACT=action, COM_HIL_LOSS_T=2.0)
    watched.view.hil_age = 2.0
    assert watched.check() == []
    watched.view.hil_age = 2.25
    assert watched.one() == Trigger(lost, CRITICAL, "No sensor data for 2.2 s: link to the plant lost")
    assert watched.check() == []
    watched.view.hil_age = 0.0
    assert watched.one() == Trigger(back, WARNING, "Sensor data are back")
    assert watched.check() == []


def test_nothing_else_is_judged_on_a_view_that_is_stale() -> None:
    watched = Watched()
    watched.view.hil_age = 10.0
    watched.view.health.position = False
    watched.view.attitude = quaternion_from_euler((2.0, 0.0, 0.0))
    watched.view.battery_remaining = 0.0
    watched.one()
    assert watched.failsafes.active == {"hil"}
    assert watched.check(NOW + 1) == []
    assert watched.failsafes.active == {"hil"}
    watched.view.hil_age = 0.0
    assert watched.one(NOW + 2).text == "Sensor data are back"
    assert {trigger.reaction for trigger in watched.check(NOW + 2)} >= {Reaction.TERMINATE, Reaction.LAND}


# The flight itself


def test_a_tumble_ends_the_flight() -> None:
    watched = Watched(FD_FAIL_TILT=70.0)
    watched.view.attitude = quaternion_from_euler((math.radians(69.9), 0.0, 0.0))
    assert watched.check() == []
    watched.view.attitude = quaternion_from_euler((math.radians(70.1), 0.0, 0.0))
    text = "Flight failed (FD_FAIL_TILT): rotors stopped"
    assert watched.one() == Trigger(Reaction.TERMINATE, EMERGENCY, text)


def test_a_state_that_is_no_number_ends_the_flight() -> None:
    watched = Watched(FD_FAIL_TILT=180.0)
    watched.view.load_position = (math.nan, 0.0, 0.0)
    assert watched.one().reaction is Reaction.TERMINATE


def test_a_wrong_inertial_sensor_lands_the_vehicle() -> None:
    watched = Watched()
    watched.view.health.wrong = "accelerometer"
    assert watched.one() == Trigger(Reaction.LAND, CRITICAL, "Accelerometer wrong: landing")
    assert watched.failsafes.active == {"inertial"}


# Offboard set-points


@pytest.mark.parametrize(
    ("action", "reaction", "word", "to_sticks"),
    [
        (0, Reaction.HOLD, "holding", Mode.POSITION),
        (1, Reaction.HOLD, "holding", Mode.ALTITUDE),
        (2, Reaction.HOLD, "holding", None),
        (3, Reaction.RETURN, "returning", None),
        (4, Reaction.LAND, "landing", None),
        (5, Reaction.HOLD, "holding", None),
        (6, Reaction.TERMINATE, "rotors stopped", None),
        (7, Reaction.DISARM, "disarming", None),
    ],
)
def test_offboard_without_a_fresh_set_point(
    action: int, reaction: Reaction, word: str, to_sticks: Mode | None
) -> None:
    watched = Watched(COM_OBL_RC_ACT=action, COM_OF_LOSS_T=1.5)
    assert watched.check(setpoint_fresh=False) == []
    assert watched.check(mode=Mode.OFFBOARD, setpoint_fresh=True) == []
    expected = Trigger(reaction, WARNING, f"No offboard set-point for 1.5 s: {word}", to_sticks)
    assert watched.one(mode=Mode.OFFBOARD, setpoint_fresh=False) == expected


# A pilot's sticks


@pytest.mark.parametrize(
    ("action", "reaction", "word"),
    [
        (1, Reaction.HOLD, "holding"),
        (2, Reaction.RETURN, "returning"),
        (3, Reaction.LAND, "landing"),
        (5, Reaction.TERMINATE, "rotors stopped"),
        (6, Reaction.DISARM, "disarming"),
    ],
)
def test_sticks_that_fall_silent(action: int, reaction: Reaction, word: str) -> None:
    watched = Watched(NAV_RCL_ACT=action, COM_RC_LOSS_T=0.5)
    assert watched.check(last_sticks=NOW - 0.5) == []
    expected = Trigger(reaction, WARNING, f"No sticks for 0.5 s: {word}")
    assert watched.one(last_sticks=NOW - 0.51) == expected


def test_sticks_that_were_lost_before_arming_are_no_loss() -> None:
    watched = Watched(COM_RC_LOSS_T=0.5)
    assert watched.check(last_sticks=ARMED_AT - 0.51) == []
    assert len(watched.check(last_sticks=ARMED_AT - 0.5)) == 1
    assert Watched().check(last_sticks=-math.inf, armed_at=-math.inf) == []


@pytest.mark.parametrize("source", range(5))
def test_sticks_count_only_where_a_joystick_may_fly(source: int) -> None:
    watched = Watched(COM_RC_IN_MODE=source)
    assert len(watched.check(last_sticks=NOW - 1)) == (1 if source in (1, 2, 3) else 0)


@pytest.mark.parametrize(
    ("mode", "bit"),
    [
        (Mode.MISSION, 1),
        (Mode.HOLD, 2),
        (Mode.TAKEOFF, 2),
        (Mode.OFFBOARD, 4),
        (Mode.POSITION, 0),
        (Mode.RTL, 0),
    ],
)
def test_modes_in_which_lost_sticks_are_no_failure(mode: Mode, bit: int) -> None:
    for excepted in (1, 2, 4):
        watched = Watched(COM_RCL_EXCEPT=excepted)
        assert len(watched.check(mode=mode, last_sticks=NOW - 1)) == (0 if excepted == bit else 1)


# Ground stations


@pytest.mark.parametrize(
    ("action", "reaction", "word"),
    [
        (1, Reaction.HOLD, "holding"),
        (2, Reaction.RETURN, "returning"),
        (3, Reaction.LAND, "landing"),
        (5, Reaction.TERMINATE, "rotors stopped"),
        (6, Reaction.DISARM, "disarming"),
    ],
)
def test_the_last_ground_station_falls_silent(action: int, reaction: Reaction, word: str) -> None:
    watched = Watched(NAV_DLL_ACT=action, COM_DL_LOSS_T=12.5)
    assert watched.check(last_station=NOW - 12.5) == []
    expected = Trigger(reaction, WARNING, f"No ground station for 12.5 s: {word}")
    assert watched.one(NOW + 1, last_station=NOW + 1 - 12.6) == expected


def test_no_station_ever_and_no_reaction_wanted_are_no_loss() -> None:
    assert Watched(NAV_DLL_ACT=1).check(last_station=None) == []
    assert Watched(NAV_DLL_ACT=0).check(last_station=NOW - 50) == []


def test_a_station_that_was_lost_before_arming_is_no_loss() -> None:
    watched = Watched(NAV_DLL_ACT=1, COM_DL_LOSS_T=10.0)
    assert watched.check(last_station=ARMED_AT - 10.1) == []
    assert len(watched.check(NOW + 1, last_station=ARMED_AT - 10.0)) == 1  # it counted as there at arming


# The geofence


@pytest.mark.parametrize(
    ("action", "reaction", "word"),
    [
        (1, Reaction.NONE, "warning only"),
        (2, Reaction.HOLD, "holding"),
        (3, Reaction.RETURN, "returning"),
        (4, Reaction.TERMINATE, "rotors stopped"),
        (5, Reaction.LAND, "landing"),
    ],
)
def test_outside_the_geofence(action: int, reaction: Reaction, word: str) -> None:
    watched = Watched(GF_ACTION=action)
    watched.fence = Fence((0.0, 0.0, 0.0), 50.0, 0.0, 0.0)
    watched.view.position = (60.0, 0.0, 5.0)
    where = "Vehicle 60 m from home is outside the geofence of 50 m (GF_MAX_HOR_DIST)"
    assert watched.one() == Trigger(reaction, CRITICAL, f"{where}: {word}")


def test_without_an_action_the_geofence_is_none() -> None:
    watched = Watched(GF_ACTION=0)
    watched.fence = Fence((0.0, 0.0, 0.0), 50.0, 0.0, 0.0)
    watched.view.position = (60.0, 0.0, 5.0)
    assert watched.check() == []


def test_the_load_is_fenced_in_too_while_it_hangs() -> None:
    watched = Watched(GF_ACTION=2)
    zone = Zone(False, ((6.0, 0.0),), 1.0)
    watched.fence = Fence((0.0, 0.0, 0.0), 0.0, 0.0, 0.0, (zone,))
    watched.view.load_position = (6.0, 0.0, 1.0)
    assert watched.one().text == "Load inside exclusion zone 0 of the geofence: holding"
    watched.view.load_attached = False
    watched.check(NOW + 1)
    assert watched.failsafes.active == set()


# The battery


@pytest.mark.parametrize(
    ("action", "critical", "emergency"),
    [
        (0, Reaction.NONE, Reaction.NONE),
        (2, Reaction.LAND, Reaction.LAND),
        (3, Reaction.RETURN, Reaction.LAND),
    ],
)
def test_a_battery_runs_down(action: int, critical: Reaction, emergency: Reaction) -> None:
    watched = Watched(COM_LOW_BAT_ACT=action, BAT_LOW_THR=0.75, BAT_CRIT_THR=0.125, BAT_EMERGEN_THR=0.0625)
    words = {Reaction.NONE: "warning only", Reaction.LAND: "landing", Reaction.RETURN: "returning"}
    steps = [
        (0.75, 0.72, WARNING, "72 %: low", Reaction.NONE),
        (0.125, 0.12, CRITICAL, "12 %: critical", critical),
        (0.0625, 0.06, EMERGENCY, "6 %: emergency", emergency),
    ]
    now = NOW
    for threshold, below, severity, text, reaction in steps:
        now += 2.0
        watched.view.battery_remaining = threshold
        assert watched.check(now - 1.0) == []
        watched.view.battery_remaining = below
        assert watched.one(now) == Trigger(reaction, severity, f"Battery at {text}, {words[reaction]}")


def test_an_unknown_charge_is_not_low() -> None:
    watched = Watched()
    watched.view.battery_remaining = math.nan
    assert watched.check() == []


def test_milder_reactions_are_smaller() -> None:
    order = [
        Reaction.NONE,
        Reaction.HOLD,
        Reaction.RETURN,
        Reaction.LAND,
        Reaction.TERMINATE,
        Reaction.DISARM,
    ]
    assert sorted(Reaction) == order
