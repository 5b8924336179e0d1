"""The table at the top of `lockstep.py`, line by line, on a simulation that only counts."""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import pytest

from sitl_bridge.ids import COMPONENT_TRUTH
from sitl_bridge.mavlink.framing import decode, split
from sitl_bridge.plant.clocks.lockstep import (
    KEEP_ALIVE,
    REPEATS_BEFORE_NOTICE,
    SILENCE_BEFORE_NOTICE,
    Lockstep,
)
from sitl_bridge.plant.clocks.retransmission import FIRST_TIMEOUT
from tests.plant.clocks.scripted import PERIOD, CountedSimulation, ScriptedClock, four

SILENT, BACK = "no answer from the autopilot: the world waits for it", "autopilot answers again"


class Clock(ScriptedClock[Lockstep]):
    def __init__(self, last_tick: int = 10**9, instance: int = 0, **options: Any) -> None:
        simulation = CountedSimulation(instance, last_tick=last_tick)
        super().__init__(partial(Lockstep, **options), simulation, instance)  # type: ignore[arg-type]

    def in_flight(self) -> Clock:
        """Begun by the answer to tick 1 within a millisecond, tick 2 sent."""
        self.send()
        self.answer(1, 0.5, after=0.001)
        while self.send_when_due() != [b"tick 2"]:
            assert self.now < 110.0
        self.simulation.done.clear()
        return self

    @property
    def wait(self) -> float:
        return self.clock.next_deadline() - self.now


def test_without_an_autopilot_ticks_go_out_at_the_nominal_pace_and_the_vehicle_is_held() -> None:
    c = Clock()
    assert c.clock.next_deadline() == 100.0
    assert c.send() == [b"tick 1"]
    assert c.send() == []
    assert c.wait == pytest.approx(PERIOD)
    assert c.send(0.9 * PERIOD) == []
    assert c.send(0.1 * PERIOD + 1e-9) == [b"tick 2"]
    assert c.clock.next_deadline() == pytest.approx(100.0 + 2 * PERIOD)
    assert c.send(5.0) == [b"tick 3"]  # after a pause: at once, and not in a burst
    assert c.clock.next_deadline() == c.now
    assert c.simulation.done == ["held", "held"]
    assert c.said == []


def test_an_answer_before_the_first_tick_makes_it_one_that_is_waited_for() -> None:
    c = Clock()
    c.answer(0)
    assert c.simulation.done == ["heard"]
    assert c.send() == [b"tick 1"]
    assert c.wait == pytest.approx(FIRST_TIMEOUT)
    c.answer(1, 0.5)
    assert c.simulation.done == ["heard", "begun", ("flown", pytest.approx([0.5, 0, 0, 0]))]


def test_an_answer_to_an_older_tick_ends_freewheeling_and_the_current_one_is_waited_for() -> None:
    c = Clock()
    c.send()
    c.send(PERIOD)
    c.answer(1, after=0.001)
    assert c.simulation.done == ["held", "heard"]
    assert c.clock.next_deadline() == pytest.approx(100.0 + PERIOD + FIRST_TIMEOUT)
    assert c.send_when_due() == [b"tick 2"]


def test_a_datagram_without_an_answer_does_not_end_freewheeling() -> None:
    c = Clock()
    c.send()
    c.clock.receive(b"garbage", c.now)
    c.clock.receive(c.answers.packer.pack(_command()), c.now)
    assert c.simulation.done == [("message", 76)]
    assert c.send(PERIOD) == [b"reply 76", b"tick 2"]


def test_an_unarmed_answer_goes_on_and_begins_nothing() -> None:
    c = Clock()
    c.send()
    c.answer(1, armed=False)
    assert c.simulation.done == ["heard", "held"]
    assert c.send() == [b"tick 2"]
    c.answer(2, 0.25, 0.25, 0.25, 0.25)
    assert c.simulation.done == ["heard", "held", "begun", ("flown", four(0.25))]
    assert c.send() == [b"tick 3"]
    c.answer(3, 0.25, armed=False)
    assert c.simulation.done[4:] == [("flown", [0.0] * 4)]  # disarmed in flight: rotors stop


def test_the_answer_ends_the_tick_and_the_next_is_due_at_once() -> None:
    c = Clock().in_flight()
    assert c.send() == []
    c.answer(2, 0.5, after=0.001)
    assert c.simulation.done == [("flown", [0.5, 0, 0, 0])]
    assert c.wait == 0.0
    assert c.send() == [b"tick 3"]
    assert c.clock.resent_ticks == 0


