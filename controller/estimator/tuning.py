"""What the filter assumes of sensors and surroundings, and the record that its kernels read."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

import numpy as np

from controller.estimator.records import (
    ACCELEROMETER,
    BAROMETER,
    ERROR_SIZE,
    GPS_POSITION,
    GPS_VELOCITY,
    GYROSCOPE,
    MAGNETOMETER,
    PARAMETERS,
    PARTS,
    SENSOR_COUNT,
    TRACKER,
)
from sitl_bridge.frames import STANDARD_GRAVITY
from sitl_bridge.vehicle.description import Vehicle

Triple = tuple[float, float, float]


@dataclass(frozen=True)
class Tuning:
    """Standard deviations (per sample), gates and drifts; the defaults are those of `consumer` sensors."""

    accelerometer_std: float = 0.35
    """m/s²"""
    gyroscope_std: float = 0.015
    """rad/s"""
    magnetometer_std: float = 0.05
    """rad, of heading"""
    magnetometer_bias_std: float = 0.0
    """of each body axis, as a part of the whole field: the magnetometer's lasting error"""
    barometer_std: float = 0.3
    """m"""
    gps_position_std: Triple = (0.5, 0.5, 0.8)
    """m, of the white noise, when the message does not say"""
    gps_velocity_std: Triple = (0.1, 0.1, 0.15)
    """m/s, likewise"""
    gps_wander_std: Triple = (0.0, 0.0, 0.0)
    """m, of an error of the position that wanders (first-order Gauss-Markov); a state of its own"""
    gps_wander_time: float = 60.0
    """s, its time constant"""
    accelerometer_range: float = 16.0 * STANDARD_GRAVITY
    """m/s²; a sample at the limit is not used"""
    gyroscope_range: float = math.radians(2000.0)
    """rad/s; likewise"""
    gates: dict[str, float] = field(
        default_factory=lambda: {
            "accelerometer": 6.0,
            "gyroscope": 6.0,
            "magnetometer": 4.0,
            "barometer": 5.0,
            "gps_position": 5.0,
            "gps_velocity": 5.0,
            "tracker": 5.0,
        }
    )
    """Standard deviations beyond which an innovation is refused"""
    field: Triple = (0.023, 0.450, -0.893)
    """direction of the magnetic field, world ENU, any length (Zurich: 3° east, 63° down)"""
    force_std: float | None = None
    """m/s², of the unmodelled specific force on the vehicle; by default from the description's disturbance"""
    force_time: float | None = None
    """s, its correlation time; by default half of the disturbance's holding time"""
    load_force_density: float | None = None
    """m/s² per sqrt(Hz), of the white force on the load"""
    torque_density: float = 0.01
    """rad/s² per sqrt(Hz), as angular acceleration of the vehicle's largest moment of inertia"""
    gyro_bias_walk: float = 2e-5
    """rad/s per sqrt(s)"""
    accel_bias_walk: float = 2e-4
    """m/s² per sqrt(s)"""
    baro_walk: float = 0.01
    """m per sqrt(s)"""
    baro_offset_std: float = 3.0
    """m, at the start"""
    home_altitude: float = 0.0
    """m above mean sea level; used where the barometer says the height at the start, and not the receiver"""
    accel_bias_std: float = 0.05
    """m/s², at the start"""
    gyro_bias_std: float = 0.01
    """rad/s, at the start"""
    estimate_load_wind: bool = False
    """estimate a slowly varying force on the load; not observable together with accelerometer bias"""
    estimate_load_mass: bool = False
    """estimate the load's mass"""
    gps_period: float = 0.1
    """s, between fixes"""
    tracker_period: float = 0.0
    """s, between pictures of the load's tracker; 0 where none is fitted"""
    rotor_time_constant: float = 0.0
    """s, first-order lag of the rotors' speed"""
    has_ground: bool = True
    """False where vehicle and load fly without ground (the paper)"""
    align_time: float = 0.4
    """s, over which the start-up alignment averages"""


class Instrument(Protocol):
    """A sensor of HIL_SENSOR, as the vehicle description has it (noise as density, SI)."""

    noise_density: float
    bias: float
    random_walk: float
    range: float
    rate: float


class Receiver(Protocol):
    """A GPS receiver, as the vehicle description has it."""

    rate: float
    horizontal_noise: float
    vertical_noise: float
    horizontal_velocity_noise: float
    vertical_velocity_noise: float
    horizontal_wander: float
    vertical_wander: float
    wander_time: float


class Suite(Protocol):
    """What a vehicle senses with."""

    @property
    def accelerometer(self) -> Any: ...

    @property
    def gyroscope(self) -> Any: ...

    @property
    def magnetometer(self) -> Any: ...

    @property
    def barometer(self) -> Any: ...

    @property
    def gps(self) -> Any: ...

    @property
    def tracker(self) -> Any: ...


