"""The vehicle description: airframe, rotors, cable, load, start and surroundings, from one TOML file.

Both processes read the same description, so there is no second copy of any figure. Units are SI,
the world is ENU with z up, the body FLU; angles are in radians.
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from pydantic import field_validator, model_validator

from sitl_bridge.ids import ACTUATOR_CONTROLS
from sitl_bridge.vehicle.cable_law import cable_law
from sitl_bridge.vehicle.cable_materials import MaterialName
from sitl_bridge.vehicle.chain import MOST_SEGMENTS
from sitl_bridge.vehicle.law_weights import LawWeights
from sitl_bridge.vehicle.physics import PhysicsError, physics_faults
from sitl_bridge.vehicle.rotors import Rotor, rotor_effect
from sitl_bridge.vehicle.schema import (
    Angles,
    Arm,
    Inertia,
    Place,
    Rates,
    Section,
    Vector,
    Velocity,
    quantity,
)
from sitl_bridge.vehicle.sensors import Sensors


class Drag(Section):
    """Drag of a body in air, F = -(k_1 + k_2 |v|) v with v its velocity through the air."""

    linear: float = quantity("N s/m", "k_1, on each axis alike", 0.0, ge=0, le=1e3)
    quadratic: float = quantity("N s²/m²", "k_2, half of air density times drag area", 0.0, ge=0, le=1e3)


class Airframe(Section):
    mass: float = quantity("kg", "m_v, of the vehicle without load", gt=0, le=1e4)
    inertia: Inertia = quantity("kg m²", "principal moments of inertia, body axes")
    drag: Drag = Drag()
    legs: tuple[Arm, ...] = quantity(
        "m", "points that touch the ground, body FLU, from the centre of mass", (), max_length=8
    )


class Cable(Section):
    """The cable between vehicle and load: the paper's spring and damper, or a rope of some material."""

    stiffness: float = quantity("N/m", "k_a of eq. 9; progressive: follows from the material", gt=0, le=1e6)
    damping: float = quantity(
        "N s/m", "c_a of eq. 9; progressive: follows from the loss factor", 0.0, ge=0, le=1e5
    )
    rest_length: float = quantity("m", "l_0 of eq. 9", gt=0, le=1e3)
    model: Literal["two-way", "tension-only", "linear", "progressive", "chain"] = quantity(
        "-",
        "two-way also pushes below its rest length (the paper's); tension-only, or linear, never does; "
        "progressive is a rope of `material`, chain has segments with mass; see docs/cables.md",
        "tension-only",
    )
    material: MaterialName | None = quantity("-", "of a progressive cable; nylon unless told", None)
    diameter: float | None = quantity(
        "m",
        "of a progressive cable; unless told, it follows from breaking_tension or the load",
        None,
        ge=1e-5,
        le=0.5,
    )
    loss_factor: float | None = quantity(
        "-",
        "of a progressive cable: energy lost in a cycle over 2 pi times that stored; the material's",
        None,
        ge=1e-3,
        le=0.3,
    )
    breaking_tension: float | None = quantity(
        "N", "more than this, and the cable breaks", None, gt=0, le=1e12
    )

    segments: int = quantity("-", "of a chain", 8, ge=2, le=MOST_SEGMENTS)
    mass: float | None = quantity("kg", "of a chain; a tenth of the load's unless told", None, gt=0, le=1e3)
    drag: float = quantity(
        "N s²/m³",
        "of a chain, across a metre of it: half of air density times diameter times drag coefficient",
        0.0,
        ge=0,
        le=10,
    )

    @field_validator("model")
    @classmethod
    def _linear_is_tension_only(cls, model: str) -> str:
        return "tension-only" if model == "linear" else model

    @property
    def is_linear(self) -> bool:
        """Whether its force follows from `stiffness` and `damping`."""
        return self.model != "progressive"

    @property
    def is_chain(self) -> bool:
        """Whether it has segments, each a spring and damper, with mass."""
        return self.model == "chain"


class Gripper(Section):
    """A hook at the cable's end that lets the load go, and takes it up again."""

    reach: float = quantity("m", "from hook to load, up to which it is taken", 0.3, gt=0, le=10)
    release_time: float = quantity("s", "from the command until the load is free", 0.2, ge=0, le=10)


class Winch(Section):
    """A drum at the vehicle that changes the cable's rest length, driven by a motor with a brake.

    A cable whose described rest length is outside the range widens it.
    """

    min_length: float = quantity("m", "rest length of the cable, reeled in", gt=0, le=1e3)
    max_length: float = quantity("m", "rest length of the cable, paid out", gt=0, le=1e3)
    rate: float = quantity("m/s", "largest rate of the rest length", gt=0, le=20)
    time_constant: float = quantity("s", "first-order lag of the motor's speed", 0.1, ge=1e-3, le=10)
    stall_tension: float = quantity("N", "more than this, and it cannot reel in", gt=0, le=1e6)

    @model_validator(mode="after")
    def _has_a_range(self) -> Winch:
        if self.min_length >= self.max_length:
            raise ValueError(
                f"min_length = {self.min_length:g} m is not below max_length = {self.max_length:g} m; "
                "expected a range of lengths"
            )
        return self


