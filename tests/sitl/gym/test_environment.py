"""The environments keep Gymnasium's contract, repeat themselves by seed, and can be solved."""

from __future__ import annotations

import re
import subprocess
import sys
import warnings
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import sitl.gym
from sitl.gym.actions import RateActions
from sitl.gym.environment import SlungLoad
from sitl.gym.observations import SENSOR_NAMES, TRUTH_NAMES
from sitl.gym.plant import RATE_HZ, GymPlant
from sitl.gym.tasks import LOST, DeliveryTask, Moment
from sitl_bridge.plant.physics.state import BODY_RATES
from sitl_bridge.vehicle.files import load_vehicle

IDS = tuple(sitl.gym.IDS)
KINDS = [(a, o) for a in ("rates", "rotors") for o in ("truth", "sensors")]


def trajectory(env: gymnasium.Env[Any, Any], seed: int, steps: int) -> tuple[np.ndarray, np.ndarray]:
    """Observations and rewards under random actions of the seed."""
    draw = np.random.default_rng(seed)
    observed = [env.reset(seed=seed)[0]]
    rewards = []
    assert env.action_space.shape is not None
    for _ in range(steps):
        action = 0.2 * draw.uniform(-1, 1, env.action_space.shape).astype(np.float32)
        found, reward, *_ = env.step(action)
        observed.append(found)
        rewards.append(float(reward))
    return np.array(observed), np.array(rewards)


@pytest.mark.parametrize("name", IDS)
@pytest.mark.parametrize(("actions", "observation"), KINDS)
def test_gymnasiums_checker_is_content(name: str, actions: str, observation: str) -> None:
    env = gymnasium.make(name, actions=actions, observation=observation)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env.unwrapped)


def test_an_id_with_its_module_needs_no_import() -> None:
    """In a process of its own: this one has imported the environments."""
    script = "import gymnasium; print(gymnasium.make('sitl.gym:sitl/Position-v0').spec.id)"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert done.stdout.strip() == "sitl/Position-v0", done.stderr


@pytest.mark.parametrize("observation", ["truth", "sensors"])
def test_a_seed_repeats_the_episode_to_the_last_bit(observation: str) -> None:
    env = gymnasium.make("sitl/Delivery-v0", observation=observation)
    first, rewards = trajectory(env, 7, 100)
    trajectory(env, 8, 3)  # nothing of another episode is left
    again, rewards_again = trajectory(env, 7, 100)
    np.testing.assert_array_equal(first, again)
    np.testing.assert_array_equal(rewards, rewards_again)
    other, _ = trajectory(env, 9, 100)
    assert not np.array_equal(first, other)


def test_episodes_of_one_seed_differ_from_each_other() -> None:
    env = SlungLoad()
    _, first = env.reset(seed=1)
    _, second = env.reset()
    assert not np.array_equal(first["target_m"], second["target_m"])


@pytest.mark.parametrize("mode", ["sync", "async"])
def test_several_fly_as_each_would_alone(mode: str) -> None:
    several = gymnasium.make_vec("sitl/Position-v0", num_envs=2, vectorization_mode=mode)
    try:
        observed, _ = several.reset(seed=[3, 4])
        assert several.action_space.shape is not None
        still = np.zeros(several.action_space.shape, np.float32)
        for _ in range(5):
            observed, *_ = several.step(still)
    finally:
        several.close()
    for row, seed in zip(observed, (3, 4), strict=True):
        env = gymnasium.make("sitl/Position-v0")
        env.reset(seed=seed)
        for _ in range(5):
            alone, *_ = env.step(still[0])
        np.testing.assert_array_equal(row, alone)


@pytest.mark.parametrize("actions", ["rates", "rotors"])
def test_action_0_hovers(actions: str) -> None:
    """Without wind nothing moves, but for what the rotors' first ticks of lag do."""
    env = SlungLoad(actions=actions)
    observed, _ = env.reset(seed=1)
    assert env.action_space.shape is not None
    for _ in range(100):
        observed, *_ = env.step(np.zeros(env.action_space.shape, np.float32))
    names = [f"{body}_v{axis}_m_s" for body in ("load", "vehicle") for axis in "xyz"]
    velocity = [observed[TRUTH_NAMES.index(name)] for name in names]
    assert np.abs(velocity).max() < 1e-6


