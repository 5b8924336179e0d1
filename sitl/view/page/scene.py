"""A `View` drawn by viser: vehicle by its rotors' layout, cable, load, trails, set-point, ground, wind."""

from __future__ import annotations

import math
from collections import deque
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sitl.export.shapes import disc_diameter, load_radius
from sitl.view.page.cable import CableScene
from sitl.view.page.plans import PlanScene
from sitl.view.view import UPRIGHT, View
from sitl_bridge.frames import Quaternion, Triple, rotate
from sitl_bridge.vehicle.description import Vehicle

Colour = tuple[int, int, int]
_ARM: Colour = (55, 60, 70)
_DISC: Colour = (70, 130, 220)
_BLADE: Colour = (30, 40, 60)
_LOAD: Colour = (235, 140, 40)
_CONTACT: Colour = (200, 60, 40)
_SET_POINT: Colour = (60, 170, 90)
_TRAILS: dict[str, Colour] = {"vehicle": (110, 150, 230), "load": (240, 170, 90)}
TRAIL_POINTS = 300
TOUCH = 0.003
"""m above the ground within which something counts as touching it."""
LEAST_WIND = 0.1
"""m/s: less is not drawn."""
BACK_IN_TIME = 0.5
"""s: a moment so much earlier than the last begins the trails anew."""
TRAIL_SPACING = 0.05
"""m between two points of a trail."""
BLADE_SPEED = 12.0
"""rad/s at which a rotor at full speed is drawn: its own would look like standing still."""


