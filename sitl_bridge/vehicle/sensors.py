"""What sensors a vehicle carries and how well they measure: the same figures for plant and estimator.

A preset (`presets/*.toml`, each figure with its source) fills the whole table, perhaps on top of another
preset; `sensors.preset = "urban"` takes one, and any other key changes it (`--set sensors.gps.rate=5`).
Without a preset the sensors are ideal, but for the last digits of the magnetometer. Noise is given as
density, so that it does not depend on the rate.
"""

from __future__ import annotations

from sitl_bridge.vehicle.schema import Section, quantity


class Instrument(Section):
    """A sensor that HIL_SENSOR carries. Units are SI: m/s², rad/s, T, m (barometer), K (thermometer)."""

    noise_density: float = quantity(
        "SI s^½", "white noise: a sample at rate f has standard deviation density·√f", 0.0, ge=0, le=1e6
    )
    bias: float = quantity("SI", "standard deviation of each axis' bias at the start", 0.0, ge=0, le=1e6)
    random_walk: float = quantity("SI s^-½", "each axis' bias wanders by this·√t", 0.0, ge=0, le=1e6)
    resolution: float = quantity("SI", "smallest step of a reading; 0: none", 0.0, ge=0, le=1e6)
    range: float = quantity("SI", "largest reading, either sign; 0: none", 0.0, ge=0, le=1e6)
    rate: float = quantity("Hz", "readings a second; 0: one at each tick", 0.0, ge=0, le=1e4)


class Gps(Section):
    """A receiver: white noise on each fix, and an error that wanders (first-order Gauss-Markov)."""

    rate: float = quantity("Hz", "fixes a second", 10.0, gt=0, le=100)
    delay: float = quantity("s", "from the time a fix is valid to its arrival", 0.0, ge=0, le=2)
    horizontal_noise: float = quantity("m", "standard deviation, east and north", 0.0, ge=0, le=1e4)
    vertical_noise: float = quantity("m", "standard deviation, up", 0.0, ge=0, le=1e4)
    horizontal_velocity_noise: float = quantity(
        "m/s", "standard deviation, east and north", 0.0, ge=0, le=1e6
    )
    vertical_velocity_noise: float = quantity("m/s", "standard deviation, up", 0.0, ge=0, le=99)
    horizontal_wander: float = quantity("m", "standard deviation, east and north", 0.0, ge=0, le=1e4)
    vertical_wander: float = quantity("m", "standard deviation, up", 0.0, ge=0, le=1e4)
    wander_time: float = quantity("s", "time constant of the wandering error", 60.0, gt=0, le=1e6)
    dropouts_per_hour: float = quantity("1/h", "how often the fix is lost, on average", 0.0, ge=0, le=3600)
    dropout_duration: float = quantity("s", "mean length of a loss (exponential)", 5.0, gt=0, le=1e6)
    satellites: int = quantity("-", "in view", 14, ge=4, le=40)


class Tracker(Section):
    """A camera under the vehicle that sees where the load is, relative to the vehicle."""

    rate: float = quantity("Hz", "sightings a second", 20.0, gt=0, le=200)
    delay: float = quantity("s", "from exposure to arrival", 0.0, ge=0, le=1)
    angle_noise: float = quantity("rad", "standard deviation across the line of sight", 0.0, ge=0, le=3)
    distance_noise: float = quantity(
        "-", "standard deviation along it, share of the distance", 0.0, ge=0, le=3
    )
    field_of_view: float = quantity("rad", "largest angle from straight down", 1.0, gt=0, le=1.5)
    range: float = quantity("m", "largest distance", 30.0, gt=0, le=1e6)


DITHER = 1.3e-10
"""T s^½: what even an ideal magnetometer has. PX4 takes one for dead that repeats itself to 1e-6 gauss."""


class Sensors(Section):
    """Everything the vehicle senses with."""

    preset: str = quantity("-", "name of the preset that these figures started from", "ideal")
    accelerometer: Instrument = Instrument()
    gyroscope: Instrument = Instrument()
    magnetometer: Instrument = Instrument(noise_density=DITHER)
    barometer: Instrument = Instrument()
    thermometer: Instrument = Instrument()
    gps: Gps = Gps()
    tracker: Tracker | None = None
