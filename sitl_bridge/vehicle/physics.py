"""A description judged as physics: what no body, cable or start can be. Pure functions.

Each check names the top-level keys that it reads. So the sound tables of a faulty file are judged, too, and
all faults are said at once. What a vehicle can or cannot fly is for the gain design to say.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Container, Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sitl_bridge.ids import ACTUATOR_CONTROLS, HOIST_CONTROLS
from sitl_bridge.vehicle.cable_law import cable_law, linear_cable
from sitl_bridge.vehicle.chain import chain_rate
from sitl_bridge.vehicle.rotors import full_thrust, rotor_effect

if TYPE_CHECKING:
    from sitl_bridge.vehicle.description import Drag, Vehicle

SMALLEST_SHARE = 1e-6
"""Of a rotor in the thrust without moments, against that of rotors that share it evenly."""
GYRATION = (1e-4, 50.0)
"""m: radii of gyration that bodies have, from a grain to an airliner."""
LONGEST_REACTION = 100.0
"""m: torque over thrust of a rotor. The paper's is 5 m, a real propeller's some hundredths."""
MOST_STRETCH = 100.0
"""Rest lengths by which the load's weight may stretch the cable; the paper's softest is 5."""
FASTEST_MODE = 25e3
"""1/s: a faster cable or ground contact is integrated in steps below 10 microseconds."""
FASTEST_DRAG = 1e3
"""1/s: drag that stops a body faster is not resolved by the integration's longest step, 1 ms."""
FASTEST_CHAIN = 1e5
"""1/s, of the modes within a chain: integrated in steps of 10 microseconds."""
LONGEST_START = 2.0
"""Cable lengths in hover: at most so long is the cable at the start."""


class PhysicsFault(NamedTuple):
    """One fault: the key that it is about, and a line that says what and what was expected."""

    location: tuple[str | int, ...]
    text: str


class PhysicsError(ValueError):
    """A description that physics does not allow."""

    def __init__(self, faults: list[PhysicsFault]) -> None:
        self.faults = faults
        super().__init__("; ".join(fault.text for fault in faults))


Found = Iterator[PhysicsFault]


def physics_faults(vehicle: Vehicle, sound: Container[str]) -> list[PhysicsFault]:
    """Every fault of a vehicle. sound: its top-level keys whose values may be read."""
    return [
        fault
        for check, keys in CHECKS.items()
        if all(key in sound for key in keys)
        for fault in check(vehicle)
    ]


def mode_rate(square: float, double: float) -> float:
    """Largest modulus, 1/s, of the roots of s² + double·s + square = 0, both coefficients not negative."""
    half = 0.5 * double
    if half * half > square:
        return half + math.sqrt(max(half * half - square, 0.0))
    return math.sqrt(square)


def _fault(key: str, text: str) -> PhysicsFault:
    """key: dotted, without the index of a vector's component where all of it is meant."""
    parts = key.split(".")
    return PhysicsFault(tuple(int(part) if part.isdecimal() else part for part in parts), text)


def _inertia(vehicle: Vehicle) -> Found:
    moments, mass = vehicle.airframe.inertia, vehicle.airframe.mass
    largest = int(np.argmax(moments))
    others = sum(moments) - moments[largest]
    if moments[largest] > others * (1.0 + 1e-9):
        yield _fault(
            f"airframe.inertia.{largest}",
            f"airframe.inertia.{largest} = {moments[largest]:g} kg m²: more than the other two together, "
            f"which no body has; expected up to {others:g} kg m²",
        )
    smallest = min(moments)
    low, high = (mass * radius**2 for radius in GYRATION)
    if smallest < low or moments[largest] > high:
        yield _fault(
            "airframe.inertia",
            f"airframe.inertia = {[*moments]} kg m²: not of a body of {mass:g} kg; "
            f"expected {low:.2g} to {high:.2g} kg m²",
        )