def test_duplicates_and_answers_to_other_ticks_are_dropped() -> None:
    c = Clock().in_flight()
    c.answer(1)
    c.answer(3)
    assert c.simulation.done == []
    c.answer(2)
    done = list(c.simulation.done)
    c.answer(2)
    c.answer(3)  # nothing is due before it was sent
    assert c.simulation.done == done


def test_the_whole_tick_is_taken_where_there_is_one() -> None:
    c = Clock().in_flight()
    c.simulation.flies_whole = True
    c.answer(2, after=0.001)
    assert c.simulation.done == ["flown whole"]
    assert c.send() == [b"tick 3"]
    waited = c.wait
    c.send_when_due()
    c.answer(3)  # of a tick that was repeated, too
    assert c.simulation.done == ["flown whole"] * 2
    c.simulation.flies_whole = False  # an answer to a tick that is over
    c.answer(3)
    c.send()
    assert c.wait == pytest.approx(2 * waited)


def test_an_autopilot_is_back_with_a_whole_tick_too() -> None:
    c = Clock().in_flight()
    for _ in range(REPEATS_BEFORE_NOTICE + 1):
        c.send(SILENCE_BEFORE_NOTICE)
    c.simulation.flies_whole = True
    c.answer(2)
    assert c.said == [SILENT, BACK]


def test_the_whole_tick_is_not_taken_where_the_last_controls_have_to_be_known() -> None:
    c = Clock(on_silence="continue").in_flight()
    c.simulation.flies_whole = True
    c.answer(2, 0.5)
    assert c.simulation.done == [("flown", [0.5, 0, 0, 0])]


# Repeats


def test_a_tick_without_an_answer_is_sent_again_each_time_after_twice_the_time() -> None:
    c = Clock().in_flight()
    waits = []
    for _ in range(4):
        waits.append(c.wait)
        assert c.send_when_due() == [b"tick 2"]
    first = FIRST_TIMEOUT
    assert waits == pytest.approx([first, 2 * first, 4 * first, 8 * first])
    assert c.clock.resent_ticks == 4
    assert c.simulation.done == []


def test_repeats_before_the_scenario_are_not_counted() -> None:
    c = Clock()
    c.answer(0)
    c.send()
    assert c.send_when_due() == [b"tick 1"]
    assert c.clock.resent_ticks == 0


def test_the_round_trip_is_never_estimated_from_a_repeated_tick() -> None:
    """Karn's algorithm: its answer may belong to any of the sendings."""
    c = Clock().in_flight()
    before = c.wait
    c.send_when_due()
    assert c.wait == pytest.approx(2 * before)
    c.answer(2, after=0.2)
    c.send()
    assert c.wait == pytest.approx(before)


def test_a_second_answer_to_a_repeated_tick_doubles_the_time_until_there_is_a_sample() -> None:
    c = Clock().in_flight()
    c.answer(2, after=0.001)
    c.send()
    before = c.wait
    c.send_when_due()
    c.answer(3)
    c.answer(3)  # before the next tick is sent, and a third answer says nothing more
    c.answer(3)
    c.send()
    assert c.wait == pytest.approx(2 * before)
    c.answer(4, after=0.001)
    c.send()
    assert c.wait == pytest.approx(before)
    c.answer(4)  # of a tick that was sent once: the link's own doing
    c.answer(5, after=0.001)
    c.send()
    assert c.wait == pytest.approx(before)


def test_a_round_trip_that_has_become_longer_than_the_time_out_is_measured_in_the_end() -> None:
    c = Clock().in_flight()
    long = 0.1  # s; that of the first tick was 1 ms
    tick = 2
    under_way = [c.now + long]
    while tick < 60:
        if c.clock.next_deadline() < under_way[0]:
            if c.send_when_due():
                under_way.append(c.now + long)
            continue
        c.now = under_way.pop(0)
        c.answer(tick)
        if c.simulation.tick > tick:
            for _ in under_way:  # what was sent again is answered again
                c.answer(tick)
            tick = c.simulation.tick
            c.send()
            under_way = [c.now + long]
    assert c.wait >= 3 * long


def test_what_came_before_the_scenario_does_not_count_for_the_round_trip() -> None:
    c = Clock()
    c.answer(0, armed=False)
    for tick in range(1, 5):
        c.send()
        c.answer(tick, armed=False, after=0.004)
    c.send()
    c.answer(5, after=0.003)  # the way was planned
    c.send()
    assert c.wait == pytest.approx(FIRST_TIMEOUT)
    c.answer(6, after=0.001)
    c.send()
    assert c.wait == pytest.approx(10 * 0.001)


