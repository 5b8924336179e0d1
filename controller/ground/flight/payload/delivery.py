"""DELIVER of a winch: set the load down below the hovering vehicle, release it, reel in."""

from __future__ import annotations

from enum import Enum, auto

from controller.ground.flight.payload.gripper import RELEASE, Gripper
from controller.ground.flight.payload.winch import Winch, WinchWork
from controller.ground.telemetry.vehicle_state import Profile, VehicleView

LOW = 1.5
"""m, height of the load above the ground at which the slow part begins"""
TOUCH_SPEED = 0.2
"""m/s, at which the load touches down"""
_TAPER = 0.5
"""1/s, with which the rate falls to it"""
SLACK = 0.3
"""m of cable that are paid out beyond the touch-down, for the hook to open without a pull"""


class Step(Enum):
    """What is done now."""

    LOWER = auto()
    SLACKEN = auto()
    RELEASE = auto()
    REEL_IN = auto()


class Delivery:
    """One delivery after another, by one winch and one gripper."""

    def __init__(self, winch: Winch, gripper: Gripper) -> None:
        self._winch, self._gripper = winch, gripper
        self.step: Step | None = None
        """None: there is no delivery"""
        self._length = 0.0
        """m, of the cable at the start, to which it is reeled in"""

    def fault(self, view: VehicleView, profile: Profile) -> str:
        """Why the load cannot be delivered here, or an empty string."""
        if not profile.has_ground:
            return "there is no ground to set the load down on"
        if not view.load_attached:
            return "there is no load on the hook"
        height = view.load_position[2] - profile.ground_height
        left = self._winch.longest - self._winch.length
        if height > left:
            return f"the load hangs {height:.1f} m up, and {left:.1f} m of cable are left; go lower"
        return ""

    def begin(self) -> None:
        """Lower the load from here."""
        self.step, self._length = Step.LOWER, self._winch.length

    def break_off(self) -> bool:
        """Reel in, with the load if it is still on the hook; returns whether there was anything to end."""
        if self.step is None or self.step is Step.REEL_IN:
            return False
        self._reel_in()
        self.step = None
        return True

    def reset(self) -> None:
        """The winch was told something else, or the flight is over."""
        self.step = None

    def advance(self, view: VehicleView, ground: float) -> str:
        """Go on; returns what there is to say."""
        winch = self._winch
        if self.step is Step.LOWER:
            if not view.load_attached:
                self._reel_in()
            elif view.load_on_ground:
                self.step = Step.SLACKEN
                winch.go_by(SLACK, 0.0)
                return "Load set down"
            elif winch.length >= winch.longest:
                self.break_off()
                return "Delivery broken off: the cable is too short"
            else:
                self._lower(view.load_position[2] - ground)
        elif self.step is Step.SLACKEN and winch.done:
            self.step = Step.RELEASE
            self._gripper.act(RELEASE)
        elif self.step is Step.RELEASE and self._gripper.done:
            self._reel_in()
        elif self.step is Step.REEL_IN and winch.done:
            self.step = None
            return "Delivered"
        return ""

    def _lower(self, height: float) -> None:
        """height: m, of the load above the ground."""
        slow = TOUCH_SPEED + _TAPER * max(0.0, height - LOW)
        self._winch.turn(slow)
        self._winch.work = WinchWork.DROPPING if height > LOW else WinchWork.GROUND_SENSE

    def _reel_in(self) -> None:
        self.step = Step.REEL_IN
        self._winch.go_by(self._length - self._winch.length, 0.0)
        self._winch.work = WinchWork.RETRACTING
