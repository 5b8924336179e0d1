"""Lift-off beside the load, drag, pick up, hover, set down, land, under a simple controller of the test's."""

import numpy as np
import pytest

from sitl_bridge.plant.physics.parameters import step_count
from sitl_bridge.plant.physics.state import (
    LOAD_GROUND_FORCE,
    LOAD_POSITION,
    LOAD_VELOCITY,
    TENSION,
    VEHICLE_GROUND_FORCE,
    VEHICLE_POSITION,
    VEHICLE_VELOCITY,
)
from tests.plant.flying import Array, Flight, flight

PERIOD = 0.004


class Pilot:
    """Position, then attitude, by proportional and derivative action; knows the cable's pull."""

    def __init__(self, plant: Flight) -> None:
        self.plant = plant
        v = plant.vehicle
        effect = [
            (
                r.thrust_coefficient,
                r.position[1] * r.thrust_coefficient,
                -r.position[0] * r.thrust_coefficient,
                (-1.0 if r.direction == "ccw" else 1.0) * r.torque_coefficient,
            )
            for r in v.rotors
        ]
        self.inverse = np.linalg.pinv(np.array(effect).T)
        self.largest = np.array([r.max_speed for r in v.rotors])

    def fly_to(self, target: Array) -> None:
        """Set the rotors for this tick."""
        plant, v, x = self.plant, self.plant.vehicle, self.plant.x
        w, i, j, k = x[6:10]
        up = np.array([2 * (i * k + w * j), 2 * (j * k - w * i), 1 - 2 * (i * i + j * j)])
        body = np.array(
            [
                [1 - 2 * (j * j + k * k), 2 * (i * j + w * k), 2 * (i * k - w * j)],
                [2 * (i * j - w * k), 1 - 2 * (i * i + k * k), 2 * (j * k + w * i)],
                up,
            ]
        )
        across = x[LOAD_POSITION] - x[VEHICLE_POSITION]
        pull = plant.reactions[TENSION] * across / np.linalg.norm(across)
        wanted = 2.0 * (target - x[VEHICLE_POSITION]) - 2.5 * x[VEHICLE_VELOCITY]
        force = v.airframe.mass * (np.clip(wanted, -2.0, 2.0) + np.array([0, 0, v.gravity])) - pull
        tilt = body @ np.cross(up, force / np.linalg.norm(force))
        yaw = np.array([0.0, 0.0, -2.0 * np.arctan2(2 * (w * k + i * j), 1 - 2 * (j * j + k * k))])
        moment = np.array(v.airframe.inertia) * (60.0 * tilt + 4.0 * yaw - [14.0, 14.0, 4.0] * x[10:13])
        squared = self.inverse @ [force @ up, *moment]
        plant.command[: len(v.rotors)] = np.minimum(np.sqrt(np.maximum(squared, 0.0)), self.largest)

    def stop(self) -> None:
        """Rotors off."""
        self.plant.command[:] = 0.0


class Log:
    """What a flight went through, tick by tick."""

    def __init__(self) -> None:
        self.states: list[Array] = []
        self.reactions: list[Array] = []


def flown(*overrides: str) -> tuple[Flight, dict[str, Log]]:
    """The whole sequence; a log for each phase."""
    plant = flight("iris", *overrides)
    pilot, logs = Pilot(plant), {}
    step = PERIOD / step_count(plant.vehicle, PERIOD)
    for phase, seconds, target in (
        ("stand", 2.0, None),
        ("take off", 3.0, (0.0, 0.0, 0.8)),
        ("drag", 6.0, (-1.5, 0.0, 1.0)),
        ("lift", 8.0, (-1.5, 0.0, 3.0)),
        ("set down", 8.0, (-1.5, 0.0, 1.2)),
        ("land", 8.0, (-2.1, 0.0, 0.0)),
        ("rest", 10.0, None),
    ):
        log = logs[phase] = Log()
        for _ in range(round(seconds / PERIOD)):
            if target is None:
                pilot.stop()
            else:
                pilot.fly_to(np.array(target))
            plant.run(PERIOD, step)
            log.states.append(plant.x.copy())
            log.reactions.append(plant.reactions.copy())
    return plant, logs


@pytest.fixture(scope="module")
def logs() -> dict[str, Log]:
    return flown()[1]


def length(x: Array) -> float:
    """Of the cable, m."""
    return float(np.linalg.norm(x[LOAD_POSITION] - x[VEHICLE_POSITION]))


def test_slack_at_first(logs: dict[str, Log]) -> None:
    for phase in ("stand", "take off"):
        assert max(r[TENSION] for r in logs[phase].reactions) == 0.0
    x = logs["take off"].states[-1]
    assert x[2] == pytest.approx(0.8, abs=0.05)
    np.testing.assert_allclose(x[LOAD_POSITION], logs["stand"].states[0][LOAD_POSITION], atol=1e-9)


def test_drags_the_load(logs: dict[str, Log]) -> None:
    """It moves for more than a metre with the ground under it, all the time pulled by the cable."""
    drag = logs["drag"]
    assert drag.states[0][13] - drag.states[-1][13] > 1.0
    assert all(r[LOAD_GROUND_FORCE] > 0.0 for r in drag.reactions)
    assert max(r[TENSION] for r in drag.reactions) < 150.0


def test_lifts_and_hovers(logs: dict[str, Log]) -> None:
    x, felt = logs["lift"].states[-1], logs["lift"].reactions[-1]
    assert felt[LOAD_GROUND_FORCE] == 0.0
    assert x[2] == pytest.approx(3.0, abs=0.1)
    assert length(x) == pytest.approx(1.5 + felt[TENSION] / 60.0, abs=0.005)
    # It swings on from having been dragged: the tension is the weight on average.
    late = [r[TENSION] for r in logs["lift"].reactions[-1000:]]
    assert min(late) > 0.0
    assert np.mean(late) == pytest.approx(0.3 * 9.81, rel=0.05)


def test_sets_down_and_lands_without_jitter(logs: dict[str, Log]) -> None:
    down = logs["set down"].reactions[-1]
    assert down[TENSION] == 0.0
    assert down[LOAD_GROUND_FORCE] == pytest.approx(0.3 * 9.81, rel=1e-3)
    rest = logs["rest"]
    late = np.array(rest.states[len(rest.states) // 2 :])
    assert np.abs(late[:, VEHICLE_VELOCITY]).max() < 1e-9
    assert np.abs(late[:, LOAD_VELOCITY]).max() < 1e-9
    assert np.ptp(late, axis=0).max() < 1e-9
    assert rest.reactions[-1][VEHICLE_GROUND_FORCE] == pytest.approx(1.5 * 9.81, rel=1e-6)


def test_repeatable(logs: dict[str, Log]) -> None:
    again = flown()[1]
    for phase, log in logs.items():
        np.testing.assert_array_equal(again[phase].states, log.states)


def test_stiff_cable_flies_it_too(logs: dict[str, Log]) -> None:
    """A cable so stiff that the rule shortens the step."""
    plant, stiff = flown("cable.stiffness=2e4", "cable.damping=20", "cable.breaking_tension=1e6")
    assert step_count(plant.vehicle, PERIOD) > 4
    assert length(stiff["lift"].states[-1]) == pytest.approx(1.5, abs=0.001)
    assert np.abs(stiff["rest"].states[-1][LOAD_VELOCITY]).max() < 1e-9