def from_sensors(sensors: Suite, rate_hz: float, field: Triple, **more: Any) -> Tuning:
    """The tuning for a sensor suite of the description at a loop rate.

    field: the magnetic field at home, T, world ENU. more: any other field of Tuning. No sensor is taken for
    better than a floor: an ideal one would leave the filter nothing to weigh.
    """

    def std(instrument: Instrument, floor: float) -> float:
        return max(floor, instrument.noise_density * math.sqrt(instrument.rate or rate_hz))

    accelerometer: Instrument = sensors.accelerometer
    gyroscope: Instrument = sensors.gyroscope
    barometer: Instrument = sensors.barometer
    gps: Receiver = sensors.gps
    horizontal, vertical = max(0.01, gps.horizontal_noise), max(0.01, gps.vertical_noise)
    across, up = max(0.01, gps.horizontal_velocity_noise), max(0.01, gps.vertical_velocity_noise)
    plain = Tuning()
    return replace(
        plain,
        accelerometer_std=std(accelerometer, 0.02),
        gyroscope_std=std(gyroscope, 1e-3),
        magnetometer_std=std(sensors.magnetometer, 0.0) / math.hypot(field[0], field[1]) + 1e-3,
        magnetometer_bias_std=sensors.magnetometer.bias / math.hypot(*field),
        barometer_std=std(barometer, 0.02),
        gps_position_std=(horizontal, horizontal, vertical),
        gps_velocity_std=(across, across, up),
        gps_wander_std=(gps.horizontal_wander, gps.horizontal_wander, gps.vertical_wander),
        gps_wander_time=gps.wander_time,
        accelerometer_range=accelerometer.range or plain.accelerometer_range,
        gyroscope_range=gyroscope.range or plain.gyroscope_range,
        field=field,
        accel_bias_std=max(0.02, 1.5 * accelerometer.bias),
        gyro_bias_std=max(0.002, 1.5 * gyroscope.bias),
        accel_bias_walk=max(5e-5, accelerometer.random_walk),
        gyro_bias_walk=max(2e-6, gyroscope.random_walk),
        baro_walk=max(plain.baro_walk, barometer.random_walk),
        # Of a receiver that wanders the height is no better known than the barometer's, which then has to do.
        baro_offset_std=max(0.1, 1.5 * barometer.bias)
        if gps.vertical_wander > 0.0
        else plain.baro_offset_std,
        gps_period=1.0 / gps.rate,
        tracker_period=1.0 / sensors.tracker.rate if sensors.tracker is not None else 0.0,
        **more,
    )


def parameters(vehicle: Vehicle, period: float, tuning: Tuning) -> Any:
    """The record array (1,) of PARAMETERS for a vehicle, a tick of `period` seconds, and a tuning."""
    record = np.zeros(1, dtype=PARAMETERS)
    p = record[0]
    cable, vehicle_mass, load_mass = vehicle.cable, vehicle.airframe.mass, vehicle.load.mass
    reduced = 1.0 / (1.0 / vehicle_mass + 1.0 / load_mass)
    p["period"] = period
    p["gravity"] = vehicle.gravity
    p["vehicle_mass"] = vehicle_mass
    p["inertia"] = vehicle.airframe.inertia
    p["load_mass"] = load_mass
    # A bounce faster than the samples cannot be seen; the filter's cable is then as stiff as it can follow.
    stiffness = min(cable.stiffness, reduced * (MOST_SUBSTEPS * STEP_ANGLE / period) ** 2)
    damping = min(cable.damping, 2.0 * math.sqrt(stiffness * reduced))
    p["stiffness"] = stiffness
    p["damping"] = damping
    p["rest_length"] = cable.rest_length + load_mass * vehicle.gravity * (
        1.0 / cable.stiffness - 1.0 / stiffness
    )
    p["substeps"] = max(1, math.ceil(math.sqrt(stiffness / reduced) * period / STEP_ANGLE))
    p["two_way"] = cable.model == "two-way"
    p["has_ground"] = tuning.has_ground
    if vehicle.ground is not None:
        p["starts_on_ground"] = vehicle.initial.start == "ground"
        p["standing_height"] = vehicle.ground.height - min(leg[2] for leg in vehicle.airframe.legs)
        p["lying_height"] = vehicle.ground.height + vehicle.load.radius
    p["vehicle_drag"] = (vehicle.airframe.drag.linear, vehicle.airframe.drag.quadratic)
    p["load_drag"] = (vehicle.load.drag.linear, vehicle.load.drag.quadratic)
    p["rotor_count"] = len(vehicle.rotors)
    for index, rotor in enumerate(vehicle.rotors):
        p["rotor_x"][index], p["rotor_y"][index], _ = rotor.position
        p["thrust_coefficient"][index] = rotor.thrust_coefficient
        sign = -1.0 if rotor.direction == "ccw" else 1.0
        p["reaction_coefficient"][index] = sign * rotor.torque_coefficient
    p["rotor_time_constant"] = tuning.rotor_time_constant
    p["command_delay"] = vehicle.loop.delay_ticks
    direction = np.array(tuning.field)
    p["field"] = direction / np.linalg.norm(direction)
    start = np.array(vehicle.initial_load_position) - np.array(vehicle.initial_vehicle_position)
    p["initial_load"] = start
    stds = np.zeros(SENSOR_COUNT)
    stds[ACCELEROMETER], stds[GYROSCOPE] = tuning.accelerometer_std, tuning.gyroscope_std
    stds[MAGNETOMETER], stds[BAROMETER] = tuning.magnetometer_std, tuning.barometer_std
    p["sensor_std"] = stds
    p["gps_position_std"], p["gps_velocity_std"] = tuning.gps_position_std, tuning.gps_velocity_std
    p["home_altitude"] = tuning.home_altitude
    p["gps_wander_std"], p["gps_wander_time"] = tuning.gps_wander_std, tuning.gps_wander_time
    p["accelerometer_range"], p["gyroscope_range"] = tuning.accelerometer_range, tuning.gyroscope_range
    for index, name in GATE_NAMES.items():
        p["gate"][index] = tuning.gates[name]
    _set_disturbance(p, vehicle, tuning)
    p["torque_density"] = tuning.torque_density * max(vehicle.airframe.inertia)
    p["gyro_bias_walk"], p["accel_bias_walk"] = tuning.gyro_bias_walk, tuning.accel_bias_walk
    p["baro_walk"] = tuning.baro_walk
    p["load_wind_walk"] = 0.02 * load_mass if tuning.estimate_load_wind else 0.0
    p["load_mass_walk"] = 1e-3 if tuning.estimate_load_mass else 0.0
    p["initial_std"] = initial_std(vehicle, tuning)
    p["clone_interval"] = tuning.gps_period
    p["tracker_interval"] = tuning.tracker_period
    p["align_samples"] = max(8, round(tuning.align_time / period))
    return record


