"""The gripper as ground control sees it: what it was told, what it has done by now.

It reports nothing itself, as on most vehicles: the load is free a release time after the command. It is taken
when the hook is within reach of it, by truth; on the estimate, when it pulls.
"""

from __future__ import annotations

import math

from controller.ground.telemetry.vehicle_state import VehicleView
from sitl_bridge.vehicle.description import Gripper as Description

RELEASE, GRAB, HOLD = 0, 1, 2
GRIPPER_ACTIONS = (RELEASE, GRAB, HOLD)
"""Of DO_GRIPPER; hold changes nothing"""
PATIENCE = 3.0
"""s that a mission waits for the gripper, PX4's default of PD_GRIPPER_TO"""


class Gripper:
    """One gripper; the load is on its hook at the start."""

    def __init__(self, description: Description) -> None:
        self._description = description
        self.feels_hook = False
        """Only a pull shows that the hook has taken the load"""
        self.restart()

    def restart(self) -> None:
        """The load is on the hook."""
        self.action: int | None = None
        """The last command"""
        self.released = False
        """The load is off the hook"""
        self._since: float | None = None

    def act(self, action: int) -> None:
        """Release or grab from now on."""
        if action != self.action:
            self.action, self._since = action, None

    @property
    def output(self) -> float:
        """Actuator control: -1 release, 1 grab, 0 as it is."""
        if self.action is None:
            return 0.0
        return 1.0 if self.action == GRAB else -1.0

    @property
    def done(self) -> bool:
        """Whether the last command has been carried out."""
        return self.action is None or self.released is (self.action == RELEASE)

    def update(self, view: VehicleView, armed: bool, rest_length: float, attached: bool) -> bool:
        """Look at the vehicle; returns whether the load has just come off or on. Outputs act while armed.

        rest_length: m, of the cable; attached: whether the load pulls, or could, by the feedback.
        """
        if self.done or not armed:
            self._since = None
            return False
        if self.action == RELEASE:
            if self._since is None:
                self._since = view.time
            if view.time - self._since < self._description.release_time:
                return False
        elif not (attached if self.feels_hook else self._within_reach(view, rest_length)):
            return False
        self.released = self.action == RELEASE
        return True

    def _within_reach(self, view: VehicleView, rest_length: float) -> bool:
        x, y, z = view.position
        load = view.load_position
        height = z - rest_length
        if view.load_on_ground:
            height = max(height, load[2])  # the hook lies on the ground beside the load
        near = math.dist((x, y, height), load) <= self._description.reach
        return near and math.dist(view.position, load) <= rest_length
