"""Noise processes, drawn in blocks. Each has its own generator, so it depends on no other."""

from __future__ import annotations

import math

import numpy as np

from sitl_bridge.plant.physics.state import Array


class White:
    """White noise of a density (SI s^½), sampled every `period` seconds."""

    def __init__(self, density: float, period: float, generator: np.random.Generator) -> None:
        self._std = density / math.sqrt(period)
        self._generator = generator

    def draw(self, count: int, axes: int) -> Array:
        """The next samples, (count, axes)."""
        if self._std == 0.0:
            return np.zeros((count, axes))
        return self._std * self._generator.standard_normal((count, axes))


class RandomWalk:
    """A bias that starts anywhere (standard deviation `start`) and walks (SI s^-½), sampled every
    `period`."""

    def __init__(
        self, start: float, walk: float, period: float, axes: int, generator: np.random.Generator
    ) -> None:
        self._value = start * generator.standard_normal(axes)
        self._step = walk * math.sqrt(period)
        self._generator = generator

    def draw(self, count: int, axes: int) -> Array:
        """The next samples, (count, axes)."""
        if self._step == 0.0:
            return np.tile(self._value, (count, 1))
        path = self._value + np.cumsum(self._step * self._generator.standard_normal((count, axes)), axis=0)
        self._value = path[-1].copy()
        return path


class GaussMarkov:
    """A first-order Gauss-Markov process: standard deviation (axes,), time constant s, exact at samples.

    Starts in its stationary distribution; its autocorrelation is std² exp(-|t| / time_constant).
    """

    def __init__(
        self, std: Array, time_constant: float, period: float, generator: np.random.Generator
    ) -> None:
        self._keep = math.exp(-period / time_constant)
        self._kick = std * math.sqrt(-math.expm1(-2.0 * period / time_constant))
        self._generator = generator
        self._still = not std.any()
        self.value: Array = std * generator.standard_normal(len(std))

    def step(self) -> Array:
        """The value (axes,) one period on."""
        if self._still:
            return self.value
        self.value = self._keep * self.value + self._kick * self._generator.standard_normal(len(self._kick))
        return self.value


class Dropouts:
    """Losses that begin at random (Poisson) and last at random (exponential), stepped every `period`
    seconds."""

    def __init__(
        self, per_hour: float, duration: float, period: float, generator: np.random.Generator
    ) -> None:
        # A Markov chain of two states: exact for exponential times, sampled.
        self._begin = -math.expm1(-per_hour / 3600.0 * period)
        self._end = -math.expm1(-period / duration)
        self._generator = generator
        self.lost = False

    def step(self) -> bool:
        """Whether the signal is lost one period on."""
        if self._begin > 0.0:
            change = self._end if self.lost else self._begin
            self.lost ^= bool(self._generator.random() < change)
        return self.lost
