"""RFC 6298 in the lockstep clock's retransmission timer."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sitl_bridge.plant.clocks.retransmission import (
    FIRST_TIMEOUT,
    LARGEST_SAMPLE,
    LONGEST_TIMEOUT,
    ROUND_TRIPS,
    RetransmissionTimer,
)


def test_before_the_first_sample_it_waits_a_fixed_time_and_backs_off() -> None:
    timer = RetransmissionTimer()
    waits = []
    for _ in range(12):
        waits.append(timer.timeout())
        timer.expired()
    assert waits[:4] == pytest.approx([FIRST_TIMEOUT * 2**k for k in range(4)])
    assert waits[-1] == LONGEST_TIMEOUT


@given(st.lists(st.floats(1e-6, 1.0), min_size=1, max_size=60))
def test_the_timeout_is_ten_smoothed_round_trips_and_no_shorter_than_the_rfcs(
    round_trips: list[float],
) -> None:
    timer = RetransmissionTimer()
    smoothed, variation = round_trips[0], round_trips[0] / 2
    timer.sample(round_trips[0])
    for round_trip in round_trips[1:]:
        sample = min(round_trip, LARGEST_SAMPLE * smoothed)
        variation = 0.75 * variation + 0.25 * abs(smoothed - sample)
        smoothed = 0.875 * smoothed + 0.125 * sample
        timer.sample(round_trip)
    assert timer.timeout() == pytest.approx(min(LONGEST_TIMEOUT, ROUND_TRIPS * smoothed))
    assert ROUND_TRIPS * smoothed >= smoothed + 4 * variation


def test_a_stall_makes_the_timeout_an_eighth_longer_at_most() -> None:
    timer = RetransmissionTimer()
    timer.sample(1e-4)
    before = timer.timeout()
    timer.sample(0.5)
    assert timer.timeout() == pytest.approx(9 / 8 * before)


def test_the_timeout_doubles_from_a_ticks_second_repeat_on_and_is_the_plain_one_for_the_next() -> None:
    timer = RetransmissionTimer()
    timer.sample(1e-4)
    before = timer.timeout()
    for repeat in range(1, 4):
        timer.expired()
        assert timer.timeout() == pytest.approx(2 ** (repeat - 1) * before)
    timer.over()
    assert timer.timeout() == before


def test_after_a_needless_repeat_the_timeout_stays_doubled_until_there_is_a_sample() -> None:
    timer = RetransmissionTimer()
    timer.sample(1e-4)
    before = timer.timeout()
    timer.expired()
    timer.over()
    timer.repeated_needlessly()
    assert timer.timeout() == pytest.approx(2 * before)
    timer.expired()
    assert timer.timeout() == pytest.approx(2 * before)
    timer.expired()
    assert timer.timeout() == pytest.approx(4 * before)
    timer.over()
    timer.sample(1e-4)
    assert timer.timeout() <= before
