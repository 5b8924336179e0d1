"""The elastic cable: a spring and damper between vehicle and load (eq. 9, corrected)."""

from __future__ import annotations

from typing import Any

from sitl_bridge.compiled import kernel


@kernel
def tension(p: Any, length: float, rate: float) -> float:
    """Tension F in N, positive when the cable pulls.

    F = k_a (l - l_0) + c_a dl/dt. A two-way cable, the paper's, also pushes; a tension-only cable never
    does: when it is shorter than its rest length, or the damper would push, it carries nothing.

    p: parameter record; length: l in m; rate: dl/dt in m/s.
    """
    extension = length - p.rest_length
    force: float = p.stiffness * extension + p.damping * rate
    if p.two_way:
        return force
    if extension <= 0.0 or force <= 0.0:
        return 0.0
    return force
