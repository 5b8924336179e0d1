"""The estimator as the autopilot sees it: measurements in, estimate, covariance and health out."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from controller.estimator import intake, step
from controller.estimator.records import (
    ACCELEROMETER,
    ALIGNING,
    ERROR_SIZE,
    FILTER,
    FLYING,
    GYROSCOPE,
    INPUT,
    LOAD_DROPPED,
    LOAD_ON_CABLE,
    LOAD_ON_GROUND,
    LOAD_RELEASED,
    MOST_ROTORS,
    OUTPUT_SIZE,
    PARTS,
    SENSORS,
    STANDING,
    X_ACCEL_BIAS,
    X_ATTITUDE,
    X_GYRO_BIAS,
    Array,
)
from controller.estimator.tuning import Tuning, parameters
from sitl_bridge.vehicle.description import Vehicle, hover_rotor_speeds

Sequence3 = tuple[float, float, float] | Array


UNKNOWN_POSITION = 3.0
"""m, standard deviation beyond the usual error of a receiver that wanders: the position is not known."""
REFUSED_TIME = 1.0
"""s for which GPS is refused, until that is a state of affairs and not an outlier."""


DENIAL_TIME = 1.0
"""s after a step of an inertial sensor, until its bias is what the other sensors leave of it."""
UNUSUAL_BIAS = {
    ACCELEROMETER: ("accel_bias", X_ACCEL_BIAS, 0.5),
    GYROSCOPE: ("gyro_bias", X_GYRO_BIAS, 0.03),
}
"""Part of the error state, first index of the nominal state, and what is unusual at least, m/s² or rad/s."""


class SensorHealth(NamedTuple):
    """What the filter made of one sensor."""

    test_ratio: float
    """the last innovation as a part of its gate, largest axis; above 1 it was refused"""
    rejected: int
    """samples refused since the start"""
    age: float
    """s since a sample was used"""
    nis: float
    """mean normalised innovation squared per degree of freedom since the start; 1 when consistent"""
    within: float
    """share of innovations within their 95 % bounds since the start"""
    offset: float = 0.0
    """size of a bias that came at once and is not the sensor's usual one, rad/s or m/s²; 0: there is none"""


class Health(NamedTuple):
    """Whether the estimate can be flown on."""

    aligned: bool
    attitude: bool
    """good for attitude"""
    velocity: bool
    position: bool
    load: bool
    """the load's place relative to the vehicle is known"""
    dead_reckoning: bool
    """no GPS for a while: position and velocity drift"""
    gps_glitch: bool
    """GPS comes, but is refused"""
    gps_refused: bool
    """it has been for seconds"""
    load_released: bool
    position_std: float
    """m, horizontal"""
    height_std: float
    velocity_std: float
    tilt_std: float
    """rad"""
    load_std: float
    """m, relative to the vehicle, largest axis"""
    load_resets: int
    sensors: dict[str, SensorHealth]


