"""Section IV and Appendix F: the linear model entry by entry, controllability, poles, and the gains."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from controller.design.catalogue import paper_lqr_weights, paper_weights
from controller.design.model import LinearModel, linear_model
from sitl.studies.paper import independent_simulation as second
from sitl.studies.paper import page, riccati
from sitl.studies.paper.analysis.controllability import exact_model, product, rank
from sitl.studies.paper.analysis.linear_model import (
    complex_text,
    damping_ratio,
    gains,
    hover_point,
    lengths,
    open_loop_modes,
    sorted_poles,
)
from sitl.studies.paper.analysis.printed_model import PRINTED_LENGTH, STATES, linmod_matrix, printed_matrices
from sitl.studies.paper.context import Context
from sitl.studies.paper.drawings.linear import draw_poles
from sitl.studies.paper.page import Cell
from sitl.studies.paper.record import CORRECTED, UNSUPPORTED
from sitl_bridge.vehicle.files import load_vehicle

Array = NDArray[np.float64]


def section(context: Context) -> str:
    """The section's content."""
    context.say("linear model, controllability, poles and gains")
    return "".join((_appendix_f(context), _controllability(context), _poles(context), _gains(context)))


def _appendix_f(context: Context) -> str:
    ledger, vehicle = context.ledger, load_vehicle("paper")
    thrust = vehicle.hover_thrust
    printed_a, printed_b = printed_matrices()
    at_printed, true = linear_model(vehicle, PRINTED_LENGTH, 196.2), linear_model(vehicle)
    wrench = (thrust, 0.0, 0.0, 0.0)
    source = "Appendix F"
    linmod = {at: second.jacobians(vehicle, hover_point(vehicle, at), wrench) for at in lengths(vehicle)}
    ledger.check_array("A.printed", at_printed.A, printed_a, 1e-12, "", source + "1")
    numeric, _ = linmod[vehicle.hover_length]
    ledger.check_array("A.true", true.A, numeric, 1e-6, "", "second simulation's linmod")
    ledger.check_array("B", true.B, printed_b, 1e-12, "", source + "1")
    a_error = float(np.abs(at_printed.A - printed_a).max())
    ledger.at_most("appendix_f.A_largest_difference_from_F1", a_error, 1e-12, "", source + "1")
    f2, in_text = linmod_matrix()
    f2_error = float(np.abs(at_printed.A - f2)[in_text].max())
    ledger.at_most(
        "appendix_f.A_largest_difference_from_F2", f2_error, 1e-12, "", source + "2, 323 of 324 entries"
    )
    b_error = float(np.abs(true.B - printed_b).max())
    ledger.at_most("appendix_f.B_largest_difference_from_F1", b_error, 1e-12, "", source + "1")
    worst = 0.0
    for model, (a, b) in zip((at_printed, true), linmod.values(), strict=True):
        worst = max(worst, float(np.abs(a - model.A).max()), float(np.abs(b - model.B).max()))
    ledger.at_most(
        "appendix_f.largest_difference_from_numeric_jacobian", worst, 1e-6, "", "second simulation's linmod"
    )
    lateral = ledger.check(
        "appendix_f.lateral_entry_true", float(true.A[6, 3]), 4.952, 5e-4, "1/s²", "errata.md"
    )
    ledger.check("appendix_f.lateral_entry_printed", float(at_printed.A[6, 3]), 5.0, 1e-12, "1/s²", source)
    ledger.judge(
        "appendix_f",
        "IV.A, App. F",
        "A and B at x*, from equations and from linmod",
        f"equal in all 324 + 72 entries at l = 2 m; at the true equilibrium the lateral 5 is {lateral:.3f}",
        CORRECTED,
        "l = 2 m is no equilibrium; at 1.981 m only the four lateral pairs change",
        ["appendix_f"],
    )
    rows = []
    for i, j in np.argwhere((printed_a != 0) | (np.abs(true.A) > 1e-12)).tolist():
        if i < 6 or i > 14:
            continue  # the kinematic ones
        rows.append(
            (
                f"[d{STATES[i]}/dt, {STATES[j]}]",
                f"{printed_a[i, j]:g}",
                Cell(f"A.printed.{i}.{j}"),
                Cell(f"A.true.{i}.{j}"),
            )
        )
    return page.text(
        "Our Jacobian is written down by hand; a numerical one of the second simulation (what linmod does) "
        "agrees "
        f"with it to {worst:.0e}. At the paper's point it is Appendix F1 and F2, entry by entry "
        f"(largest difference {max(a_error, f2_error, b_error):.0e}). Below: all entries that "
        "are not kinematic."
    ) + page.table(
        ledger,
        ("entry of A", "App. F1, F2", "ours at l = 2 m", f"at l = {vehicle.hover_length:g} m"),
        rows,
    )


