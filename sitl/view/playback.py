"""A finished flight in the browser with a time line, or as one page that needs no server."""

from __future__ import annotations

import itertools
import time
from pathlib import Path
from typing import Any

import numpy as np

from sitl.view.page.panel import Panel, overview
from sitl.view.page.scene import Scene
from sitl.view.view import View
from sitl_bridge.process import StopRequest
from sitl_bridge.vehicle.description import Vehicle

FRAME_INTERVAL = 1.0 / 30.0
SPEEDS = ("0.1", "0.25", "0.5", "1", "2", "5")


def play(views: list[View], vehicle: Vehicle, server: Any, stop: StopRequest) -> None:
    """Play a flight over and over until asked to stop; the person moves the time line, pauses, slows down."""
    gui = server.gui
    end = views[-1].time_s
    playing = gui.add_checkbox("Play", initial_value=True)
    at = gui.add_slider("Time [s]", min=0.0, max=max(end, 0.01), step=0.01, initial_value=0.0)
    speed = gui.add_dropdown("Speed", SPEEDS, initial_value="1")
    scene, panel = Scene(server, vehicle), Panel(server)
    scene.show_path(_set_points(views))
    times = np.array([view.time_s for view in views])
    while stop.reason is None:
        started = time.monotonic()
        view = views[min(int(np.searchsorted(times, at.value)), len(views) - 1)]
        scene.show(view)
        panel.show(view, started)
        time.sleep(FRAME_INTERVAL)
        if playing.value:
            ahead = at.value + float(speed.value) * (time.monotonic() - started)
            at.value = 0.0 if ahead > end else ahead


def export_html(views: list[View], vehicle: Vehicle, server: Any, file: Path) -> None:
    """Write the flight as one self-contained page with a time line."""
    scene = Scene(server, vehicle)
    scene.show_path(_set_points(views))
    aimed = overview(views)
    if aimed is not None:
        server.initial_camera.position, server.initial_camera.look_at = aimed
    scene.show(views[0])
    serializer = server.get_scene_serializer()
    for before, view in itertools.pairwise(views):
        serializer.insert_sleep(view.time_s - before.time_s)
        scene.show(view)
    file.write_text(serializer.as_html(), encoding="utf-8")


def _set_points(views: list[View]) -> Any:
    """(n, 3): where the set-point went; fewer than two where it stood still."""
    points = [view.set_point for view in views if view.set_point is not None]
    return np.array(list(dict.fromkeys(points))).reshape(-1, 3)