class Estimator:
    """Error-state Kalman filter for vehicle and load. Deterministic; nothing is allocated in `tick`.

    Once a tick: put what was measured into `given` (layout.INPUT) by the methods below, then `tick(time)`,
    then read `state`, then report with `command` what the rotors are told from this tick on.
    """

    def __init__(self, vehicle: Vehicle, period: float, tuning: Tuning) -> None:
        """period: s between ticks. Starts in alignment at rest."""
        self.vehicle = vehicle
        self.tuning = tuning
        self.period = period
        self._filter = np.zeros(1, dtype=FILTER)
        self._record = np.zeros(1, dtype=INPUT)
        self.given = self._record[0]
        """this tick's measurements, cleared by `tick`"""
        self._output = np.zeros(OUTPUT_SIZE)
        self._rotor_speed = np.zeros(MOST_ROTORS)
        self.arrays = (self._filter, self._record, self._output, self._rotor_speed)
        """State, input, estimate and commanded speeds, for a compiled tick that does what `tick` and
        `command` do."""
        self._tick = step.tick.bind(self._filter, self._record, self._output)
        self._change = step.change.bind(self._filter)
        self._command = step.command.bind(self._filter, self._rotor_speed)
        self.memory = self._filter[0]["m"]
        self._sensed: NDArray[Any] | None = None
        self._give: Callable[[], int] = int
        self.reset()

    def reset(self, *, in_flight: bool = False) -> None:
        """Forget everything and align anew, at rest or in flight."""
        self._filter[...] = np.zeros((), dtype=FILTER)
        self._filter["p"] = parameters(self.vehicle, self.period, self.tuning)
        self._filter_length = float(self._filter[0]["p"]["rest_length"])
        """m, of the described cable, as the filter's model has it"""
        self._filter["transition"][0] = np.eye(ERROR_SIZE)
        self._filter["x"][0, X_ATTITUDE] = 1.0
        self._record[...] = np.zeros((), dtype=INPUT)
        self._output[...] = 0.0
        self.memory["in_flight"] = in_flight
        self.memory["delay_found"] = -1
        if in_flight:
            speeds = hover_rotor_speeds(self.vehicle)
            self.memory["rotor_speed"][: len(speeds)] = speeds

    def imu(self, accelerometer: Sequence3, gyroscope: Sequence3) -> None:
        """Specific force (m/s²) and angular rate (rad/s), body FLU, sampled at this tick."""
        self.given["accelerometer"] = accelerometer
        self.given["gyroscope"] = gyroscope
        self.given["has_imu"] = True

    def magnetometer(self, field: Sequence3) -> None:
        """Magnetic field, body FLU, any unit, sampled at this tick."""
        self.given["magnetometer"] = field
        self.given["has_magnetometer"] = True

    def barometer(self, altitude: float) -> None:
        """Pressure altitude in m above home (any constant offset), sampled at this tick."""
        self.given["altitude"] = altitude
        self.given["has_altitude"] = True

    def sensed(self, record: NDArray[Any]) -> None:
        """What the HIL link has of these: a record of `hil.ticks.SENSED`, shape (1,), to be kept."""
        if record is not self._sensed:
            self._sensed = record
            self._give = intake.give.bind(record, self._record)
        self._give()

    def gps(
        self,
        time: float,
        position: Sequence3,
        velocity: Sequence3,
        position_std: Sequence3 | None = None,
        velocity_std: Sequence3 | None = None,
    ) -> None:
        """A fix (m, m/s, world ENU) that belongs to `time` (s), now or earlier."""
        self.given["gps_time"] = time
        self.given["gps_position"] = position
        self.given["gps_velocity"] = velocity
        self.given["gps_position_std"] = position_std or self.tuning.gps_position_std
        self.given["gps_velocity_std"] = velocity_std or self.tuning.gps_velocity_std
        self.given["has_gps"] = True

    def load_seen(self, time: float, position: Sequence3, std: Sequence3) -> None:
        """The tracker's view of the load, m, body FLU, relative to the vehicle, at `time` (s)."""
        self.given["tracker_time"] = time
        self.given["tracker"] = position
        self.given["tracker_std"] = std
        self.given["has_tracker"] = True

    def tick(self, time: float) -> Array:
        """Carry the estimate to `time` (s) with what was given; returns `state()`."""
        given = self.given
        given["time"] = time
        self._tick()
        given["has_imu"] = given["has_magnetometer"] = given["has_altitude"] = False
        given["has_gps"] = given["has_tracker"] = False
        return self._output

    def command(self, rotor_speed: Array) -> None:
        """Note what the rotors are told from this tick on, rad/s (n,): the next tick needs the thrust."""
        self._rotor_speed[: len(rotor_speed)] = rotor_speed
        self._command()

    def take_off(self, rotor_speed: Array | None = None) -> None:
        """Nothing holds the vehicle any more: it flies from the next tick on.

        rotor_speed: rad/s (n,), that the rotors have already; by default none.
        """
        if rotor_speed is not None:
            self.memory["rotor_speed"][: len(rotor_speed)] = rotor_speed
            # A delayed loop goes on giving them until the first command arrives.
            commands = self.memory["commands"]
            commands[:, : len(rotor_speed)] = rotor_speed
            self.memory["command_count"] += len(commands)
        self._change(FLYING, int(self.memory["load_mode"]))

    def hide_offset(self, offset: Array) -> None:
        """Report the positions (m, world, (3,)) without `offset` at first; it comes in within limits.

        Nominal state and covariance stay.
        """
        self.memory["slip"][:3] = offset

    @property
    def found_delay(self) -> int:
        """Ticks after which commands are seen to act, when it is not what is reckoned with; else -1."""
        return int(self.memory["delay_found"])

    def set_delay(self, ticks: int) -> None:
        """Commands act so many ticks late from now on."""
        self._filter[0]["p"]["command_delay"] = ticks
        self.memory["delay_found"] = -1
        self.memory["delay_ticks_compared"] = 0

    def forget_delay(self) -> None:
        """What was seen so far of how late commands act is no more of use."""
        self.memory["delay_ticks_watched"] = self.memory["delay_ticks_compared"] = 0
        self.memory["delay_found"] = -1

    def reeled(self, rest_length: float, rate: float) -> None:
        """The winch has made the cable so long (m), and goes on at a rate (m/s, positive pays out)."""
        p = self._filter[0]["p"]
        longer = float(self.memory["cable_longer"])  # than told, as a tracker sees it
        p["rest_length"] = self._filter_length + longer + rest_length - self.vehicle.cable.rest_length
        p["reel_rate"] = rate

    def landed(self) -> None:
        """The vehicle stands on the ground, rotors stopped."""
        self._change(STANDING, int(self.memory["load_mode"]))

    def load_on_ground(self) -> None:
        """The load lies on the ground."""
        self._change(int(self.memory["vehicle_mode"]), LOAD_ON_GROUND)

    def load_released(self) -> None:
        """The gripper has let the load go: it falls to the ground, if there is one."""
        load = LOAD_DROPPED if self.tuning.has_ground else LOAD_RELEASED
        self._change(int(self.memory["vehicle_mode"]), load)

    def hook(self, closed: bool) -> None:
        """Whether the gripper is to grab: a pull then shows that it has taken a load that was dropped."""
        self.memory["hook_closed"] = closed

    @property
    def in_flight(self) -> bool:
        """Whether it was aligned, or is to be, in flight."""
        return bool(self.memory["in_flight"])

    @property
    def flying(self) -> bool:
        """Whether it takes the vehicle to be in the air, and not held."""
        return int(self.memory["vehicle_mode"]) == FLYING

    @property
    def held(self) -> bool:
        """Whether it takes the vehicle to be held in the air, at its start."""
        return self.aligned and not self.flying and not self.memory["grounded"]

    @property
    def grounded(self) -> bool:
        """Whether it takes the vehicle to stand on the ground."""
        return bool(self.memory["grounded"]) and not self.flying

    @property
    def load_mode(self) -> int:
        """LOAD_ON_CABLE, LOAD_ON_GROUND, LOAD_RELEASED or LOAD_DROPPED."""
        return int(self.memory["load_mode"])

    @property
    def tension(self) -> float:
        """Of the cable, N."""
        return float(self.memory["tension"])

    @property
    def aligned(self) -> bool:
        """Whether the start-up alignment is done."""
        return int(self.memory["vehicle_mode"]) != ALIGNING

    def state(self) -> Array:
        """The estimate (18,) in the order of eq. 31; the same array every time."""
        return self._output

    @property
    def nominal(self) -> Array:
        """The nominal state (35,), see layout; attitude as a quaternion, load relative to the vehicle."""
        return np.asarray(self._filter["x"][0])

    @property
    def error_covariance(self) -> Array:
        """Covariance (34, 34) of the error state, see layout.PARTS."""
        return np.asarray(self._filter["P"][0])

    def covariance(self) -> Array:
        """Covariance (18, 18) of `state()`, eq. 31.

        The heading is as uncertain as the magnetometer's lasting error, of which a hover shows nothing.
        """
        selector = eq31_jacobian(self._output[15], self._output[16])
        return np.asarray(selector @ self.error_covariance @ selector.T)

    def health(self) -> Health:
        """A summary for arming, failsafes, SYS_STATUS and ESTIMATOR_STATUS."""
        m, cov = self.memory, self.error_covariance
        now = float(m["time"])
        sensors = {}
        for index, name in enumerate(SENSORS):
            count = int(m["nis_count"][index])
            sensors[name] = SensorHealth(
                float(m["test_ratio"][index]),
                int(m["rejected"][index]),
                now - float(m["last_used"][index]),
                float(m["nis_sum"][index]) / count if count else math.nan,
                float(m["within"][index]) / max(1, int(m["seen"][index])),
                self._offset(index),
            )

        def std(part: str, rows: slice) -> float:
            return math.sqrt(max(0.0, float(np.max(np.diag(cov)[PARTS[part]][rows]))))

        position, height = std("position", slice(0, 2)), std("position", slice(2, 3))
        velocity, tilt = std("velocity", slice(0, 3)), std("attitude", slice(0, 2))
        load = std("load", slice(0, 3))
        gps_age = min(sensors["gps_position"].age, sensors["gps_velocity"].age)
        hanging = int(m["load_mode"]) == LOAD_ON_CABLE
        refused = int(m["rejected_in_row"][SENSORS.index("gps_position")])
        return Health(
            aligned=self.aligned,
            attitude=self.aligned and tilt < 0.1,
            velocity=self.aligned and velocity < 1.0,
            position=self.aligned and position < math.hypot(UNKNOWN_POSITION, self.tuning.gps_wander_std[0]),
            load=self.aligned and hanging and load < 0.3 * self.vehicle.hover_length,
            dead_reckoning=gps_age > 1.0,
            gps_glitch=refused > 0,
            gps_refused=refused * self.tuning.gps_period > REFUSED_TIME,
            load_released=int(m["load_mode"]) in (LOAD_RELEASED, LOAD_DROPPED),
            position_std=position,
            height_std=height,
            velocity_std=velocity,
            tilt_std=tilt,
            load_std=load,
            load_resets=int(m["load_resets"]),
            sensors=sensors,
        )

    def _offset(self, sensor: int) -> float:
        """`SensorHealth.offset`: an unusual bias, once the other sensors have had time to deny it."""
        if sensor not in UNUSUAL_BIAS:
            return 0.0
        part, start, least = UNUSUAL_BIAS[sensor]
        usual = float(np.max(self._filter["p"][0]["initial_std"][PARTS[part]]))
        size = float(np.max(np.abs(self.nominal[start : start + 3])))
        stepped = float(self.memory["step_time"][sensor])
        settled = stepped > 0.0 and float(self.memory["time"]) - stepped > DENIAL_TIME
        return size if settled and size > max(least, 6.0 * usual) else 0.0


def eq31_jacobian(roll: float, pitch: float) -> Array:
    """How the error state (34) moves the state of eq. 31 (18): Jacobian (18, 34)."""
    jacobian = np.zeros((OUTPUT_SIZE, ERROR_SIZE))
    identity = np.eye(3)
    jacobian[0:3, PARTS["position"]] = identity
    jacobian[3:6, PARTS["position"]] = identity
    jacobian[3:6, PARTS["load"]] = identity
    jacobian[6:9, PARTS["velocity"]] = identity
    jacobian[9:12, PARTS["velocity"]] = identity
    jacobian[9:12, PARTS["load_velocity"]] = identity
    jacobian[12:15, PARTS["rates"]] = identity
    sr, cr, cp, tp = math.sin(roll), math.cos(roll), math.cos(pitch), math.tan(pitch)
    jacobian[15:18, PARTS["attitude"]] = [
        [1.0, sr * tp, cr * tp],
        [0.0, cr, -sr],
        [0.0, sr / cp, cr / cp],
    ]
    return jacobian
