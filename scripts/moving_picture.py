"""Makes a moving picture of a flight: the page of `sitl view`, seen by a headless Chromium.

    python scripts/moving_picture.py docs/images/flight.webp

Needs the extra [test], and Chromium.
"""

from __future__ import annotations

import argparse
import io
import shutil
import tempfile
from pathlib import Path

import viser
from PIL import Image
from playwright.sync_api import sync_playwright

import sitl
from sitl.flights.free_ports import free_ports
from sitl.recording.recording import read_recording
from sitl.view.page.panel import Panel
from sitl.view.page.scene import Scene
from sitl.view.replay import views_of_recording
from sitl.view.view import View
from sitl_bridge.vehicle.files import load_vehicle

SCENARIO, VEHICLE = "circle", "iris"
BEGIN, END = 4.0, 12.0
"""s of the flight that are shown."""
DISTANCE = 2.2
"""m of the camera, east and north, from the middle of the cable."""
FRAME_RATE_HZ = 8.0
SIZE = (960, 600)
WIDTH = 720
"""Pixels of the picture; the page is drawn larger, so that its text stays readable."""
SETTLE_MS = 250
"""For the browser to draw a moment."""
LARGEST = 1_500_000
"""Bytes."""
FLAGS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-quic"]


def main() -> None:
    """Fly, look, write."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("file", type=Path, help="WebP to write")
    file = parser.parse_args().file
    frames = _frames()
    for quality in (70, 55, 40, 25):
        first, *others = frames
        options = {"duration": round(1000 / FRAME_RATE_HZ), "loop": 0, "quality": quality, "method": 6}
        first.save(file, save_all=True, append_images=others, **options)
        if file.stat().st_size < LARGEST:
            return
    raise SystemExit(f"{file} is larger than {LARGEST} bytes")


def _frames() -> list[Image.Image]:
    vehicle = load_vehicle(VEHICLE)
    with tempfile.TemporaryDirectory() as folder:
        sitl.fly(SCENARIO, vehicle=VEHICLE, feedback="truth", duration_s=END, out=folder)
        views = views_of_recording(read_recording(Path(folder)), FRAME_RATE_HZ)
    [port] = free_ports(1)
    server = viser.ViserServer(host="127.0.0.1", port=port, label="sitl", verbose=False)
    scene, panel = Scene(server, vehicle), Panel(server)
    frames = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=FLAGS)
        page = browser.new_page(viewport={"width": SIZE[0], "height": SIZE[1]})
        page.goto(f"http://127.0.0.1:{port}")
        page.locator("canvas").first.wait_for()
        panel.camera.value = "free"
        for close in page.locator("button.mantine-Notification-closeButton").all():
            close.click()  # a remark on software rendering
        for view in views:
            scene.show(view)
            panel.show(view, view.time_s)
            _look(server, view)
            if view.time_s < BEGIN:
                continue
            page.wait_for_timeout(SETTLE_MS if frames else 3000)
            shot = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
            frames.append(shot.resize((WIDTH, WIDTH * SIZE[1] // SIZE[0])))
        browser.close()
    server.stop()
    return frames


def _look(server: viser.ViserServer, view: View) -> None:
    """From near behind, so that vehicle and load fill the picture."""
    assert view.vehicle is not None
    assert view.load is not None
    x, y, z = (0.5 * (a + b) for a, b in zip(view.vehicle, view.load, strict=True))
    for client in server.get_clients().values():
        client.camera.position = (x - DISTANCE, y - DISTANCE, z + 0.4 * DISTANCE)
        client.camera.look_at = (x + 0.3 * DISTANCE, y - 0.3 * DISTANCE, z)  # the panel covers the right


if __name__ == "__main__":
    main()
