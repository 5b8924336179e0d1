"""The elastic cable: a spring and damper between vehicle and load (eq. 9, corrected).

Taut or slack is decided between steps and held within one: within a step the force is then a smooth
function of the state, and `slack_or_taut` says, by its sign, when the other one holds. Where the sign
changes, the step is split at that instant, so that the integrator keeps its order through snatches.
"""

from __future__ import annotations

from typing import Any

from sitl_bridge.compiled import kernel
from sitl_bridge.plant.physics.state import CABLE_HOLDS, Array


@kernel
def spring_force(p: Any, length: Any, rate: Any) -> Any:
    """Force of the stretched cable in N: k_a (l - l_0) + c_a dl/dt, whatever its sign.

    p: parameter record; length: l in m; rate: dl/dt in m/s.
    """
    extension = length - p.rest_length
    return p.stiffness * extension + p.damping * rate


@kernel
def tension(p: Any, length: float, rate: float) -> float:
    """Tension F in N, positive when the cable pulls.

    F = k_a (l - l_0) + c_a dl/dt. A two-way cable, the paper's, also pushes; a tension-only cable never
    does: when it is shorter than its rest length, or the damper would push, it carries nothing.

    p: parameter record; length: l in m; rate: dl/dt in m/s.
    """
    force: float = spring_force(p, length, rate)
    if p.two_way or (length > p.rest_length and force > 0.0):
        return force
    return 0.0


@kernel
def slack_or_taut(p: Any, x: Array) -> float:
    """N; positive where a tension-only cable pulls, continuous where it goes from slack to taut or back.

    The smaller of the spring's force and the whole force: taut means longer than l_0, and pulling.
    """
    ex, ey, ez = x[13] - x[0], x[14] - x[1], x[15] - x[2]
    length = (ex * ex + ey * ey + ez * ez) ** 0.5
    spring = p.stiffness * (length - p.rest_length)
    if length <= 0.0:
        return float(spring)
    rate = ((x[16] - x[3]) * ex + (x[17] - x[4]) * ey + (x[18] - x[5]) * ez) / length
    damper = p.damping * rate
    return float(spring + damper if damper < 0.0 else spring)


@kernel
def cable_acts(p: Any, x: Array, inner: Array) -> bool:
    """Whether the cable exerts a force in this state: it holds, and is two-way or taut.

    p: parameter record; x: state; inner: inner state.
    """
    if inner[CABLE_HOLDS] == 0.0:
        return False
    return bool(p.two_way) or slack_or_taut(p, x) > 0.0
