"""The sensors of HIL_SENSOR: truth with error, quantised, saturated, at their rates.

All errors of a block of ticks are drawn at once; what is left for each tick is compiled: add, round, clip.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sitl_bridge.compiled import Buffer, entry_point
from sitl_bridge.plant.random_streams import stream
from sitl_bridge.plant.sensors.atmosphere import SEA_LEVEL_PRESSURE
from sitl_bridge.plant.sensors.noise import RandomWalk, White
from sitl_bridge.vehicle.sensors import Instrument, Sensors

MEASUREMENT = np.dtype(
    [
        ("accelerometer", "f8", 3),  # specific force, m/s², body FLU
        ("gyroscope", "f8", 3),  # rad/s, body FLU
        ("magnetometer", "f8", 3),  # T, body FLU
        ("pressure", "f8"),  # Pa
        ("differential_pressure", "f8"),  # Pa
        ("pressure_altitude", "f8"),  # m
        ("temperature", "f8"),  # deg C
        ("updated", "i8"),  # bit i: channel i, in this order, is new (as HIL_SENSOR.fields_updated has it)
    ]
)
CHANNELS = 13


class Place(NamedTuple):
    """Where a sensor's readings stand in MEASUREMENT."""

    first: int
    axes: int


PLACES = {
    "accelerometer": Place(0, 3),
    "gyroscope": Place(3, 3),
    "magnetometer": Place(6, 3),
    "barometer": Place(9, 3),  # pressure, differential pressure (no error of its own), altitude
    "thermometer": Place(12, 1),
}

# What a sensor does; kept for each channel. Only GPS can be lost: it says that it has no fix.
WORKS, OFF, STUCK, GARBAGE, WRONG, LOST = range(6)

ROWS = 512
"""Ticks whose errors are drawn at once."""


INSTRUMENTS = np.dtype(
    [
        ("errors", "f8", (ROWS, CHANNELS)),  # of each tick of a block, SI
        ("garbage", "f8", (ROWS, CHANNELS)),  # likewise
        (
            "figures",
            "f8",
            (4, CHANNELS),
        ),  # rows: resolution (0: none), least, most, error if wrong
        ("timing", "i8", (2, CHANNELS)),  # rows: ticks from reading to reading, what the sensor does
        ("reading", MEASUREMENT, (1,)),
    ]
)
"""All sensors of HIL_SENSOR."""


@entry_point(Buffer(MEASUREMENT, (1,)), Buffer(INSTRUMENTS, (1,)), int)
def read(truth: Any, instruments: Any, tick: int) -> int:
    """Readings of one tick from the truth, as a real sensor gives them, written where they are new."""
    sensors = instruments[0]
    errors, garbage, figures, timing = sensors.errors, sensors.garbage, sensors.figures, sensors.timing
    true, out = truth[0], sensors.reading[0]
    row = tick % ROWS
    bits = 0
    for channel in range(CHANNELS):
        doing = timing[1, channel]
        if doing == OFF or tick % timing[0, channel] != 0:
            continue
        bits |= 1 << channel
        if doing == STUCK:
            continue
        if channel < 3:
            value = true.accelerometer[channel]
        elif channel < 6:
            value = true.gyroscope[channel - 3]
        elif channel < 9:
            value = true.magnetometer[channel - 6]
        elif channel == 9:
            value = true.pressure
        elif channel == 10:
            value = true.differential_pressure
        elif channel == 11:
            value = true.pressure_altitude
        else:
            value = true.temperature
        value += errors[row, channel]
        if doing == GARBAGE:
            value = garbage[row, channel]
        elif doing == WRONG:
            value += figures[3, channel]
        resolution = figures[0, channel]
        if resolution > 0.0:
            value = resolution * math.floor(value / resolution + 0.5)
        value = min(max(value, figures[1, channel]), figures[2, channel])
        if channel < 3:
            out.accelerometer[channel] = value
        elif channel < 6:
            out.gyroscope[channel - 3] = value
        elif channel < 9:
            out.magnetometer[channel - 6] = value
        elif channel == 9:
            out.pressure = value
        elif channel == 10:
            out.differential_pressure = value
        elif channel == 11:
            out.pressure_altitude = value
        else:
            out.temperature = value
    out.updated = bits
    return bits


