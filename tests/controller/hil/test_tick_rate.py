"""Only a plant at the law's own rate is flown."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from controller.hil.tick_rate import TICKS, TickRate

RATES = st.sampled_from([50.0, 120.0, 250.0, 300.0, 400.0, 1000.0])


def time_usec(tick: int, rate_hz: float) -> int:
    return round((tick + 1) * 1e6 / rate_hz)


@given(rate_hz=RATES, first=st.integers(0, 10**6))
def test_the_same_rate_fits_after_a_few_ticks(rate_hz: float, first: int) -> None:
    said: list[str] = []
    check = TickRate(rate_hz, said.append)
    fits = [check.fits(time_usec(first + k, rate_hz)) for k in range(3 * TICKS)]
    assert fits == [False] * TICKS + [True] * (2 * TICKS)
    assert said == []


@given(designed=RATES, flown=RATES, lost=st.lists(st.booleans(), min_size=60, max_size=60))
def test_another_rate_never_fits_and_is_said_once(designed: float, flown: float, lost: list[bool]) -> None:
    if designed == flown:
        return
    said: list[str] = []
    check = TickRate(designed, said.append)
    came = [time_usec(k, flown) for k in range(60) if not (lost[k] and k % 5 == 0)]
    assert not any(check.fits(time) for time in came)
    assert len(said) == 1
    assert f"({flown:.0f} Hz)" in said[0]
    assert f"designed for {designed:g} Hz" in said[0]


def test_after_a_restart_it_looks_again() -> None:
    check = TickRate(250.0, lambda text: None)
    assert any(check.fits(time_usec(k, 250.0)) for k in range(2 * TICKS))
    check.restart()
    assert not any(check.fits(time_usec(k, 500.0)) for k in range(2 * TICKS))
