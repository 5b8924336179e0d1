"""The point at which a vehicle holds: of the load while it hangs, of the vehicle otherwise.

The load's and the vehicle's point differ by the length of the cable. A load that hangs, lies, is lost or
reeled in changes whose point it is, and never where the vehicle hovers.
"""

from __future__ import annotations

import math

from controller.ground.flight.motion.geometry import above, below
from controller.ground.flight.motion.setpoint_types import Body
from controller.ground.telemetry.vehicle_state import Profile, VehicleView
from sitl_bridge.frames import Triple

_TOUCH_DOWN = 3.0
"""s after the winch has stood still, in which a load may be found to lie that it has lowered"""
_NEAR = 1.0
"""m, within which a vehicle hovers where it is to hover"""


class HoverPoint:
    """Point, heading and speed of HOLD, and of every mode while it waits."""

    def __init__(self, profile: Profile) -> None:
        self.point: Triple = (0.0, 0.0, 0.0)
        """m ENU, of `body`"""
        self.body = Body.LOAD
        self.yaw = 0.0
        """rad ENU"""
        self.speed = math.nan
        """m/s, horizontal, that was asked for; NaN: the default"""
        self._profile = profile
        self._set_down = False
        """The winch has lowered the load to the ground"""
        self._pays_out = False
        """The winch has paid out since the last look"""
        self._paid_out_at = -math.inf
        """s of the plant's time, of the last look at which it had"""

    def stay_at(self, point: Triple, body: Body) -> None:
        """Hold at a point of a body, m."""
        self.point, self.body = point, body

    def without_load(self) -> None:
        """The load is gone: the vehicle stays above where the load was to be."""
        self.stay_at(above(self.point, self._profile.hover_length), Body.VEHICLE)

    def lengthened(self, change: float) -> None:
        """The cable is longer by so much, m: the vehicle stays where it holds, and the load goes down."""
        self._pays_out = self._pays_out or change > 0.0
        if self.body is Body.LOAD:
            x, y, z = self.point
            self.point = (x, y, z - change)

    def picked_up(self) -> None:
        """Forget that the winch has set the load down."""
        self._set_down = False

    def note_set_down(self, view: VehicleView) -> None:
        """A load that the winch lowers to the ground, or lifts from it: the vehicle holds where it hovers."""
        if self._pays_out:
            self._pays_out, self._paid_out_at = False, view.time
        lowered = view.time - self._paid_out_at < _TOUCH_DOWN
        lies = view.load_attached and view.load_on_ground and (lowered or self._set_down)
        lifted = view.load_attached and view.cable_taut and not view.load_on_ground
        if self._profile.winch is None or not (lifted if self._set_down else lies):
            self._set_down = self._set_down and view.load_attached
            return
        self._set_down = lies
        hanging = self._profile.hover_length
        if lies and self.body is Body.LOAD:
            vehicle = above(self.point, hanging)
            steady = math.dist(vehicle, view.position) < _NEAR
            self.stay_at(vehicle if steady else view.position, Body.VEHICLE)
        elif not lies and self.body is Body.VEHICLE:
            self.stay_at(below(self.point, hanging), Body.LOAD)