def test_the_rate_loop_reaches_the_asked_rates() -> None:
    vehicle = load_vehicle("iris", ["initial.start=hover", "initial.load_position=[0, 0, 50]"])
    plant, actions = GymPlant(vehicle, 0, sense=False), RateActions(vehicle, RATE_HZ)
    actions.take(np.array([0.0, 0.1, -0.1, 0.1]))
    for _ in range(100):
        plant.fly(actions.controls(plant.state[BODY_RATES]))
    np.testing.assert_allclose(plant.state[BODY_RATES], [0.3, -0.3, 0.15], atol=0.03)


def test_a_lost_vehicle_ends_the_episode() -> None:
    env = SlungLoad(actions="rotors")
    env.reset(seed=1)
    rewards, over = [], False
    while not over:
        _, reward, over, _, info = env.step(np.array([1, -1, 1, -1], np.float32))
        rewards.append(reward)
        assert len(rewards) < 200
    assert rewards[-1] == LOST
    assert not info["is_success"]
    assert np.isfinite(rewards).all()


def test_sensors_tell_what_is_true_but_for_their_errors() -> None:
    """Ideal sensors in hover: the tracker sees the cable's length, the accelerometer gravity."""
    env = SlungLoad(observation="sensors", overrides=["sensors.preset=ideal"])
    observed, info = env.reset(seed=1)
    for _ in range(50):
        observed, *_, info = env.step(np.zeros(4, np.float32))
    value = dict(zip(SENSOR_NAMES, observed.tolist(), strict=True))
    length = load_vehicle("iris").hover_length
    assert value["sighting_z_m"] == pytest.approx(-length, abs=0.1)
    assert value["specific_force_z_m_s2"] == pytest.approx(9.81, abs=1e-3)
    assert value["target_minus_fix_z_m"] == pytest.approx(info["target_m"][2] - 20.0 - length, abs=0.05)
    assert value["target_minus_barometer_m"] == pytest.approx(value["target_minus_fix_z_m"], abs=0.1)
    assert 0.0 <= value["fix_age_s"] <= 0.2


def test_delivery_takes_a_second_of_rest_at_the_place() -> None:
    task = DeliveryTask(50.0)
    task.begin(load_vehicle("iris"), np.random.default_rng(0))
    there = Moment(distance=0.1, before=0.1, speed=0.1, effort=0.0, lost=False)
    assert not any(task.judge(there).done for _ in range(49))
    assert not task.judge(there._replace(speed=1.0)).done
    assert [task.judge(there).done for _ in range(50)] == [False] * 49 + [True]


@pytest.mark.parametrize("argument", ["task", "actions", "observation", "vehicle"])
def test_an_argument_that_there_is_not_is_one_line(argument: str) -> None:
    wrong: dict[str, Any] = {argument: "x"}
    with pytest.raises(ValueError, match="expected") as caught:
        SlungLoad(**wrong)
    assert len(str(caught.value).splitlines()) == 1


@pytest.mark.parametrize("action", [[0.0, 0.0, 0.0], [np.nan, 0.0, 0.0, 0.0]])
def test_an_action_that_is_none_is_refused(action: list[float]) -> None:
    env = SlungLoad()
    env.reset(seed=1)
    with pytest.raises(ValueError, match="finite numbers"):
        env.step(np.array(action, np.float32))


def test_a_step_before_a_reset_is_refused() -> None:
    with pytest.raises(gymnasium.error.ResetNeeded):
        SlungLoad().step(np.zeros(4, np.float32))


def test_the_pages_example_delivers(capsys: pytest.CaptureFixture[str]) -> None:
    page = (Path(__file__).parents[3] / "docs/gym.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    assert len(code.splitlines()) <= 22
    exec(code, {})
    total = float(capsys.readouterr().out.split()[0])
    assert total > 100.0
