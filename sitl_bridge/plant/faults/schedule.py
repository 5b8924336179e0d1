"""Faults as data: what fails, when, for how long; from a scenario's table or from MAV_CMD_INJECT_FAILURE.

    [[faults.sensor]]
    sensor = "magnetometer"
    failure = "stuck"
    at = 10.0
    duration = 5.0          # absent: for good

A table of faults becomes a timeline of actions, and a command becomes actions at once; whoever simulates
takes them in order. Nothing here has state. Gusts join the wind, link faults go to `link_faults`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal, NamedTuple, Protocol

from sitl_bridge.plant.sensors.instruments import GARBAGE, LOST, OFF, STUCK, WORKS, WRONG
from sitl_bridge.vehicle.description import Gust, Vehicle
from sitl_bridge.vehicle.files import DescriptionError
from sitl_bridge.vehicle.schema import Section, quantity

DOING = {
    WORKS: "works again",
    OFF: "is off",
    STUCK: "is stuck",
    GARBAGE: "reads garbage",
    WRONG: "is wrong",
    LOST: "is lost",
}
"""What a sensor does, in words."""
FAILURES = {"off": OFF, "stuck": STUCK, "garbage": GARBAGE, "wrong": WRONG, "lost": LOST}


class Timed(Section):
    at: float = quantity("s", "from the start of the scenario", ge=0, le=1e7)
    duration: float | None = quantity("s", "how long; absent: for good", None, gt=0, le=1e7)


class SensorFault(Timed):
    """A sensor is off (silent), stuck (repeats itself), reads garbage or is wrong by an offset; GPS also:
    lost."""

    sensor: Literal["accelerometer", "gyroscope", "magnetometer", "barometer", "gps", "tracker"] = quantity(
        "-", "which"
    )
    failure: Literal["off", "stuck", "garbage", "wrong", "lost"] = quantity("-", "how; lost is for gps only")


class RotorFault(Timed):
    rotor: int = quantity("-", "number of the rotor, from 1", ge=1, le=16)
    thrust: float = quantity("-", "share of its thrust that is left; 0: off", 0.0, ge=0, le=1)


class CableFault(Section):
    """The cable snaps, or the vehicle lets go of it: nothing joins vehicle and load from then on."""

    at: float = quantity("s", "from the start of the scenario", ge=0, le=1e7)


class LoadFault(Timed):
    mass: float = quantity("kg", "of the load from then on", ge=1e-3, le=1e4)


class LinkFault(Timed):
    """What happens to datagrams of the HIL link; a stall holds them all back until it is over."""

    failure: Literal["drop", "delay", "jitter", "duplicate", "reorder", "stall"] = quantity("-", "how")
    direction: Literal["both", "to_autopilot", "to_plant"] = quantity("-", "which way", "both")
    share: float = quantity("-", "probability for each datagram", 1.0, gt=0, le=1)
    delay: float = quantity("s", "delay; jitter: largest; duplicate, reorder: lag", 0.02, gt=0, le=10)


class Faults(Section):
    """A scenario's faults, a list for each kind."""

    sensor: tuple[SensorFault, ...] = ()
    rotor: tuple[RotorFault, ...] = ()
    cable: tuple[CableFault, ...] = ()
    load: tuple[LoadFault, ...] = ()
    gust: tuple[Gust, ...] = ()
    link: tuple[LinkFault, ...] = ()


class Faulty(Protocol):
    """What faults happen to."""

    def set_sensor(self, name: str, doing: int) -> None:
        """Let a sensor work or fail."""

    def set_rotor(self, index: int, thrust: float) -> None:
        """Leave a rotor (from 0) a share of its thrust."""

    def release_cable(self) -> None:
        """Join vehicle and load no more."""

    def set_load_mass(self, mass: float | None) -> None:
        """Change the load's mass, kg; None: as described."""


class SetSensor(NamedTuple):
    """A sensor fails, or works again."""

    sensor: str
    doing: int

    def __str__(self) -> str:
        return f"{self.sensor} {DOING[self.doing]}"

    def apply(self, to: Faulty) -> None:
        """Let it happen."""
        to.set_sensor(self.sensor, self.doing)


class SetRotor(NamedTuple):
    """A rotor (from 0) keeps this share of its thrust."""

    rotor: int
    thrust: float

    def __str__(self) -> str:
        return f"rotor {self.rotor + 1} has {100.0 * self.thrust:g} % of its thrust"

    def apply(self, to: Faulty) -> None:
        """Let it happen."""
        to.set_rotor(self.rotor, self.thrust)


class ReleaseCable(NamedTuple):
    """The cable snaps or lets go."""

    def __str__(self) -> str:
        return "the cable lets go of the load"

    def apply(self, to: Faulty) -> None:
        """Let it happen."""
        to.release_cable()


class SetLoadMass(NamedTuple):
    """The load has this mass, kg; None: as described."""

    mass: float | None

    def __str__(self) -> str:
        return "the load has its own mass again" if self.mass is None else f"the load weighs {self.mass:g} kg"

    def apply(self, to: Faulty) -> None:
        """Let it happen."""
        to.set_load_mass(self.mass)