def test_the_round_trip_is_counted_from_the_sending() -> None:
    c = Clock().in_flight()
    for tick in range(2, 60):
        c.answer(tick, after=0.002)
        c.send()
    assert c.wait == pytest.approx(10 * 0.002, rel=0.01)


def test_silence_is_said_once_after_a_second_and_three_repeats() -> None:
    c = Clock().in_flight()
    repeats, sent_at = 0, c.now
    while not c.said:
        c.send_when_due()
        repeats += 1
    assert repeats > REPEATS_BEFORE_NOTICE
    assert c.now - sent_at >= SILENCE_BEFORE_NOTICE
    assert c.now - sent_at < SILENCE_BEFORE_NOTICE + 0.5 + 1e-9
    for _ in range(3):
        c.send_when_due()
    assert c.said == [SILENT]
    c.answer(2)
    assert c.said == [SILENT, BACK]


def test_one_late_look_is_no_silence() -> None:
    """Of a process that was stopped: three repeats have to go out too."""
    c = Clock().in_flight()
    for repeat in range(REPEATS_BEFORE_NOTICE + 1):
        assert c.said == []
        c.send(2.0)
        assert len(c.said) == (repeat == REPEATS_BEFORE_NOTICE)


def test_silence_counts_from_the_first_sending_of_the_tick() -> None:
    c = Clock().in_flight()
    c.answer(2, after=0.001)
    c.send(100.0)  # sent late
    began = c.now
    while c.now - began < 0.9 * SILENCE_BEFORE_NOTICE:
        c.send(0.3)
    assert c.said == []


def test_no_repeats_on_a_link_that_loses_nothing() -> None:
    c = Clock(resend=False).in_flight()
    for _ in range(12):
        assert c.send_when_due() == []
    assert c.clock.resent_ticks == 0
    assert c.said == [SILENT]
    c.answer(2)
    assert c.send() == [b"tick 3"]


def test_continue_on_silence_flies_the_tick_with_the_last_controls_after_three_repeats() -> None:
    c = Clock(on_silence="continue")
    c.send()
    c.answer(1, 0.5, after=0.001)
    c.answers.to(9, 0.75)  # what is written next does not change what was taken
    c.send()
    c.simulation.done.clear()
    for _ in range(REPEATS_BEFORE_NOTICE):
        assert c.send_when_due() == [b"tick 2"]
    assert c.simulation.done == []
    assert c.send_when_due() == [b"tick 3"]
    assert c.simulation.done == [("flown", [0.5, 0, 0, 0])]
    assert c.clock.unanswered_ticks == 1
    for _ in range(REPEATS_BEFORE_NOTICE):
        assert c.send_when_due() == [b"tick 3"]
    assert c.send_when_due() == [b"tick 4"]
    assert c.clock.unanswered_ticks == 2
    c.answer(4, 0.25)
    assert c.simulation.done[-1] == ("flown", [0.25, 0, 0, 0])


def test_controls_are_kept_as_they_were() -> None:
    c = Clock(on_silence="continue").in_flight()
    c.answer(2, 0.5)
    c.send()
    c.answer(7, 0.75)  # read into the same memory, and dropped
    for _ in range(REPEATS_BEFORE_NOTICE + 1):
        c.send_when_due()
    assert c.simulation.done == [("flown", [0.5, 0, 0, 0])] * 2


def test_continue_on_silence_waits_while_there_are_no_controls_yet() -> None:
    c = Clock(on_silence="continue")
    c.answer(0)
    c.send()
    for _ in range(8):
        assert c.send_when_due() == [b"tick 1"]
    assert c.simulation.done == ["heard"]
    assert c.clock.unanswered_ticks == 0


# The end, and what else is sent


def test_after_the_last_tick_nothing_is_sent() -> None:
    c = Clock(last_tick=2).in_flight()
    assert not c.clock.finished
    c.answer(2)
    assert c.clock.finished
    assert c.send() == []


def test_replies_go_out_with_the_tick_or_without_one() -> None:
    c = Clock().in_flight()
    c.clock.receive(c.answers.packer.pack(_command()), c.now)
    assert c.send() == [b"reply 76"]
    c.clock.receive(c.answers.packer.pack(_command()), c.now)
    assert c.send_when_due() == [b"reply 76", b"tick 2"]
    assert c.send() == []


def test_replies_go_out_after_the_last_tick() -> None:
    c = Clock(last_tick=2).in_flight()
    c.answer(2)
    c.clock.receive(c.answers.packer.pack(_command()), c.now)
    assert c.send() == [b"reply 76"]


def _command() -> Any:
    from pymavlink.dialects.v20 import common

    return common.MAVLink_command_long_message(1, 1, 511, 0, *[0.0] * 7)