def _thrust(vehicle: Vehicle) -> Found:
    available = full_thrust(vehicle.rotors)
    if available <= vehicle.hover_thrust:
        mass = available / vehicle.gravity - vehicle.airframe.mass
        lighter = f" or load.mass below {mass:.3g} kg" if mass > 0.0 else ""
        yield _fault(
            "rotors",
            f"rotors give {available:.4g} N at full speed, hovering takes {vehicle.hover_thrust:.4g} N; "
            f"expected more thrust{lighter}",
        )


def _steering(vehicle: Vehicle) -> Found:
    for index, rotor in enumerate(vehicle.rotors):
        if rotor.torque_coefficient > LONGEST_REACTION * rotor.thrust_coefficient:
            yield _fault(
                f"rotors.{index}.torque_coefficient",
                f"rotors.{index}.torque_coefficient = {rotor.torque_coefficient:g} N m s²/rad²: no rotor "
                "has so much torque for its thrust; expected up to "
                f"{LONGEST_REACTION * rotor.thrust_coefficient:.3g} N m s²/rad²",
            )
            return
    effect = rotor_effect(vehicle.rotors)
    if np.linalg.matrix_rank(effect) < len(effect):
        yield _fault(
            "rotors",
            "rotors: they cannot give thrust and all three moments independently; "
            "expected hubs on all sides, some cw and some ccw, with torque_coefficient > 0",
        )
        return
    share = np.linalg.pinv(effect)[:, 0]
    idle = [str(i) for i in np.flatnonzero(share <= SMALLEST_SHARE / len(share))]
    if idle:
        yield _fault(
            "rotors",
            f"rotors: thrust without moments leaves nothing to {', '.join(idle)}; "
            "expected hubs on all sides, and as much cw as ccw",
        )


def _hoist(vehicle: Vehicle) -> Found:
    if vehicle.gripper is None and vehicle.winch is None:
        return
    most = ACTUATOR_CONTROLS - HOIST_CONTROLS
    if len(vehicle.rotors) > most:
        yield _fault(
            "rotors",
            f"rotors: {len(vehicle.rotors)} leave no actuator controls to gripper and winch; "
            f"expected up to {most}",
        )


def _cable(vehicle: Vehicle) -> Found:
    cable, weight = vehicle.cable, vehicle.load.mass * vehicle.gravity
    if not cable.is_linear:
        yield from _rope(vehicle, weight)
        return
    for key in ("material", "diameter", "loss_factor"):
        if getattr(cable, key) is not None:
            yield _fault(
                f"cable.{key}",
                f"cable.{key} = {getattr(cable, key)}: goes with cable.model = 'progressive' only; "
                f"cable.model is '{cable.model}'",
            )
    if cable.breaking_tension is not None and cable.breaking_tension <= weight:
        yield _fault(
            "cable.breaking_tension",
            f"cable.breaking_tension = {cable.breaking_tension:g} N: the load weighs {weight:.4g} N, "
            f"and the cable breaks under it; expected more than {weight:.4g} N",
        )
    if weight / cable.stiffness > MOST_STRETCH * cable.rest_length:
        least = weight / (MOST_STRETCH * cable.rest_length)
        yield _fault(
            "cable.stiffness",
            f"cable.stiffness = {cable.stiffness:g} N/m: the load stretches the cable by "
            f"{weight / cable.stiffness:.3g} m; expected {least:.3g} N/m or more",
        )


def _rope(vehicle: Vehicle, weight: float) -> Found:
    """A progressive cable: it carries the load."""
    cable, law = vehicle.cable, cable_law(vehicle)
    bears = min(law.breaking_load, cable.breaking_tension or math.inf)
    if bears <= weight:
        key = "breaking_tension" if cable.diameter is None or bears < law.breaking_load else "diameter"
        value = f"{cable.diameter:g} m" if key == "diameter" else f"{cable.breaking_tension:g} N"
        yield _fault(
            f"cable.{key}",
            f"cable.{key} = {value}: the cable bears {bears:.4g} N and the load weighs {weight:.4g} N; "
            "expected a stronger cable",
        )


