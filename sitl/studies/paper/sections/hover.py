"""Section III: the hover equilibrium, eqs. 16 to 25, as printed and corrected."""

from __future__ import annotations

import math

import numpy as np

from sitl.studies.paper import independent_simulation as second
from sitl.studies.paper import page
from sitl.studies.paper.context import Context
from sitl.studies.paper.page import Cell
from sitl.studies.paper.record import CORRECTED, UNSUPPORTED
from sitl_bridge.vehicle.description import Vehicle, hover_rotor_speed
from sitl_bridge.vehicle.files import load_vehicle

PRINTED_POINT = (2.5, 0.5)
"""z_v and z_p of the point that section IV.A linearises at, m."""


def section(context: Context) -> str:
    """The section's content."""
    ledger = context.ledger
    vehicle = load_vehicle("paper")
    mass, load_mass, g = vehicle.airframe.mass, vehicle.load.mass, vehicle.gravity
    cable, rotor = vehicle.cable, vehicle.rotors[0]

    length = ledger.check("equilibrium.length_m", vehicle.hover_length, 1.981, 1e-9, "m", "errata.md, eq. 17")
    thrust = ledger.check("equilibrium.thrust_N", vehicle.hover_thrust, 196.2, 1e-9, "N", "eq. 19")
    speed = ledger.check(
        "equilibrium.rotor_speed_rad_s",
        hover_rotor_speed(vehicle),
        22.147,
        5e-4,
        "rad/s",
        "errata.md, eq. 24",
    )
    x, u = [0.0, 0.0, length, *[0.0] * 15], [thrust, 0.0, 0.0, 0.0]
    ledger.check_array(
        "equilibrium.x", x, [0.0, 0.0, 1.981, *[0.0] * 15], 1e-9, "eq. 31", "errata.md, eq. 17"
    )
    ledger.check_array("equilibrium.u", u, [196.2, 0.0, 0.0, 0.0], 1e-9, "N, N m", "eq. 19")
    residual = max(abs(a) for a in accelerations(vehicle, length, thrust))
    ledger.at_most("equilibrium.residual_acceleration_m_s2", residual, 1e-12, "m/s²", "eq. 16")

    printed_length = ledger.check(
        "hover.printed_length_m",
        cable.rest_length - load_mass * g / cable.stiffness,
        0.019,
        1e-9,
        "m",
        "eq. 17",
    )
    growth = ledger.at_least(
        "hover.printed_length_growth_rate_1_s",
        _growth(vehicle, printed_length, thrust),
        10.0,
        "1/s",
        "errata.md: load balanced above the vehicle",
    )
    printed_speed = ledger.check(
        "hover.printed_rotor_speed_rad_s",
        math.sqrt(thrust / rotor.thrust_coefficient),
        2 * 22.147,
        1e-3,
        "rad/s",
        "eq. 24",
    )
    share = 4 * rotor.thrust_coefficient * printed_speed**2 / thrust
    ledger.check("hover.printed_rotor_speed_thrust_ratio", share, 4.0, 1e-9, "", "errata.md, eq. 24")
    lift = 4 * rotor.thrust_coefficient * speed**2
    ledger.check("hover.thrust_of_four_rotors_N", lift, thrust, 1e-9, "N", "eq. 20")
    top, bottom = PRINTED_POINT
    up, down = accelerations(vehicle, top - bottom, thrust)
    ledger.check("hover.printed_point_vehicle_acceleration_m_s2", up, -0.19, 1e-9, "m/s²", "errata.md, IV.A")
    ledger.check("hover.printed_point_load_acceleration_m_s2", down, 0.19, 1e-9, "m/s²", "errata.md, IV.A")
    # Appendix C: run the model with hover thrust until it stands still.
    start = load_vehicle("paper", ["initial.vehicle_position=[0, 0, 1]"])
    run = second.simulate(start, (thrust, 0.0, 0.0, 0.0), np.linspace(0.0, 60.0, 61))
    found = float(run.states[-1, 2] - run.states[-1, 5])
    ledger.check("hover.steady_length_by_simulation_m", found, length, 1e-6, "m", "Appendix C, 60 s")

    ledger.judge(
        "hover.length",
        "III, eqs. 16 to 18",
        f"l = l₀ - m_p g/k_a = {page.number(printed_length)} m",
        f"{length:.3f} m, also where a 60 s simulation comes to rest",
        CORRECTED,
        "ê points down: l = l₀ + m_p g/k_a. The printed root is the load balanced above the vehicle",
        [
            "equilibrium.length_m",
            "hover.printed_length_m",
            "hover.printed_length_growth_rate_1_s",
            "hover.steady_length_by_simulation_m",
        ],
    )
    ledger.judge(
        "hover.rotor_speed",
        "III, eq. 24",
        f"ω = √((m_v+m_p) g/c_t) = {page.number(printed_speed)} rad/s",
        f"{speed:.3f} rad/s",
        CORRECTED,
        "four rotors share the thrust: c_t is 4 c_t",
        ["equilibrium.rotor_speed_rad_s", "hover.printed_rotor_speed_thrust_ratio"],
    )
    ledger.judge(
        "hover.printed_point",
        "IV.A",
        f"x* with z_v = {top} m, z_p = {bottom} m is an equilibrium",
        f"vehicle and load accelerate there by {up:.2f} and {down:+.2f} m/s²",
        UNSUPPORTED,
        "l = 2 m is rounded from 1.981 m",
        ["hover.printed_point_vehicle_acceleration_m_s2", "hover.printed_point_load_acceleration_m_s2"],
    )
    full, printed = Cell("equilibrium.thrust_N"), Cell("hover.printed_length_m")
    fast, right = Cell("hover.printed_rotor_speed_rad_s"), Cell("equilibrium.rotor_speed_rad_s")
    rows: list[tuple[str | Cell, ...]] = [
        ("17", "l = l₀ - m_p g/k_a", printed, "l = l₀ + m_p g/k_a", Cell("equilibrium.length_m"), "m"),
        ("18, 19", "T = (m_v + m_p) g", full, "the same", full, "N"),
        ("20", "c_t Σω² = T", full, "the same", Cell("hover.thrust_of_four_rotors_N"), "N"),
        ("21, 22", "ω₂ = ω₄, ω₁ = ω₃", "", "the same", "", ""),
        ("23", "d c_q (…) = 0", "", "c_q (…) = 0: same root, and d = 1 m in Table I", "", ""),
        ("24", "√((m_v+m_p) g/c_t)", fast, "√((m_v+m_p) g/(4 c_t))", right, "rad/s"),
        (
            "25",
            "z_vss - z_pss, by simulation",
            "",
            "the same",
            Cell("hover.steady_length_by_simulation_m"),
            "m",
        ),
    ]
    return (
        page.text(
            "Hovering, the thrust carries both masses and the cable carries the load: it is longer than l₀ "
            "by "
            f"m_p g/k_a = {page.number(load_mass * g / cable.stiffness)} m. The paper has ê pointing up, "
            "so that its root "
            "is a load that stands on the cable above the vehicle: an equilibrium too, but one that falls "
            "over, "
            f"growing by {page.number(growth)} 1/s."
        )
        + page.table(ledger, ("eq.", "as printed", "value", "corrected", "value", "unit"), rows)
        + page.text(
            f"Rotors at the printed speed of eq. 24 would give {page.number(share)} times hover thrust. "
            "The point "
            f"[z_v, z_p] = [{top}, {bottom}] m that section IV.A linearises at is no equilibrium: vehicle "
            "and load "
            f"accelerate towards each other by {page.number(abs(up))} m/s² each. Masses: {mass:g} and "
            f"{load_mass:g} kg."
        )
    )


def accelerations(vehicle: Vehicle, length: float, thrust: float) -> tuple[float, float]:
    """Vertical accelerations of vehicle and load, m/s², upright, the load `length` straight below (eq. 3)."""
    pull = vehicle.cable.stiffness * (length - vehicle.cable.rest_length)
    return (
        (thrust - pull) / vehicle.airframe.mass - vehicle.gravity,
        pull / vehicle.load.mass - vehicle.gravity,
    )


def _growth(vehicle: Vehicle, length: float, thrust: float) -> float:
    """Largest growth rate, 1/s, with the load balanced `length` above the vehicle."""
    x = np.zeros(second.STATE_SIZE)
    x[5] = length
    a, _ = second.jacobians(vehicle, x, (thrust, 0.0, 0.0, 0.0), step=1e-6)
    return float(np.linalg.eigvals(a).real.max())