class Load(Section):
    mass: float = quantity("kg", "m_p", gt=0, le=1e4)
    radius: float = quantity("m", "height of its centre above the ground that it lies on", 0.0, ge=0, le=10)
    drag: Drag = Drag()


class Ground(Section):
    """Level ground: compliant, with friction. Its stiffness follows from how far it yields to a resting
    body."""

    height: float = quantity("m", "world z of the surface", 0.0, ge=-1e5, le=1e5)
    sink: float = quantity("m", "how far a body at rest sinks in", 0.003, ge=1e-5, le=0.1)
    damping_ratio: float = quantity("-", "of a resting body's bounce", 0.7, ge=0, le=2)
    friction: float = quantity("-", "coefficient of friction under the legs", 0.6, ge=0, le=5)
    load_friction: float = quantity("-", "coefficient of friction under the load", 0.5, ge=0, le=5)


class Turbulence(Section):
    """Dryden turbulence at low altitude, MIL-F-8785C 3.7.3.4."""

    wind_at_6_m: float = quantity("m/s", "W_20: light 7.7, moderate 15.4, severe 23.1", gt=0, le=60)
    height: float = quantity("m", "height above ground that sets scale and intensity", 10.0, ge=3, le=300)
    airspeed: float = quantity("m/s", "V: how fast the frozen field drifts past", 5.0, ge=0.01, le=100)


class Gust(Section):
    """One 1-cosine gust: from nothing to the peak and back."""

    start: float = quantity("s", "from the start of the scenario", ge=0, le=1e7)
    duration: float = quantity("s", "from nothing to nothing", ge=1e-3, le=1e3)
    peak: Velocity = quantity("m/s", "air velocity at its height, world ENU, on top of the wind")
    acts_on: Literal["both", "vehicle", "load"] = quantity("-", "bodies that it meets", "both")


class Air(Section):
    wind: Velocity = quantity("m/s", "steady air velocity, world ENU", (0.0, 0.0, 0.0))
    turbulence: Turbulence | None = None
    gusts: tuple[Gust, ...] = ()


class Battery(Section):
    """A pack of lithium cells: voltage falls with the charge drawn and with the current."""

    cells: int = quantity("-", "in series", ge=1, le=100)
    capacity: float = quantity("A h", "charge of the full pack", ge=1e-3, le=1e4)
    resistance: float = quantity("ohm", "of the whole pack", ge=0, le=10)
    full_cell_voltage: float = quantity("V", "open circuit, full", 4.2, gt=0, le=10)
    empty_cell_voltage: float = quantity("V", "open circuit, empty", 3.5, gt=0, le=10)
    charge: float = quantity("-", "share of the capacity that is left at the start", 1.0, gt=0, le=1)
    drive_efficiency: float = quantity("-", "rotor shaft power over electric power", 0.75, gt=0, le=1)
    figure_of_merit: float = quantity("-", "ideal over shaft power, of rotors", 0.6, gt=0, le=1)
    avionics_power: float = quantity("W", "drawn by everything but the rotors", 5.0, ge=0, le=1e4)

    @model_validator(mode="after")
    def _falls(self) -> Battery:
        if self.empty_cell_voltage > self.full_cell_voltage:
            raise ValueError(
                f"empty_cell_voltage = {self.empty_cell_voltage:g} V is above "
                f"full_cell_voltage = {self.full_cell_voltage:g} V; expected a pack whose voltage falls"
            )
        return self


class Initial(Section):
    """Start state: hovering above the load at the equilibrium length, or both at rest on the ground.

    On the ground, positions give east and north only, and the vehicle stands at the origin unless told where.
    """

    start: Literal["hover", "ground"] = quantity(
        "-", "in the air, or on the legs with a slack cable", "hover"
    )
    load_position: Place = quantity("m", "world ENU", (0.0, 0.0, 0.0))
    vehicle_position: Place | None = quantity("m", "world ENU", None)
    load_velocity: Velocity = quantity("m/s", "world ENU", (0.0, 0.0, 0.0))
    vehicle_velocity: Velocity = quantity("m/s", "world ENU", (0.0, 0.0, 0.0))
    attitude: Angles = quantity("rad", "roll, pitch, yaw (about X, Y, Z; R = Rz Ry Rx)", (0.0, 0.0, 0.0))
    body_rates: Rates = quantity("rad/s", "p, q, r, body FLU", (0.0, 0.0, 0.0))


class Disturbance(Section):
    force_std: float = quantity("N", "standard deviation on each axis of a white force", 0.0, ge=0, le=1e4)
    hold_time: float = quantity("s", "each draw of the white force is held so long", 0.01, ge=1e-4, le=10)
    acts_on: Literal["both", "vehicle", "load"] = quantity("-", "bodies that the white force acts on", "both")