def _controllability(context: Context) -> str:
    ledger, vehicle = context.ledger, load_vehicle("paper")
    a, b = exact_model(vehicle)
    size = len(a)
    blocks, powers = [b], [a]
    for _ in range(size - 1):
        blocks.append(product(a, blocks[-1]))
        powers.append(product(a, powers[-1]))
    matrix = [[x for block in blocks for x in block[i]] for i in range(size)]
    full = int(
        ledger.check("controllability_rank", rank(matrix), 18, 0, "", "errata.md, eq. 52: exact arithmetic")
    )
    literal_blocks = [*powers[:-1], product(powers[-1], b)]
    literal = [[x for block in literal_blocks for x in block[i]] for i in range(size)]
    wrong = int(
        ledger.check("controllability.literal_eq52_rank", rank(literal), 14, 0, "", "errata.md, eq. 52")
    )
    floating = np.array([[float(x) for x in row] for row in matrix])
    condition = float(np.linalg.cond(floating))
    exponent = math.log10(condition)
    ledger.check("controllability.log10_condition", exponent, 11.0, 1.0, "", "errata.md: about 1e11")
    ledger.put(
        "controllability.floating_point_rank",
        int(np.linalg.matrix_rank(floating)),
        "",
        "rounding decides it at this condition: shown because it is what one would compute",
    )
    model = linear_model(vehicle)
    pbh = min(
        float(np.linalg.svd(np.hstack([p * np.eye(size) - model.A, model.B]), compute_uv=False)[-1])
        for p in np.linalg.eigvals(model.A)
    )
    ledger.at_least("controllability.pbh_smallest_singular_value", pbh, 1e-3, "", "above rounding: full rank")
    ledger.judge(
        "controllability",
        "IV.B, eq. 52",
        "full rank, so controllable",
        f"rank {full} of 18, in exact arithmetic and by the PBH test",
        CORRECTED,
        f"the matrix is [B AB … A¹⁷B]; as printed, [A A² … AⁿB], it has rank {wrong}",
        ["controllability", "controllability_rank"],
    )
    return page.heading("Controllability") + page.text(
        f"[B AB … A¹⁷B] has rank <b>{full}</b>, by elimination in rational numbers. Its condition number is "
        f"10^{exponent:.1f}, so that a floating-point rank is no proof. The PBH test needs no such matrix: "
        "the "
        "smallest singular value of [λ1 - A, B] over all poles λ is "
        f"{page.number(pbh)}, far above rounding. Eq. 52 as printed gives rank {wrong}, and says nothing "
        "about B."
    )