# The pace


def test_a_speed_is_kept_on_the_whole_and_a_late_tick_is_made_up_by_one() -> None:
    c = Clock(speed=2.0).in_flight()
    pace = PERIOD / 2
    began = c.now
    for tick in range(2, 12):
        c.answer(tick, after=0.0001)
        c.send_when_due()
    assert c.now - began == pytest.approx(9.5 * pace, abs=pace)
    c.answer(12, after=20 * pace)
    assert c.wait == 0.0
    c.send()
    c.answer(13)
    assert c.wait == pytest.approx(0.0)
    c.send()
    c.answer(14)
    assert c.wait == pytest.approx(pace)


def test_before_its_time_the_next_tick_is_not_sent() -> None:
    c = Clock(speed=0.1).in_flight()
    c.answer(2)
    assert c.send(0.03) == []
    assert c.send_when_due() == [b"tick 3"]


def test_while_no_tick_is_due_for_long_the_autopilot_hears_that_the_plant_is_there() -> None:
    c = Clock(speed=0.002, instance=3).in_flight()
    c.answer(2)
    c.clock.receive(c.answers.packer.pack(_command()), c.now)
    assert c.wait == pytest.approx(KEEP_ALIVE)
    reply, heartbeat = c.send_when_due()
    assert reply == b"reply 76"
    (frame,) = split(heartbeat).frames
    assert (frame.system, frame.component) == (4, COMPONENT_TRUTH)
    assert decode(frame).get_type() == "HEARTBEAT"
    assert c.wait == pytest.approx(KEEP_ALIVE)


# Pause and steps


def paused() -> Clock:
    c = Clock().in_flight()
    c.clock.change_speed(0.0, c.now)
    c.answer(2, after=0.001)
    c.simulation.done.clear()
    return c


def test_at_speed_0_the_tick_under_way_ends_and_no_other_begins() -> None:
    c = paused()
    assert c.clock.speed == 0.0
    for _ in range(5):
        (heartbeat,) = c.send_when_due()
        assert heartbeat != b"tick 3"
    assert c.simulation.done == []
    c.clock.change_speed(None, c.now)
    assert c.clock.speed is None
    assert c.send() == [b"tick 3"]


def test_a_pause_between_two_ticks_holds_at_once() -> None:
    c = Clock(speed=1.0).in_flight()
    c.answer(2)
    c.clock.change_speed(0.0, c.now)
    assert c.wait == pytest.approx(KEEP_ALIVE)


def test_a_new_speed_counts_from_now() -> None:
    c = paused()
    c.now += 60.0
    c.clock.change_speed(1.0, c.now)
    assert c.send() == [b"tick 3"]
    c.answer(3)
    assert c.wait == pytest.approx(PERIOD)
    c.send_when_due()
    c.clock.change_speed(4.0, c.now)
    c.answer(4)
    assert c.wait == pytest.approx(PERIOD / 4)


@pytest.mark.parametrize("ticks", [1, 3])
def test_a_world_that_stands_still_goes_on_for_so_many_ticks(ticks: int) -> None:
    c = paused()
    c.clock.step(ticks, c.now)
    for tick in range(3, 3 + ticks):
        assert c.send() == [b"tick %d" % tick]
        assert c.clock.steps_left == 3 + ticks - tick - 1
        c.answer(tick)
    assert c.wait == pytest.approx(KEEP_ALIVE)
    assert c.clock.steps_left == 0
    assert c.send_when_due() != [b"tick %d" % (3 + ticks)]


def test_steps_asked_for_while_a_tick_is_under_way_come_after_it() -> None:
    c = Clock().in_flight()
    c.clock.change_speed(0.0, c.now)
    c.clock.step(1, c.now)
    assert c.clock.steps_left == 1
    assert c.send() == []
    c.answer(2)
    assert c.send() == [b"tick 3"]
    c.answer(3)
    assert c.wait == pytest.approx(KEEP_ALIVE)


def test_only_a_world_that_stands_still_takes_steps() -> None:
    c = Clock(speed=1.0).in_flight()
    c.clock.step(5, c.now)
    assert c.clock.steps_left == 0
    c = paused()
    for ticks in (0, -1):
        c.clock.step(ticks, c.now)
        assert c.clock.steps_left == 0
        assert c.wait == pytest.approx(KEEP_ALIVE)
    c.clock.step(2, c.now)
    c.clock.change_speed(0.0, c.now)
    assert c.clock.steps_left == 0


def test_nothing_has_a_deadline_of_never() -> None:
    assert paused().clock.next_deadline() < math.inf
