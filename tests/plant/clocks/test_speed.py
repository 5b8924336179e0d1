"""Pause, steps and slow motion: time stands still between two ticks, and nothing else changes."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import common as mavlink

from controller.hil.session import PLANT_TIMEOUT
from sitl_bridge.mavlink.framing import Frame, Packer, decode, split
from sitl_bridge.plant.clocks.lockstep import KEEP_ALIVE
from sitl_bridge.plant.clocks.realtime import Realtime
from sitl_bridge.plant.log.notices import Notices
from sitl_bridge.plant.wire.speed import SPEED, STEPS, SpeedService
from tests.plant.clocks.test_lockstep import Flight
from tests.plant.network import Faults, paper, simulation

VIEWER = Packer(254, 190)


def setting(name: str, value: float) -> bytes:
    return VIEWER.pack(mavlink.MAVLink_param_set_message(1, 191, name.encode(), value, 9))


def answered(service: SpeedService, said: bytes, now: float) -> dict[str, float]:
    values = [decode(frame) for frame in split(service.receive(said, now)).frames]
    assert all(value.get_type() == "PARAM_VALUE" for value in values)
    return {value.param_id: value.param_value for value in values}


class Steered:
    """A lockstep flight whose speed is set over MAVLink."""

    def __init__(self, speed: float | None = None) -> None:
        self.flight = Flight(Faults(), speed=speed)
        self.said: list[str] = []
        self.service = SpeedService(0, self.flight.clock, self.said.append)

    def set(self, name: str, value: float) -> dict[str, float]:
        return answered(self.service, setting(name, value), self.flight.network.now)

    def run(self, ticks: int) -> None:
        """Until so many are flown."""
        self.flight.network.run(lambda: self.flight.simulation.ticks_flown >= ticks)

    def wait(self, seconds: float) -> None:
        until = self.flight.network.now + seconds
        self.flight.network.run(lambda: self.flight.network.now >= until)

    @property
    def flown(self) -> int:
        return self.flight.simulation.ticks_flown


def test_a_pause_of_minutes_changes_no_state_and_loses_no_link() -> None:
    steered = Steered()
    undisturbed = Flight(Faults()).fly().bytes()
    steered.run(30)
    assert steered.set(SPEED, 0.0)[SPEED] == 0.0
    steered.wait(0.1)
    flown = steered.flown
    assert flown <= 31
    steered.wait(180.0)
    assert steered.flown == flown
    steered.set(SPEED, -1.0)
    assert steered.flight.fly().bytes() == undisturbed
    assert not [text for text in steered.flight.autopilot_said if "waiting" in text]
    assert steered.said[0].startswith("paused at t = 0.1")
    assert steered.said[1].startswith("goes on at t = 0.1")


def test_steps_are_flown_and_no_more() -> None:
    steered = Steered()
    steered.run(10)
    steered.set(SPEED, 0.0)
    steered.wait(0.1)
    for ticks in (1, 7):
        before = steered.flown
        steered.set(STEPS, ticks)
        steered.wait(5.0)
        assert steered.flown == before + ticks
    assert steered.set(STEPS, -3)[STEPS] == 0.0
    steered.wait(1.0)
    assert steered.flown == before + 7


def test_slow_motion_keeps_its_pace_and_the_link() -> None:
    steered = Steered()
    steered.run(10)
    steered.set(SPEED, 0.002)  # a tick takes 2 s: longer than the autopilot takes for a silent plant
    assert steered.flight.simulation.period / 0.002 > PLANT_TIMEOUT > KEEP_ALIVE
    before = steered.flown
    steered.wait(20.5)
    assert steered.flown - before == pytest.approx(10, abs=1)
    assert not [text for text in steered.flight.autopilot_said if "waiting" in text]
    steered.set(SPEED, 1.0)
    before = steered.flown
    steered.wait(0.2)
    assert steered.flown - before == pytest.approx(50, abs=1)


def test_steps_of_a_flight_that_goes_on_are_not_asked_for() -> None:
    steered = Steered(speed=1.0)
    steered.run(10)
    assert steered.set(STEPS, 50)[STEPS] == 0.0
    steered.set(SPEED, 0.0)
    steered.wait(1.0)
    assert steered.flown <= 11


def test_real_time_stays_what_it_is() -> None:
    service = SpeedService(0, Realtime(simulation(paper(), 0.4)[0], Notices(print), 0), print)
    listed = mavlink.MAVLink_param_request_list_message(1, 191)
    assert answered(service, VIEWER.pack(listed), 0.0) == {SPEED: 1.0}
    assert answered(service, setting(SPEED, 0.0), 0.0) == {SPEED: 1.0}
    assert answered(service, setting(STEPS, 1.0), 0.0) == {}


@pytest.mark.parametrize(
    ("message", "names"),
    [
        (mavlink.MAVLink_param_request_list_message(0, 0), {SPEED, STEPS}),
        (mavlink.MAVLink_param_request_read_message(1, 191, b"SIM_SPEEDUP", -1), {SPEED}),
        (mavlink.MAVLink_param_request_read_message(1, 191, b"", 1), {STEPS}),
        (mavlink.MAVLink_param_request_read_message(1, 191, b"", 2), set()),
        (mavlink.MAVLink_param_request_list_message(1, 1), set()),
        (mavlink.MAVLink_param_request_list_message(2, 191), set()),
        (mavlink.MAVLink_param_set_message(1, 191, b"OTHER", 1.0, 9), set()),
    ],
)
def test_it_answers_what_is_asked_of_it(message: Any, names: set[str]) -> None:
    assert set(answered(Steered().service, VIEWER.pack(message), 0.0)) == names


STEERED = Steered()


@given(st.binary(max_size=40), st.sampled_from([20, 21, 23]))
def test_no_payload_upsets_it(payload: bytes, message_id: int) -> None:
    service = STEERED.service
    service._answer(Frame(message_id, 254, 190, payload, b"\xfd"), 0.0)
    service.receive(payload, 0.0)


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_a_speed_that_is_none_is_refused(value: float) -> None:
    assert Steered(speed=1.0).set(SPEED, value) == {SPEED: 1.0}
