"""What a command is made of: each term by its formula, and their sum in the log of a flight."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import sitl
from controller.design.catalogue import design
from controller.law.allocation import allocation
from controller.law.attitude_law import attitude_law, attitude_step
from controller.law.control_law import WORK, engaged_memory
from controller.law.control_step import control_step
from controller.law.reference import setpoint
from controller.law.state import LOAD_POSITION, STATE_SIZE, VEHICLE_POSITION, Array
from controller.law.terms import (
    COMPONENTS,
    DELAY,
    FEEDFORWARD_TERM,
    INTEGRAL,
    PROPORTIONAL,
    SATURATED,
    TERM_COLUMNS,
    TERMS,
)
from controller.own_law.interface import LawError
from sitl.recording.recording import Columns, read_columns
from sitl_bridge.vehicle.files import load_vehicle
from sitl_bridge.vehicle.rotors import rotor_effect
from tests.controller.fleet import FLEET, delayed
from tests.controller.ground.flown import Flown

RATE_HZ = 250.0


def of(log: Columns, term: str) -> Array:
    """(n, 4)"""
    return np.stack([log[f"{term}_{component}"] for component in COMPONENTS], axis=1)


@pytest.mark.parametrize("off_m", [0.02, 40.0])
def test_each_term_is_its_part_of_the_sum(off_m: float) -> None:
    """Two commands under way, lagging rotors, an error that has been integrated for a while."""
    vehicle = delayed(FLEET["small, lag"], 2)
    law = design("default", vehicle, RATE_HZ)
    memory, work = engaged_memory(np.zeros(3)), np.zeros(1, dtype=WORK)
    estimate, controls = np.zeros(STATE_SIZE), np.zeros(16)
    estimate[VEHICLE_POSITION] = (0.0, 0.0, vehicle.hover_length)
    estimate[LOAD_POSITION] += (off_m, 0.0, 0.0)
    path = setpoint((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    law["adapts"] = 0
    step = control_step.bind(law, allocation(vehicle), path, memory, work, estimate, controls)
    for _ in range(20):
        past, rotors, before = memory["past"][0].copy(), memory["rotors"][0].copy(), memory.copy()
        limited = step()
        error = estimate[LOAD_POSITION] - work["reference"][0]
        integral = before["integral"][0]
        if before["ticks"][0] > 0:
            rate = work["integral_rate"][0]
            integral = integral + rate * 0.5 / RATE_HZ * (error + before["last_error"][0])
        terms, gains = work["terms"][0], work["gains"][0]
        np.testing.assert_allclose(terms[FEEDFORWARD_TERM], work["feedforward"][0])
        feedback = -gains["state_gain"] @ work["deviation"][0]
        np.testing.assert_allclose(terms[PROPORTIONAL], feedback, rtol=1e-9, atol=1e-12)
        scale = np.abs(feedback).max()
        integrated = -gains["integral_gain"] @ integral
        np.testing.assert_allclose(terms[INTEGRAL], integrated, rtol=1e-9, atol=1e-12 * scale)
        under_way = np.einsum("akj,aj->k", gains["past_gain"][:2], past[:2]) + gains["lag_gain"] @ rotors
        np.testing.assert_allclose(terms[DELAY], -under_way, rtol=1e-9, atol=1e-12 * scale)
        commands = zip(vehicle.rotors, controls[: len(vehicle.rotors)], strict=True)
        thrusts = [rotor.thrust_coefficient * (c * rotor.max_speed) ** 2 for rotor, c in commands]
        given = rotor_effect(vehicle.rotors) @ thrusts
        np.testing.assert_allclose(terms.sum(axis=0), given, rtol=1e-9, atol=1e-9 * scale)
        cut = bool(limited) or work["held_back"][0].any()
        assert np.allclose(terms[SATURATED], 0.0, atol=1e-9 * scale) != cut
    assert cut == (off_m > 1.0)


def test_the_terms_of_an_attitude_law_add_up() -> None:
    vehicle = load_vehicle("iris")
    law, work = attitude_law(vehicle, RATE_HZ), np.zeros(1, dtype=WORK)
    law["thrust"], law["rate"], law["integral"] = vehicle.hover_thrust, (1.0, -2.0, 0.5), (0.1, 0.2, 0.3)
    estimate, controls = np.zeros(STATE_SIZE), np.zeros(16)
    estimate[12:15] = rates = np.array((0.5, 1.0, -2.0))
    attitude_step.bind(law, allocation(vehicle), work, estimate, controls)()
    terms, inertia = work["terms"][0], np.array(vehicle.airframe.inertia)
    turning = np.cross(rates, inertia * rates)
    np.testing.assert_allclose(terms[FEEDFORWARD_TERM], (vehicle.hover_thrust, *turning), atol=1e-12)
    np.testing.assert_allclose(terms[INTEGRAL, 1:], inertia * (0.1, 0.2, 0.3))
    np.testing.assert_allclose(terms.sum(axis=0), work["achieved"][0], atol=1e-12)


@pytest.mark.parametrize(("feedback", "name"), [("truth", "paper"), ("estimate", "default")])
def test_the_logged_terms_add_up_to_what_the_rotors_gave(tmp_path: Path, feedback: str, name: str) -> None:
    """The state log's rotor speeds at a tick are those that the command of that tick asks for."""
    flight = sitl.fly("setpoint", duration_s=1.0, out=tmp_path, feedback=feedback, design=name, logs="all")
    log = read_columns(tmp_path / "law_terms.parquet")
    vehicle = load_vehicle("paper")
    speeds = np.stack([flight.states[f"rotor_{i + 1}_rad_s"] for i in range(4)], axis=1)
    rows = np.searchsorted(flight.states["time_s"], log["time_s"] - 1e-6)
    assert len(rows) == round(RATE_HZ)
    np.testing.assert_allclose(flight.states["time_s"][rows], log["time_s"], atol=1e-9)
    thrusts = speeds[rows] ** 2 * [rotor.thrust_coefficient for rotor in vehicle.rotors]
    given = thrusts @ rotor_effect(vehicle.rotors).T
    total = sum(of(log, term) for term in TERMS)
    np.testing.assert_allclose(total, given, atol=2e-4)  # single precision of some 200 N
    assert of(log, "proportional").any()
    assert of(log, "integral").any()


