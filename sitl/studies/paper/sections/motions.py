"""Figs. 2 to 5 and 12 to 16: the uncontrolled motions that the paper validates its equations with.

Each from two simulations: the plant (ENU/FLU, quaternion, fixed step) and `second` (NED/FRD, Euler angles,
adaptive), drawn on top of each other.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.signal import lsim, lti

from sitl.studies.paper import independent_simulation as second
from sitl.studies.paper import offline, page, plots
from sitl.studies.paper.context import Context
from sitl.studies.paper.record import REPRODUCED
from sitl_bridge.vehicle.description import Vehicle
from sitl_bridge.vehicle.files import load_vehicle

Array = NDArray[np.float64]

AGREEMENT = 1e-6
"""Largest difference between the two simulations, m and rad."""
MOMENT = 1e-4
"""The paper does not say how large its moments are, N m; this one turns the vehicle by 29° in 10 s."""
SAMPLE = 0.02
"""s"""
FROM_REST_LENGTH = ("initial.vehicle_position=[0, 0, 1]",)
"""l = l₀ at the start: the cable carries nothing yet, and the masses bounce about the equilibrium."""


class Case(NamedTuple):
    """One motion: what differs from Table I in equilibrium, thrust over hover's, signs of the moments."""

    title: str
    overrides: tuple[str, ...]
    thrust: float
    signs: tuple[int, int, int]
    duration: float


CASES = {
    "2": Case("no input", (), 0.0, (0, 0, 0), 3.0),
    "3": Case("hover thrust, no damping", ("cable.damping=0", *FROM_REST_LENGTH), 1.0, (0, 0, 0), 10.0),
    "4": Case("hover thrust, with damping", FROM_REST_LENGTH, 1.0, (0, 0, 0), 10.0),
    "5": Case("negative moment about Y", (), 1.0, (0, -1, 0), 10.0),
    "12": Case("negative moment about X", (), 1.0, (-1, 0, 0), 10.0),
    "12_reversed": Case("positive moment about X (not in the paper)", (), 1.0, (1, 0, 0), 10.0),
    "13": Case("positive moment about Y", (), 1.0, (0, 1, 0), 10.0),
    "14": Case("negative moment about Z", (), 1.0, (0, 0, -1), 10.0),
    "15": Case("positive moment about Z", (), 1.0, (0, 0, 1), 10.0),
    "16": Case("negative moments about Z and X", (), 1.0, (-1, 0, -1), 10.0),
}


def section(context: Context) -> str:
    """The section's content."""
    blocks = [
        page.text(
            "Two simulations of each motion. Broad and pale: the plant that everything else on this page "
            "flies "
            "(east-north-up, quaternion, Runge-Kutta at 1 ms). Thin and dashed: a second one that shares "
            "no code "
            "with it (north-east-down, body axes forward-right-down, Euler angles, DOP853 at 1e-10), as "
            "the paper's "
            "6-DoF block is. Where one sees a single line, they agree; the number says how well."
        )
    ]
    for key, case in CASES.items():
        context.say(f"figure {key}: {case.title}")
        blocks.append(_figure(context, key, case))
    ledger = context.ledger
    moments = [k for k in CASES if any(CASES[k].signs)]
    worst = max(ledger.numbers["figures"][k]["largest_difference_m"] for k in CASES)
    ledger.judge(
        "figures.2",
        "III.A, fig. 2",
        "without input both fall, only z changes",
        "both fall; their common centre with g. From equilibrium the stretched cable first pulls them "
        "together",
        REPRODUCED,
        "",
        ["figures.2"],
    )
    three, four = ledger.numbers["figures"]["3"], ledger.numbers["figures"]["4"]
    ledger.judge(
        "figures.3",
        "III.A, fig. 3",
        "without damping vehicle and load oscillate against each other, undiminished",
        f"{three['frequency_hz']:.4f} Hz, damping ratio {abs(three['damping_ratio']):.0e}",
        REPRODUCED,
        "",
        ["figures.3"],
    )
    ledger.judge(
        "figures.4",
        "III.A, fig. 4",
        "with damping an equilibrium is reached",
        f"{four['frequency_hz']:.4f} Hz, damping ratio {four['damping_ratio']:.4f}, as theory says",
        REPRODUCED,
        "",
        ["figures.4"],
    )
    ledger.judge(
        "figures.moments",
        "III.A and App. A, figs. 5, 12 to 16",
        "a moment turns the vehicle about its axis, with the right sign; both implementations agree",
        f"signs and angles as theory says; the two simulations differ by at most {worst:.0e} m",
        REPRODUCED,
        "",
        [f"figures.{k}" for k in moments],
    )
    return "".join(blocks)


