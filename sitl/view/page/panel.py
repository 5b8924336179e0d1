"""The numbers beside the picture: state, small plots, camera, and texts of the vehicle."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sitl.view.view import View
from sitl_bridge.frames import Triple

Array = NDArray[np.float64]
CAMERAS = ("free", "chase", "top", "load")
PLOTTED = ("tension [N]", "swing [°]", "tilt [°]", "battery [%]")
NEAREST, DISTANCE_SHARE = 2.0, 0.9
"""m from which a vehicle without a load is looked at, and how much more (m) for each metre of cable."""
MARGIN = 0.5
"""m around everything that is in sight in an overview."""
FIELD_OF_VIEW = math.radians(75.0)
"""Vertical, of viser's camera."""
FROM_SOUTH_WEST = (-0.62, -0.62, 0.48)
"""Direction of length 1 to the camera of an overview."""
HISTORY_S = 30.0
BACK_IN_TIME = 0.5
"""s: a moment so much earlier than the last begins the plots anew."""
LEAST_STEP = 0.001
"""s between two points of a plot."""
SLOW_INTERVAL = 0.2
"""s between two refreshes of numbers and plots."""


class Panel:
    """What stands beside the scene."""

    def __init__(self, server: Any) -> None:
        self._server = server
        gui = server.gui
        self.camera = gui.add_dropdown("Camera", CAMERAS, initial_value="chase")
        self._numbers = gui.add_markdown("waiting for a vehicle …")
        self._texts = gui.add_markdown("", visible=False)
        self._history: deque[tuple[float, ...]] = deque()
        self._plots: dict[str, Any] = {}
        """Added when there is something to plot: one that is shown later than it was made has no width."""
        self._next = -math.inf

    def show(self, view: View, now: float) -> None:
        """Numbers, plots and cameras of a moment; `now` (s) is the wall clock's."""
        self._aim(view)
        if now < self._next:
            return
        self._next = now + SLOW_INTERVAL
        self._numbers.content = numbers(view)
        self._texts.content = "\n".join(f"- {text}" for text in reversed(view.texts))
        self._texts.visible = bool(view.texts)
        self._plot(view)

    def _plot(self, view: View) -> None:
        """The last half minute of what is known."""
        history = self._history
        if history and view.time_s < history[-1][0] - BACK_IN_TIME:
            history.clear()
        if history and view.time_s < history[-1][0] + LEAST_STEP:
            return
        history.append((view.time_s, *plotted(view)))
        while history[0][0] < view.time_s - HISTORY_S:
            history.popleft()
        times, *columns = np.array(history).T
        for label, column in zip(PLOTTED, columns, strict=True):
            known = np.isfinite(column)
            if known.sum() > 1:
                self._draw(label, times[known], column[known])

    def _draw(self, label: str, times: Array, values: Array) -> None:
        """A line through (times, values), both (n,), in the plot of that name."""
        from viser import uplot

        if label in self._plots:
            self._plots[label].data = (times, values)
            return
        self._plots[label] = self._server.gui.add_uplot(
            (times, values),
            (uplot.Series(label="t"), uplot.Series(label=label, stroke="#2f6fd0", width=2)),
            title=label,
            scales={"x": uplot.Scale(time=False, auto=True), "y": uplot.Scale(auto=True)},
            legend=uplot.Legend(show=False),
            aspect=3.0,
        )

    def _aim(self, view: View) -> None:
        aimed = aim(self.camera.value, view)
        if aimed is None:
            return
        for client in self._server.get_clients().values():
            client.camera.position, client.camera.look_at = aimed


def plotted(view: View) -> tuple[float, ...]:
    """The numbers of `PLOTTED`, NaN where one is not known."""
    nan = math.nan
    return (
        nan if view.tension is None else view.tension,
        nan if view.swing is None else math.degrees(view.swing),
        nan if view.vehicle is None else math.degrees(view.tilt),
        nan if view.battery is None else 100.0 * view.battery,
    )


def aim(camera: str, view: View) -> tuple[Triple, Triple] | None:
    """Where a camera is and what it looks at, m; None where the person moves it."""
    if view.vehicle is None or camera == "free":
        return None
    x, y, z = view.vehicle
    distance = NEAREST + DISTANCE_SHARE * (view.cable_length or 0.0)
    target = view.load or view.vehicle
    middle = tuple(0.5 * (a + b) for a, b in zip(view.vehicle, target, strict=True))
    if camera == "top":
        height = 1.5 * distance  # a little to the south, so that north is up
        return (x, y - 0.01 * height, z + height), (x, y, z)
    if camera == "load":
        return (target[0] + 0.3, target[1] - 0.5, target[2] + 0.1), view.vehicle
    return (x - 0.7 * distance, y - 0.7 * distance, z + 0.2 * distance), (middle[0], middle[1], middle[2])


def overview(views: Sequence[View]) -> tuple[Triple, Triple] | None:
    """Where a camera is that has a whole flight in sight, and what it looks at, m; None: no vehicle."""
    seen = [at for view in views for at in (view.vehicle, view.load, view.set_point) if at is not None]
    if not seen:
        return None
    low, high = np.min(seen, axis=0), np.max(seen, axis=0)
    centre = 0.5 * (low + high)
    around = max(NEAREST, 0.5 * float(np.linalg.norm(high - low)) + MARGIN)
    away = around / math.sin(0.5 * FIELD_OF_VIEW) * np.array(FROM_SOUTH_WEST)
    (x, y, z), (to_x, to_y, to_z) = (centre + away).tolist(), centre.tolist()
    return (x, y, z), (to_x, to_y, to_z)


def numbers(view: View) -> str:
    """The table of numbers, as Markdown."""
    rows = [("time", f"{view.time_s:.1f} s" + (", paused" if view.speed == 0.0 else ""))]
    if view.mode is not None:
        rows.append(("mode", f"{view.mode}, {'armed' if view.armed else 'disarmed'}"))
    for name, at in (("vehicle", view.vehicle), ("load", view.load), ("set-point", view.set_point)):
        if at is not None:
            rows.append((name, " ".join(f"{value:.2f}" for value in at) + " m"))
    if view.swing is not None:
        rows.append(("swing", f"{math.degrees(view.swing):.1f}°"))
    rows.append(("tilt", f"{math.degrees(view.tilt):.1f}°"))
    if view.cable_length is not None:
        rows.append(("cable", f"{view.cable_length:.2f} m"))
    if view.tension is not None:
        rows.append(("tension", "no cable" if math.isnan(view.tension) else f"{view.tension:.1f} N"))
    if view.wind is not None and math.hypot(*view.wind) >= 0.05:
        rows.append(("wind", f"{math.hypot(*view.wind):.1f} m/s"))
    if view.battery is not None:
        rows.append(("battery", f"{100 * view.battery:.0f} %"))
    return "| | |\n|---|---|\n" + "\n".join(f"| {name} | {value} |" for name, value in rows)