WRONG_BY = {
    "accelerometer": 2.0,
    "gyroscope": 0.2,
    "magnetometer": 3e-5,
    "barometer": 20.0,
    "thermometer": 30.0,
}
"""What a wrong sensor is off by on each axis, SI (barometer: m of height)."""
GARBAGE_RANGE = {
    "accelerometer": 157.0,
    "gyroscope": 35.0,
    "magnetometer": 8e-4,
    "barometer": 5e3,
    "thermometer": 85.0,
}
"""Garbage is uniform in ± this, SI (barometer: m of height, about sea level)."""


class Instruments:
    """The sensors of HIL_SENSOR in time. `reading` is a record of MEASUREMENT, shape (1,)."""

    def __init__(
        self,
        sensors: Sensors,
        tick_period: float,
        seed: int,
        truth: Any,
        pascals_per_metre: float,
        record: NDArray[Any],
    ) -> None:
        """truth: record of MEASUREMENT that holds the truth at each `read`; pascals_per_metre: < 0, at home;
        record: (1,) of INSTRUMENTS, written."""
        fields = record[0]
        self.reading: NDArray[Any] = fields["reading"]
        self._errors, self._garbage = fields["errors"], fields["garbage"]
        self._timing, self._figures = fields["timing"], fields["figures"]
        self._timing[:] = 1
        self._figures[1], self._figures[2] = -math.inf, math.inf
        self._slope = pascals_per_metre
        self._period = tick_period
        self._sensors = {name: getattr(sensors, name) for name in PLACES}
        for name, instrument in self._sensors.items():
            self._set_figures(name, instrument)
        self._read = read.bind(truth, record)
        self.reset(seed)

    def ticks_left(self, tick: int) -> int:
        """How many ticks after `tick` fresh errors are to be drawn."""
        return ROWS - 1 - tick % ROWS

    def reset(self, seed: int) -> None:
        """Begin again at tick 0 with fresh random streams, every sensor working."""
        self._noise = {}
        for name, instrument in self._sensors.items():
            period = self._timing[0, PLACES[name].first] * self._period
            axes = 1 if name == "barometer" else PLACES[name].axes
            self._noise[name] = (
                White(instrument.noise_density, period, stream(seed, f"{name}.white")),
                RandomWalk(
                    instrument.bias, instrument.random_walk, self._period, axes, stream(seed, f"{name}.bias")
                ),
            )
        self._fill_garbage(stream(seed, "garbage"))
        self._timing[1] = WORKS
        self._draw()

    def set(self, name: str, doing: int) -> None:
        """Let a sensor work (WORKS) or fail (OFF, STUCK, GARBAGE, WRONG)."""
        first, axes = PLACES[name]
        self._timing[1, first : first + axes] = doing

    def read(self, tick: int) -> None:
        """Fill `reading` from the truth at `tick`: once for 0 or 1, then for each that follows."""
        if tick % ROWS == 0 and tick > 0:
            self._draw()
        self._read(tick)

    def _set_figures(self, name: str, instrument: Instrument) -> None:
        first, axes = PLACES[name]
        places = slice(first, first + axes)
        if instrument.rate > 0.0:
            self._timing[0, places] = max(1, round(1.0 / (instrument.rate * self._period)))
        self._figures[0, places] = instrument.resolution
        if instrument.range > 0.0:
            self._figures[1, places], self._figures[2, places] = -instrument.range, instrument.range
        self._figures[3, places] = WRONG_BY[name]
        if name == "barometer":
            # Its figures are in metres of height; what it measures is pressure. No error of differential
            # pressure.
            self._figures[0, 9] = instrument.resolution * -self._slope
            self._figures[1:3, 9] = 0.0, math.inf
            self._figures[:, 10] = 0.0, -math.inf, math.inf, 0.0
            self._figures[3, 9] = WRONG_BY[name] * self._slope

    def _draw(self) -> None:
        for name, (white, walk) in self._noise.items():
            first, axes = PLACES[name]
            if name == "barometer":
                metres = (white.draw(ROWS, 1) + walk.draw(ROWS, 1))[:, 0]
                self._errors[:, 9], self._errors[:, 11] = metres * self._slope, metres
            else:
                self._errors[:, first : first + axes] = white.draw(ROWS, axes) + walk.draw(ROWS, axes)

    def _fill_garbage(self, generator: np.random.Generator) -> None:
        """One block, used over and over: garbage enough."""
        self._garbage[:] = generator.uniform(-1.0, 1.0, (ROWS, CHANNELS))
        for name, most in GARBAGE_RANGE.items():
            first, axes = PLACES[name]
            self._garbage[:, first : first + axes] *= most
        self._garbage[:, 9] = SEA_LEVEL_PRESSURE + self._garbage[:, 11] * self._slope
        self._garbage[:, 10] = 0.0
