"""The real-time clock tick by tick, on a simulation that only counts."""

from __future__ import annotations

import pytest
from pymavlink.dialects.v20 import common as mavlink

from sitl_bridge.plant.clocks.realtime import AUTOPILOT_TIMEOUT, Realtime
from tests.plant.clocks.scripted import PERIOD, CountedSimulation, ScriptedClock, four

STOPPED_TEXT = f"no answer from the autopilot for {AUTOPILOT_TIMEOUT} s: rotors stopped"


class Clock(ScriptedClock[Realtime]):
    def __init__(self, last_tick: int = 10**9, delay_ticks: int = 0) -> None:
        super().__init__(Realtime, CountedSimulation(delay_ticks=delay_ticks, last_tick=last_tick))  # type: ignore[arg-type]

    def answer_four(self, tick: int, control: float = 0.5, armed: bool = True, after: float = 0.0) -> None:
        """The autopilot answers with the same control for four rotors."""
        self.answer(tick, *[control] * 4, armed=armed, after=after)

    def in_flight(self) -> Clock:
        """Begun by the answer to tick 1 at its beginning; no command is under way."""
        self.send()
        self.answer_four(1)
        assert self.send_when_due() == [b"tick 2"]
        self.simulation.done.clear()
        return self


def test_ticks_go_out_at_absolute_deadlines_and_the_vehicle_is_held() -> None:
    c = Clock()
    assert c.clock.next_deadline() == 100.0
    assert c.send(-0.001) == []
    assert c.send(0.001) == [b"tick 1"]
    assert c.clock.next_deadline() == pytest.approx(100.0 + PERIOD)
    assert c.send(1.5 * PERIOD) == [b"tick 2"]  # late by half a period: the next is not
    assert c.clock.next_deadline() == pytest.approx(100.0 + 2 * PERIOD)
    assert c.simulation.done == ["held"]
    assert c.clock.lateness.ticks == 0


def test_before_the_scenario_a_late_tick_is_not_counted() -> None:
    c = Clock()
    c.send()
    c.send(5 * PERIOD)
    assert (c.clock.late_ticks, c.clock.lateness.ticks) == (0, 0)
    assert c.clock.next_deadline() == pytest.approx(c.now + PERIOD)


def test_lost_time_is_counted_and_stays_lost() -> None:
    c = Clock().in_flight()
    assert (c.clock.late_ticks, c.clock.lateness.ticks) == (0, 1)
    assert c.send(PERIOD + 0.99 * PERIOD) == [b"tick 3"]
    assert c.clock.late_ticks == 0
    c.now = c.clock.next_deadline()
    assert c.send(PERIOD * 1.01) == [b"tick 4"]
    assert (c.clock.late_ticks, c.clock.lateness.ticks) == (1, 3)
    assert c.clock.lateness.largest == pytest.approx(1.01 * PERIOD)
    assert c.send() == []
    assert c.clock.next_deadline() == pytest.approx(c.now + PERIOD)


def test_exactly_a_period_late_is_late() -> None:
    c = Clock().in_flight()
    c.now = c.clock.next_deadline() + PERIOD
    c.clock.to_send(c.now)
    assert c.clock.late_ticks == 1


def test_the_first_armed_answer_begins_the_scenario_and_counts() -> None:
    c = Clock()
    c.send()
    c.answer_four(1, armed=False)
    assert c.simulation.done == ["heard"]
    c.answer_four(1, 0.5)
    c.answer_four(1, 0.75)
    assert c.simulation.done == ["heard", "heard", "begun", "heard"]
    c.send_when_due()
    assert c.simulation.done[4:] == [[(0, four(0.5)), (0, four(0.75))]]


def test_an_unarmed_answer_in_flight_stops_the_rotors() -> None:
    c = Clock().in_flight()
    c.answer_four(2, 0.5, armed=False)
    c.send_when_due()
    assert c.simulation.done == ["heard", [(0, [0.0] * 4)]]