def test_fewer_rows_are_kept_by_default_and_they_are_the_same(tmp_path: Path) -> None:
    for logs in ("usual", "all", "none"):
        sitl.fly("setpoint", duration_s=0.4, out=tmp_path / logs, logs=logs)
    few, every = (read_columns(tmp_path / logs / "law_terms.parquet") for logs in ("usual", "all"))
    assert tuple(few) == ("time_s", *TERM_COLUMNS)
    for name, column in few.items():
        np.testing.assert_array_equal(column, every[name][::5])
    assert not (tmp_path / "none" / "law_terms.parquet").exists()


def test_under_ground_control_a_law_tells_its_terms_while_it_flies() -> None:
    flown = Flown()
    flown.run(0.2)
    assert flown.pilot.terms is None
    client = flown.client()
    assert client.command(400, 1).result == 0
    flown.run(0.2)
    assert flown.pilot.terms is None, "the rotors idle"
    assert client.command(22).result == 0
    flown.run_until(lambda: flown.station.machine.mode.name == "TAKEOFF")
    flown.run(0.5)
    terms, rotors = flown.pilot.terms, flown.vehicle.rotors
    assert terms is not None
    speeds = flown.session._writer.controls[: len(rotors)] * [rotor.max_speed for rotor in rotors]
    thrusts = speeds**2 * [rotor.thrust_coefficient for rotor in rotors]
    np.testing.assert_allclose(terms.reshape(5, 4).sum(axis=0), rotor_effect(rotors) @ thrusts, atol=1e-6)


class Silent:
    """A law of one's own that says no more than what the rotors are to do."""

    def __init__(self, *, vehicle: object, rate_hz: float) -> None:
        self.thrust = load_vehicle("paper").hover_thrust

    def step(self, estimate: object, reference: object) -> tuple[float, tuple[float, ...]]:
        return self.thrust, (0.0, 0.0, 0.0)


class Telling(Silent):
    """One that tells more than the rotors can give."""

    def step(self, estimate: object, reference: object) -> tuple[float, tuple[float, ...]]:
        self.terms = {"feedforward": (self.thrust, 0, 0, 0), "integral": [1e4, 0, 0, 0]}
        return self.thrust + 1e4, (0.0, 0.0, 0.0)


class Wrong(Silent):
    terms = {"differential": (0.0, 0.0, 0.0, 0.0)}  # noqa: RUF012


def test_a_law_of_ones_own_may_tell_its_terms_or_none(tmp_path: Path) -> None:
    sitl.fly("hover", law=Silent, duration_s=0.2, out=tmp_path / "silent")
    assert not (tmp_path / "silent" / "law_terms.parquet").exists()
    sitl.fly("hover", law=Telling, duration_s=0.2, out=tmp_path / "telling")
    log = read_columns(tmp_path / "telling" / "law_terms.parquet")
    assert set(log["integral_thrust_N"]) == {1e4}
    assert not of(log, "proportional").any()
    most = sum(rotor.thrust_coefficient * rotor.max_speed**2 for rotor in load_vehicle("paper").rotors)
    total = sum(of(log, term) for term in TERMS)
    np.testing.assert_allclose(total[:, 0], most, rtol=1e-6)


def test_terms_that_are_none_end_the_flight_with_what_was_expected() -> None:
    with pytest.raises(LawError, match=r"differential.*expected wrenches of four numbers"):
        sitl.fly("hover", law=Wrong, duration_s=0.2)
