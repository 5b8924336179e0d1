"""The elastic cable: a spring and damper between vehicle and load (eq. 9, corrected).

All that depends on the cable's model is here: its force on the bodies, its tension, when it goes slack or
taut, when it breaks. The equations of motion, the integrator and the log call these kernels and know nothing
of the law.

Taut or slack is decided between steps and held within one: within a step the force is then a smooth
function of the state, and the sign of `taut_margin_of` says when the other one holds. Where the sign
changes, the step is split at that instant, so that the integrator keeps its order through snatches.

A progressive cable and a chain are of `flexible_cable`: they have states of their own, and their force is
continuous where they go slack.

Arguments: p, parameter record; x, state (19,); inner, inner state (149,); see `state`.
"""

from __future__ import annotations

from typing import Any

from sitl_bridge.compiled import kernel
from sitl_bridge.plant.physics.cables.chain import chain_tension
from sitl_bridge.plant.physics.cables.flexible_cable import CHAIN, LINEAR, PROGRESSIVE, progressive_tension
from sitl_bridge.plant.physics.state import CABLE_HOLDS, CABLE_STATE, Array


@kernel
def spring_and_damper(p: Any, length: Any, rate: Any) -> Any:
    """F = k_a (l - l_0) + c_a d(l - l_0)/dt in N, whatever its sign; length: l in m; rate: dl/dt in m/s."""
    return p.stiffness * (length - p.rest_length) + p.damping * (rate - p.reel_rate)


@kernel
def taut_margin(p: Any, length: float, rate: float) -> float:
    """N; positive where a tension-only cable pulls, continuous where it goes from slack to taut or back.

    The smaller of the spring's force and the whole force: a taut cable is longer than l_0, and pulls. One
    whose damper outweighs its spring would push; it carries nothing.
    """
    spring = p.stiffness * (length - p.rest_length)
    whole = spring_and_damper(p, length, rate)
    return float(min(whole, spring))


@kernel
def tension(p: Any, length: float, rate: float) -> float:
    """Tension F in N, positive when the cable pulls; a two-way cable, the paper's, also pushes."""
    if p.two_way or taut_margin(p, length, rate) > 0.0:
        return float(spring_and_damper(p, length, rate))
    return 0.0


@kernel
def span(x: Array) -> tuple[Any, Any, Any, Any]:
    """Vector from vehicle to load, m, world, and its length l, m."""
    dx, dy, dz = x[13] - x[0], x[14] - x[1], x[15] - x[2]
    return dx, dy, dz, (dx * dx + dy * dy + dz * dz) ** 0.5


@kernel
def speed_along(x: Array, ax: Any, ay: Any, az: Any) -> Any:
    """Velocity of the load against the vehicle, times the vector a."""
    return (x[16] - x[3]) * ax + (x[17] - x[4]) * ay + (x[18] - x[5]) * az


@kernel
def stretch(x: Array) -> tuple[float, float]:
    """Length l, m, and its rate dl/dt, m/s; no rate where the bodies are in the same place."""
    dx, dy, dz, length = span(x)
    if length <= 0.0:
        return length, 0.0
    return length, speed_along(x, dx, dy, dz) / length


@kernel
def taut_margin_of(p: Any, x: Array) -> float:
    """`taut_margin` in this state, N."""
    length, rate = stretch(x)
    return float(taut_margin(p, length, rate))


@kernel
def is_taut(p: Any, x: Array, inner: Array) -> bool:
    """Whether a spring-damper exerts a force in this state: it holds, and is two-way or taut."""
    if inner[CABLE_HOLDS] == 0.0 or p.cable_kind != LINEAR:
        return False
    return bool(p.two_way) or taut_margin_of(p, x) > 0.0


@kernel
def goes_slack(p: Any, inner: Array) -> bool:
    """Whether a spring-damper can change between slack and taut at all: it holds, and cannot push."""
    return inner[CABLE_HOLDS] > 0.0 and not p.two_way and p.cable_kind == LINEAR


@kernel
def taut_force(p: Any, x: Array) -> tuple[Any, Any, Any]:
    """Force of a cable that is held taut on the vehicle, N, world; on the load: the opposite."""
    dx, dy, dz, length = span(x)
    shrink = 1.0 / length
    ex, ey, ez = dx * shrink, dy * shrink, dz * shrink
    pull = spring_and_damper(p, length, speed_along(x, ex, ey, ez))
    return pull * ex, pull * ey, pull * ez


@kernel
def tension_of(p: Any, x: Array, inner: Array) -> float:
    """Tension in this state, N; 0 once the cable has broken or let go."""
    if inner[CABLE_HOLDS] == 0.0:
        return 0.0
    length, rate = stretch(x)
    if p.cable_kind == PROGRESSIVE:
        return float(progressive_tension(p, length / p.rest_length - 1.0, inner, CABLE_STATE))
    if p.cable_kind == CHAIN:
        return float(chain_tension(p, x, inner, CABLE_STATE))
    return float(tension(p, length, rate))


@kernel
def break_overloaded(p: Any, x: Array, inner: Array) -> None:
    """Let the cable go, for good, where its tension exceeds what it bears; inner is written."""
    if tension_of(p, x, inner) > p.breaking_tension:
        inner[CABLE_HOLDS] = 0.0
