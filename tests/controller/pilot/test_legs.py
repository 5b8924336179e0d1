"""From point to point: when a leg is over, and that compiled whole ticks fly the same as ticks in parts."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator

import numpy as np
import pytest

import sitl
from controller.law.reference import Path, points
from controller.pilot.autopilot import Autopilot
from controller.pilot.legs import CABLE_LAGS, Legs, leg_time
from sitl.flights.scenario import Points, Scenario
from sitl_bridge.vehicle.files import load_vehicle

RATE_HZ = 250.0
TICK_USEC = 4000
POSITIONS = ((1.0, 0.0, 5.0), (1.0, 2.0, 5.0), (1.0, 2.0, 6.0))


def path(hold: float = 1.0) -> Path:
    return points(POSITIONS, hold, (0.0, 0.0, 5.0))


def test_a_path_has_a_leg_for_each_point() -> None:
    legs = path(0.5)
    assert legs["centre"].tolist() == [list(position) for position in POSITIONS]
    assert legs["start"].tolist() == [[0.0, 0.0, 5.0], *legs["centre"][:-1].tolist()]
    assert legs["begin"].tolist() == [0.0, math.inf, math.inf]
    assert set(legs["hold"].tolist()) == {0.5}


def test_a_leg_lasts_for_its_ramp_at_its_pace_and_the_time_to_stay() -> None:
    leg = path(1.0)[:1]
    ramp = float(leg["ramp_time"][0])
    assert leg_time(leg) == ramp + 1.0
    assert leg_time(leg, 0.8) == pytest.approx(ramp / 0.8 + 1.0)
    leg["cable_lag"] = 0.5  # the cable takes longer to come to rest than the load is to stay
    assert leg_time(leg) == ramp + CABLE_LAGS * 0.5


def test_the_next_leg_begins_when_one_is_over_and_the_last_never_is() -> None:
    told: list[tuple[int, int, float]] = []
    all_legs = path()
    all_legs["ramp_time"] = 2.0
    legs = Legs(all_legs[1:], RATE_HZ, lambda *about: told.append(about))
    leg, ticks, now = all_legs[:1], 0, 7_000_000
    legs.begin(now)
    while len(legs.began_s) < 3:
        if legs.is_over(leg, ticks):  # as `Autopilot.step` does it
            leg, ticks = legs.next(now), 1
        ticks += 1
        now += TICK_USEC
    assert legs.began_s == pytest.approx([0.0, 3.0, 5.996])  # a leg begins at its first tick, as one goes on
    assert told == [(1, 3, 0.0), (2, 3, pytest.approx(3.0)), (3, 3, pytest.approx(5.996))]
    assert leg["centre"][0].tolist() == list(POSITIONS[2])
    assert legs.due(leg, ticks, 1.0, now) == math.inf
    assert not legs.is_over(leg, 10**9)
    legs.begin(now)  # the plant has started again
    assert legs.began_s == [0.0]
    assert legs.next(now)["centre"][0].tolist() == list(POSITIONS[1])


@pytest.mark.parametrize("pace", [1.0, 0.93])
def test_the_rule_is_due_with_the_tick_that_begins_the_leg(pace: float) -> None:
    """Of ticks at the rate none before is due; this one is."""
    legs, leg = Legs(path()[1:], RATE_HZ), path()[:1]
    legs.begin(0)
    due = legs.due(leg, 1, pace, 0)
    for number in range(1, 2000):  # steps made before the tick of this number
        assert (number * TICK_USEC * 1e-6 >= due) == legs.is_over(leg, number, pace)


def scenario(hold: float = 0.3) -> Scenario:
    return Scenario(vehicle="paper", reference=Points(kind="points", positions=POSITIONS, hold=hold))


@pytest.fixture
def in_parts(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    with monkeypatch.context() as patch:
        patch.setattr(Autopilot, "whole_until", lambda self, now: -math.inf)
        yield


def rows(feedback: str) -> tuple[np.ndarray, list[float]]:  # type: ignore[type-arg]
    vehicle = load_vehicle("paper", ["initial.load_position=[0,0,5]"])
    heavier = ["load.mass=11.0"]  # on truth that is found out, and legs are flown more slowly than planned
    flight = sitl.fly(
        scenario(), vehicle=vehicle, plant_overrides=heavier, feedback=feedback, duration_s=7.0, seed=3
    )
    began = [point["set_at_s"] for point in flight.summary["points"]]
    return np.stack(list(flight.states.values())), began


@pytest.mark.parametrize("feedback", ["truth", "estimate"])
def test_whole_ticks_fly_the_legs_as_ticks_in_parts_do(
    feedback: str, request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> None:
    flown_whole = 0

    def note(self: Autopilot, time_usec: int, now: float) -> None:
        nonlocal flown_whole
        flown_whole += 1

    monkeypatch.setattr(Autopilot, "flown_whole", note)
    whole, began = rows(feedback)
    assert None not in began  # every leg was begun
    assert flown_whole > 0.8 * 7.0 * RATE_HZ
    request.getfixturevalue("in_parts")
    flown_whole = 0
    parts, began_in_parts = rows(feedback)
    assert flown_whole == 0
    assert began == began_in_parts
    np.testing.assert_array_equal(whole, parts)


@pytest.mark.parametrize("lag", [0.0, 0.1])
def test_without_a_stay_the_next_leg_begins_without_a_jump(lag: float) -> None:
    """On an overdamped cable, too, whose stretch is behind: the load is where its legs have it."""
    overrides = ["initial.load_position=[0,0,5]", f"cable.damping={70.0 if lag else 2.0}"]
    overrides += [f"rotors.{rotor}.time_constant={lag / 4.0}" for rotor in range(4)]
    flight = sitl.fly(
        scenario(0.0), vehicle=load_vehicle("paper", overrides), feedback="truth", duration_s=20.0
    )
    assert flight.summary["settled"]
    for point in flight.summary["points"]:
        assert point["overshoot_pct"] < 0.5, point
    bends = np.abs(np.diff(flight.states["cable_tension_N"], n=2))  # what is left of a motion is a slope
    load = np.stack([flight.states[f"load_{axis}_m"] for axis in "xyz"], axis=1)
    for before, point in itertools.pairwise(flight.summary["points"]):
        tick = round(point["set_at_s"] * RATE_HZ)
        assert bends[tick - 2 : tick + 5].max() < (1e-4 if lag else 1e-3)  # of 98 N; at once: 5e-4 with lag
        assert np.linalg.norm(load[tick] - before["position_m"]) < 5e-3 * before["step_m"]


def test_what_the_law_has_learnt_stays_from_leg_to_leg() -> None:
    """A load 10 % heavier than told: each leg is overshot by less than 1 %, the second by no more."""
    vehicle = load_vehicle("paper", ["initial.load_position=[0,0,5]"])
    flight = sitl.fly(
        scenario(1.0), vehicle=vehicle, plant_overrides=["load.mass=11.0"], feedback="truth", duration_s=14.0
    )
    figures = [point["overshoot_pct"] for point in flight.summary["points"]]
    assert flight.summary["settled"]
    assert max(figures) < 1.0, figures
    assert figures[1] <= figures[0] + 0.05
