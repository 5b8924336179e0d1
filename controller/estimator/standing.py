"""Whether a vehicle stands: it rests on what carries it, and does not tip under its rotors.

Taken for standing while it still slides or already tips, it would have its deceleration for a tilt and its
gyroscope for faulty. Sent up again it would be lost: GPS contradicts an attitude that is wrong by degrees.
"""

from __future__ import annotations

from controller.estimator.correct.live_samples import failed
from controller.estimator.predict.rotation import matrix
from controller.estimator.records import GYROSCOPE, X_RATES, Filter
from sitl_bridge.compiled import kernel

CARRIED = 0.2
"""Share of the vehicle's weight that has to be carried from below."""
RESTING, RESTING_RATE = 0.25, 0.3
"""Share of its weight by which the forces on a vehicle at rest may not add up; rad/s that it may turn."""
TIPPING_TIME = 0.02
"""s: so long the gyroscope has to contradict a vehicle that stands with its rotors turning."""


@kernel
def rests(f: Filter) -> bool:
    """Whether thrust and the pull from below carry the weight and no more, and it does not turn."""
    m, x, weight = f.m, f.x, f.p.vehicle_mass * f.p.gravity
    _, _, along_x, _, _, along_y, _, _, along_z = matrix(x)
    east, north = m.pull[0] + m.thrust * along_x, m.pull[1] + m.thrust * along_y
    up = m.pull[2] + m.thrust * along_z - weight
    turning = x[X_RATES] ** 2 + x[X_RATES + 1] ** 2 + x[X_RATES + 2] ** 2
    return bool(east**2 + north**2 + up**2 < (RESTING * weight) ** 2 and turning < RESTING_RATE**2)


@kernel
def tips(f: Filter) -> bool:
    """Whether a vehicle that is taken to stand turns under its rotors."""
    m, p = f.m, f.p
    turns = m.rejected_in_row[GYROSCOPE] * p.period > TIPPING_TIME and not failed(f, GYROSCOPE)
    return bool(turns and m.thrust > CARRIED * p.vehicle_mass * p.gravity)
