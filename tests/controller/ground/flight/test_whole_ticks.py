"""A tick under ground control in one compiled call is the tick in stages: the same flight, to the bit."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest
from pymavlink.dialects.v20.common import MAV_CMD_DO_GRIPPER as DO_GRIPPER

from controller.ground.flight.client_requests import Reposition, reposition
from controller.ground.flight.payload.gripper import RELEASE
from controller.pilot.guided.autopilot import GuidedAutopilot
from controller.pilot.guided.stages import AT_ONCE, NEVER, Stage, due, never_due
from sitl_bridge.vehicle.files import load_vehicle
from tests.controller.ground.flown import Flown
from tests.estimator.guided import GuidedFlight

ELSEWHERE = Reposition(False, (2.0, -1.0, math.nan), math.nan, math.nan)
Told = tuple[list[bytes], list[str], int]
"""States of the plant, what was said, and how many ticks were flown whole."""


def watched(pilot: GuidedAutopilot, whole: bool, count: Callable[[], None]) -> None:
    """Count the ticks that are flown whole, or let there be none."""
    flown = pilot.flown_whole

    def note(time_usec: int, now: float) -> None:
        count()
        flown(time_usec, now)

    pilot.flown_whole = note  # type: ignore[method-assign]
    if not whole:
        pilot.whole_until = lambda now: AT_ONCE  # type: ignore[method-assign]


def on_truth(whole: bool) -> Told:
    """Take-off, a point to go to, and the load released there."""
    flight, wholes, states = Flown(), [0], []

    def count() -> None:
        wholes[0] += 1

    flight.every_tick = lambda: states.append(flight.simulation.world.state.tobytes())
    client = flight.client()
    flight.tick()
    watched(flight.pilot, whole, count)
    flight.take_off(client)
    assert reposition(flight.station.machine, ELSEWHERE, True).ok
    flight.run(3.0)
    assert client.command(DO_GRIPPER, 1, RELEASE).result == 0
    flight.run(3.0)
    return states, client.texts(), wholes[0]


def on_estimate(whole: bool) -> Told:
    """Take-off, and a point to go to."""
    flight, wholes = GuidedFlight(load_vehicle("iris"), 1), [0]

    def count() -> None:
        wholes[0] += 1

    flight._tick()
    watched(flight.pilot, whole, count)
    flight.arm_and_take_off(3.0)
    assert reposition(flight.machine, ELSEWHERE, True).ok
    flight.wait(4.0)
    return [state.tobytes() for _, state, _ in flight.rows], flight.said, wholes[0]


@pytest.mark.parametrize("fly", [on_truth, on_estimate])
def test_the_compiled_tick_flies_as_the_stages_do(fly: Callable[[bool], Told]) -> None:
    states, said, wholes = fly(True)
    in_parts, said_in_parts, none = fly(False)
    assert states == in_parts
    assert said == said_in_parts
    assert none == 0
    assert wholes > 0.5 * len(states)


def test_the_stage_that_is_due_first_ends_the_whole_ticks() -> None:
    def stage(when: float) -> Stage:
        return Stage("", lambda moment: None, lambda: when)

    assert due([stage(3.0), stage(2.0), stage(NEVER)]) == 2.0
    assert due([stage(3.0), stage(AT_ONCE)]) == AT_ONCE
    assert due([Stage("", lambda moment: None, never_due)]) == NEVER


def test_the_view_is_that_of_the_last_tick_when_somebody_asks() -> None:
    flight = Flown()
    client = flight.client()
    flight.tick()
    latest, wholes = [0.0], [0]

    def count() -> None:
        wholes[0] += 1

    watched(flight.pilot, True, count)
    flight.take_off(client)
    flight.every_tick = lambda: latest.__setitem__(slice(None), flight.simulation.world.state[:3].tolist())
    behind = 0
    for _ in range(20):
        flight.run(0.008)
        before = wholes[0]
        flight.tick()
        behind += wholes[0] - before
        client.heartbeat()  # anything that comes in
        view = flight.station.machine.view
        assert view is not None
        assert view.position == pytest.approx(latest, abs=1e-5)  # single precision on the wire
        assert view.time * 1e6 == pytest.approx(flight.simulation.time_usec - 4000)
    assert behind > 10
