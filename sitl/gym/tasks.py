"""What is to be done in an episode, and what it is worth. Random numbers are passed in."""

from __future__ import annotations

import math
from typing import NamedTuple, Protocol

import numpy as np

from controller.law.state import Array
from sitl_bridge.vehicle.description import Turbulence, Vehicle


class Moment(NamedTuple):
    """What a task judges at the end of a step."""

    distance: float
    """m, from load to target."""
    before: float
    """m, at the end of the step before."""
    speed: float
    """m/s, of the load."""
    effort: float
    """Mean square of the action, 0 to 1."""
    lost: bool


class Judged(NamedTuple):
    """A step's worth."""

    reward: float
    done: bool
    """Whether the task is fulfilled."""


class Task(Protocol):
    """One kind of episode."""

    def begin(self, vehicle: Vehicle, draw: np.random.Generator) -> tuple[Vehicle, Array]:
        """The vehicle in its surroundings, and the target (3,), m, world ENU."""

    def judge(self, moment: Moment) -> Judged:
        """The worth of a step."""


LOST = -100.0
"""Reward of losing the vehicle."""
EFFORT = 0.05


class PositionTask:
    """Take the load to a point within 3 m and keep it there. At most 1 a step, for being there."""

    def begin(self, vehicle: Vehicle, draw: np.random.Generator) -> tuple[Vehicle, Array]:
        """The target is anywhere in a ball about the load."""
        direction = draw.normal(size=3)
        offset = 3.0 * draw.random() ** (1.0 / 3.0) * direction / np.linalg.norm(direction)
        return vehicle, np.array(vehicle.initial_load_position) + offset

    def judge(self, moment: Moment) -> Judged:
        """exp(-distance in m), less the effort."""
        if moment.lost:
            return Judged(LOST, False)
        return Judged(math.exp(-moment.distance) - EFFORT * moment.effort, False)


class DeliveryTask:
    """Take the load to a place 10 to 20 m away, through a wind that is not observed, and hold it still there.

    It is delivered once it was within 0.5 m and slower than 0.5 m/s for a second.
    """

    NEAR, SLOW, HELD = 0.5, 0.5, 1.0
    STRONGEST_WIND = 6.0
    """m/s, steady, from any side; light turbulence on top."""

    def __init__(self, steps_per_second: float) -> None:
        self._needed = round(self.HELD * steps_per_second)
        self._held = 0

    def begin(self, vehicle: Vehicle, draw: np.random.Generator) -> tuple[Vehicle, Array]:
        """Place and wind are drawn."""
        self._held = 0
        azimuth, distance = draw.uniform(-math.pi, math.pi), draw.uniform(10.0, 20.0)
        offset = [distance * math.cos(azimuth), distance * math.sin(azimuth), draw.uniform(-3.0, 3.0)]
        origin, speed = draw.uniform(-math.pi, math.pi), draw.uniform(0.0, self.STRONGEST_WIND)
        wind = (speed * math.cos(origin), speed * math.sin(origin), 0.0)
        air = vehicle.air.model_copy(update={"wind": wind, "turbulence": Turbulence(wind_at_6_m=7.7)})
        target = np.array(vehicle.initial_load_position) + offset
        return vehicle.model_copy(update={"air": air}), target

    def judge(self, moment: Moment) -> Judged:
        """Metres that it came closer, less time and effort; 100 for the delivery."""
        if moment.lost:
            return Judged(LOST, False)
        there = moment.distance < self.NEAR and moment.speed < self.SLOW
        self._held = self._held + 1 if there else 0
        done = self._held >= self._needed
        closer = moment.before - moment.distance
        return Judged(closer - 0.01 - EFFORT * moment.effort + (100.0 if done else 0.0), done)


def task(kind: str, steps_per_second: float) -> Task:
    """`position` or `delivery`. Raises ValueError for anything else."""
    if kind == "position":
        return PositionTask()
    if kind == "delivery":
        return DeliveryTask(steps_per_second)
    raise ValueError(f"task = {kind!r}; expected position or delivery")
