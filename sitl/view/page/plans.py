"""Mission, geofence and rally points drawn by viser; drawn anew when they change."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from sitl.view.plan import NO_PLAN, Plan, outline
from sitl_bridge.frames import Triple

_MISSION = (150, 80, 200)
_INSIDE = (40, 150, 80)
_FORBIDDEN = (210, 60, 50)
_RALLY = (40, 110, 200)
FENCE_HEIGHT = 3.0
"""m above the ground of the upper of the two lines that stand for a zone's border."""
POSTS = 16
"""Uprights between the two, at most."""
MARK = 0.08
"""m, radius of the ball at an item or a rally point."""
ABOVE_GROUND = 0.03
"""m, so that ground and line do not flicker."""


class PlanScene:
    """server's scene; ground: its height, m."""

    def __init__(self, scene: Any, ground: float) -> None:
        self._scene = scene
        self._ground = ground
        self._shown = NO_PLAN
        self._handles: list[Any] = []

    def show(self, plan: Plan) -> None:
        """Draw a plan in the place of the last one."""
        if plan is self._shown:
            return
        self._shown = plan
        for handle in self._handles:
            handle.remove()
        self._handles = []
        for index, zone in enumerate(plan.zones):
            self._border(f"/plan/zone_{index}", outline(zone, self._ground), zone.inclusion)
        places = np.array([place for _, place in plan.waypoints])
        if len(places) > 1:
            self._line("/plan/way", np.stack((places[:-1], places[1:]), axis=1), _MISSION, 2.0)
        for number, place in plan.waypoints:
            self._mark(f"/plan/item_{number}", str(number), place, _MISSION)
        for index, (east, north) in enumerate(plan.rally):
            self._mark(f"/plan/rally_{index}", f"R{index + 1}", (east, north, self._ground), _RALLY)

    def _border(self, name: str, border: NDArray[np.float64], inclusion: bool) -> None:
        """Two lines above each other with uprights between them; green to stay in, red to stay out."""
        up = np.array([0.0, 0.0, 1.0])
        low, high = border + ABOVE_GROUND * up, border + FENCE_HEIGHT * up
        every = max(1, (len(border) - 1) // POSTS)
        sides = [np.stack((line[:-1], line[1:]), axis=1) for line in (low, high)]
        posts = np.stack((low[:-1:every], high[:-1:every]), axis=1)
        self._line(name, np.concatenate((*sides, posts)), _INSIDE if inclusion else _FORBIDDEN, 2.0)

    def _line(
        self, name: str, segments: NDArray[np.float64], colour: tuple[int, int, int], thickness: float
    ) -> None:
        line = self._scene.add_line_segments(
            name, segments.astype(np.float32), colour, thickness=thickness, thickness_units="screen"
        )
        self._handles.append(line)

    def _mark(self, name: str, text: str, at: Triple, colour: tuple[int, int, int]) -> None:
        ball = self._scene.add_icosphere(name, radius=MARK, color=colour, position=at, cast_shadow=False)
        above = (at[0], at[1], at[2] + 2.0 * MARK)
        label = self._scene.add_label(f"{name}_label", text, position=above, anchor="bottom-center")
        self._handles += [ball, label]
