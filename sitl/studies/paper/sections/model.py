"""Section II: the equations as implemented beside the paper's, each correction shown to be one by numbers."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from sitl.studies.paper import page
from sitl.studies.paper.context import Context
from sitl.studies.paper.record import CORRECTED
from sitl_bridge.frames import quaternion_from_euler, rotate

Array = NDArray[np.float64]

ANGLES = (0.3, -0.4, 0.5)
"""Roll, pitch, yaw at which the printed and the corrected formulas are compared, rad."""
RATES = np.array([0.7, -0.2, 0.4])
"""p, q, r, rad/s, likewise."""

AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))

EQUATIONS = (
    (
        "2",
        "R = Rz(ψ)·Ry(θ)·Rx(φ), with [3,3] = cψ cθ; the text has φ θ ψ about Z, Y, X",
        "[3,3] = cφ cθ; φ θ ψ about X, Y, Z, as eqs. 7, 14 and 15 have it",
        "sitl_bridge/frames.py; a unit quaternion in the plant",
    ),
    ("3, 4, 7, 8", "M p̈ = F_g + F_t + F_c", "as printed", "plant/dynamics.py"),
    (
        "5, 6, 12, 13",
        "T_i = c_T ω_i², Q_i = c_Q ω_i²; moments from the layout",
        "as printed",
        "plant/dynamics.py",
    ),
    (
        "9",
        "F = k_a (l - l₀) + c_a v_r, v_r “the absolute relative velocity”",
        "v_r = dl/dt with its sign. Two-way: it also pushes when l &lt; l₀, which a real cable cannot; "
        "<code>cable.model=tension-only</code> does not",
        "plant/cable.py",
    ),
    ("10, 11", "I ω̇ = U - ω × I ω", "as printed", "plant/dynamics.py"),
    (
        "14, 15",
        "rates from and to Euler angles",
        "as printed (for angles about X, Y, Z)",
        "second simulation",
    ),
    ("40 to 45", "missing dots; 1/m_p on the left in 44", "as eq. 3", "plant/dynamics.py"),
    (
        "49 to 51",
        "φ̇ = p + r cψ tθ + q sψ sθ; θ̇ = q cψ - r sψ; ψ̇ = r cψ/cθ + q sψ/θ",
        "φ̇ = p + q sφ tθ + r cφ tθ; θ̇ = q cφ - r sφ; ψ̇ = (q sφ + r cφ)/cθ",
        "second simulation",
    ),
)


def section(context: Context) -> str:
    """The section's content."""
    ledger = context.ledger
    printed, corrected = rotation(ANGLES, as_printed=True), rotation(ANGLES)
    ours = np.array([rotate(quaternion_from_euler(ANGLES), axis) for axis in AXES]).T
    ledger.at_least(
        "model.eq2.printed_orthogonality_error", _skewness(printed), 0.01, source="errata.md, eq. 2"
    )
    ledger.at_most("model.eq2.corrected_orthogonality_error", _skewness(corrected), 1e-12, source="algebra")
    ledger.at_most(
        "model.eq2.difference_from_quaternion", float(np.abs(corrected - ours).max()), 1e-12, source="algebra"
    )
    ledger.at_least("model.eqs49_51.printed_error_rad_s", _rate_error(True), 0.01, "rad/s", "errata.md")
    ledger.at_most("model.eqs49_51.corrected_error_rad_s", _rate_error(False), 1e-8, "rad/s", "eq. 15")
    # A cable that shortens at 1 m/s under the damper alone: what flows into the two bodies.
    damping, rate = 10.0, -1.0
    ledger.check(
        "model.eq9.printed_damping_power_W", -damping * abs(rate) * rate, 10.0, 1e-9, "W", "-F dl/dt"
    )
    ledger.check("model.eq9.signed_damping_power_W", -damping * rate * rate, -10.0, 1e-9, "W", "-F dl/dt")
    m = ledger.numbers["model"]
    ledger.judge(
        "model",
        "II, eqs. 2 to 15, 40 to 51",
        "equations of motion from Newton and Euler",
        "the same, and a second, independent simulation agrees (figures 2 to 16 below)",
        CORRECTED,
        "slips in eqs. 2, 9, 40 to 51 and in which angle belongs to which axis",
        ["model"],
    )
    return (
        page.text(
            "A quadrotor (position r_v, mass m_v, rigid, rotors on the body's axes) carries a point mass "
            "(r_p, m_p) on "
            "a cable that is fixed to its centre of mass. World: east, north, up; body: forward, left, up. "
            "φ, θ, ψ are roll, pitch and yaw; e is the unit vector from vehicle to load, l the cable's "
            "length. "
            "The cable pulls the vehicle by +F e and the load by -F e."
        )
        + page.table(ledger, ("eq.", "as printed", "as implemented", "where"), EQUATIONS)
        + page.text(
            f"That these are corrections shows in numbers, at φ, θ, ψ = {ANGLES} rad. The printed eq. 2 is "
            "no rotation "
            f"(‖RᵀR - 1‖ = {page.number(m['eq2']['printed_orthogonality_error'])}), the corrected one is, to "
            f"{m['eq2']['corrected_orthogonality_error']:.0e}. Eqs. 49 to 51 as printed miss the true "
            "Euler rates by "
            f"{page.number(m['eqs49_51']['printed_error_rad_s'])} rad/s at p, q, r = {RATES.tolist()} "
            "rad/s, corrected "
            f"by {m['eqs49_51']['corrected_error_rad_s']:.0e}. With the “absolute” velocity in eq. 9, a "
            "cable "
            f"that shortens at 1 m/s would pump {page.number(m['eq9']['printed_damping_power_W'])} W into "
            "the bodies; "
            f"with the signed one, damping takes {page.number(-m['eq9']['signed_damping_power_W'])} W out."
        )
    )


