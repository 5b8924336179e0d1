"""`sitl view` without a browser: sources, replays, refusals."""

from __future__ import annotations

import importlib.util
import math
import subprocess
import sys
import webbrowser
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from viser import ViserServer

from sitl.command_line.commands import main
from sitl.flights.scenario import Circle, load_scenario
from sitl.recording.recording import RecordingError, read_recording
from sitl.view.page.cable import along, colour_of, load_shares
from sitl.view.page.panel import FIELD_OF_VIEW, aim, numbers, overview, plotted
from sitl.view.page.scene import Scene
from sitl.view.replay import views_of_recording, views_of_tlog
from sitl.view.run import ViewOptions, announce
from sitl.view.view import View
from sitl.view.way import Way
from sitl_bridge.frames import rotate
from sitl_bridge.process import StopRequest
from sitl_bridge.vehicle.files import load_vehicle
from tests.patience import PATIENCE
from tests.sitl.export.flights import leave_flight


def sitl_view(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "sitl", "view", *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=PATIENCE)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("nonsense",), "udpout|udpin|"),
        (("nonsense",), "finished flight"),
        (("udpin:127.0.0.1:20001", "--export", "x.html"), "--export"),
        ((".", "--export", "/nowhere/x.html"), "no such folder"),
        ((".", "udpin:127.0.0.1:20001"), "shown alone"),
        ((".",), "state.parquet"),
        ((".", "--scenario", "circle"), "--scenario"),
    ],
)
def test_a_source_that_is_none_is_one_line(arguments: tuple[str, ...], says: str, tmp_path: Path) -> None:
    source, *rest = arguments
    outcome = sitl_view(str(tmp_path) if source == "." else source, *rest)
    assert outcome.returncode == 2
    assert outcome.stderr.count("\n") == 1
    assert says in outcome.stderr


def test_a_replay_has_the_flights_moments(tmp_path: Path) -> None:
    leave_flight(tmp_path)
    recording = read_recording(tmp_path)
    views = views_of_recording(recording, rate_hz=10.0)
    assert [view.time_s for view in views] == pytest.approx([0.1 * k for k in range(21)])
    assert views[10].load == pytest.approx((math.sin(1.0), math.cos(1.0), 2.1))
    assert views[0].swing == pytest.approx(math.atan2(1.0, 1.5))


def test_a_log_without_a_vehicle_says_so(tmp_path: Path) -> None:
    leave_flight(tmp_path)
    with pytest.raises(RecordingError, match="no vehicle's position"):
        views_of_tlog(tmp_path / "link.tlog")


def test_numbers_leave_out_what_is_not_known() -> None:
    text = numbers(View(time_s=1.0))
    assert "battery" not in text
    assert "None" not in text
    assert "50 %" in numbers(View(battery=0.5))


def test_from_the_top_north_is_up() -> None:
    aimed = aim("top", View(vehicle=(1.0, 2.0, 3.0), load=(1.4, 1.9, 1.5)))
    assert aimed is not None
    (x, y, z), (to_x, to_y, to_z) = aimed
    assert (to_x - x, to_z < z) == (0.0, True)
    assert 0.0 < to_y - y < 0.05 * (z - to_z)


@pytest.mark.parametrize("camera", ["chase", "top", "load"])
def test_a_camera_looks_at_what_flies_from_elsewhere(camera: str) -> None:
    view = View(vehicle=(1.0, 2.0, 3.0), load=(1.0, 2.0, 1.5))
    aimed = aim(camera, view)
    assert aimed is not None
    position, target = aimed
    assert math.dist(position, target) > 0.1
    assert aim("free", view) is None


def test_an_overview_has_the_whole_flight_in_sight() -> None:
    """Of a page that nobody aims at anything, wherever the flight goes."""
    way = [(5.0 * math.cos(0.1 * k), 5.0 * math.sin(0.1 * k), 0.2 * k) for k in range(60)]
    views = [View(vehicle=(x, y, z + 2.0), load=(x, y, z)) for x, y, z in way]
    aimed = overview(views)
    assert aimed is not None
    position, target = map(np.array, aimed)
    ahead = (target - position) / np.linalg.norm(target - position)
    for view in views:
        for at in (view.vehicle, view.load):
            to_it = np.array(at) - position
            assert math.acos(to_it @ ahead / np.linalg.norm(to_it)) < 0.5 * FIELD_OF_VIEW
    assert overview([View()]) is None


def test_an_arrow_shows_the_wind_while_it_blows() -> None:
    server = ViserServer(port=0, verbose=False)
    try:
        scene = Scene(server, load_vehicle("iris", []))
        arrows = []
        for wind in ((3.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 2.0, 0.0), None):
            scene.show(View(vehicle=(0.0, 0.0, 2.0), wind=wind))
            arrows.append(scene._wind.visible)
        assert arrows == [True, False, True, False]
    finally:
        server.stop()


