"""The real-time clock, without sockets: absolute deadlines, late ticks, silence."""

from __future__ import annotations

import numpy as np
import pytest

from controller.hil.answers import AnswerWriter
from sitl_bridge.ids import COMPONENT_AUTOPILOT
from sitl_bridge.mavlink.framing import Packer
from sitl_bridge.plant.clocks.realtime import AUTOPILOT_TIMEOUT, Realtime
from sitl_bridge.plant.log.notices import Notices
from tests.plant.clocks.test_lockstep import Scripted
from tests.plant.network import Faults, Network, autopilot_session, paper, simulation


class Flight:
    def __init__(self, duration: float | None = 1.0, faults: Faults | None = None) -> None:
        self.said: list[str] = []
        vehicle = paper()
        self.simulation, self.rows = simulation(vehicle, duration)
        self.clock = Realtime(self.simulation, Notices(self.said.append), 0)
        self.session = autopilot_session(vehicle)
        self.network = Network(self.clock, self.session, faults or Faults())
        self.clock.start(self.network.now)


def test_ticks_come_at_absolute_deadlines() -> None:
    flight = Flight()
    flight.network.run(lambda: flight.simulation.started)
    began = flight.network.now
    flight.network.run(lambda: flight.clock.finished)
    assert flight.network.now - began == pytest.approx(1.0, abs=0.005)
    assert flight.clock.late_ticks == 0
    assert flight.clock.lateness.ticks == 250
    assert flight.clock.lateness.largest < 1e-9
    assert len(flight.rows.rows) == 251


def test_lost_time_is_counted_and_not_made_up_in_a_burst() -> None:
    flight = Flight()
    flight.network.run(lambda: flight.simulation.ticks_flown == 50)
    flight.network.stalled.add("plant")
    flight.network.run(lambda: flight.network.now > 100.4)
    stall_ends = flight.network.now
    flight.network.stalled.clear()
    flight.network.run(lambda: flight.simulation.ticks_flown >= 52)
    assert flight.clock.late_ticks == 1
    flight.network.run(lambda: flight.network.now > stall_ends + 0.04)
    assert flight.simulation.ticks_flown <= 50 + 12  # no faster than the pace


def test_a_command_takes_effect_when_it_arrives() -> None:
    late = Flight(duration=0.2, faults=Faults(delay_s=1.1e-3))
    prompt = Flight(duration=0.2, faults=Faults(delay_s=1e-6))
    for flight in (late, prompt):
        flight.network.autopilot = Scripted(_0=0.6)
        flight.network.run(lambda flight=flight: flight.clock.finished)  # type: ignore[misc]
    # 2.2 ms of a round trip at the start under hover thrust: the turning begins so much later.
    assert late.rows.rows[10][12] != prompt.rows.rows[10][12]


def test_silence_stops_the_rotors_after_the_timeout_and_is_said_once() -> None:
    flight = Flight(duration=None)
    flight.network.run(lambda: flight.simulation.ticks_flown == 100)
    silent_since = flight.network.now
    flight.network.stalled.add("autopilot")
    flight.network.run(lambda: flight.network.now > silent_since + AUTOPILOT_TIMEOUT - 0.01)
    assert (flight.simulation.world.rotor_speed[:4] > 0).all()
    flight.network.run(lambda: flight.network.now > silent_since + AUTOPILOT_TIMEOUT + 0.01)
    assert (flight.simulation.world.rotor_speed == 0).all()
    flight.network.run(lambda: flight.network.now > silent_since + 1.0)
    assert [text for text in flight.said if "rotors stopped" in text] == [flight.said[-1]]


def test_an_autopilot_back_within_the_timeout_flies_on() -> None:
    flight = Flight(duration=12.0)
    flight.network.run(lambda: flight.simulation.ticks_flown == 500)
    away = flight.network.now
    flight.network.stalled.add("autopilot")
    flight.network.run(lambda: flight.network.now > away + 0.8 * AUTOPILOT_TIMEOUT)
    flight.network.stalled.clear()
    flight.network.run(lambda: flight.clock.finished)
    assert flight.rows.rows[-1][14:17] == pytest.approx([1.0, 2.0, 1.0], abs=0.15)
    assert not any("stopped" in text for text in flight.said)


def test_an_overtaken_answer_does_not_count() -> None:
    flight = Flight()
    flight.network.run(lambda: flight.simulation.ticks_flown == 50)
    flight.network.stalled.add("autopilot")
    world, now = flight.simulation.world, flight.simulation.time_usec
    writer = AnswerWriter(0, Packer(1, COMPONENT_AUTOPILOT))
    for time_usec, control in ((now, 0.75), (now - 4000, 0.25)):
        writer.controls[:4] = control
        flight.clock.receive(writer.answer(time_usec, True), flight.network.now)
    flight.network.run(lambda: flight.simulation.ticks_flown == 52)
    largest = [rotor.max_speed for rotor in world.vehicle.rotors]
    assert world.rotor_speed[:4] == pytest.approx(np.multiply(0.75, largest))


def test_until_the_first_armed_answer_the_vehicle_is_held() -> None:
    flight = Flight()
    flight.network.stalled.add("autopilot")
    state = flight.simulation.world.state.copy()
    flight.network.run(lambda: flight.network.now > 101.0)
    assert (flight.simulation.world.state == state).all()
    assert flight.simulation.tick == pytest.approx(250, abs=2)
    assert not flight.rows.rows
