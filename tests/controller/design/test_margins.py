"""Delay margins: the closed-loop matrix against the law itself, and what the designs have to bear."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import linalg

from controller.design.catalogue import design
from controller.design.margins import closed_loop_matrix, delay_margin, spectral_radius
from controller.design.model import LinearModel, actuated_model
from controller.design.names import DESIGNS
from controller.law.control_law import WORK, Design, engaged_memory
from controller.law.reference import setpoint
from controller.law.state import LOAD_POSITION, STATE_SIZE, Array
from sitl.studies.random_vehicles import random_vehicle
from sitl_bridge.vehicle.description import Vehicle
from tests.controller.compiled_law import given_step
from tests.controller.fleet import FLEET, attributes, delayed

ORIGIN = (0.0, 0.0, 0.0)
EVERY_INPUT = (0, 1, 2, 3)


def flown(
    model: LinearModel, record: Design, extra: float, inputs: tuple[int, ...], start: Array, ticks: int
) -> Array:
    """Load positions (ticks + 1, 3), the real law flying the linear model; commands change between ticks.

    The input is a list of (time, command) that the plant looks up, its delayed entries `extra` s later.
    """
    law, work = attributes(record), np.zeros(1, dtype=WORK)
    estimate = np.zeros(STATE_SIZE)
    step = given_step.bind(record, engaged_memory(np.zeros(3)), setpoint(ORIGIN, ORIGIN), work, estimate)
    period, told = float(law.period), int(law.delay)
    hover = np.array(law.hover_state)
    n, m = model.B.shape
    x = start.copy()
    commands: list[Array] = []

    def command_at(time: float) -> Array:
        late = int(np.floor((time - extra) / period + 1e-9)) - told
        soon = int(np.floor(time / period + 1e-9)) - told
        out = commands[soon].copy() if soon >= 0 else np.zeros(m)
        for i in inputs:
            out[i] = commands[late][i] if late >= 0 else 0.0
        return out

    transition: dict[float, Array] = {}
    dynamics = np.zeros((n + m, n + m))
    dynamics[:n, :n], dynamics[:n, n:] = model.A, model.B
    rest = extra % period
    pieces = (rest, period - rest) if rest > 0 else (period,)
    loads = [x[LOAD_POSITION].copy()]
    for tick in range(ticks):
        estimate[:] = x[:STATE_SIZE] + hover
        step()
        commands.append(work["wrench"][0] - law.hover_wrench)
        time = tick * period
        for piece in pieces:
            if piece not in transition:
                transition[piece] = linalg.expm(dynamics * piece)
            x = (transition[piece] @ np.concatenate([x, command_at(time + 1e-6)]))[:n]
            time += piece
        loads.append(x[LOAD_POSITION].copy())
    return np.array(loads)


@pytest.mark.parametrize("extra", [0.0, 0.3, 1.0, 2.7], ids="{} periods".format)
@pytest.mark.parametrize(
    ("name", "vehicle", "told"),
    [
        ("default", "small", 0),
        ("default", "small, lag", 2),
        ("paper", "paper, 10 m", 1),
        ("paper-lqr", "paper", 0),
        ("paper-lqr", "large, lag", 1),
        ("geometric", "paper", 0),
        ("geometric", "large, lag", 2),
    ],
)
def test_the_matrix_is_the_law_on_the_linear_model(name: str, vehicle: str, told: int, extra: float) -> None:
    model = actuated_model(FLEET[vehicle])
    record = design(name, delayed(FLEET[vehicle], told), 100.0)
    delay = extra * 0.01
    start = np.zeros(len(model.A))
    # Small: away from hover the laws turn deviations into a frame of the reference or the cable.
    start[:STATE_SIZE] = 3e-7 * np.random.default_rng(3).standard_normal(STATE_SIZE)
    for inputs in ((1,), (0, 3), EVERY_INPUT):
        matrix = closed_loop_matrix(model, record, delay, inputs)
        z = np.zeros(len(matrix))
        z[: len(start)] = start
        if name != "paper-lqr":
            # The law integrates from its second tick on: at the first its integral comes out as 0.
            z[-6:-3] = -0.01 * z[LOAD_POSITION]
            z[-3:] = z[LOAD_POSITION]
        expected = [z[LOAD_POSITION].copy()]
        for _ in range(60):
            z = matrix @ z
            expected.append(z[LOAD_POSITION].copy())
        found = flown(model, record, delay, inputs, start, 60)
        np.testing.assert_allclose(found, expected, atol=1e-6 * float(np.abs(expected).max()))


@pytest.mark.parametrize("vehicle", FLEET.values(), ids=FLEET)
@pytest.mark.parametrize(("rate_hz", "told"), [(50, 0), (50, 2), (100, 1), (250, 0), (500, 0)])
def test_the_default_design_bears_20_ms_at_each_input(vehicle: Vehicle, rate_hz: float, told: int) -> None:
    known = delayed(vehicle, told)
    model, record = actuated_model(known), design("default", known, rate_hz)
    assert spectral_radius(closed_loop_matrix(model, record)) < 1.0
    for inputs in (*((i,) for i in EVERY_INPUT), EVERY_INPUT):
        assert delay_margin(model, record, inputs, longest=0.02) == 0.02, inputs


@pytest.mark.parametrize("number", range(20))
def test_so_it_does_with_random_vehicles(number: int) -> None:
    vehicle = random_vehicle(np.random.default_rng(1_000_003 + number), 50.0)
    model, record = actuated_model(vehicle), design("default", vehicle, 250.0)
    for inputs in (*((i,) for i in EVERY_INPUT), EVERY_INPUT):
        assert spectral_radius(closed_loop_matrix(model, record, 0.02, inputs)) < 1.0, inputs


@pytest.mark.parametrize("name", DESIGNS)
@pytest.mark.parametrize(("rate_hz", "told"), [(50, 2), (250, 0)])
def test_every_design_is_stable_in_the_loop_that_it_is_made_for(name: str, rate_hz: float, told: int) -> None:
    for vehicle in (FLEET["paper"], FLEET["paper, 10 m"]):
        known = delayed(vehicle, told)
        matrix = closed_loop_matrix(actuated_model(known), design(name, known, rate_hz))
        assert spectral_radius(matrix) < 1.0


def test_the_margin_is_where_the_radius_crosses_one() -> None:
    vehicle = FLEET["paper"]
    model, record = actuated_model(vehicle), design("default", vehicle, 250.0)
    margin = delay_margin(model, record, (2,))
    assert 0.02 < margin < 0.1
    assert spectral_radius(closed_loop_matrix(model, record, margin, (2,))) < 1.0
    assert spectral_radius(closed_loop_matrix(model, record, margin + 2e-4, (2,))) >= 1.0


def test_margins_of_an_unstable_and_of_an_unshakeable_loop() -> None:
    near, far = FLEET["paper"], FLEET["paper, 10 m"]
    # docs/paper.md: gains for one length are unstable on the other.
    assert delay_margin(actuated_model(far), design("paper", near, 250.0)) == 0.0
    assert delay_margin(actuated_model(near), design("default", near, 250.0), (3,), longest=0.01) == 0.01
