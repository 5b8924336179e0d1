"""Rotors: first-order lag of their speeds, and what force and moment they make."""

from __future__ import annotations

import math
from typing import Any

from sitl_bridge.compiled import kernel
from sitl_bridge.plant.physics.state import Array


@kernel
def rotor_wrench(p: Any, rotor_speed: Array) -> tuple[float, float, float, float]:
    """Total thrust (N) and moments about the body's x, y, z (N m) of all rotors (eqs. 6 and 13).

    p: parameter record; rotor_speed: (n,) in rad/s.
    """
    thrust, roll, pitch, yaw = 0.0, 0.0, 0.0, 0.0
    for i in range(p.rotor_count):
        squared = rotor_speed[i] * rotor_speed[i]
        lift = p.thrust_coefficient[i] * squared
        thrust += lift
        roll += p.rotor_y[i] * lift
        pitch -= p.rotor_x[i] * lift
        yaw += p.reaction_coefficient[i] * squared
    return thrust, roll, pitch, yaw


@kernel
def rotor_decay(p: Any, duration: float, out: Array) -> None:
    """How much of each rotor's deviation from its command is left after `duration` seconds.

    p: parameter record; out: (16,) or more, written for each rotor; 0 where there is no lag.
    """
    for i in range(p.rotor_count):
        lag = p.time_constant[i]
        out[i] = math.exp(-duration / lag) if lag > 0.0 else 0.0


@kernel
def spin_up(p: Any, speed: Array, command: Array, decay: Array, out: Array) -> None:
    """Rotor speeds (rad/s) after the time that `decay` stands for, with the command held; exact.

    speed, command, decay: (n,); out: (n,), written; may be `speed` itself.
    """
    for i in range(p.rotor_count):
        out[i] = command[i] + (speed[i] - command[i]) * decay[i]
