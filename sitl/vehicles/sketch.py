"""A vehicle in a few figures, as a data sheet has them, and the description that follows. Pure functions.

Rules of thumb, each with the vehicles that it was read from (`iris`, `heavy`), are constants of this module
and in docs/your-own-vehicle.md. A rule only fills in what is not given.
"""

from __future__ import annotations

import math
from typing import Any, Literal

from pydantic import model_validator

from sitl_bridge.vehicle.schema import Section, quantity

GRAVITY = 9.81
MASS_AT_HUBS = 0.4
"""Share of the mass that is in motors, rotors and arms, as points at the hubs."""
BODY_RADIUS = 0.3
"""Arms: radius of the ball that the rest of the mass is."""
TIP_SPEED = 140.0
"""m/s, of a blade at full speed; iris 141, heavy 145."""
DISC_GAP = 0.75
"""Diameter of the discs over the distance of neighbouring hubs; iris 0.66, heavy 0.84."""
REACTION = 0.08
"""Torque over thrust, in diameters: power coefficient 0.05 and thrust coefficient 0.1 of a propeller."""
LAG = 0.075
"""s per m of diameter; iris 0.078, heavy 0.072."""
LOAD_DENSITY = 570.0
"""kg/m³; the load of iris."""
AIR_DENSITY, SPHERE_DRAG = 1.225, 0.47
VEHICLE_DRAG = (0.17, 0.023)
"""N s/m per kg^(3/4), and N s²/m² per kg^(2/3); iris and heavy within a third."""
BREAKING = 10.0
"""Times the load's weight."""
LOOSE = 0.7
"""Of the cable's length, from the vehicle to the load at the start."""

Content = dict[str, Any]


class Sketch(Section):
    """What a person knows of a vehicle. Ranges are those in which the default law flies it."""

    name: str = quantity("-", "short name", "mine", min_length=1)
    mass: float = quantity("kg", "of the vehicle with its battery, without load", ge=0.2, le=60)
    rotors: Literal[4, 6, 8] = quantity("-", "number of them, on a circle: 4, 6 or 8", 4)
    arm: float | None = quantity(
        "m", "from the centre to each hub (default: from the mass)", None, ge=0.05, le=2
    )
    thrust_to_weight: float | None = quantity(
        "-", "thrust at full speed over the weight of vehicle and load (default: 2)", None, ge=1.4, le=6
    )
    hover_throttle: float | None = quantity(
        "-", "or: throttle in hover with the load, 1 / sqrt(thrust-to-weight)", None, ge=0.4, le=0.85
    )
    max_thrust: float | None = quantity("N", "or: thrust of all rotors at full speed", None, ge=1, le=6000)
    load_mass: float | None = quantity("kg", "(default: a fifth of the mass)", None, ge=0.01, le=60)
    cable_length: float | None = quantity("m", "unstretched (default: six arms)", None, ge=0.5, le=50)
    stretch: float | None = quantity(
        "m", "by which the hanging load stretches it, or in percent (default: 3%)", None, gt=0, le=30
    )
    stretch_share: float | None = quantity("-", "the same, of its length", None, ge=0.001, le=0.6)
    cable_damping: float = quantity("-", "damping ratio of the load's bounce", 0.05, ge=0.01, le=1)
    rotor_diameter: float | None = quantity("m", "(default: from the hubs)", None, ge=0.05, le=2)
    rotor_lag: float | None = quantity("s", "time constant (default: from the diameter)", None, ge=0, le=0.1)
    sensors: str = quantity("-", "preset of the sensors", "consumer")

    @model_validator(mode="after")
    def _one_thrust(self) -> Sketch:
        given = [
            f"{name} = {value:g}"
            for name in ("thrust_to_weight", "hover_throttle", "max_thrust")
            if (value := getattr(self, name)) is not None
        ]
        if len(given) > 1:
            raise ValueError(f"{' and '.join(given)}: each gives the thrust; expected one of them")
        if self.stretch is not None and self.stretch_share is not None:
            raise ValueError("stretch and stretch_share give the same value; expected one of them")
        return self

    @model_validator(mode="after")
    def _suits(self) -> Sketch:
        ratio, share = self.payload / self.mass, self.stretched / self.length
        if not 0.0199999 <= ratio <= 1.500001:  # a mass times a ratio is rounded
            raise ValueError(
                f"load_mass = {self.payload:g} kg: {ratio:.2g} of the vehicle's mass; "
                f"expected {0.02 * self.mass:.2g} to {1.5 * self.mass:.2g} kg"
            )
        if self.stretch is not None and not 0.001 <= share <= 0.6:
            raise ValueError(
                f"stretch = {self.stretched:g} m: {100.0 * share:.2g} % of the cable; "
                f"expected {0.001 * self.length:.2g} to {0.6 * self.length:.2g} m"
            )
        if self.max_thrust is not None and not 1.4 <= self.thrust / self.weight <= 6.0:
            raise ValueError(
                f"max_thrust = {self.thrust:g} N: {self.thrust / self.weight:.2g} of the weight of vehicle "
                f"and load; expected {1.4 * self.weight:.3g} to {6.0 * self.weight:.3g} N"
            )
        return self

    @property
    def radius(self) -> float:
        """m, from the centre to each hub; a quarter of a metre at 1.5 kg, as `iris`."""
        return 0.22 * math.cbrt(self.mass) if self.arm is None else self.arm

    @property
    def payload(self) -> float:
        """kg, of the load."""
        return 0.2 * self.mass if self.load_mass is None else self.load_mass

    @property
    def weight(self) -> float:
        """N, of vehicle and load."""
        return (self.mass + self.payload) * GRAVITY

    @property
    def thrust(self) -> float:
        """N, of all rotors at full speed."""
        if self.max_thrust is not None:
            return self.max_thrust
        ratio = 2.0 if self.thrust_to_weight is None else self.thrust_to_weight
        return self.weight * (ratio if self.hover_throttle is None else self.hover_throttle**-2)

    @property
    def length(self) -> float:
        """m, of the cable, unstretched."""
        return max(0.5, 6.0 * self.radius) if self.cable_length is None else self.cable_length

    @property
    def stretched(self) -> float:
        """m, by which the hanging load stretches the cable."""
        share = 0.03 if self.stretch_share is None else self.stretch_share
        return share * self.length if self.stretch is None else self.stretch