def _figure(context: Context, key: str, case: Case) -> str:
    ledger = context.ledger
    vehicle = load_vehicle("paper", case.overrides)
    times = np.linspace(0.0, case.duration, round(case.duration / SAMPLE) + 1)
    moment = [sign * MOMENT for sign in case.signs]
    wrench = (case.thrust * vehicle.hover_thrust, moment[0], moment[1], moment[2])
    ours, other = offline.open_loop(vehicle, wrench, times), second.simulate(vehicle, wrench, times)
    apart = np.abs(ours.states - other.states)
    name = f"figures.{key}"
    metres = ledger.at_most(
        f"{name}.largest_difference_m", float(apart[:, :6].max()), AGREEMENT, "m", "two implementations"
    )
    radians = ledger.at_most(
        f"{name}.largest_difference_rad", float(apart[:, 15:].max()), AGREEMENT, "rad", "two implementations"
    )
    if any(case.signs):
        words = _moment_numbers(context, name, case, vehicle, ours)
        picture = _draw_turn(times, ours.states, other.states)
    else:
        sideways = float(np.abs(ours.states[:, [0, 1, 3, 4]]).max())
        ledger.at_most(f"{name}.largest_sideways_m", sideways, AGREEMENT, "m", "III.A: only z changes")
        words = (
            _fall_numbers(context, name, ours)
            if key == "2"
            else _bounce_numbers(context, name, vehicle, ours)
        )
        picture = draw_heights(times, ours.states, other.states)
    title = f"Fig. {key}" if key.isdigit() else "Beside fig. 12"
    return page.figure(
        picture,
        f"<b>{title}: {case.title}.</b> {words} Largest difference between the two simulations: "
        f"{metres:.1e} m, {radians:.1e} rad.",
    )


def _fall_numbers(context: Context, name: str, ours: offline.Motion) -> str:
    centre = 0.5 * (ours.states[:, 2] + ours.states[:, 5])
    fall = float(-2.0 * (centre[-1] - centre[0]) / ours.time[-1] ** 2)
    context.ledger.check(f"{name}.centre_acceleration_m_s2", fall, 9.81, 1e-6, "m/s²", "g")
    return (
        f"The common centre falls with {fall:.3f} m/s²; the cable, stretched at first, oscillates meanwhile."
    )


def _bounce_numbers(context: Context, name: str, vehicle: Vehicle, ours: offline.Motion) -> str:
    natural, ratio = bounce_mode(vehicle)
    frequency, damping = oscillation(ours.time, ours.states[:, 2] - ours.states[:, 5] - vehicle.hover_length)
    damped = natural * math.sqrt(1.0 - ratio**2) / (2.0 * math.pi)
    context.ledger.check(
        f"{name}.frequency_hz", frequency, damped, 2e-4, "Hz", "√(k_a(1/m_v+1/m_p)(1-ζ²))/2π"
    )
    context.ledger.check(f"{name}.damping_ratio", damping, ratio, 2e-4, "", "c_a √((1/m_v+1/m_p)/k_a)/2")
    return (
        f"From l = l₀: the bounce has {frequency:.4f} Hz (theory {damped:.4f}) "
        f"and a damping ratio of {abs(damping):.4f} (theory {ratio:.4f})."
    )


def _moment_numbers(context: Context, name: str, case: Case, vehicle: Vehicle, ours: offline.Motion) -> str:
    """Angles against M t²/2I; for figure 5 the signs that the text gives."""
    ledger, end = context.ledger, ours.states[-1]
    words = []
    names = ("roll", "pitch", "yaw")
    single = sum(map(abs, case.signs)) == 1
    for axis, sign in enumerate(case.signs):
        if not sign:
            continue
        rate = sign * MOMENT / vehicle.airframe.inertia[axis] * case.duration
        label = "pqr"[axis]
        ledger.check(f"{name}.final_{label}_rad_s", float(end[12 + axis]), rate, 1e-9, "rad/s", "M t/I")
        if single:
            angle = 0.5 * rate * case.duration
            ledger.check(
                f"{name}.final_{names[axis]}_rad", float(end[15 + axis]), angle, 1e-6, "rad", "M t²/2I"
            )
            words.append(f"{names[axis]} ends at {math.degrees(end[15 + axis]):.2f}°, as M t²/2I says")
    if single and not case.signs[2]:
        # Forward is -sign for roll (to the right) and +sign for pitch.
        direction, moves = (1, -case.signs[0]) if case.signs[0] else (0, case.signs[1])
        went = bool(end[direction] * moves > 0 and end[3 + direction] * moves > 0)
        sank = bool(end[2] < ours.states[0, 2] and end[5] < ours.states[0, 5])
        ledger.true(f"{name}.both_move_with_the_tilt", went, "III.A")
        ledger.true(f"{name}.both_lose_height", sank, "III.A: the thrust stays the same")
        words.append(f"vehicle and load move to {'+' if moves > 0 else '-'}{'xy'[direction]} and lose height")
    elif single:
        still = float(np.abs(ours.states[:, :6] - ours.states[0, :6]).max())
        ledger.at_most(f"{name}.largest_displacement_m", still, AGREEMENT, "m", "yaw moves nothing else")
        words.append("nothing else moves")
    else:
        words.append("roll and yaw together couple into pitch")
    return f"{MOMENT:g} N m on each axis named; {', '.join(words)}."


