"""How many steps of the Gymnasium environment a second takes; nothing without the extra [gym]."""

from __future__ import annotations

import time
from importlib.util import find_spec

STEPS = 2_000


def gym_figures() -> dict[str, float]:
    """Steps a second of one environment in hover, on truth and on sensors."""
    if find_spec("gymnasium") is None:
        return {}
    import numpy as np

    from sitl.gym.environment import SlungLoad

    found = {}
    for key, observation in (("gym_steps_per_s", "truth"), ("gym_steps_per_s_sensors", "sensors")):
        environment = SlungLoad(observation=observation)
        environment.reset(seed=0)
        hover = np.zeros(environment.action_space.shape or (), np.float32)
        environment.step(hover)
        began = time.perf_counter()
        for _ in range(STEPS):
            environment.step(hover)
        found[key] = STEPS / (time.perf_counter() - began)
    return found