Action = SetSensor | SetRotor | ReleaseCable | SetLoadMass


class Due(NamedTuple):
    """An action and its scenario time, s."""

    time: float
    action: Action


def timeline(faults: Faults) -> list[Due]:
    """What happens to the world when, in order; the end of a fault is an action too.

    Of faults of one thing that overlap, the last to begin counts, and when it ends, what it has covered.
    """
    found = [Due(cable.at, ReleaseCable()) for cable in faults.cable]
    for name in sorted({fault.sensor for fault in faults.sensor}):
        of_sensor = [fault for fault in faults.sensor if fault.sensor == name]
        doing = [SetSensor(name, FAILURES[fault.failure]) for fault in of_sensor]
        found += _course(of_sensor, doing, SetSensor(name, WORKS))
    for number in sorted({fault.rotor for fault in faults.rotor}):
        of_rotor = [fault for fault in faults.rotor if fault.rotor == number]
        thrust = [SetRotor(number - 1, fault.thrust) for fault in of_rotor]
        found += _course(of_rotor, thrust, SetRotor(number - 1, 1.0))
    found += _course(faults.load, [SetLoadMass(fault.mass) for fault in faults.load], SetLoadMass(None))
    return sorted(found, key=lambda due: due.time)


def lightest_load(faults: Faults) -> float | None:
    """The smallest mass, kg, that a fault gives the load; None: none does."""
    return min((fault.mass for fault in faults.load), default=None)


def checked(faults: Faults, vehicle: Vehicle) -> Faults:
    """The faults, if this vehicle can have them; raises DescriptionError with a line for each other."""
    count = len(vehicle.rotors)
    found = [
        f"faults.rotor.{index}.rotor = {fault.rotor}: {vehicle.name} has rotors 1 to {count}"
        for index, fault in enumerate(faults.rotor)
        if fault.rotor > count
    ]
    found += [
        f"faults.sensor.{index}.failure = 'lost': for gps only"
        for index, fault in enumerate(faults.sensor)
        if fault.failure == "lost" and fault.sensor != "gps"
    ]
    found += [
        f"faults.sensor.{index}.sensor = 'tracker': {vehicle.name} has no [sensors.tracker]"
        for index, fault in enumerate(faults.sensor)
        if fault.sensor == "tracker" and vehicle.sensors.tracker is None
    ]
    if found:
        raise DescriptionError("faults", found)
    return faults


def with_gusts(vehicle: Vehicle, faults: Faults) -> Vehicle:
    """The vehicle with the scenario's gusts in its air."""
    if not faults.gust:
        return vehicle
    air = vehicle.air.model_copy(update={"gusts": (*vehicle.air.gusts, *faults.gust)})
    return vehicle.model_copy(update={"air": air})


def _course(faults: Sequence[Timed], actions: Sequence[Action], well: Action) -> list[Due]:
    """What the faults of one thing do to it, in order of time: each what the action at its place says."""
    spans = [
        (fault.at, math.inf if fault.duration is None else fault.at + fault.duration) for fault in faults
    ]
    found: list[Due] = []
    now = well
    for time in sorted({time for span in spans for time in span if time < math.inf}):
        active = [index for index, (begin, end) in enumerate(spans) if begin <= time < end]
        latest = max(active, key=lambda index: (spans[index][0], index), default=None)
        action = well if latest is None else actions[latest]
        if action != now:
            found.append(Due(time, action))
            now = action
    return found


# MAV_CMD_INJECT_FAILURE (420): FAILURE_UNIT in param1, FAILURE_TYPE in param2, instance (0: all) in param3.
UNITS = {0: "gyroscope", 1: "accelerometer", 2: "magnetometer", 3: "barometer", 4: "gps"}
UNIT_MOTOR = 101
TYPES = {0: WORKS, 1: OFF, 2: STUCK, 3: GARBAGE, 4: WRONG}
TYPE_OK, TYPE_OFF = 0, 1


def from_command(unit: float, kind: float, instance: float, rotor_count: int) -> list[Action] | None:
    """Actions of MAV_CMD_INJECT_FAILURE with these three parameters; None: not supported.

    A motor can be off or well; sensors there are one of each, so instance is 0 or 1.
    """
    numbers = (unit, kind, 0.0 if math.isnan(instance) else instance)
    if not all(math.isfinite(number) and number == int(number) for number in numbers):
        return None
    which, how, one = (int(number) for number in numbers)
    if which == UNIT_MOTOR and how in (TYPE_OK, TYPE_OFF) and 0 <= one <= rotor_count:
        thrust = 1.0 if how == TYPE_OK else 0.0
        rotors = range(rotor_count) if one == 0 else [one - 1]
        return [SetRotor(index, thrust) for index in rotors]
    if which in UNITS and how in TYPES and one in (0, 1):
        return [SetSensor(UNITS[which], TYPES[how])]
    return None
