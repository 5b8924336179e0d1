"""Live: links in, the browser out, in one loop that never holds up whoever speaks."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from sitl.view.listener import Listener
from sitl.view.many_senders import ManySenders
from sitl.view.page.panel import Panel
from sitl.view.page.scene import Scene
from sitl.view.page.steering import Steering
from sitl.view.view import View
from sitl.view.way import Way
from sitl_bridge.frames import LocalOrigin
from sitl_bridge.mavlink.links.address import Address
from sitl_bridge.mavlink.links.link import Link
from sitl_bridge.mavlink.links.opening import open_link
from sitl_bridge.process import StopRequest
from sitl_bridge.vehicle.description import Vehicle

FRAME_INTERVAL = 1.0 / 30.0
"""s between two pictures."""
MOST_DATAGRAMS = 200
"""Taken in from one link before the next picture."""


def watch(
    addresses: Sequence[Address], vehicle: Vehicle, server: Any, stop: StopRequest, way: Way | None = None
) -> None:
    """Show what speaks on the links until asked to stop. Raises OSError where a link can't be opened.

    way: of the reference that is flown; None: it is not known.
    """
    home = vehicle.home
    listener = Listener(LocalOrigin(home.latitude, home.longitude, home.altitude), vehicle.node_count)
    scene, steering, panel = Scene(server, vehicle), Steering(server.gui), Panel(server)
    if way is not None:
        scene.show_path(way.points)
    links: list[Link] = []
    try:
        for address in addresses:
            many = address.kind == "udpin"
            links.append(ManySenders(address) if many else open_link(address, lambda text: None))
        _loop(links, listener, scene, panel, steering, way, stop)
    finally:
        for link in links:
            link.close()


def _loop(
    links: list[Link],
    listener: Listener,
    scene: Scene,
    panel: Panel,
    steering: Steering,
    way: Way | None,
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
                scene.show(_with_set_point(shown, way))
            panel.show(_with_set_point(listener.view, way), now)
            steering.show(listener.view)


def _drain(link: Link, listener: Listener, until: float) -> None:
    """Take in what has come; wait for the first until `until`."""
    for _ in range(MOST_DATAGRAMS):
        datagram = link.receive(until)
        if datagram is None:
            return
        listener.receive(datagram, time.monotonic())
        until = 0.0


def _with_set_point(view: View, way: Way | None) -> View:
    """With the reference's set-point, unless the vehicle tells its own."""
    if way is None or view.set_point is not None or not view.of_scenario:
        return view
    return replace(view, set_point=way.set_point(view.time_s))