def _chain(vehicle: Vehicle) -> Found:
    rate = chain_rate(vehicle)
    if rate > FASTEST_CHAIN:
        yield _fault(
            "cable.segments",
            f"cable.segments = {vehicle.cable.segments}: they move at {rate:.2g} 1/s, too fast to simulate; "
            f"expected up to {FASTEST_CHAIN:g} 1/s: fewer, heavier, softer or less damped ones",
        )


def _cable_rate(vehicle: Vehicle) -> Found:
    cable = linear_cable(vehicle)
    lighter, heavier = sorted((vehicle.airframe.mass, vehicle.load.mass))
    reduced = lighter / (1.0 + lighter / heavier)
    rate = mode_rate(cable.stiffness / reduced, cable.damping / reduced)
    if rate <= FASTEST_MODE:
        return
    if not vehicle.cable.is_linear:
        yield _fault(
            "cable",
            f"cable: vehicle and load move on it at {rate:.2g} 1/s, too fast to simulate; "
            "expected a thinner or longer cable, or heavier bodies",
        )
        return
    stiffest, most_damped = FASTEST_MODE**2 * reduced, FASTEST_MODE * reduced
    if cable.stiffness > stiffest:
        key, value, limit, unit = "stiffness", cable.stiffness, stiffest, "N/m"
    else:
        key, value, limit, unit = "damping", cable.damping, most_damped, "N s/m"
    yield _fault(
        f"cable.{key}",
        f"cable.{key} = {value:g} {unit}: vehicle and load move on it at {rate:.2g} 1/s, too fast to "
        f"simulate; expected up to {limit:.2g} {unit}, or heavier bodies",
    )


def _drag(vehicle: Vehicle) -> Found:
    yield from _drag_of("airframe", vehicle.airframe.drag, vehicle.airframe.mass)


def _drag_of_load(vehicle: Vehicle) -> Found:
    yield from _drag_of("load", vehicle.load.drag, vehicle.load.mass)


def _drag_of(table: str, drag: Drag, mass: float) -> Found:
    for key, value, unit in (
        ("linear", drag.linear, "N s/m"),
        ("quadratic", drag.quadratic, "N s²/m²"),
    ):
        most = FASTEST_DRAG * mass
        if value > most:
            yield _fault(
                f"{table}.drag.{key}",
                f"{table}.drag.{key} = {value:g} {unit}: stops {mass:g} kg within a millisecond; "
                f"expected up to {most:.3g} {unit}",
            )


def _legs(vehicle: Vehicle) -> Found:
    if vehicle.ground is None:
        return
    legs = vehicle.airframe.legs
    if len(legs) < 3:
        yield _fault(
            "airframe.legs", "airframe.legs: on ground a vehicle needs three or more; expected points in m"
        )
        return
    if min(leg[2] for leg in legs) >= 0.0:
        yield _fault(
            "airframe.legs", "airframe.legs: none is below the centre of mass; expected a negative z of each"
        )
    azimuths = sorted(math.atan2(leg[1], leg[0]) for leg in legs)
    gaps = [b - a for a, b in zip(azimuths, [*azimuths[1:], azimuths[0] + 2.0 * math.pi], strict=True)]
    if max(gaps) >= math.pi:
        yield _fault(
            "airframe.legs",
            "airframe.legs: all on one side of the centre of mass, the vehicle falls over; "
            "expected legs on all sides",
        )


def _turning_on_legs(vehicle: Vehicle) -> Found:
    """On legs that reach far a body of little inertia turns faster than can be simulated."""
    ground, airframe = vehicle.ground, vehicle.airframe
    if ground is None or not airframe.legs or next(_inertia(vehicle), None) is not None:
        return
    heave = vehicle.gravity / ground.sink
    ratio = 2.0 * ground.damping_ratio / math.sqrt(heave)  # damping over stiffness, s
    for axis, moment in enumerate(airframe.inertia):
        squares = [sum(part * part for i, part in enumerate(leg) if i != axis) for leg in airframe.legs]
        square = heave * airframe.mass * sum(squares) / len(squares) / moment
        rate = mode_rate(square, square * ratio)
        if rate > FASTEST_MODE:
            yield _fault(
                "airframe.legs",
                f"airframe.legs: up to {math.sqrt(max(squares)):.3g} m from an axis of {moment:g} kg m², the "
                f"vehicle turns on them at {rate:.2g} 1/s, too fast to simulate; expected shorter legs",
            )
            return