def rotation(angles: tuple[float, float, float], as_printed: bool = False) -> Array:
    """Eq. 2 for roll, pitch, yaw (rad), as printed or corrected."""
    (sf, sq, sp), (cf, cq, cp) = ([f(a) for a in angles] for f in (math.sin, math.cos))
    return np.array(
        [
            [cp * cq, cp * sf * sq - cf * sp, sp * sf + cp * cf * sq],
            [cq * sp, cp * cf + sp * sf * sq, cf * sp * sq - cp * sf],
            [-sq, cq * sf, (cp if as_printed else cf) * cq],
        ]
    )


def euler_rates(angles: tuple[float, float, float], rates: Array, as_printed: bool) -> Array:
    """Eqs. 49 to 51: rates of roll, pitch and yaw, rad/s, from p, q, r."""
    (p, q, r), (roll, pitch, yaw) = rates.tolist(), angles
    s, c, t = math.sin, math.cos, math.tan
    if as_printed:
        return np.array(
            [
                p + r * c(yaw) * t(pitch) + q * s(yaw) * s(pitch),
                q * c(yaw) - r * s(yaw),
                r * c(yaw) / c(pitch) + q * s(yaw) / pitch,
            ]
        )
    turned = q * s(roll) + r * c(roll)
    return np.array([p + turned * t(pitch), q * c(roll) - r * s(roll), turned / c(pitch)])


def _skewness(matrix: Array) -> float:
    return float(np.linalg.norm(matrix.T @ matrix - np.eye(3)))


def _rate_error(as_printed: bool) -> float:
    """How far the body rates that follow from R along these Euler rates are from p, q, r, rad/s."""
    step, rates = 1e-6, euler_rates(ANGLES, RATES, as_printed)
    ahead, behind = (rotation(tuple((np.array(ANGLES) + s * step * rates).tolist())) for s in (1, -1))
    skew = rotation(ANGLES).T @ (ahead - behind) / (2 * step)  # R' = R [w]x
    return float(np.linalg.norm(np.array([skew[2, 1], skew[0, 2], skew[1, 0]]) - RATES))
