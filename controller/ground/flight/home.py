"""Home: where the vehicle was armed, or where a client has put it."""

from __future__ import annotations

from controller.ground.telemetry.vehicle_state import VehicleView
from sitl_bridge.frames import Geodetic, LocalOrigin, Triple


class Home:
    """Where Return goes; heights of the fence count from here."""

    def __init__(self, origin: LocalOrigin) -> None:
        self.position: Triple | None = None
        """m ENU, of the vehicle, where it stood when it was armed last"""
        self.load: Triple = (0.0, 0.0, 0.0)
        """m ENU, of the load, likewise"""
        self._origin = origin
        self._chosen: tuple[float, float] | None = None
        """m, of a home that a client has set"""

    @property
    def or_origin(self) -> Triple:
        """Home, the world's origin until there is one, m ENU."""
        return self.position or (0.0, 0.0, 0.0)

    def geodetic(self) -> Geodetic:
        """The same as latitude, longitude and altitude."""
        return self._origin.geodetic(self.or_origin)

    def set_here(self, view: VehicleView) -> None:
        """Home is here, or where a client has put it; its height is the vehicle's."""
        self.position, self.load = view.position, view.load_position
        if self._chosen is not None:
            self.move_to(*self._chosen)

    def move_to(self, east: float, north: float) -> None:
        """Put home at a place (m), at the height that it has; the load belongs there, too."""
        self._chosen = (east, north)
        self.position = (east, north, self.or_origin[2])
        self.load = (east, north, self.load[2])

    def set_below(self, view: VehicleView, ground_height: float) -> None:
        """Home is on the ground (m) under a vehicle that was found in the air."""
        self.position = self.load = (view.position[0], view.position[1], ground_height)
