"""How the vehicle answers a step on cables of other stiffness, damping and length."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from controller.design.catalogue import design, paper_weights
from controller.design.lqr import sampled_gain, sampled_model
from controller.design.model import linear_model, with_integrator
from controller.law.reference import setpoint
from controller.law.state import Array
from sitl.report.metrics import overshoot_pct, settling_time
from sitl.studies.paper import independent_simulation as second
from sitl.studies.paper import offline
from sitl.studies.paper.analysis.linear_model import gains, hover_point, open_loop_modes
from sitl.studies.paper.analysis.sampled_loop import held
from sitl.studies.paper.analysis.step import TARGET, law
from sitl.studies.sweep.draws import draws
from sitl.studies.sweep.study import Study, Vary
from sitl.studies.sweep.worker import drawn
from sitl_bridge.vehicle.description import Vehicle
from sitl_bridge.vehicle.files import load_vehicle

DURATION = 15.0
"""s"""


RATE_HZ = offline.RATE_HZ


FAST_HZ = 1000.0
"""Where the continuous gains, held, are stable without delay."""


BASE = ("cable.rest_length=10",)
"""V.B's cable; everything else is Table I's."""


class Response(NamedTuple):
    """V.B's step with the paper's weights, for one cable and load."""

    bounce: complex
    """Open-loop pole, 1/s"""
    pendulum: float
    """Open-loop frequency, rad/s"""
    bounce_closed: complex
    """The closed loop's pole nearest to the open loop's bounce, 1/s"""
    stretch: float
    """m"""
    settling: float | None
    """2 %, s"""
    overshoot: float
    """%"""
    peak_tension: float
    """N"""
    diverged: bool


ROW = (
    "stretch_m",
    "bounce_frequency_hz",
    "bounce_damping_ratio",
    "bounce_damping_ratio_closed_loop",
    "pendulum_frequency_hz",
    "settling_time_2pct_s",
    "overshoot_pct",
    "peak_tension_N",
)
"""What the page's tables show of a row, in their order."""


ROW_HEAD = (
    "stretch [m]",
    "bounce [Hz]",
    "its damping ratio",
    "in closed loop",
    "pendulum [Hz]",
    "2 % settling [s]",
    "overshoot [%]",
    "peak tension [N]",
)


LINMOD_TOLERANCE = 1e-4
"""Of frequencies (relative) and damping ratios against those of a Jacobian taken by differences."""


def nearest(poles: Any, wanted: complex) -> complex:
    """That of the poles which is nearest."""
    return complex(poles[np.argmin(np.abs(poles - wanted))])


class Step(NamedTuple):
    """What V.B came to."""

    settling: float | None
    """2 %, s; None: not settled"""
    overshoot: float
    """%"""
    peak_tension: float
    """N"""
    diverged: bool


def step_of(run: second.Run | offline.Motion, tension: Array) -> Step:
    """V.B's figures of a run and the cable's tension in it (n,), N."""
    error = np.linalg.norm(run.load - np.array(TARGET), axis=1)
    return Step(
        settling=None if run.diverged else settling_time(run.time, error, 0.02 * float(error[0])),
        overshoot=overshoot_pct(run.load, run.load[0], np.array(TARGET)) or 0.0,
        peak_tension=float(tension.max()),
        diverged=run.diverged,
    )


def fly_again(vehicle: Vehicle, gain: Array) -> Step:
    """V.B in the second simulation, with a sampled gain (4, 21), and without rotor limits."""
    u_star = np.array([vehicle.hover_thrust, 0.0, 0.0, 0.0])
    law = second.Law(gain, hover_point(vehicle), u_star, lambda _: TARGET)
    run = second.fly_sampled(vehicle, law, 1.0 / RATE_HZ, round(DURATION * RATE_HZ), steps=2)
    return step_of(run, offline.cable_tension(vehicle, run.states))


def on(*overrides: str) -> Vehicle:
    """The paper's vehicle with V.B's cable and these overrides."""
    return load_vehicle("paper", [*BASE, *overrides])


def swept(key: str, values: Sequence[float]) -> dict[float, Response]:
    """V.B for each value of a key of the vehicle: a study as `sitl sweep` draws it, simulated offline."""
    varied = Vary(key=key, values=tuple(values))
    study = Study(name=f"V.B over {key}", scenario="setpoint", designs=("paper",), vary=(varied,))
    plain = study.model_dump(mode="json")
    return {draw.inputs[key]: respond(drawn(plain, draw.inputs).told) for draw in draws(study)}


def settling_by_continuous_law(vehicle: Vehicle) -> float:
    """2 % settling time, s, of V.B with the paper's continuous gains, in the second simulation."""
    times = np.linspace(0.0, DURATION, round(DURATION * RATE_HZ) + 1)
    run = second.fly(vehicle, law(vehicle, lambda _: TARGET), times)
    error = np.linalg.norm(run.load - np.array(TARGET), axis=1)
    return settling_time(run.time, error, 0.02 * float(error[0])) or math.inf


def respond(vehicle: Vehicle, name: str = "paper") -> Response:
    """Simulate V.B for a vehicle, with a design made for it."""
    bounce, pendulum, _ = (pole for _, pole, _ in open_loop_modes(vehicle))
    model = with_integrator(linear_model(vehicle))
    gain = sampled_gain(sampled_model(model, paper_weights(), 1.0 / RATE_HZ))
    a, b = held(model, 1.0 / RATE_HZ)
    closed = np.log(np.linalg.eigvals(a - b @ gain.state).astype(complex)) * RATE_HZ
    run = offline.closed_loop(
        vehicle, design(name, vehicle, RATE_HZ), setpoint(TARGET, (0.0, 0.0, 0.0)), DURATION
    )
    return Response(
        bounce=bounce,
        pendulum=pendulum.imag,
        bounce_closed=nearest(closed, bounce),
        stretch=vehicle.hover_length - vehicle.cable.rest_length,
        **step_of(run, run.tension)._asdict(),
    )


def settling_by_fast_sampling(vehicle: Vehicle) -> float:
    """The same, in the plant with its rotor limits, the continuous gains held at FAST_HZ."""
    gain, _ = gains(vehicle, integral=True)
    held_gains = design("paper", vehicle, FAST_HZ)
    held_gains["state_gain"], held_gains["integral_gain"] = gain[:, :18], gain[:, 18:]
    path = setpoint(TARGET, (0.0, 0.0, 0.0))
    run = offline.closed_loop(vehicle, held_gains, path, DURATION, FAST_HZ)
    return step_of(run, run.tension).settling or math.inf
