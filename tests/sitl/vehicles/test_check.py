"""`sitl vehicle check`: its figures are theory's, its flight is real, its exit code says which it was."""

from __future__ import annotations

import json
import math

import pytest

from controller.design.catalogue import design
from controller.design.margins import closed_loop_matrix, spectral_radius
from controller.design.model import actuated_model
from controller.design.motion.limits import limits_of
from sitl.command_line.commands import main
from sitl.vehicles.check import fly_step
from sitl.vehicles.figures import figures, modes
from sitl_bridge.vehicle.files import load_vehicle, vehicle_names

NO_DRAG = [f"{body}.drag.{kind}=0" for body in ("airframe", "load") for kind in ("linear", "quadratic")]


@pytest.mark.parametrize("name", vehicle_names())
def test_modes_are_those_of_two_bodies_on_a_spring(name: str) -> None:
    vehicle = load_vehicle(name, NO_DRAG)
    mass, load, cable = vehicle.airframe.mass, vehicle.load.mass, vehicle.cable
    reduced = mass * load / (mass + load)
    bounce, pendulum = modes(vehicle)
    assert bounce.frequency * 2 * math.pi == pytest.approx(math.sqrt(cable.stiffness / reduced), rel=1e-9)
    ratio = cable.damping / (2.0 * math.sqrt(cable.stiffness * reduced))
    assert bounce.damping == pytest.approx(ratio, rel=1e-9)
    swing = math.sqrt(vehicle.gravity / vehicle.hover_length * (1.0 + load / mass))
    assert pendulum.frequency * 2 * math.pi == pytest.approx(swing, rel=1e-9)
    assert pendulum.damping < 1e-9


def test_an_overdamped_bounce_has_its_damping_ratio() -> None:
    vehicle = load_vehicle("paper", ["cable.damping=100"])
    bounce, _ = modes(vehicle)
    assert bounce.damping == pytest.approx(100.0 / (2.0 * math.sqrt(100.0 * 5.0)), rel=1e-9)


def test_drag_of_the_load_damps_the_pendulum() -> None:
    """A light load's swing below a heavy vehicle decays with c/2m."""
    vehicle = load_vehicle("iris", [*NO_DRAG, "load.mass=0.003", "load.drag.linear=0.002"])
    _, pendulum = modes(vehicle)
    rate = 0.002 / (2.0 * 0.003)
    assert pendulum.damping == pytest.approx(rate / (2 * math.pi * pendulum.frequency), rel=0.01)


def test_the_delay_margin_is_where_the_loop_loses_stability() -> None:
    vehicle = load_vehicle("iris")
    margin = figures(vehicle, 250.0).delay_margin_s
    loop = actuated_model(vehicle), design("default", vehicle, 250.0)
    assert spectral_radius(closed_loop_matrix(*loop, margin)) < 1.0
    assert spectral_radius(closed_loop_matrix(*loop, margin + 2e-4)) >= 1.0


@pytest.mark.parametrize("name", vehicle_names())
def test_a_shipped_vehicle_flies(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["vehicle", "check", name, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["flies"] is True
    assert found["refusals"] == []
    assert found["step"]["outcome"] == "settled"
    assert found["thrust_to_weight"] == pytest.approx(1.0 / found["hover_thrust_share"])
    assert found["hover_control"] ** -2 <= found["thrust_to_weight"] * 1.001


@pytest.mark.parametrize("damping", [51.0, 130.0])
def test_a_cable_that_is_damped_beyond_its_bounce_is_flown(damping: float) -> None:
    """Its relaxation time, 0.5 and 1.3 s, is not short beside a step of two seconds."""
    vehicle = load_vehicle("paper", [f"cable.damping={damping}"])
    step = fly_step(vehicle, 1.0)
    assert step.outcome == "settled"
    assert step.largest_tilt_deg < math.degrees(limits_of(vehicle).tilt) + 1.0


def test_a_vehicle_that_no_law_flies_is_code_1_with_the_reason(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["vehicle", "check", "iris", "--set", "rotors.0.time_constant=9"]) == 1
    said = capsys.readouterr().out
    assert "refused           rotors.*.time_constant = 9 s" in said
    assert said.rstrip().endswith("DOES NOT FLY IT")
    assert "step of" not in said


def test_a_faulty_description_is_code_2(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["vehicle", "check", "iris", "--set", "airframe.mass=-1"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("iris: airframe.mass = -1 kg")
    assert main(["vehicle", "check", "nowhere.toml"]) == 2


def test_the_shipped_vehicles_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["vehicle", "list", "--json"]) == 0
    assert [entry["name"] for entry in json.loads(capsys.readouterr().out)] == vehicle_names()
    assert main(["vehicle", "list"]) == 0
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()] == vehicle_names()