def bounce_mode(vehicle: Vehicle) -> tuple[float, float]:
    """Natural frequency (rad/s) and damping ratio of vehicle and load bouncing on the cable."""
    both = 1.0 / vehicle.airframe.mass + 1.0 / vehicle.load.mass
    natural = math.sqrt(vehicle.cable.stiffness * both)
    return natural, vehicle.cable.damping * both / (2.0 * natural)


def oscillation(time: Array, signal: Array) -> tuple[float, float]:
    """Frequency (Hz) and damping ratio of a decaying oscillation about zero.

    Frequency from its zero crossings, damping from the logarithmic decrement of its extremes (parabolas
    through three samples).
    """
    crossings = np.flatnonzero(np.diff(np.sign(signal)) != 0)
    at = time[crossings] - signal[crossings] * np.diff(time)[crossings] / np.diff(signal)[crossings]
    frequency = (len(at) - 1) / (2.0 * (at[-1] - at[0]))
    size = np.abs(signal)
    tops = [i for i in range(1, len(size) - 1) if size[i] > size[i - 1] and size[i] >= size[i + 1]]
    heights = [
        size[i] + (size[i + 1] - size[i - 1]) ** 2 / (8.0 * (2.0 * size[i] - size[i - 1] - size[i + 1]))
        for i in tops
    ]
    decrement = math.log(heights[0] / heights[-1]) / (len(heights) - 1)  # over half periods
    return float(frequency), decrement / math.hypot(math.pi, decrement)


def driven_oscillation(time: Array, signal: Array, drive: Array) -> tuple[float, float]:
    """Damped frequency (Hz) and damping ratio of y'' + 2ζω y' + ω² y = drive, y at rest to begin with.

    time: equidistant, s; signal: y, and drive: in its unit per s², both (n,). Fitted to the whole signal, so
    that what drives it is not taken for its own motion.
    """
    crossings = int(np.count_nonzero(np.diff(np.sign(signal))))
    guess = math.pi * max(1, crossings) / float(time[-1] - time[0])

    def response(parameters: Array) -> Array:
        natural, ratio = parameters.tolist()
        system = lti([1.0], [1.0, 2.0 * ratio * natural, natural**2])
        return np.asarray(lsim(system, drive, time)[1] - signal)

    found: list[float] = least_squares(response, [guess, 0.1], x_scale=[guess, 0.1]).x.tolist()
    natural, ratio = found
    return natural * math.sqrt(max(0.0, 1.0 - ratio**2)) / (2.0 * math.pi), ratio


def draw_heights(times: Array, ours: Array, other: Array) -> bytes:
    figure, axes = plots.panels(1, height=3.0)
    ax = axes[0, 0]
    plots.pair(ax, plots.VEHICLE, "vehicle z", (times, ours[:, 2]), (times, other[:, 2]))
    plots.pair(ax, plots.LOAD, "load z", (times, ours[:, 5]), (times, other[:, 5]))
    ax.set(xlabel="time [s]", ylabel="height z [m]")
    plots.shared_legend(figure, ax)
    return plots.png(figure)


def _draw_turn(times: Array, ours: Array, other: Array) -> bytes:
    figure, axes = plots.panels(2, 2, height=2.3)
    for panel, label in enumerate("xyz"):
        ax: Any = axes.flat[panel]
        for colour, name, column in ((plots.VEHICLE, "vehicle", panel), (plots.LOAD, "load", 3 + panel)):
            plots.pair(ax, colour, name, (times, ours[:, column]), (times, other[:, column]))
        ax.set_ylabel(f"{label} [m]")
        _at_least(ax, 0.01)
    ax = axes[1, 1]
    for axis, (colour, name) in enumerate(((plots.ROLL, "roll"), (plots.PITCH, "pitch"), (plots.YAW, "yaw"))):
        plots.pair(
            ax,
            colour,
            name,
            (times, np.degrees(ours[:, 15 + axis])),
            (times, np.degrees(other[:, 15 + axis])),
        )
    ax.set_ylabel("angle [°]")
    handles, labels = ax.get_legend_handles_labels()
    ax.legend(handles[::2], labels[::2], fontsize="small")
    for ax in axes[1]:
        ax.set_xlabel("time [s]")
    plots.shared_legend(figure, axes[0, 0])
    return plots.png(figure)


def _at_least(ax: Any, span: float) -> None:
    """Do not magnify rounding: an axis that shows nothing spans so many metres."""
    low, high = ax.get_ylim()
    if high - low < span:
        middle = 0.5 * (low + high)
        ax.set_ylim(middle - span / 2, middle + span / 2)
