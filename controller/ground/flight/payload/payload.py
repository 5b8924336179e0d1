"""Gripper and winch as commands and mission items work them, and both in a delivery."""

from __future__ import annotations

import math

from pymavlink.dialects.v20 import common as mavlink

from controller.ground.commands.result import OK, UNSUPPORTED, Verdict, deny, not_now
from controller.ground.flight.payload.delivery import Delivery
from controller.ground.flight.payload.gripper import Gripper
from controller.ground.flight.payload.winch import Winch, WinchWork
from controller.ground.telemetry.vehicle_state import Profile, VehicleView

RELAX: int = mavlink.WINCH_RELAXED
LENGTH: int = mavlink.WINCH_RELATIVE_LENGTH_CONTROL
RATE: int = mavlink.WINCH_RATE_CONTROL
LOCK: int = mavlink.WINCH_LOCK
DELIVER: int = mavlink.WINCH_DELIVER
HOLD: int = mavlink.WINCH_HOLD
RETRACT: int = mavlink.WINCH_RETRACT
LOAD_LINE: int = mavlink.WINCH_LOAD_LINE
ABANDON_LINE: int = mavlink.WINCH_ABANDON_LINE
LOAD_PAYLOAD: int = mavlink.WINCH_LOAD_PAYLOAD
_LAST = LOAD_PAYLOAD
_PRESENTED = 0.5
"""m of cable beyond the shortest with which the hook is within a person's reach"""


def winch_fault(action: float, length: float, rate: float) -> str:
    """What is wrong with DO_WINCH's numbers, or an empty string."""
    if not (0 <= action <= _LAST and action == int(action)):
        return f"action {action:g}; use 0 to {_LAST}"
    if action == LENGTH and not math.isfinite(length):
        return "length control needs a length, m, in param3"
    if action == RATE and not math.isfinite(rate):
        return "rate control needs a rate, m/s, in param4"
    return ""


class Payload:
    """Gripper and winch of one vehicle; None: there is none."""

    def __init__(self, profile: Profile) -> None:
        self._profile = profile
        self.gripper = None if profile.gripper is None else Gripper(profile.gripper)
        self.winch = None if profile.winch is None else Winch(profile.winch, profile.rest_length)
        self._delivery: Delivery | None = None
        if self.winch is not None and self.gripper is not None:
            self._delivery = Delivery(self.winch, self.gripper)

    def restart(self) -> None:
        """As described: the load on the hook, the winch locked."""
        for part in (self.gripper, self.winch):
            if part is not None:
                part.restart()
        self.stop_delivery()

    @property
    def delivers(self) -> bool:
        """Whether there is all that a delivery needs."""
        return self._delivery is not None

    @property
    def delivering(self) -> bool:
        """Whether a delivery is under way."""
        return self._delivery is not None and self._delivery.step is not None

    @property
    def reeling(self) -> bool:
        """Whether the winch still works at what it was told, other than to turn or to stand."""
        return self.delivering or (self.winch is not None and not self.winch.done)

    def work_winch(self, action: float, length: float, rate: float, view: VehicleView | None) -> Verdict:
        """DO_WINCH; length in m, rate in m/s, positive pays out."""
        winch = self.winch
        if winch is None:
            return Verdict(UNSUPPORTED, "Winch denied: this vehicle has none; see [winch] in its file")
        if fault := winch_fault(action, length, rate):
            return deny(f"Winch denied: {fault}")
        if action == DELIVER:
            return self._deliver(view)
        self.stop_delivery()
        if action == RELAX:
            winch.relax()
        elif action == LENGTH:
            winch.go_by(length, rate if math.isfinite(rate) else 0.0)
        elif action == RATE:
            winch.turn(rate)
        elif action in (LOCK, HOLD):
            winch.turn(0.0)
            winch.work = WinchWork.LOCKED if action == LOCK else WinchWork.NONE
        elif action in (RETRACT, LOAD_LINE):
            winch.go_by(-math.inf, 0.0)
            winch.work = WinchWork.RETRACTING if action == RETRACT else WinchWork.LOAD_LINE
        elif action == ABANDON_LINE:
            winch.go_by(math.inf, 0.0)
            winch.work = WinchWork.ABANDON_LINE
        elif action == LOAD_PAYLOAD:
            winch.go_by(winch.shortest + _PRESENTED - winch.length, 0.0)
            winch.work = WinchWork.LOAD_PAYLOAD
        return OK

    def _deliver(self, view: VehicleView | None) -> Verdict:
        if self._delivery is None:
            return Verdict(UNSUPPORTED, "Delivery denied: this vehicle has no gripper to release the load")
        if view is None:
            return not_now("Delivery denied: no position yet; start the plant")
        if fault := self.delivery_fault(view):
            return deny(f"Delivery denied: {fault}")
        self._delivery.begin()
        return OK

    def delivery_fault(self, view: VehicleView) -> str:
        """Why the load cannot be delivered from here, or an empty string."""
        return "" if self._delivery is None else self._delivery.fault(view, self._profile)

    def update(self, view: VehicleView) -> str:
        """Go on with a delivery; returns what there is to say."""
        return "" if self._delivery is None else self._delivery.advance(view, self._profile.ground_height)

    def break_off(self) -> bool:
        """Something else is to be flown: end a delivery, and reel in; returns whether there was one."""
        return self._delivery is not None and self._delivery.break_off()

    def stop_delivery(self) -> None:
        """End a delivery, the winch as it is."""
        if self._delivery is not None:
            self._delivery.reset()
