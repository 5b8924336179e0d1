"""Identification: lags, delays and thrust curves that a test has put in are found again."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.over.identify.excitation import PERIOD, PITCH, ROLL, THRUST, excited, sines
from controller.over.identify.fit import Series, fit_response, fit_thrust, response_at
from controller.over.law import Setpoint
from controller.over.stack import thrust_setpoint
from sitl.command_line.commands import main

FREQUENCIES = np.array(ROLL) / PERIOD


def test_no_two_inputs_share_a_frequency() -> None:
    every = (*ROLL, *PITCH, *THRUST)
    assert len(set(every)) == len(every)


def test_the_sines_are_gentle() -> None:
    times = np.arange(0.0, 2.0 * PERIOD, 0.01)
    hover = 17.66
    sent = [excited(Setpoint(hover, (0.0, 0.0, 0.0)), t, hover) for t in times]
    assert max(abs(s.thrust - hover) for s in sent) < 0.12 * hover
    rates = np.array([s.rates[0] for s in sent])
    assert np.abs(rates).max() < 0.6
    assert np.degrees(np.abs(np.cumsum(rates) * 0.01)).max() < 6.0


@settings(max_examples=8, deadline=None)
@given(lag=st.floats(0.02, 0.3), delay=st.floats(0.0, 0.12), seed=st.integers(0, 1000))
def test_lag_and_delay_are_found_in_a_closed_loop_with_noise(lag: float, delay: float, seed: int) -> None:
    """A first-order plant in steps of 2 ms; a feedback on its noisy output disturbs the input."""
    noise = np.random.default_rng(seed)
    step, hold = 2e-3, 5
    count = round(3 * PERIOD / step)
    delayed = round(delay / step)
    x, output, wanted = 0.0, 0.0, np.zeros(count)
    times, sent, came = [], [], []
    for k in range(count):
        if k % hold == 0:
            output = x + 0.05 * noise.normal()
            u = 0.12 * sines(ROLL, k * step) - 0.3 * output
            wanted[k : k + hold] = u
            times.append(k * step)
            sent.append(u)
            came.append(output)
        acting = wanted[k - delayed] if k >= delayed else 0.0
        x = acting + (x - acting) * np.exp(-step / lag)
    keep = np.array(times) > PERIOD
    at = np.array(times)[keep]
    seen = (Series(at, np.array(sent)[keep]), Series(at, np.array(came)[keep]))
    found = fit_response(*seen, FREQUENCIES, known_gain=1.0)
    assert fit_response(*seen, FREQUENCIES).gain == pytest.approx(1.0, abs=0.15)
    assert found.lag == pytest.approx(lag, abs=0.004 + 0.05 * lag)
    assert found.delay == pytest.approx(delay, abs=0.004 + 0.02 * lag)


@given(full=st.floats(20.0, 60.0), curve=st.floats(0.0, 1.0))
def test_the_thrust_curve_is_found_from_hover_and_slope(full: float, curve: float) -> None:
    force, d = 0.5 * full, 1e-5 * full
    setpoint = thrust_setpoint(force, full, curve)
    slope = 2 * d / (thrust_setpoint(force + d, full, curve) - thrust_setpoint(force - d, full, curve))
    found = fit_thrust(force, setpoint, slope)
    for share in (0.3, 0.5, 0.8):
        wanted = thrust_setpoint(share * full, full, curve)
        assert thrust_setpoint(share * full, found.full, found.curve) == pytest.approx(wanted, abs=1e-3)


def test_uneven_samples_and_a_drift_do_not_matter() -> None:
    noise = np.random.default_rng(0)
    times = np.sort(noise.uniform(0.0, 30.0, 3000))
    values = 3.0 + 0.2 * times + 2.0 * np.cos(2 * np.pi * 1.3 * times + 0.5)
    found = response_at(times, values, np.array([0.8, 1.3]))
    assert found[1] == pytest.approx(2.0 * np.exp(0.5j), abs=1e-6)
    assert abs(found[0]) < 1e-6


@pytest.mark.parametrize(("flag", "value"), [("--steer", "attitude"), ("--baseline", "point")])
def test_what_does_not_go_with_it_is_one_line(
    flag: str, value: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["identify", "--over", "udpin:127.0.0.1:1", flag, value]) == 2
    assert f"{flag}: does not go with identify" in capsys.readouterr().err