class Scene:
    """What stands in the browser. server: a `viser.ViserServer`, or its like."""

    def __init__(self, server: Any, vehicle: Vehicle) -> None:
        self._scene = server.scene
        self._vehicle = vehicle
        self._angles = np.zeros(len(vehicle.rotors))
        self._last_time: float | None = None
        self._trails = {body: deque[Triple](maxlen=TRAIL_POINTS) for body in _TRAILS}
        self._lines: dict[str, Any] = {}
        self._wind: Any = None
        self._draw_ground()
        self._cable = CableScene(server.scene, vehicle)
        self._plan = PlanScene(server.scene, vehicle.ground.height if vehicle.ground is not None else 0.0)
        self._contacts = [
            self._scene.add_cylinder(
                f"/contact_{index}",
                radius=0.08,
                height=0.01,
                color=_CONTACT,
                visible=False,
                cast_shadow=False,
            )
            for index in range(len(contact_points(vehicle, UPRIGHT)))
        ]
        self._body = self._scene.add_frame("/vehicle", show_axes=False, visible=False)
        self._blades = [self._draw_rotor(index) for index in range(len(vehicle.rotors))]
        radius = load_radius(vehicle)
        self._load = self._scene.add_icosphere("/load", radius=radius, color=_LOAD, visible=False)
        self._target = self._scene.add_icosphere(
            "/set_point", radius=1.5 * radius, color=_SET_POINT, opacity=0.4, visible=False
        )

    def show(self, view: View) -> None:
        """Draw a moment; what is not known is not drawn."""
        if self._last_time is not None and view.time_s < self._last_time - BACK_IN_TIME:
            for points in self._trails.values():
                points.clear()
        self._show_vehicle(view)
        self._show_contacts(view)
        if view.load is not None:
            self._load.position, self._load.visible = view.load, True
        self._cable.show(view)
        self._plan.show(view.plan)
        if view.set_point is not None:
            self._target.position, self._target.visible = view.set_point, True
        for body, at in (("vehicle", view.vehicle), ("load", view.load)):
            if at is not None:
                self._trail(body, at)
        self._show_wind(view.vehicle, view.wind)

    def show_path(self, points: NDArray[np.float64]) -> None:
        """Draw the reference's way: points (n, 3), m, world."""
        self._draw_line("/path", points, _SET_POINT, 1.0)

    def _draw_line(self, name: str, points: NDArray[np.float64], colour: Colour, thickness: float) -> None:
        """A line through points (n, 3), m; an older one of that name is changed."""
        if len(points) < 2:
            return
        segments = np.stack((points[:-1], points[1:]), axis=1).astype(np.float32)
        colours = np.broadcast_to(np.array(colour, np.uint8), segments.shape)
        line = self._lines.get(name)
        if line is None:
            self._lines[name] = self._scene.add_line_segments(
                name, segments, colours, thickness=thickness, thickness_units="screen"
            )
        else:
            line.points, line.colors = segments, colours

    def _draw_ground(self) -> None:
        ground = self._vehicle.ground
        height = ground.height if ground is not None else 0.0
        self._scene.add_grid(
            "/ground",
            width=400.0,
            height=400.0,
            cell_size=1.0,
            section_size=10.0,
            position=(0.0, 0.0, height),
            infinite_grid=True,
            fade_distance=150.0,
            plane_opacity=0.5 if ground is not None else 0.0,
            plane_color=(235, 240, 232),
        )

    def _draw_rotor(self, index: int) -> Any:
        """An arm with a disc; returns the blade's handle, which turns."""
        rotor = self._vehicle.rotors[index]
        x, y, z = rotor.position
        radius = 0.5 * disc_diameter(self._vehicle, index)
        arm = np.array([[[0.0, 0.0, 0.0], [x, y, z]]])
        self._scene.add_line_segments(
            f"/vehicle/arm_{index}", arm, _ARM, thickness=4.0, thickness_units="screen"
        )
        hub = (x, y, z + 0.04 * radius)
        self._scene.add_cylinder(
            f"/vehicle/disc_{index}",
            radius=radius,
            height=0.02 * radius,
            color=_DISC,
            opacity=0.35,
            position=hub,
            cast_shadow=False,
        )
        return self._scene.add_box(
            f"/vehicle/blade_{index}",
            dimensions=(1.9 * radius, 0.12 * radius, 0.03 * radius),
            color=_BLADE,
            position=hub,
        )

    def _show_vehicle(self, view: View) -> None:
        if view.vehicle is None:
            return
        self._body.position, self._body.wxyz, self._body.visible = view.vehicle, view.attitude, True
        passed = 0.0 if self._last_time is None else max(0.0, view.time_s - self._last_time)
        self._last_time = view.time_s
        for index, blade in enumerate(self._blades):
            speed = view.rotors[index] if index < len(view.rotors) else 0.0
            sign = 1.0 if self._vehicle.rotors[index].direction == "ccw" else -1.0
            self._angles[index] += sign * BLADE_SPEED * speed * passed
            blade.wxyz = _about_z(float(self._angles[index]))

    def _show_contacts(self, view: View) -> None:
        """Where legs and load touch the ground."""
        ground = self._vehicle.ground
        if ground is None or view.vehicle is None:
            return
        places = [
            tuple(map(sum, zip(view.vehicle, leg, strict=True)))
            for leg in contact_points(self._vehicle, view.attitude)[:-1]
        ]
        low = view.load or (0.0, 0.0, math.inf)
        places.append((low[0], low[1], low[2] - self._vehicle.load.radius))
        for mark, (x, y, z) in zip(self._contacts, places, strict=True):
            mark.visible = z < ground.height + TOUCH
            if mark.visible:
                mark.position = (x, y, ground.height + 0.01)

    def _trail(self, body: str, at: Triple) -> None:
        points = self._trails[body]
        if points and math.dist(points[-1], at) < TRAIL_SPACING:
            return
        points.append(at)
        self._draw_line(f"/trail/{body}", np.array(points), _TRAILS[body], 1.5)

    def _show_wind(self, at: Triple | None, wind: Triple | None) -> None:
        blows = at is not None and wind is not None and math.hypot(*wind) > LEAST_WIND
        if at is not None and wind is not None and blows:
            head = tuple(a + 0.2 * w for a, w in zip(at, wind, strict=True))
            self._wind = self._scene.add_arrows("/wind", np.array([[at, head]]), (80, 160, 200))
        elif self._wind is not None and self._wind.visible:
            self._wind.visible = False


def contact_points(vehicle: Vehicle, attitude: Quaternion) -> list[Triple]:
    """Ends of the legs from the centre of mass, m, world; last, for the load, the origin."""
    return [*(rotate(attitude, leg) for leg in vehicle.airframe.legs), (0.0, 0.0, 0.0)]


def _about_z(angle: float) -> Quaternion:
    return (math.cos(0.5 * angle), 0.0, 0.0, math.sin(0.5 * angle))