def described(sketch: Sketch) -> Content:
    """The content of the description's TOML."""
    payload, ball = sketch.payload, _load_radius(sketch.payload)
    stiffness = payload * GRAVITY / sketch.stretched
    reduced = sketch.mass * payload / (sketch.mass + payload)
    legs = min(0.4 * sketch.radius, 0.3 * sketch.length)
    above = legs - ball
    aside = math.sqrt(max(0.0, (LOOSE * sketch.length) ** 2 - above**2))
    linear, quadratic = VEHICLE_DRAG
    return {
        "name": sketch.name,
        "description": f"{sketch.rotors} rotors, {sketch.mass:g} kg, {payload:g} kg on {sketch.length:.3g} m",
        "airframe": {
            "mass": sketch.mass,
            "inertia": [_short(moment) for moment in inertia(sketch.mass, sketch.radius)],
            "legs": [
                [_short(x * sketch.radius), _short(y * sketch.radius), _short(-legs)]
                for x, y in ((0.5, 0.5), (-0.5, 0.5), (-0.5, -0.5), (0.5, -0.5))
            ],
            "drag": {
                "linear": _short(linear * sketch.mass**0.75),
                "quadratic": _short(quadratic * sketch.mass ** (2.0 / 3.0)),
            },
        },
        "cable": {
            "stiffness": _short(stiffness),
            "damping": _short(2.0 * sketch.cable_damping * math.sqrt(stiffness * reduced)),
            "rest_length": _short(sketch.length),
            "breaking_tension": _short(BREAKING * payload * GRAVITY),
        },
        "load": {
            "mass": payload,
            "radius": _short(ball),
            "drag": {"quadratic": _short(0.5 * AIR_DENSITY * SPHERE_DRAG * math.pi * ball**2)},
        },
        "rotors": _rotors(sketch),
        "sensors": {"preset": sketch.sensors},
        "ground": {},
        "initial": {"start": "ground", "load_position": [_short(aside), 0.0, _short(ball + 1.0)]},
    }


def inertia(mass: float, arm: float) -> tuple[float, float, float]:
    """kg m²: of a ball with points of mass on a ring about it, at the hubs."""
    ring = MASS_AT_HUBS * mass * arm**2
    ball = 0.4 * (1.0 - MASS_AT_HUBS) * mass * (BODY_RADIUS * arm) ** 2
    return 0.5 * ring + ball, 0.5 * ring + ball, ring + ball


def _rotors(sketch: Sketch) -> list[Content]:
    """On a circle, the first half a pitch to the left of straight ahead; directions alternate."""
    count, arm = sketch.rotors, sketch.radius
    apart = 2.0 * arm * math.sin(math.pi / count)
    diameter = DISC_GAP * apart if sketch.rotor_diameter is None else sketch.rotor_diameter
    lag = LAG * diameter if sketch.rotor_lag is None else sketch.rotor_lag
    fastest = 2.0 * TIP_SPEED / diameter
    coefficient = sketch.thrust / count / fastest**2
    return [
        {
            "position": [_short(arm * math.cos(angle)), _short(arm * math.sin(angle)), 0.0],
            "direction": "ccw" if index % 2 == 0 else "cw",
            "thrust_coefficient": _short(coefficient, 6),
            "torque_coefficient": _short(REACTION * diameter * coefficient, 6),
            "max_speed": _short(fastest, 6),
            "diameter": _short(diameter),
            "time_constant": _short(lag),
        }
        for index, angle in enumerate(2.0 * math.pi * (k + 0.5) / count for k in range(count))
    ]


def _load_radius(mass: float) -> float:
    """m, of a ball of `LOAD_DENSITY`."""
    return math.cbrt(0.75 * mass / (math.pi * LOAD_DENSITY))


def _short(value: float, digits: int = 5) -> float:
    """A value as a file has it."""
    return float(f"{value:.{digits}g}")