def _poles(context: Context) -> str:
    ledger, vehicle = context.ledger, load_vehicle("paper")
    poles = np.linalg.eigvals(linear_model(vehicle).A)
    modes = open_loop_modes(vehicle)
    # Twelve poles at zero in chains of up to four: rounding of 1e-16 moves them by its fourth root.
    drift = 1e-3
    expected = [
        p for _, pole, count in modes for p in [pole] * (count // 2) + [pole.conjugate()] * (count // 2)
    ]
    ledger.check_poles(
        "open_loop_poles", sorted_poles(poles), expected, drift, "1/s", "theory: bounce, pendulum, drift"
    )
    rows: list[tuple[str | Cell, ...]] = []
    for key, (meaning, pole, count) in zip(("bounce", "pendulum", "drift"), modes, strict=True):
        near = [p for p in poles if min(abs(p - pole), abs(p - pole.conjugate())) < 0.1]
        ledger.check(f"open_loop.{key}_poles", len(near), count, 0, "", "theory")
        apart = max(min(abs(p - pole), abs(p - pole.conjugate())) for p in near)
        tolerance = drift if key == "drift" else 1e-6
        ledger.at_most(f"open_loop.{key}_distance_from_theory", apart, tolerance, "1/s", "theory")
        shape: tuple[str | Cell, str | Cell] = "0", ""
        if abs(pole) > 0.0:
            found = complex(near[0])
            ledger.check(
                f"open_loop.{key}_frequency_hz",
                abs(found) / (2 * math.pi),
                abs(pole) / (2 * math.pi),
                1e-6,
                "Hz",
                "theory",
            )
            ledger.check(
                f"open_loop.{key}_damping_ratio",
                round(damping_ratio(found), 12),  # what is left of an undamped one is rounding
                damping_ratio(pole),
                1e-6,
                "",
                "theory",
            )
            shape = Cell(f"open_loop.{key}_frequency_hz"), Cell(f"open_loop.{key}_damping_ratio")
        rows.append((complex_text(pole), Cell(f"open_loop.{key}_poles"), meaning, *shape))
    return (
        page.heading("Open-loop poles")
        + page.table(ledger, ("pole [1/s]", "how many", "meaning", "frequency [Hz]", "damping ratio"), rows)
        + page.text(
            "Nothing damps the pendulum: the thrust is fixed to the vehicle, and air drag is not in the "
            "model. The "
            "zeros form chains (moment, rate, tilt, acceleration, position): the vehicle drifts away in "
            "any direction."
        )
    )


def _gains(context: Context) -> str:
    ledger = context.ledger
    near, far = load_vehicle("paper"), load_vehicle("paper", ["cable.rest_length=10"])
    bounce = open_loop_modes(near)[0][1]
    closed: dict[str, Any] = {}
    found: dict[str, tuple[Array, LinearModel]] = {
        "K_lqr": gains(near, False),
        "K_integral.1": gains(near, True),
        "K_integral.10": gains(far, True),
    }
    for key, (gain, model) in found.items():
        weights = paper_lqr_weights() if key == "K_lqr" else paper_weights()
        again = riccati.continuous(model, weights)
        ledger.check_array(
            key, gain, again.gain, 1e-6, "N and N m per unit of x", "eigenvectors of the Hamiltonian"
        )
        closed[key] = np.linalg.eigvals(model.A - model.B @ gain)
        ledger.check_poles(
            f"closed_loop_poles.{key}",
            sorted_poles(closed[key]),
            again.poles,
            1e-6,
            "1/s",
            "stable eigenvalues of the Hamiltonian",
        )
        ledger.at_most(f"gains.{key}.largest_real_part", float(closed[key].real.max()), -0.1, "1/s", "stable")
    fastest = float(closed["K_integral.1"].real.min())
    ledger.check("gains.fastest_pole_1_s", fastest, -1000.0, 1.0, "1/s", "errata.md")
    moved = {k: float(np.abs(p - bounce).min()) / abs(bounce) for k, p in closed.items()}
    for key, share in moved.items():
        ledger.at_most(f"gains.{key}.bounce_pole_moved_by", share, 0.02, "", "errata.md: left where it was")
    crossed = {}
    for key, gain, (_, model) in (
        ("gains_for_1_on_10", found["K_integral.1"][0], found["K_integral.10"]),
        ("gains_for_10_on_1", found["K_integral.10"][0], found["K_integral.1"]),
    ):
        worst = float(np.linalg.eigvals(model.A - model.B @ gain).real.max())
        crossed[key] = ledger.at_least(
            f"gains.{key}_largest_real_part", worst, 1e-3, "1/s", "errata.md, V.B: unstable"
        )
    ledger.judge(
        "gains.bounce",
        "V.A, VI",
        "the oscillation left at the start is due to the linearisation",
        f"its pole is in A exactly, and the weights move it by {100 * moved['K_lqr']:.2f} % "
        f"(V.A) and {100 * moved['K_integral.10']:.1f} % (V.B)",
        UNSUPPORTED,
        "with R = 1 per N² thrust is too dear to be spent on it",
        ["gains.K_lqr.bounce_pole_moved_by", "gains.K_integral.10.bounce_pole_moved_by"],
    )
    ledger.judge(
        "gains.length",
        "V.B",
        "l₀ is raised to 10 m (gains not mentioned)",
        f"gains for l₀ = 1 m are unstable on 10 m (+{crossed['gains_for_1_on_10']:.2f} 1/s) and the other "
        "way "
        f"round (+{crossed['gains_for_10_on_1']:.2f} 1/s)",
        CORRECTED,
        "the gains have to be designed for the l₀ that they fly",
        ["gains.gains_for_1_on_10_largest_real_part", "gains.gains_for_10_on_1_largest_real_part"],
    )
    ledger.judge(
        "gains.exist",
        "IV.C, IV.D, eqs. 53 to 56",
        "an LQR, and one with the integral of the load's position",
        "both stable, their gains and poles in paper.json",
        CORRECTED,
        "eqs. 54 to 56: v = ∫(p_p - p_ref), x - x*; G = [0 1 0]; eq. 53: the whole state, not x_v",
        [
            "gains.K_lqr.largest_real_part",
            "gains.K_integral.1.largest_real_part",
            "gains.K_integral.10.largest_real_part",
        ],
    )
    return (
        page.heading("Gains and closed-loop poles")
        + page.figure(
            draw_poles(np.linalg.eigvals(linear_model(near).A), closed),
            "<b>Poles.</b> Open loop and closed loop, the paper's continuous gains; the poles near "
            f"{fastest:.0f} 1/s, from an inertia of 0.01 kg m², lie far to the left of the plot. The bounce "
            f"(at {complex_text(bounce)}) stays.",
        )
        + page.text("The gains, with 4 rows [ΣT, M_x, M_y, M_z] and columns in the order of eq. 31 (then ∫):")
        + "".join(
            page.listing(np.array2string(k, precision=4, suppress_small=True, max_line_width=160), key)
            for key, (k, _) in found.items()
        )
    )
