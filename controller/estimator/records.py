"""Names for the numbers of the filter: nominal state, error state, sensors, and its flat records.

World ENU, body FLU, SI units. The nominal attitude is a unit quaternion (w, x, y, z) from body to world; its
error is a rotation vector in body axes, R = R_nominal exp([error]x). The load's position and velocity are
relative to the vehicle, in world axes: that is what the accelerometer sees, and what GPS noise leaves alone.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Nominal state: first index of each part.
X_POSITION, X_VELOCITY, X_ATTITUDE, X_RATES, X_GYRO_BIAS, X_ACCEL_BIAS, X_BARO_OFFSET = (
    0,
    3,
    6,
    10,
    13,
    16,
    19,
)
X_LOAD, X_LOAD_VELOCITY, X_FORCE, X_LOAD_WIND, X_LOAD_MASS, X_MAG_BIAS = 20, 23, 26, 29, 32, 33
NOMINAL_SIZE = 35

# Error state: the same parts, the attitude with three numbers.
POSITION, VELOCITY, ATTITUDE, RATES, GYRO_BIAS, ACCEL_BIAS, BARO_OFFSET = 0, 3, 6, 9, 12, 15, 18
LOAD, LOAD_VELOCITY, FORCE, LOAD_WIND, LOAD_MASS, MAG_BIAS = 19, 22, 25, 28, 31, 32
ERROR_SIZE = 34

PARTS = {
    "position": slice(0, 3),
    "velocity": slice(3, 6),
    "attitude": slice(6, 9),
    "rates": slice(9, 12),
    "gyro_bias": slice(12, 15),
    "accel_bias": slice(15, 18),
    "baro_offset": slice(18, 19),
    "load": slice(19, 22),
    "load_velocity": slice(22, 25),
    "force": slice(25, 28),
    "load_wind": slice(28, 31),
    "load_mass": slice(31, 32),
    "mag_bias": slice(32, 34),
}
"""Where each part lies in the error state and its covariance. `force`: specific force of everything
unmodelled on the vehicle, m/s²; `load_wind`: N; `load_mass`: logarithm of its ratio to the description's;
`mag_bias`: the magnetometer's lasting error along body x and y, as a part of the whole field."""

# Sensors, in the order of the health arrays.
ACCELEROMETER, GYROSCOPE, MAGNETOMETER, BAROMETER, GPS_POSITION, GPS_VELOCITY, TRACKER = range(7)
SENSORS = (
    "accelerometer",
    "gyroscope",
    "magnetometer",
    "barometer",
    "gps_position",
    "gps_velocity",
    "tracker",
)
SENSOR_COUNT = len(SENSORS)
STALE_SENSORS = 3
"""The first ones of these: noise is in every sample of theirs, and a repeated one is stuck."""

# What holds the vehicle, and what the load does.
ALIGNING, STANDING, FLYING = 0, 1, 2
LOAD_ON_CABLE, LOAD_ON_GROUND, LOAD_RELEASED, LOAD_DROPPED = 0, 1, 2, 3
"""Released: gone, nobody knows where to. Dropped: off its hook, and lying on the ground."""

# Remembered instants, for measurements that arrive late: six numbers each.
CLONES = 7
CLONE_ROWS = 6
CLONE_SIZE = CLONES * CLONE_ROWS
CLONE_FREE, CLONE_MOTION, CLONE_LOAD, CLONE_WANDER = 0, 1, 2, 3
"""What a slot holds: an instant that a late measurement may belong to or, always in slot 0 and only where the
receiver wanders, the present error of its position, which fades and is not the vehicle's."""

MOST_ROTORS = 16
DELAY_STEP = 2
"""Ticks between two delays of the loop that are compared."""
DELAYS = 21
"""So many delays from 0 on are, and that which the filter reckons with."""
DELAY_HISTORY = 64
"""Ticks of commanded and measured turning that are kept for it."""
COMMAND_HISTORY = 65  # as many as loop.delay_ticks may ask for, and one
# The estimate, in the order of eq. 31 (see controller.law.state): first index of each part.
POSITION_OUT, LOAD_OUT, VELOCITY_OUT, LOAD_VELOCITY_OUT, BODY_RATES_OUT, EULER_OUT = 0, 3, 6, 9, 12, 15
OUTPUT_SIZE = 18