class Loop(Section):
    delay_ticks: int = quantity("ticks", "the plant applies each command so many ticks later", 0, ge=0, le=64)


class Estimation(Section):
    """What an estimator is to find out besides its usual state; see docs/estimator.md."""

    load_wind: bool = quantity("-", "a slowly varying force on the load, N", False)
    load_mass: bool = quantity(
        "-", "the load's mass, of which the description's is then a first guess", False
    )


class Home(Section):
    """Where the world's origin lies; Zurich by default, as PX4's own simulator has it."""

    latitude: float = quantity("deg", "WGS 84", 47.397742, ge=-89, le=89)
    longitude: float = quantity("deg", "WGS 84", 8.545594, ge=-180, le=180)
    altitude: float = quantity("m", "above mean sea level", 488.0, ge=-500, le=9000)


class Vehicle(Section):
    """One vehicle, complete: what the plant simulates and what the autopilot is designed for."""

    name: str = quantity("-", "short name", min_length=1)
    description: str = quantity("-", "one line, with where the figures come from", "")
    gravity: float = quantity("m/s²", "g", 9.81, ge=0.1, le=30)
    airframe: Airframe
    rotors: tuple[Rotor, ...] = quantity(
        "-", "in the order of the actuator controls", min_length=4, max_length=ACTUATOR_CONTROLS
    )
    cable: Cable
    load: Load
    gripper: Gripper | None = None
    winch: Winch | None = None
    initial: Initial = Initial()
    disturbance: Disturbance = Disturbance()
    ground: Ground | None = None
    air: Air = Air()
    battery: Battery | None = None
    sensors: Sensors = Sensors()
    loop: Loop = Loop()
    estimation: Estimation = Estimation()
    law: LawWeights = LawWeights()
    home: Home = Home()

    @model_validator(mode="after")
    def _is_possible(self) -> Vehicle:
        if faults := physics_faults(self, type(self).model_fields):
            raise PhysicsError(faults)
        return self

    @property
    def hover_thrust(self) -> float:
        """Total thrust that carries vehicle and load, N (eq. 19)."""
        return (self.airframe.mass + self.load.mass + self.cable_mass) * self.gravity

    @property
    def cable_mass(self) -> float:
        """kg; only a chain has any."""
        if not self.cable.is_chain:
            return 0.0
        return 0.1 * self.load.mass if self.cable.mass is None else self.cable.mass

    @property
    def node_count(self) -> int:
        """Nodes of a chain between vehicle and load; 0 for another cable."""
        return self.cable.segments - 1 if self.cable.is_chain else 0

    @property
    def hover_length(self) -> float:
        """Cable length at the hover equilibrium, m (eq. 17, corrected: l_0 + m_p g / k_a)."""
        if not self.cable.is_linear:
            strain = cable_law(self).strain(self.load.mass * self.gravity)
            return self.cable.rest_length * (1.0 + strain)
        pulling = self.load.mass + 0.5 * self.cable_mass  # on average, along a chain
        return self.cable.rest_length + pulling * self.gravity / self.cable.stiffness

    @property
    def initial_vehicle_position(self) -> Vector:
        """Where the vehicle starts, m, world ENU: as given, in equilibrium above the load, or on its legs."""
        if self.initial.start == "ground" and self.ground is not None:
            x, y, _ = self.initial.vehicle_position or (0.0, 0.0, 0.0)
            return (x, y, self.ground.height - min(leg[2] for leg in self.airframe.legs) - self.ground.sink)
        if self.initial.vehicle_position is not None:
            return self.initial.vehicle_position
        x, y, z = self.initial.load_position
        return (x, y, z + self.hover_length)

    @property
    def initial_load_position(self) -> Vector:
        """Where the load starts, m, world ENU: as given, or lying on the ground there."""
        x, y, z = self.initial.load_position
        if self.initial.start == "ground" and self.ground is not None:
            z = self.ground.height + self.load.radius - self.ground.sink
        return (x, y, z)

    @property
    def initial_length(self) -> float:
        """Distance from vehicle to load at the start, m."""
        return math.dist(self.initial_vehicle_position, self.initial_load_position)


def hover_rotor_speed(vehicle: Vehicle) -> float:
    """Rotor speed of hover for a vehicle with equal rotors, rad/s (eq. 24, corrected)."""
    total = sum(rotor.thrust_coefficient for rotor in vehicle.rotors)
    return math.sqrt(vehicle.hover_thrust / total)


def hover_rotor_speeds(vehicle: Vehicle) -> tuple[float, ...]:
    """Rotor speeds that carry vehicle and load without any moment, for any layout, rad/s."""
    effect = rotor_effect(vehicle.rotors) * [rotor.thrust_coefficient for rotor in vehicle.rotors]
    squared, *_ = np.linalg.lstsq(effect, np.array([vehicle.hover_thrust, 0.0, 0.0, 0.0]), rcond=None)
    return tuple(np.sqrt(np.maximum(squared, 0.0)).tolist())