def test_a_command_acts_from_the_step_in_which_it_arrives() -> None:
    c = Clock().in_flight()
    c.answer_four(2, 0.25, after=0.26 * PERIOD)
    c.answer_four(2, 0.75, after=0.5 * PERIOD)
    c.send_when_due()
    assert c.simulation.done[2:] == [[(2, four(0.25)), (6, four(0.75))]]
    c.answer_four(3, 0.5, after=0.99 * PERIOD)
    c.send_when_due()
    assert c.simulation.done[-1] == [(8, four(0.5))]
    c.send_when_due()
    assert c.simulation.done[-1] == []  # acted once


def test_commands_of_a_tick_that_ended_late_do_not_act_beyond_it() -> None:
    c = Clock().in_flight()
    c.answer_four(2, 0.5, after=3 * PERIOD)
    c.send()
    assert c.simulation.done[-1] == [(8, four(0.5))]


def test_a_command_waits_for_the_loops_delay() -> None:
    c = Clock(delay_ticks=2).in_flight()
    for _ in range(3):  # the first answer's acts
        c.send_when_due()
    c.answer_four(c.simulation.tick, 0.75, after=0.5 * PERIOD)
    for expected in ([], [], [(4, four(0.75))]):
        c.send_when_due()
        assert c.simulation.done[-1] == expected


def test_an_answer_that_a_newer_one_has_overtaken_is_dropped() -> None:
    c = Clock().in_flight()
    c.answer_four(2, 0.75)
    c.answer_four(1, 0.25)
    c.send_when_due()
    assert c.simulation.done == ["heard", [(0, four(0.75))]]


def test_an_answer_to_a_tick_to_come_is_ignored_and_said_once() -> None:
    c = Clock().in_flight()
    c.answer_four(3)
    c.answer_four(9)
    assert c.simulation.done == []
    assert c.said == ["an answer to a tick that has not happened yet: ignored"]
    c.answer_four(2)  # and does not overtake anything
    assert c.simulation.done == ["heard"]


def test_silence_stops_the_rotors_and_is_said_once() -> None:
    c = Clock().in_flight()
    heard = c.now - PERIOD
    while c.clock.next_deadline() - heard <= AUTOPILOT_TIMEOUT:
        c.send_when_due()
        assert c.simulation.done[-1] == []
    for _ in range(3):
        c.send_when_due()
        assert c.simulation.done[-1] == [(0, [0.0] * 4)]
    assert c.said == [STOPPED_TEXT]
    c.answer_four(c.simulation.tick, 0.5)
    assert c.said == [STOPPED_TEXT, "autopilot answers again"]
    c.send_when_due()
    assert c.simulation.done[-1] == [(0, four(0.5))]


def test_a_command_that_is_under_way_when_the_autopilot_falls_silent_is_lost() -> None:
    c = Clock(delay_ticks=100).in_flight()
    c.send(AUTOPILOT_TIMEOUT + 0.05)
    c.send(1.0)
    assert c.simulation.done == [[(0, [0.0] * 4)]] * 2


def test_rotors_stop_after_the_commands_that_were_in_time() -> None:
    c = Clock().in_flight()
    c.answer_four(2, 0.25, after=0.5 * PERIOD)
    c.send(AUTOPILOT_TIMEOUT + PERIOD)
    assert c.simulation.done[-1] == [(4, four(0.25)), (4, [0.0] * 4)]


def test_after_the_last_tick_only_replies_go_out() -> None:
    c = Clock(last_tick=2).in_flight()
    command = mavlink.MAVLink_command_long_message(1, 1, 511, 0, *[0.0] * 7)
    assert not c.clock.finished
    c.clock.receive(c.answers.packer.pack(command), c.now)
    assert c.send_when_due() == [b"reply 76"]
    assert c.clock.finished
    assert c.send(1.0) == []
    c.clock.receive(c.answers.packer.pack(command), c.now)
    assert c.send(1.0) == [b"reply 76"]
    assert c.simulation.done.count([]) == 1


def test_replies_go_out_before_the_tick() -> None:
    c = Clock().in_flight()
    command = mavlink.MAVLink_command_long_message(1, 1, 511, 0, *[0.0] * 7)
    c.clock.receive(c.answers.packer.pack(command), c.now)
    assert c.send() == [b"reply 76"]
    c.clock.receive(c.answers.packer.pack(command), c.now)
    assert c.send_when_due() == [b"reply 76", b"tick 3"]
    assert c.send() == []
