"""Gymnasium environments: a load on an elastic cable to learn on. Needs the extra [gym].

`import sitl.gym` registers `sitl/Position-v0` and `sitl/Delivery-v0`. In: actions. Out: observations and
rewards. The plant flies in this process, without a link; `actions`, `observations` and `tasks` are pure. May
import the plant, `controller.law` and `controller.hil`.
"""

from __future__ import annotations

import gymnasium

STEPS_PER_SECOND = 50
"""Actions a second; the plant ticks five times as often."""
IDS = {"sitl/Position-v0": ("position", 10.0), "sitl/Delivery-v0": ("delivery", 40.0)}
"""Task, and length of an episode in s, of each registered environment."""

for _id, (_task, _seconds) in IDS.items():
    if _id not in gymnasium.registry:
        gymnasium.register(
            _id,
            entry_point="sitl.gym.environment:SlungLoad",
            max_episode_steps=round(_seconds * STEPS_PER_SECOND),
            kwargs={"task": _task},
        )
