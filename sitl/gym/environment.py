"""The environment: Gymnasium's interface over the plant."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces import Box, Space
from numpy.typing import NDArray

from sitl.gym import STEPS_PER_SECOND
from sitl.gym.actions import actions as actions_of
from sitl.gym.observations import LARGEST, OBSERVATIONS
from sitl.gym.plant import RATE_HZ, GymPlant
from sitl.gym.tasks import Moment
from sitl.gym.tasks import task as task_of
from sitl_bridge.plant.physics.state import BODY_RATES, LOAD_POSITION, LOAD_VELOCITY
from sitl_bridge.vehicle.description import Vehicle
from sitl_bridge.vehicle.files import load_vehicle

TICKS_PER_STEP = round(RATE_HZ / STEPS_PER_SECOND)
START = ("initial.start=hover", "initial.load_position=[0.0, 0.0, 20.0]")
TRACKER = (
    "sensors.tracker.rate=20",
    "sensors.tracker.angle_noise=0.01",
    "sensors.tracker.distance_noise=0.02",
)
"""Of a vehicle that has none: without one nothing that is observed tells of the load."""

METADATA: dict[str, Any] = {"render_modes": [], "render_fps": STEPS_PER_SECOND}
Observation = NDArray[np.float32]


class SlungLoad(gymnasium.Env[Observation, NDArray[np.float32]]):
    """Fly a load on an elastic cable; docs/gym.md has spaces, rewards and examples."""

    metadata = METADATA

    def __init__(
        self,
        task: str = "position",
        vehicle: str | Vehicle = "iris",
        overrides: Sequence[str] = (),
        actions: str = "rates",
        observation: str = "truth",
        render_mode: str | None = None,
    ) -> None:
        """Make an environment; `gymnasium.make("sitl/Position-v0", …)` passes its arguments on.

        Arguments:
            task: `position` or `delivery`.
            vehicle: a shipped name, a .toml file, or a complete `Vehicle`.
            overrides: `KEY=VALUE` each, as for `--set`.
            actions: `rates` (thrust and body rates) or `rotors` (a command for each).
            observation: `truth` or `sensors`.
            render_mode: None; there is no other.

        Raises ValueError for another task, action, observation or render mode, and DescriptionError for a
        faulty vehicle.
        """
        if observation not in OBSERVATIONS:
            raise ValueError(f"observation = {observation!r}; expected truth or sensors")
        if render_mode is not None:
            raise ValueError(f"render_mode = {render_mode!r}; there is none (docs/gym.md)")
        self.render_mode = None
        described = load_vehicle(vehicle, [*START, *overrides])
        if observation == "sensors" and described.sensors.tracker is None:
            described = load_vehicle(described, TRACKER)
        self._vehicle = described
        self._task = task_of(task, STEPS_PER_SECOND)
        self._kind = actions
        self._actions = actions_of(actions, described, RATE_HZ)
        self._observe, names = OBSERVATIONS[observation]
        self._on_sensors = observation == "sensors"
        self.action_space: Space[Any] = self._actions.space
        self.observation_space: Space[Any] = Box(-LARGEST, LARGEST, (len(names),), np.float32)
        self._plant: GymPlant | None = None
        self._target = np.zeros(3)
        self._distance = 0.0

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode. The same seed gives the same episode; `options` are ignored."""
        super().reset(seed=seed)
        surrounded, self._target = self._task.begin(self._vehicle, self.np_random)
        self._plant = GymPlant(surrounded, int(self.np_random.integers(2**31)), self._on_sensors)
        self._actions = actions_of(self._kind, surrounded, RATE_HZ)
        self._distance = self._error()
        return self._observed(), self._info()

    def step(self, action: NDArray[np.float32]) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Fly for 20 ms. The episode terminates when the vehicle is lost or the task is done."""
        plant = self._flying()
        given = np.asarray(action, dtype=np.float64)
        if given.shape != self.action_space.shape or not np.isfinite(given).all():
            raise ValueError(f"action = {action}; expected {self.action_space.shape} of finite numbers")
        bounded = np.clip(given, -1.0, 1.0)
        self._actions.take(bounded)
        for _ in range(TICKS_PER_STEP):
            rates = plant.sensed["gyroscope"][0] if self._on_sensors else plant.state[BODY_RATES]
            plant.fly(self._actions.controls(rates))
        before, self._distance = self._distance, self._error()
        speed = float(np.linalg.norm(plant.state[LOAD_VELOCITY]))
        effort = float(np.mean(bounded**2))
        judged = self._task.judge(Moment(self._distance, before, speed, effort, plant.look()))
        info = {**self._info(), "is_success": judged.done}
        return self._observed(), judged.reward, judged.done or plant.lost, False, info

    def _flying(self) -> GymPlant:
        if self._plant is None:
            raise gymnasium.error.ResetNeeded("call reset() before step()")
        return self._plant

    def _error(self) -> float:
        distance = float(np.linalg.norm(self._flying().state[LOAD_POSITION] - self._target))
        return distance if np.isfinite(distance) else LARGEST

    def _observed(self) -> Observation:
        found = self._observe(self._flying(), self._target)
        return np.clip(np.nan_to_num(found), -LARGEST, LARGEST).astype(np.float32)

    def _info(self) -> dict[str, Any]:
        plant = self._flying()
        return {"time_s": plant.time_s, "load_error_m": self._distance, "target_m": self._target.copy()}
