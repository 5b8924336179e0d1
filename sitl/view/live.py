"""Live: links in, the browser out, in one loop that never holds up whoever speaks."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

from sitl.view.listener import Listener
from sitl.view.panel import Panel
from sitl.view.scene import Scene
from sitl.view.steering import Steering
from sitl_bridge.frames import LocalOrigin
from sitl_bridge.mavlink.links import Address, Link, open_link
from sitl_bridge.process import StopRequest
from sitl_bridge.vehicle.description import Vehicle

FRAME_INTERVAL = 1.0 / 30.0
"""s between two pictures."""
MOST_DATAGRAMS = 200
"""Taken in from one link before the next picture."""


def watch(
    addresses: Sequence[Address], vehicle: Vehicle, server: Any, stop: StopRequest, path: Any = None
) -> None:
    """Show what speaks on the links until asked to stop. Raises OSError where a link can't be opened.

    path: (n, 3) m, the reference's way; None: there is none.
    """
    home = vehicle.home
    listener = Listener(LocalOrigin(home.latitude, home.longitude, home.altitude), vehicle.node_count)
    scene, steering, panel = Scene(server, vehicle), Steering(server.gui), Panel(server)
    if path is not None:
        scene.show_path(path)
    links: list[Link] = []
    try:
        for address in addresses:
            links.append(open_link(address, lambda text: None))
        _loop(links, listener, scene, panel, steering, stop)
    finally:
        for link in links:
            link.close()


def _loop(
    links: list[Link],
    listener: Listener,
    scene: Scene,
    panel: Panel,
    steering: Steering,
    stop: StopRequest,
) -> None:
    next_picture = time.monotonic()
    shown = None
    while stop.reason is None:
        now = time.monotonic()
        for setting in steering.asked():
            listener.set_plant(*setting)
        for datagram in listener.to_send(now):
            for link in links:
                link.send(datagram)
        until = min(next_picture, listener.next_deadline())
        for link in links:
            _drain(link, listener, until if len(links) == 1 else now)
        if len(links) > 1:
            time.sleep(max(0.0, min(0.005, until - time.monotonic())))
        if time.monotonic() >= next_picture:
            next_picture = time.monotonic() + FRAME_INTERVAL
            if listener.view is not shown:
                shown = listener.view
                scene.show(shown)
            panel.show(listener.view, now)
            steering.show(listener.view)


def _drain(link: Link, listener: Listener, until: float) -> None:
    """Take in what has come; wait for the first until `until`."""
    for _ in range(MOST_DATAGRAMS):
        datagram = link.receive(until)
        if datagram is None:
            return
        listener.receive(datagram, time.monotonic())
        until = 0.0