def _ground(vehicle: Vehicle) -> Found:
    """Bodies that start in hover are above the ground."""
    ground, initial = vehicle.ground, vehicle.initial
    if initial.start == "ground":
        if ground is None:
            yield _fault("initial.start", "initial.start = 'ground': there is no [ground] table")
        return
    if ground is None:
        return
    bodies = (initial.load_position, initial.vehicle_position or initial.load_position)
    depth = ground.height - min(position[2] for position in bodies)
    if depth > 0.0:
        yield _fault("initial", f"initial: hovering begins {depth:.4g} m below ground.height; expected above")
        return
    legs = -min((leg[2] for leg in vehicle.airframe.legs), default=0.0)
    for key, height, reach in (
        ("load_position", initial.load_position[2], vehicle.load.radius),
        ("vehicle_position", vehicle.initial_vehicle_position[2], legs),
    ):
        lowest = ground.height + reach - ground.sink
        if height < lowest:
            yield _fault(
                f"initial.{key}.2",
                f"initial.{key}.2 = {height:.4g} m: {ground.height + reach - height:.3g} m of it would be in "
                f"the ground; expected {ground.height + reach:.4g} m or more",
            )


def _start(vehicle: Vehicle) -> Found:
    """The cable at the start: neither torn nor longer than it can be."""
    initial, cable = vehicle.initial, linear_cable(vehicle)
    if initial.vehicle_position == initial.load_position:
        yield _fault(
            "initial.vehicle_position",
            "initial.vehicle_position equals initial.load_position: no cable direction",
        )
        return
    if initial.start == "ground" and vehicle.ground is not None and not vehicle.airframe.legs:
        return  # `_legs` says so; without them the vehicle has no place on the ground
    length = vehicle.initial_length
    if initial.start == "ground":
        if vehicle.ground is not None and length > cable.rest_length:
            yield _fault(
                "initial.load_position",
                f"initial: the load lies {length:.4g} m from the vehicle, "
                f"further than cable.rest_length = {cable.rest_length:.4g} m; expected on a slack cable",
            )
        return
    tension, given = cable.stiffness * (length - cable.rest_length), full_thrust(vehicle.rotors)
    strongest = min(given, cable.breaking_tension or math.inf)
    longest = min(cable.rest_length + strongest / cable.stiffness, LONGEST_START * vehicle.hover_length)
    if initial.vehicle_position is None or length <= longest:
        return
    why = f"cable.rest_length is {cable.rest_length:g} m"
    if tension > given:
        why = f"the cable pulls with {tension:.4g} N there, and the rotors give {given:.4g} N"
    elif cable.breaking_tension is not None and tension > cable.breaking_tension:
        why = f"the cable pulls with {tension:.4g} N there, and breaks at {cable.breaking_tension:g} N"
    yield _fault(
        "initial.vehicle_position",
        f"initial.vehicle_position: {length:.4g} m from the load: {why}; expected up to {longest:.4g} m",
    )


CHECKS: dict[Callable[[Vehicle], Found], tuple[str, ...]] = {
    _inertia: ("airframe",),
    _thrust: ("airframe", "cable", "load", "rotors", "gravity"),
    _steering: ("rotors",),
    _hoist: ("gripper", "rotors", "winch"),
    _cable: ("cable", "load", "gravity"),
    _cable_rate: ("cable", "load", "airframe", "gravity"),
    _chain: ("cable", "load"),
    _drag: ("airframe",),
    _drag_of_load: ("load",),
    _legs: ("airframe", "ground"),
    _turning_on_legs: ("airframe", "ground", "gravity"),
    _ground: ("airframe", "cable", "load", "gravity", "ground", "initial"),
    _start: ("airframe", "cable", "load", "gravity", "ground", "initial", "rotors"),
}
"""Every check, with the top-level keys that it reads."""
