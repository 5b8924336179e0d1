"""What is flown beyond the paper: laws, plants other than told, cables; and the figures to reach."""

from __future__ import annotations

from typing import NamedTuple

from sitl.studies.paper.analysis.step import LENGTHS
from sitl.studies.paper.flights import Request
from sitl.studies.paper.sections.position import DURATION

LAWS = ("paper-lqr", "paper", "geometric", "default")
STEP = 14.0
"""s, of a flight to V.B's set-point"""
CIRCLE = 20.0
"""s, of a flight round V.C's circle"""
ON_CIRCLE = 12.0
"""s, from which on the circle is judged"""
EFFORT = 10.0
"""s, over which the rotors' effort is judged"""
NO_FIGURE = "for comparison: there is no figure to reach"
SOURCE = "figure to reach"


class Plant(NamedTuple):
    """What is flown, other than what the law is told."""

    words: str
    overrides: tuple[str, ...]


PLANTS = {
    "described": Plant("as described", ()),
    "heavy": Plant(
        "load +10 %, stiffness −20 %, damping −50 %",
        ("load.mass=11", "cable.stiffness=80", "cable.damping=5"),
    ),
    "light": Plant(
        "load −10 %, stiffness +20 %, damping −50 %",
        ("load.mass=9", "cable.stiffness=120", "cable.damping=5"),
    ),
}
CABLES = {
    "nylon": ("cable.model=progressive", "cable.material=nylon"),
    "polyester": ("cable.model=progressive", "cable.material=polyester"),
    "dyneema": ("cable.model=progressive", "cable.material=dyneema"),
    "rubber": ("cable.model=progressive", "cable.material=rubber"),
    "tension-only": ("cable.model=tension-only",),
    "chain": ("cable.model=chain",),
}
TO_REACH: dict[str, dict[str, tuple[float, float | None, float]]] = {
    "described": {"1": (2.0, 2.3, 1.0), "10": (3.0, 3.4, 1.0)},
    "heavy": {"1": (2.8, None, 5.0), "10": (3.6, None, 5.0)},
    "light": {"1": (2.8, None, 5.0), "10": (3.6, None, 5.0)},
}
"""V.B by l₀: 2 % (s), 1 cm (s), overshoot (%), of the default design and the nonlinear one."""
CIRCLE_TO_REACH = {"described": 1e-3, "heavy": 1e-2, "light": 1e-2}
"""m, rms"""


NOISY, NOISE_FROM = 40.0, 8.0
"""s, of a hover under noise, and from when it is judged"""
NOISE = ("disturbance.force_std=5", "disturbance.acts_on=load")
NOISE_TO_REACH = {"1": 0.017, "10": 0.03}
"""m, rms"""


def laws(quick: bool) -> tuple[str, ...]:
    """Those that fly; all are in the tables of the linear loop."""
    return LAWS[1:] if quick else LAWS


def plants(quick: bool) -> tuple[str, ...]:
    """Those that fly."""
    return ("described", "heavy") if quick else tuple(PLANTS)


def lengths(plant: str, quick: bool) -> tuple[str, ...]:
    """The cables that fly with a plant."""
    return LENGTHS[1:] if quick and plant != "described" else LENGTHS


def cables(quick: bool) -> tuple[str, ...]:
    """Those that fly."""
    return ("nylon",) if quick else tuple(CABLES)


def noisy_lengths(quick: bool) -> tuple[str, ...]:
    """The cables that fly under noise."""
    return LENGTHS[1:] if quick else LENGTHS


def step_request(law: str, length: str, plant: str) -> Request:
    """A flight to V.B's set-point."""
    known = law == "paper" and plant == "described"  # figure 10 has it
    duration = DURATION if known else STEP
    return Request("setpoint", law, duration, (f"cable.rest_length={length}",), PLANTS[plant].overrides)


def circle_request(law: str, length: str, plant: str) -> Request:
    """A flight round V.C's circle."""
    return Request("circle", law, CIRCLE, (f"cable.rest_length={length}",), PLANTS[plant].overrides)


def noise_request(law: str, length: str) -> Request:
    """A hover under V.A's noise of 5 N."""
    return Request("hover", law, NOISY, (f"cable.rest_length={length}",), NOISE, seed=1)


def cable_request(cable: str) -> Request:
    """V.B by the default design on another kind of cable, 10 m long."""
    return Request("setpoint", "default", STEP, CABLES[cable])


def flown_laws(plant: str, quick: bool) -> tuple[str, ...]:
    """The laws that fly with a plant: the paper's with what they are told."""
    return laws(quick) if plant == "described" else LAWS[1:] if not quick else LAWS[2:]


def requests(quick: bool) -> list[Request]:
    """Everything that flies here."""
    out = []
    for plant in plants(quick):
        for length in lengths(plant, quick):
            out += [step_request(law, length, plant) for law in flown_laws(plant, quick)]
            out += [circle_request(law, length, plant) for law in LAWS[2:]]
    out += [noise_request(law, length) for length in noisy_lengths(quick) for law in LAWS[2:]]
    return [*out, *(cable_request(cable) for cable in cables(quick))]