def test_each_piece_of_a_chain_pulls_as_its_spring_does() -> None:
    vehicle = load_vehicle("iris", ["cable.model=chain", "cable.segments=2"])
    cable, weight = vehicle.cable, vehicle.load.mass * vehicle.gravity
    half = 0.5 * cable.rest_length
    pulled = 2.0 * cable.stiffness * 0.01
    points = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, -half - 0.01], [0.0, 0.0, -2.0 * half - 0.01]])
    assert load_shares(vehicle, None, points) == pytest.approx([pulled / weight, 0.0], abs=1e-9)
    told = load_shares(vehicle, pulled + 3.0, points)
    assert told == pytest.approx([(pulled + 3.0) / weight, 3.0 / weight])
    assert load_shares(vehicle, 7.0, points[[0, 2]]) == pytest.approx([7.0 / weight])


@pytest.mark.parametrize(
    "direction", [(0.0, 0.0, -1.0), (0.0, 0.0, 1.0), (0.6, 0.0, -0.8), (0.48, 0.64, 0.6)]
)
def test_a_rod_lies_along_its_piece(direction: tuple[float, float, float]) -> None:
    assert rotate(along(direction), (0.0, 0.0, 1.0)) == pytest.approx(direction, abs=1e-12)


def test_a_cable_is_grey_then_green_then_red() -> None:
    slack, green, red = colour_of(0.0), colour_of(1.0), colour_of(2.5)
    assert len(set(slack)) == 1
    assert green[1] > 5 * green[0]
    assert red[0] > 5 * red[1]


def test_the_way_of_a_circle_is_one_round_of_it_and_the_set_point_is_on_it() -> None:
    scenario = load_scenario("circle")
    way = Way(scenario, load_vehicle("paper"))
    assert isinstance(scenario.reference, Circle)
    centre = np.array(scenario.reference.centre)
    assert np.linalg.norm(way.points - centre, axis=1) == pytest.approx(scenario.reference.radius)
    assert way.points[0] == pytest.approx(way.points[-1])
    assert way.set_point(0.0) == pytest.approx(way.points[0])
    assert way.set_point(-5.0) == way.set_point(0.0)


def test_ground_control_has_no_way_and_a_set_point_a_straight_one() -> None:
    iris = load_vehicle("iris")
    assert len(Way(load_scenario("hold"), iris).points) == 0
    assert Way(load_scenario("hold"), iris).set_point(1.0) is None
    assert len(Way(load_scenario("setpoint"), iris).points) == 2
    assert len(Way(load_scenario("points"), iris).points) == 5
    assert Way(load_scenario("points"), iris).set_point(1.0) is None  # the autopilot knows which it is


def test_what_is_not_known_is_not_plotted() -> None:
    known = [not math.isnan(number) for number in plotted(View(tension=3.0, vehicle=(0.0, 0.0, 1.0)))]
    assert known == [True, False, True, False]
    assert plotted(View(battery=0.5))[3] == 50.0


def test_without_viser_it_says_what_to_install_before_anything_is_launched(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "viser", None)
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    monkeypatch.setattr(StopRequest, "install", lambda *arguments, **options: None)
    monkeypatch.setattr(subprocess, "Popen", lambda *arguments, **options: pytest.fail("launched"))
    for command in (["fly", "circle", "--view"], ["plant", "--view"], ["view"]):
        assert main(command) == 2
        said = capsys.readouterr().err
        assert said.count("\n") == 1
        assert "pip install 'sitl-bridge[view]'" in said


@pytest.mark.parametrize(
    ("display", "browser", "opened"), [("", True, False), (":0", True, True), (":0", False, False)]
)
def test_a_browser_is_opened_where_there_is_a_display(
    monkeypatch: pytest.MonkeyPatch, display: str, browser: bool, opened: bool
) -> None:
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setenv("DISPLAY", display)
    addresses: list[str] = []
    monkeypatch.setattr(webbrowser, "open", addresses.append)
    server = SimpleNamespace(get_port=lambda: 8081)
    announce(ViewOptions(browser=browser, host="0.0.0.0"), server)
    assert addresses == (["http://127.0.0.1:8081"] if opened else [])


def test_a_flight_in_one_process_is_not_shown() -> None:
    command = [sys.executable, "-m", "sitl", "fly", "setpoint", "--in-process", "--view"]
    outcome = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)
    assert outcome.returncode == 2
    assert outcome.stderr.startswith("--in-process: --view")
