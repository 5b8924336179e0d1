"""Following somebody who says where he is (FOLLOW_TARGET): where the vehicle goes for that."""

from __future__ import annotations

import math
from typing import NamedTuple

from controller.ground.commands.setpoints import NOTHING, Setpoint
from controller.ground.parameters.protocol import Parameters
from controller.ground.telemetry.vehicle_state import VehicleView
from sitl_bridge.frames import Triple

SILENCE = 3.0
"""s without a word of the target, after which it counts as standing; clients repeat themselves at 1 Hz"""
MOVING = 0.5
"""m/s, from which on a target has a direction"""
HEIGHT_ABOVE_TARGET = 2
"""FLW_TGT_ALT_M: the height counts from the target, and not from home"""


class TargetReport(NamedTuple):
    """What the target last said."""

    position: Triple
    """m ENU"""
    velocity: Triple
    """m/s ENU; of one that says none, zero"""
    time: float
    """s of the plant's time, when it came"""


class FollowTarget:
    """The last report, and on which side of the target the vehicle is."""

    def __init__(self) -> None:
        self.report: TargetReport | None = None
        self._course = 0.5 * math.pi
        """rad ENU, the target's direction; north until it has moved"""
        self._angle: float | None = None
        """rad ENU, from the target to the vehicle"""
        self._time = 0.0

    def start(self) -> None:
        """The mode begins: the side is taken anew."""
        self._angle = None

    def hear(self, position: Triple, velocity: Triple, time: float) -> None:
        """A report."""
        self.report = TargetReport(position, velocity, time)

    def silent(self, view: VehicleView) -> bool:
        """Whether there is no target, or none any more."""
        return self.report is None or view.time - self.report.time > SILENCE

    def setpoint(self, view: VehicleView, home: Triple, p: Parameters) -> Setpoint | None:
        """Of the vehicle; None: there is nobody to follow yet."""
        report = self.report
        if report is None:
            return None
        age = view.time - report.time
        moves = math.hypot(*report.velocity[:2]) > MOVING and age <= SILENCE
        if moves:
            self._course = math.atan2(report.velocity[1], report.velocity[0])
        coasting = min(max(age, 0.0), SILENCE)
        here = [q + v * coasting for q, v in zip(report.position, report.velocity, strict=True)]
        velocity = report.velocity if age <= SILENCE else (0.0, 0.0, 0.0)
        angle, distance = self._side(view, p), p["FLW_TGT_DST"]
        by_target = p.integer("FLW_TGT_ALT_M") == HEIGHT_ABOVE_TARGET
        height = (here[2] if by_target else home[2]) + p["FLW_TGT_HT"]
        place = (here[0] + distance * math.cos(angle), here[1] + distance * math.sin(angle), height)
        velocity = (velocity[0], velocity[1], velocity[2] if by_target else 0.0)
        yaw = math.atan2(here[1] - view.position[1], here[0] - view.position[0])
        return Setpoint(False, place, velocity, NOTHING, yaw, math.nan)

    def _side(self, view: VehicleView, p: Parameters) -> float:
        """Goes around the target no faster than FLW_TGT_MAX_VEL."""
        wanted = self._course - math.radians(p["FLW_TGT_FA"])  # clockwise from the target's front
        step = max(0.0, view.time - self._time)
        self._time = view.time
        if self._angle is None:
            self._angle = wanted
        most = p["FLW_TGT_MAX_VEL"] / p["FLW_TGT_DST"] * step
        away = math.remainder(wanted - self._angle, 2.0 * math.pi)
        self._angle += min(max(away, -most), most)
        return self._angle