PARAMETERS = np.dtype(
    [
        ("period", "f8"),
        ("substeps", "i8"),
        ("gravity", "f8"),
        ("vehicle_mass", "f8"),
        ("inertia", "f8", 3),
        ("load_mass", "f8"),
        ("stiffness", "f8"),
        ("damping", "f8"),
        ("rest_length", "f8"),
        ("reel_rate", "f8"),
        ("two_way", "b1"),
        ("has_ground", "b1"),
        ("starts_on_ground", "b1"),
        ("standing_height", "f8"),
        ("lying_height", "f8"),
        ("vehicle_drag", "f8", 2),
        ("load_drag", "f8", 2),
        ("rotor_count", "i8"),
        ("rotor_x", "f8", MOST_ROTORS),
        ("rotor_y", "f8", MOST_ROTORS),
        ("thrust_coefficient", "f8", MOST_ROTORS),
        ("reaction_coefficient", "f8", MOST_ROTORS),
        ("rotor_time_constant", "f8"),
        ("command_delay", "i8"),
        ("field", "f8", 3),
        ("initial_load", "f8", 3),
        ("sensor_std", "f8", SENSOR_COUNT),
        ("gps_position_std", "f8", 3),
        ("gps_velocity_std", "f8", 3),
        ("gps_wander_std", "f8", 3),
        ("gps_wander_time", "f8"),
        ("home_altitude", "f8"),
        ("accelerometer_range", "f8"),
        ("gyroscope_range", "f8"),
        ("gate", "f8", SENSOR_COUNT),
        ("force_std", "f8"),
        ("force_time", "f8"),
        ("gust_std", "f8"),
        ("gust_density", "f8"),
        ("load_force_density", "f8"),
        ("torque_density", "f8"),
        ("gyro_bias_walk", "f8"),
        ("accel_bias_walk", "f8"),
        ("baro_walk", "f8"),
        ("load_wind_walk", "f8"),
        ("load_mass_walk", "f8"),
        ("initial_std", "f8", ERROR_SIZE),
        ("clone_interval", "f8"),
        ("tracker_interval", "f8"),
        ("align_samples", "i8"),
    ]
)
"""What the filter needs of vehicle and tuning; see `tuning`. Densities are per square root of hertz.

rest_length, reel_rate: m and m/s, of the cable as the winch has it now; standing_height, lying_height: m,
world, of vehicle and load at rest on the ground; *_drag: linear (N s/m) and quadratic (N s²/m²); gust_*: of
white force on the vehicle beside the coloured one, m/s² as an accelerometer sees it and as the velocity feels
it; home_altitude: m above mean sea level, what a barometer without error shows at a height of 0.
"""

