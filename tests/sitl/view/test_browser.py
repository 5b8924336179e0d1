"""The view in a real browser: it draws, what it draws moves, and its controls act."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Page, sync_playwright

import sitl
from tests.patience import PATIENCE
from tests.sitl.export.flights import leave_flight

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
# A browser is the one tool of the tests that is no Python package: `scripts/setup test` cannot install it.
# Without one the suite still has to pass; what the pages are made of is tested beside this, without one.
pytestmark = pytest.mark.skipif(BROWSER is None, reason="no Chromium on this machine")
PICTURES = os.environ.get("DOCS_PICTURES")
"""Folder for screenshots that the documentation shows; see CONTRIBUTING.md."""


@pytest.fixture(scope="module")
def page() -> Iterator[Page]:
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=BROWSER,
            args=["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-quic"],
        )
        width, height = (900, 600) if PICTURES else (700, 450)  # a smaller one is drawn faster
        page = browser.new_page(viewport={"width": width, "height": height})
        page.set_default_timeout(1e3 * PATIENCE)
        yield page
        browser.close()


@pytest.fixture
def flight(tmp_path: Path) -> Path:
    """Two seconds made by hand; for a picture a real flight, of which there is something to see."""
    if PICTURES:
        sitl.fly("circle", vehicle="iris", feedback="truth", duration_s=20.0, out=tmp_path)
    else:
        leave_flight(tmp_path)
    return tmp_path


def picture(page: Page) -> np.ndarray:  # type: ignore[type-arg]
    """What the canvas shows, (height, width, 4)."""
    from io import BytesIO

    from matplotlib.image import imread

    return np.asarray(imread(BytesIO(page.locator("canvas").first.screenshot()), format="png"))


def until_moving(page: Page) -> bool:
    """Whether the canvas changes from one look to another, before long."""
    before = picture(page)
    for _ in range(40):
        page.wait_for_timeout(250)
        if not np.array_equal(picture(page), before):
            return True
    return False


def test_a_finished_flight_is_played_and_paused(flight: Path, page: Page) -> None:
    command = [sys.executable, "-m", "sitl", "view", str(flight), "--port", "18200", "--until-eof"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as view:
        assert view.stdout is not None
        assert view.stdin is not None
        try:
            page.goto(json.loads(view.stdout.readline())["address"])
            page.get_by_text("tension").first.wait_for()
            assert until_moving(page)
            seen = picture(page)
            assert len(np.unique(seen.reshape(-1, seen.shape[-1]), axis=0)) > 20  # not blank
            if PICTURES:
                page.wait_for_timeout(9000)
            page.get_by_role("checkbox", name="Play").click(force=True)
            page.wait_for_timeout(1500)
            if PICTURES:
                for close in page.locator("button.mantine-Notification-closeButton").all():
                    close.click()  # a remark on software rendering
                page.screenshot(path=Path(PICTURES) / "view.png")
            still = page.get_by_role("textbox").first.input_value()
            page.wait_for_timeout(1000)
            assert page.get_by_role("textbox").first.input_value() == still
        finally:
            view.stdin.close()
            assert view.wait(PATIENCE) == 0


def shown_time(page: Page) -> str:
    return str(page.get_by_role("cell", name="time").locator("xpath=following-sibling::td").inner_text())


def until_time_is(page: Page, wanted: Callable[[float], bool]) -> None:
    """Until the time that is shown (s) is one that is wanted."""
    for _ in range(240):
        if wanted(float(shown_time(page).split()[0])):
            return
        page.wait_for_timeout(250)
    raise AssertionError(f"the time shown is {shown_time(page)}")


def until_said(page: Page, said: Path, pattern: str) -> str:
    for _ in range(240):
        if found := re.search(pattern, said.read_text()):
            return found[1]
        page.wait_for_timeout(250)
    raise AssertionError(f"{pattern} was not said: {said.read_text()}")


def test_a_flight_is_paused_goes_on_by_a_step_and_then_by_itself(tmp_path: Path, page: Page) -> None:
    command = [sys.executable, "-m", "sitl", "fly", "setpoint", "--instance", "60", "--clock", "lockstep"]
    command += ["--speed", "1", "--duration", "10000", "--view", "--out", str(tmp_path / "flight")]
    said = tmp_path / "said"
    with said.open("w") as file, subprocess.Popen(command, stderr=file, cwd=tmp_path) as flight:
        try:
            page.goto(until_said(page, said, r"view: (\S+)\n"))
            page.get_by_role("button", name="Pause").click()
            paused = float(until_said(page, said, r"paused at t = (\S+) s"))
            until_time_is(page, lambda shown: shown == pytest.approx(paused, abs=0.06))
            page.get_by_label("Ticks a step").click()
            page.get_by_role("option", name="125", exact=True).click()
            page.get_by_role("button", name="Step").click()
            until_time_is(page, lambda shown: shown == pytest.approx(paused + 0.5, abs=0.06))
            page.get_by_role("button", name="Go on").click()
            assert float(until_said(page, said, r"goes on at t = (\S+) s")) == pytest.approx(paused + 0.5)
            until_time_is(page, lambda shown: shown > paused + 0.7)
        finally:
            flight.send_signal(signal.SIGINT)
            flight.wait(60)


def test_an_exported_page_needs_no_server(flight: Path, page: Page) -> None:
    file = flight / "mine.html"
    subprocess.run([sys.executable, "-m", "sitl", "view", str(flight), "--export", str(file)], check=True)
    page.goto(file.as_uri())
    page.locator("canvas").first.wait_for()
    assert until_moving(page)


def test_the_report_draws_its_panels(flight: Path, page: Page) -> None:
    from sitl.recording.recording import read_recording
    from sitl.report.html_report import write_html

    file = flight / "report.html"
    write_html(read_recording(flight), file)
    page.goto(file.as_uri())
    page.locator("body[data-ready=yes]").wait_for()
    assert page.locator("g.trace").count() > 0 or page.locator(".scatterlayer .trace").count() > 0
