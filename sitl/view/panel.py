"""The numbers beside the picture: state, small plots, camera, and texts of the vehicle."""

from __future__ import annotations

import math
from collections import deque
from typing import Any

import numpy as np

from sitl.view.view import View

CAMERAS = ("free", "chase", "top", "load")
PLOTTED = ("swing [deg]", "tilt [deg]", "cable length [m]")
HISTORY_S = 30.0
SLOW_INTERVAL = 0.2
"""s between two refreshes of numbers and plots."""


class Panel:
    """What stands beside the scene."""

    def __init__(self, server: Any) -> None:
        from viser import uplot

        self._server = server
        gui = server.gui
        self.camera = gui.add_dropdown("Camera", CAMERAS, initial_value="chase")
        self._numbers = gui.add_markdown("waiting for a vehicle …")
        self._history: deque[tuple[float, ...]] = deque()
        empty = np.zeros(2)
        self._plots = [
            gui.add_uplot(
                (np.arange(2.0), empty),
                (uplot.Series(label="t"), uplot.Series(label=label, stroke="#2f6fd0", width=2)),
                title=label,
                scales={"x": uplot.Scale(time=False, auto=True), "y": uplot.Scale(auto=True)},
                aspect=2.4,
            )
            for label in PLOTTED
        ]
        self._texts = gui.add_markdown("")
        self._next = -math.inf

    def show(self, view: View, now: float) -> None:
        """Numbers, plots and cameras of a moment; `now` (s) is the wall clock's."""
        self._aim(view)
        if now < self._next:
            return
        self._next = now + SLOW_INTERVAL
        self._numbers.content = numbers(view)
        self._texts.content = "\n".join(f"- {text}" for text in reversed(view.texts))
        self._plot(view)

    def _plot(self, view: View) -> None:
        swing, length = view.swing, view.cable_length
        if swing is None or length is None:
            return
        history = self._history
        if history and view.time_s < history[-1][0]:
            history.clear()
        if history and view.time_s == history[-1][0]:
            return
        history.append((view.time_s, math.degrees(swing), math.degrees(view.tilt), length))
        while history[0][0] < view.time_s - HISTORY_S:
            history.popleft()
        if len(history) > 1:
            columns = np.array(history).T
            for plot, column in zip(self._plots, columns[1:], strict=True):
                plot.data = (columns[0], column)

    def _aim(self, view: View) -> None:
        if self.camera.value == "free" or view.vehicle is None:
            return
        target = view.load or view.vehicle
        distance = 6.0 + 1.5 * (view.cable_length or 0.0)
        for client in self._server.get_clients().values():
            position, look_at = aim(self.camera.value, view, distance) or (None, target)
            if position is not None:
                client.camera.position, client.camera.look_at = position, look_at


def aim(
    camera: str, view: View, distance: float
) -> tuple[tuple[float, float, float], tuple[float, float, float]] | None:
    """Where a camera is and what it looks at, m; None where the person moves it."""
    if view.vehicle is None or camera == "free":
        return None
    x, y, z = view.vehicle
    target = view.load or view.vehicle
    middle = tuple(0.5 * (a + b) for a, b in zip(view.vehicle, target, strict=True))
    if camera == "top":
        return (x, y - 0.01, z + 1.5 * distance), target
    if camera == "load":
        return (target[0] + 0.3, target[1] - 0.5, target[2] + 0.1), view.vehicle
    return (x - 0.7 * distance, y - 0.7 * distance, z + 0.2 * distance), (middle[0], middle[1], middle[2])


def numbers(view: View) -> str:
    """The table of numbers, as Markdown."""
    rows = [("time", f"{view.time_s:.1f} s")]
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
        rows.append(("tension", f"{view.tension:.1f} N"))
    if view.battery is not None:
        rows.append(("battery", f"{100 * view.battery:.0f} %"))
    return "| | |\n|---|---|\n" + "\n".join(f"| {name} | {value} |" for name, value in rows)
