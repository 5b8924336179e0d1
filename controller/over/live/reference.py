"""A reference that somebody moves while the law flies."""

from __future__ import annotations

from controller.ground.flight.motion.setpoint_types import Body, Follow, Goto
from controller.ground.flight.motion.trajectory import Limits, Trajectory, motion_pole
from controller.law.reference import Path
from controller.law.state import Array
from controller.over.model import RATE_HZ
from sitl_bridge.vehicle.description import Vehicle

LIMITS = Limits(acceleration=2.0, total=3.0, speed=5.0, up=3.0, down=1.5)
"""PX4's usual ones for position control, less acceleration: the load hangs behind."""
PERIOD = 1.0 / RATE_HZ
MOST_STEPS = 20
"""Of a period, made up at once after a gap in the stack's states."""


class LiveReference:
    """Where the load goes, in the frame of the state."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._trajectory = Trajectory(PERIOD, motion_pole(vehicle.hover_length, vehicle.gravity))
        self._target: Goto | Follow | None = None
        self._time = 0.0

    @property
    def flying(self) -> bool:
        """Whether it has been started: only then are points taken."""
        return self._target is not None

    def start(self, position: Array, yaw: float) -> Path:
        """Hold where the load is held, m and rad; times count from now."""
        self._trajectory.start(position, 0.0 * position, yaw)
        x, y, z = position.tolist()
        self._time = 0.0
        self.go_to(Goto(Body.LOAD, (x, y, z), yaw, LIMITS.speed))
        return self._trajectory.path

    def go_to(self, target: Goto | Follow) -> None:
        """Another target."""
        self._target = target

    def path(self, time_s: float) -> Path:
        """The path at a time since the start, s; times only grow."""
        assert self._target is not None
        for _ in range(MOST_STEPS):
            if self._time + PERIOD > time_s:
                break
            self._time += PERIOD
            self._trajectory.advance(self._target, LIMITS, self._time)
        else:
            self._time = time_s
        return self._trajectory.path