MEMORY = np.dtype(
    [
        ("time", "f8"),
        ("vehicle_mode", "i8"),
        ("load_mode", "i8"),
        ("hook_closed", "b1"),
        ("align_count", "i8"),
        ("align_sum", "f8", 9),
        ("align_magnetometer", "i8"),
        ("align_gps", "b1"),
        ("in_flight", "b1"),
        ("grounded", "b1"),
        ("contact_time", "f8"),
        ("lying_time", "f8"),
        ("rotor_speed", "f8", MOST_ROTORS),
        ("thrust", "f8"),
        ("commands", "f8", (COMMAND_HISTORY, MOST_ROTORS)),
        ("command_count", "i8"),
        ("turned", "f8", (DELAY_HISTORY, 2)),
        ("rates", "f8", (DELAY_HISTORY, 2)),
        ("prompt_speed", "f8", MOST_ROTORS),
        ("delay_misfit", "f8", DELAYS + 1),
        ("delay_ticks_watched", "i8"),
        ("delay_ticks_compared", "i8"),
        ("delay_found", "i8"),
        ("cable_longer", "f8"),
        ("cable_variance", "f8"),
        ("tension", "f8"),
        ("slack_time", "f8"),
        ("swing_due", "f8"),
        ("pull", "f8", 3),
        ("pull_time", "f8"),
        ("hung", "f8", 2),
        ("hung_variance", "f8", 2),
        ("load_resets", "i8"),
        ("stale_count", "i8", STALE_SENSORS),
        ("last_sample", "f8", (STALE_SENSORS, 3)),
        ("last_change", "f8", (STALE_SENSORS, 3)),
        ("roughness", "f8", STALE_SENSORS),
        ("last_fix", "f8", 6),
        ("repeated_fixes", "i8"),
        ("clone_width", "i8"),
        ("clone_time", "f8", CLONES),
        ("clone_kind", "i8", CLONES),
        ("next_clone", "f8"),
        ("next_load_clone", "f8"),
        ("slip", "f8", 6),
        ("slip_until", "f8"),
        ("adrift", "b1"),
        ("height_suspicion", "f8"),  # running mean of normalised GPS height innovations
        ("turn_suspicion", "f8", 3),  # the same of the gyroscope's
        ("last_rate", "f8", 3),
        ("first_refused", "f8", 3),
        ("first_jump", "f8", 3),
        ("last_force_squares", "f8"),
        ("taut_time", "f8"),
        ("step_time", "f8", 2),  # when accelerometer and gyroscope were last wrong at once; 0: never
        ("test_ratio", "f8", SENSOR_COUNT),
        ("innovation", "f8", (SENSOR_COUNT, 3)),
        ("normalised", "f8", (SENSOR_COUNT, 3)),
        ("seen", "i8", SENSOR_COUNT),
        ("within", "i8", SENSOR_COUNT),
        ("nis_sum", "f8", SENSOR_COUNT),
        ("nis_count", "i8", SENSOR_COUNT),
        ("rejected", "i8", SENSOR_COUNT),
        ("rejected_in_row", "i8", SENSOR_COUNT),
        ("last_used", "f8", SENSOR_COUNT),
    ]
)
"""What the filter remembers besides state and covariance.

turned, rates: about x and y, rad/s: what the rotors' moments would have added up to without any delay, and
the gyroscope; prompt_speed: rad/s, of rotors without it; other delay_*: see `late_commands`; delay_found: in
ticks, -1: none;
cable_longer, cable_variance: m and m², by how much pictures show the cable to be longer than told, and how
well that is known; 0: not yet;
hook_closed: the gripper is to grab, so that a pull is that of a dropped load; grounded: a vehicle that stands
does so on the ground, and is not held; contact_time, lying_time: s for which something below has carried the
vehicle or the load;
swing_due: when the pull will say whether a load that was let go hangs, and so may swing; 0: it has; hung: m,
world, where the load hung last with all its weight, and how well that was known relative to the vehicle.
last_change: of a sample from the one before; roughness: running mean of the change of that, in standard
deviations of a live sensor's; last_fix: position and velocity of GPS, m and m/s.
last_rate, first_refused: innovations of the gyroscope, rad/s, before and when it was first refused;
first_jump: of that sample from the one before, rad/s;
last_force_squares: normalised innovation squared of the accelerometer, three axes; taut_time: s for which the
model's cable has been taut.
innovation, normalised: the last ones of each sensor and axis, the second in standard deviations; seen,
within: how many there were, and how many within the 95 % bounds; nis_*: squares of those that were used.
"""

INPUT = np.dtype(
    [
        ("time", "f8"),
        ("accelerometer", "f8", 3),
        ("gyroscope", "f8", 3),
        ("magnetometer", "f8", 3),
        ("altitude", "f8"),
        ("has_imu", "b1"),
        ("has_magnetometer", "b1"),
        ("has_altitude", "b1"),
        ("has_gps", "b1"),
        ("gps_time", "f8"),
        ("gps_position", "f8", 3),
        ("gps_velocity", "f8", 3),
        ("gps_position_std", "f8", 3),
        ("gps_velocity_std", "f8", 3),
        ("has_tracker", "b1"),
        ("tracker_time", "f8"),
        ("tracker", "f8", 3),
        ("tracker_std", "f8", 3),
    ]
)
"""The measurements of one tick."""


FILTER = np.dtype(
    [
        ("p", PARAMETERS),
        ("m", MEMORY),
        ("x", "f8", NOMINAL_SIZE),
        ("P", "f8", (ERROR_SIZE, ERROR_SIZE)),
        ("z", "f8", CLONE_SIZE),
        ("Pxz", "f8", (ERROR_SIZE, CLONE_SIZE)),
        ("Pzz", "f8", (CLONE_SIZE, CLONE_SIZE)),
        ("wide", "f8", (ERROR_SIZE, CLONE_SIZE)),
        ("transition", "f8", (ERROR_SIZE, ERROR_SIZE)),
        ("scratch", "f8", (2, ERROR_SIZE, ERROR_SIZE)),
        ("vectors", "f8", (8, CLONE_SIZE)),
        ("row_index", "i8", ERROR_SIZE),
        ("row_value", "f8", ERROR_SIZE),
    ]
)
"""Everything the kernels work on, in one piece of memory; all but `p` is written in place.

p, m: PARAMETERS and MEMORY; x: nominal state; P: covariance of the error state; z: remembered quantities, Pxz
and Pzz: their covariance with the error state and with each other; transition: of one step, of which only the
places in `process.COLUMNS` are ever written; scratch, vectors, row_*: see `process` and `update`.
m.clone_width: columns of Pxz up to the last remembered instant in use.
"""

Filter = Any
"""One record of FILTER."""