USUAL_WIND = 5.0
"""m/s, standard deviation: nobody tells the filter the wind, but that there may be one.

Where less is expected, twelve m/s that come at once are taken for a swing of the load: `heavy` turned over.
"""
WIND_TIME = 3.0
"""s, in which the wind's force on the vehicle changes."""
MOST_SUBSTEPS = 4
STEP_ANGLE = 0.3
"""rad of the cable's bounce that one step may take: second order is then right to a percent."""
GATE_NAMES = {
    ACCELEROMETER: "accelerometer",
    GYROSCOPE: "gyroscope",
    MAGNETOMETER: "magnetometer",
    BAROMETER: "barometer",
    GPS_POSITION: "gps_position",
    GPS_VELOCITY: "gps_velocity",
    TRACKER: "tracker",
}


def _set_disturbance(p: Any, vehicle: Vehicle, tuning: Tuning) -> None:
    """Unmodelled forces: a held white force F of the description is, to the filter, F²·hold per hertz.

    On a vehicle with drag the coloured force is that of an unknown wind, which changes slowly; a white force
    comes on top. Without drag there is no wind, and the coloured force is the white one as it is held.
    """
    disturbance = vehicle.disturbance
    hold, force = disturbance.hold_time, disturbance.force_std
    on_vehicle = force if disturbance.acts_on != "load" else 0.0
    on_load = force if disturbance.acts_on != "vehicle" else 0.0
    calm = 0.005 * vehicle.gravity  # m/s²: no model of the thrust is better than half a percent
    gust = on_vehicle / vehicle.airframe.mass
    drag = vehicle.airframe.drag
    windy = (drag.linear + drag.quadratic * USUAL_WIND) * USUAL_WIND / vehicle.airframe.mass
    p["force_std"], p["force_time"] = math.hypot(gust, calm), 0.5 * hold
    if windy > 0.0:
        p["force_std"], p["force_time"] = math.hypot(windy, calm), WIND_TIME
        p["gust_std"], p["gust_density"] = gust, gust * math.sqrt(hold)
    if tuning.force_std is not None:
        p["force_std"] = tuning.force_std
    if tuning.force_time is not None:
        p["force_time"] = tuning.force_time
    p["load_force_density"] = (
        tuning.load_force_density
        if tuning.load_force_density is not None
        else math.hypot(on_load / vehicle.load.mass, calm) * math.sqrt(hold)
    )


def initial_std(vehicle: Vehicle, tuning: Tuning) -> Any:
    """Standard deviations (34,) of the error state after an alignment at rest."""
    std = np.zeros(ERROR_SIZE)
    std[PARTS["position"]] = np.hypot(tuning.gps_position_std, tuning.gps_wander_std)
    std[PARTS["velocity"]] = tuning.gps_velocity_std
    std[PARTS["attitude"]] = (0.02, 0.02, 0.1)
    std[PARTS["rates"]] = 0.02
    std[PARTS["gyro_bias"]] = tuning.gyro_bias_std
    std[PARTS["accel_bias"]] = tuning.accel_bias_std
    std[PARTS["baro_offset"]] = tuning.baro_offset_std
    std[PARTS["load"]] = 0.1 * vehicle.hover_length
    std[PARTS["load_velocity"]] = 0.2
    std[PARTS["force"]] = 0.5
    std[PARTS["load_wind"]] = 0.05 * vehicle.load.mass * vehicle.gravity if tuning.estimate_load_wind else 0.0
    std[PARTS["load_mass"]] = 0.3 if tuning.estimate_load_mass else 0.0
    std[PARTS["mag_bias"]] = tuning.magnetometer_bias_std
    return std
