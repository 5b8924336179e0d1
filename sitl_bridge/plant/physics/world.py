"""The physical world: vehicle, cable and load, advanced in fixed steps under held rotor commands. No I/O."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sitl_bridge.magnetic import field_at
from sitl_bridge.plant.physics.battery import (
    BatteryReading,
    drained,
    electric_power,
    power_coefficients,
    reading,
)
from sitl_bridge.plant.physics.cables.cable import tension_of
from sitl_bridge.plant.physics.cables.chain import NODE_STATES
from sitl_bridge.plant.physics.cables.hoist import Reel, hoist
from sitl_bridge.plant.physics.disturbance import HeldForce, HeldWind
from sitl_bridge.plant.physics.dynamics import advance, set_rotors
from sitl_bridge.plant.physics.parameters import parameters, step_count
from sitl_bridge.plant.physics.record import WORLD
from sitl_bridge.plant.physics.state import (
    CABLE_HOLDS,
    CABLE_STATE,
    MOST_ROTORS,
    STOPPED,
    Array,
    initial_inner_state,
    initial_state,
)
from sitl_bridge.plant.sensors.atmosphere import air_pressure
from sitl_bridge.plant.sensors.gps import GpsReceiver
from sitl_bridge.plant.sensors.instruments import Instruments
from sitl_bridge.plant.sensors.tracker import LoadTracker
from sitl_bridge.plant.sensors.truth import measure
from sitl_bridge.plant.stages import EVER
from sitl_bridge.vehicle.chain import end_mass
from sitl_bridge.vehicle.description import Vehicle, hover_rotor_speeds


class World:
    """State and what acts on it. `state` is the vector of `plant.state`, world ENU, SI units."""

    def __init__(
        self, vehicle: Vehicle, rate_hz: float, seed: int, lightest_load: float | None = None
    ) -> None:
        """lightest_load: kg, to which `set_load_mass` may go; absent: what is described."""
        self.vehicle = vehicle
        self.steps_per_tick = step_count(vehicle, 1.0 / rate_hz, lightest_load)
        self.step = 1.0 / (rate_hz * self.steps_per_tick)
        self.record = np.zeros(1, dtype=WORLD)
        """All that compiled code reads and writes, of shape (1,); the attributes below are views of it."""
        fields = self.record[0]
        self.state: Array = fields["state"]
        self.inner: Array = fields["inner"]
        self.reactions: Array = fields["reactions"]
        self.rotor_speed: Array = fields["rotor_speed"]
        self.trim_controls = trim_controls(vehicle)
        self.initial_controls = self.trim_controls if vehicle.initial.start == "hover" else STOPPED
        """What the rotors do until the first command."""
        self._seed = seed
        self._parameters: NDArray[Any] = fields["parameters"]
        self._parameters[:] = parameters(vehicle)
        self._truth: NDArray[Any] = fields["truth"]
        altitude = vehicle.home.altitude
        slope = air_pressure(altitude + 0.5) - air_pressure(altitude - 0.5)
        self.instruments = Instruments(
            vehicle.sensors, 1.0 / rate_hz, seed, self._truth, slope, fields["instruments"]
        )
        self.measurement = self.instruments.reading
        self._period = 1.0 / rate_hz
        self._drain = power_coefficients(vehicle, vehicle.battery) if vehicle.battery else ()
        self._force = HeldForce(vehicle.disturbance, self.step, seed, fields["force"])
        self._wind = HeldWind(vehicle, self.step, seed, fields["wind"])
        self._controls: Array = fields["controls"]
        self._speed_share: Array = fields["speed_share"]
        fields["magnetic_field"] = field_at(vehicle.home)
        fields["schedule"] = (
            self.steps_per_tick, self.step, self._force.hold_steps, self._wind.hold_steps, altitude
        )  # fmt: skip
        self._set_rotors = set_rotors.bind(
            self._parameters, self._controls, self._speed_share, self.rotor_speed
        )
        self._advance = advance.bind(
            self._parameters,
            self.state,
            self.inner,
            self.rotor_speed,
            self._force.table,
            self._wind.table,
            fields["work"],
        )
        self._measure = measure.bind(
            self._parameters,
            self.state,
            self.inner,
            self._force.now,
            self._wind.now,
            fields["work"],
            fields["magnetic_field"],
            self.reactions,
            self._truth,
        )
        self.reset()

    def reset(self) -> None:
        """Back to the initial state, with fresh random streams; in the air with the rotors as in hover."""
        self.reset_motion()
        self.reset_sensors()

    def reset_motion(self) -> None:
        """Bodies, forces and battery back to the initial state; the sensors go on as they are."""
        self.state[:] = initial_state(self.vehicle)
        self.inner[:] = initial_inner_state(self.vehicle)
        self._force.reset(self._seed)
        self._wind.reset(self._seed)
        battery = self.vehicle.battery
        self._charge = battery.charge if battery is not None else 1.0
        self._speed_share[:] = 1.0
        self._parameters["rest_length"], self._parameters["reel_rate"] = self.vehicle.cable.rest_length, 0.0
        self._parameters["hoist"] = hoist(self.vehicle)
        self.set_load_mass(None)
        self.command(self.initial_controls)

    def reset_sensors(self) -> None:
        """Every sensor works, with fresh random streams; the next tick that is measured is 0 or 1."""
        sensors = self.vehicle.sensors
        self.instruments.reset(self._seed)
        self.gps = GpsReceiver(sensors.gps, self._period, self._seed)
        self.tracker = None
        if sensors.tracker is not None:
            self.tracker = LoadTracker(sensors.tracker, self._period, self._seed)

    def command(self, controls: Sequence[float] | Array) -> None:
        """Set the rotors: 16 controls of 0..1, proportional to speed; what is not finite means stopped."""
        self._controls[:] = controls
        self._set_rotors()

    def advance(self, steps: int) -> None:
        """Advance by so many integration steps with the rotors held."""
        force, wind = self._force, self._wind
        while steps > 0:
            covered = min(steps, force.steps_left, wind.steps_left)
            self._advance(
                force.next_step, wind.next_step, force.hold_steps, wind.hold_steps, covered, self.step
            )
            force.advance(covered)
            wind.advance(covered)
            steps -= covered

    def motion_ticks_left(self) -> int:
        """How many ticks the tables of held forces and winds last beyond."""
        held = [table for table in (self._force, self._wind) if not table.constant]
        return min(((table.steps_left - 1) // self.steps_per_tick for table in held), default=EVER)

    def next_steps(self) -> tuple[int, int]:
        """Number of the next step in the tables of held forces and winds."""
        return self._force.next_step, self._wind.next_step

    def count_tick(self) -> None:
        """A tick was flown by `tick.fly_whole_tick`."""
        if not self._force.constant:
            self._force.count(self.steps_per_tick)
        if not self._wind.constant:
            self._wind.count(self.steps_per_tick)

    def battery(self, duration: float) -> BatteryReading | None:
        """Draw on the battery for `duration` seconds at the rotors' present speeds; None: there is none."""
        battery = self.vehicle.battery
        if battery is None:
            return None
        speeds = self.inner[: len(self.vehicle.rotors)].tolist()
        now = reading(battery, self._charge, electric_power(battery, self._drain, speeds))
        self._charge = drained(battery, self._charge, now.current, duration)
        return now

    def set_sensor(self, name: str, doing: int) -> None:
        """Let a sensor work or fail, see `sensors.instruments`."""
        if name == "gps":
            self.gps.doing = doing
        elif name != "tracker":
            self.instruments.set(name, doing)
        elif self.tracker is not None:
            self.tracker.doing = doing

    def set_rotor(self, index: int, thrust: float) -> None:
        """Leave a rotor (from 0) a share of its thrust, at the same command."""
        self._speed_share[index] = math.sqrt(thrust)

    def release_cable(self) -> None:
        """Join vehicle and load no more."""
        self.inner[CABLE_HOLDS] = 0.0

    @property
    def cable_holds(self) -> bool:
        """Whether the cable joins vehicle and load."""
        return bool(self.inner[CABLE_HOLDS])

    def cable_tension(self) -> float:
        """The cable's tension, N."""
        return tension_of(self._parameters.view(np.recarray)[0], self.state, self.inner)

    def chain_nodes(self) -> Array:
        """Where the nodes of a chain are, (n, 3), m, from the top; other cables have none."""
        count = self.vehicle.node_count
        return self.inner[CABLE_STATE : CABLE_STATE + NODE_STATES * count].reshape(count, NODE_STATES)[:, :3]

    def wind(self) -> Array:
        """At the vehicle, m/s, world ENU."""
        return self._wind.now[:3]

    def reel(self) -> Reel:
        """The winch as it is now."""
        p = self._parameters[0]
        return Reel(
            float(p["rest_length"]),
            float(p["reel_rate"]),
            self.cable_tension(),
            bool(p["hoist"]["clutch_open"]),
        )

    def set_load_mass(self, mass: float | None) -> None:
        """Change the load's mass, kg; None: as described."""
        mass = self.vehicle.load.mass if mass is None else mass
        self._parameters["load_mass"] = mass + end_mass(self.vehicle)

    def log_sources(self) -> tuple[NDArray[Any], Array, Array, Array, Array]:
        """Parameter record, state, inner state, commands and force as they change, for a log to read."""
        return self._parameters, self.state, self.inner, self.rotor_speed, self._force.now

    def sensed(self) -> tuple[NDArray[Any], NDArray[Any], Array, Array]:
        """Readings and truth of the sensors, state, and wind at vehicle and load, as they change."""
        return self.measurement, self._truth, self.state, self._wind.now

    def measure(self, tick: int, held: bool) -> None:
        """Fill `measurement` from the world as it is at a tick, to be called once for each in turn.

        A held vehicle measures as if it stood.
        """
        self._measure(held, self.vehicle.home.altitude)
        self.instruments.read(tick)


def trim_controls(vehicle: Vehicle) -> tuple[float, ...]:
    """Controls (16) whose thrust carries vehicle and load without any moment."""
    largest = np.array([rotor.max_speed for rotor in vehicle.rotors])
    controls = np.minimum(np.array(hover_rotor_speeds(vehicle)) / largest, 1.0).tolist()
    return (*controls, *([0.0] * (MOST_ROTORS - len(controls))))
