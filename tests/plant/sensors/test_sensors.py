"""Each sensor against its specification: Allan variance, spectrum, quantisation, rates, delays, streams."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pygeomag
import pytest
from numpy.typing import NDArray
from scipy.special import lpmv

from sitl_bridge.magnetic import EPOCH, field_at
from sitl_bridge.plant.physics.state import STATE_SIZE
from sitl_bridge.plant.physics.world import World
from sitl_bridge.plant.random_streams import stream
from sitl_bridge.plant.sensors.atmosphere import air_pressure, air_temperature
from sitl_bridge.plant.sensors.gps import FIX_3D, NO_FIX, GpsReceiver
from sitl_bridge.plant.sensors.instruments import (
    CHANNELS,
    GARBAGE,
    INSTRUMENTS,
    LOST,
    MEASUREMENT,
    OFF,
    PLACES,
    STUCK,
    WORKS,
    WRONG,
    Instruments,
)
from sitl_bridge.plant.sensors.noise import GaussMarkov, RandomWalk, White
from sitl_bridge.plant.sensors.tracker import LoadTracker
from sitl_bridge.vehicle.description import Home
from sitl_bridge.vehicle.files import load_vehicle
from sitl_bridge.vehicle.sensors import Gps, Instrument, Sensors, Tracker

Array = NDArray[np.float64]
RATE = 250.0
IDEAL = ["sensors.preset=ideal"]
SLOPE = air_pressure(488.5) - air_pressure(487.5)


def suite(preset: str) -> Sensors:
    return load_vehicle("iris", [f"sensors.preset={preset}"]).sensors


def record(sensors: Sensors, ticks: int, rate: float = RATE, seed: int = 1, **doing: int) -> Array:
    """Readings (ticks, 13) of a truth of zeros but 95 600 Pa and 12 deg C."""
    truth = np.zeros(1, dtype=MEASUREMENT)
    truth["pressure"], truth["temperature"] = 95600.0, 12.0
    instruments = Instruments(sensors, 1.0 / rate, seed, truth, SLOPE, np.zeros(1, dtype=INSTRUMENTS))
    for name, what in doing.items():
        instruments.set(name, what)
    rows = np.empty((ticks, CHANNELS))
    flat = instruments.reading.view(np.float64)
    for tick in range(ticks):
        instruments.read(tick)
        rows[tick] = flat[:CHANNELS]
    return rows


def allan_deviation(samples: Array, size: int) -> Any:
    """Of samples (n, axes), averaged in non-overlapping blocks of `size`, (axes,)."""
    blocks = samples[: len(samples) // size * size].reshape(-1, size, samples.shape[1]).mean(axis=1)
    return np.sqrt(0.5 * np.mean(np.diff(blocks, axis=0) ** 2, axis=0))


@pytest.mark.parametrize("name", ["accelerometer", "gyroscope", "magnetometer"])
def test_consumer_white_noise_by_allan_deviation(name: str) -> None:
    """Density over the square root of the averaging time, from one sample to a second."""
    sensors = suite("consumer")
    density = getattr(sensors, name).noise_density
    first, axes = PLACES[name]
    samples = record(sensors, 100_000)[:, first : first + axes]
    for size, spread in ((1, 0.01), (10, 0.03), (50, 0.06), (250, 0.12)):
        overall = math.sqrt(np.mean(allan_deviation(samples, size) ** 2))
        assert overall == pytest.approx(density / math.sqrt(size / RATE), rel=spread)


def test_consumer_figures_at_250_hz() -> None:
    """The figures of the specification, each sample."""
    rows = record(suite("consumer"), 50_000)
    std = np.std(np.diff(rows, axis=0), axis=0) / math.sqrt(2)
    np.testing.assert_allclose(std[:3], 0.35, rtol=0.02)
    np.testing.assert_allclose(std[3:6], 0.015, rtol=0.02)
    np.testing.assert_allclose(std[9] / -SLOPE, 0.3, rtol=0.02)
    east, north, _ = field_at(Home())
    np.testing.assert_allclose(std[6:9] / math.hypot(east, north), 0.05, rtol=0.02)


@pytest.mark.parametrize("name", ["accelerometer", "gyroscope", "magnetometer", "barometer", "thermometer"])
def test_each_channel_by_allan_deviation(name: str) -> None:
    """White noise, random walk and steps of the reading, through the instrument, at a rate of its own.

    Over tau seconds: N / sqrt(tau) of a density N, K sqrt(tau / 3) of a walk K; quantisation, which noise of
    more than a step makes white, q² / 12 a reading.
    """
    rate, walk, step = 50.0, 0.02, 0.1
    density = 0.03
    figures = Instrument(noise_density=density, random_walk=walk, resolution=step, rate=rate)
    first, axes = PLACES[name]
    # A barometer's axes are pressure and the altitude made of it; its figures are in metres.
    unit = abs(SLOPE) if name == "barometer" else 1.0
    axes = 1 if name == "barometer" else axes
    rows = np.concatenate(
        [
            record(Sensors(**{name: figures}), 100_000, seed=seed)[
                :: round(RATE / rate), first : first + axes
            ]
            for seed in range(6 // axes)
        ],
        axis=1,
    )
    for tau in (0.02, 0.2, 2.0, 20.0):
        size = round(tau * rate)
        white = density**2 + step**2 / 12.0 / rate
        expected = unit * math.sqrt(white / tau + walk**2 * tau / 3.0)
        blocks = len(rows) / size * rows.shape[1]
        measured = math.sqrt(np.mean(allan_deviation(rows, size) ** 2))
        assert measured == pytest.approx(expected, rel=4.0 / math.sqrt(blocks) + 0.03)


def test_density_not_deviation_is_kept_at_other_rates() -> None:
    std = np.std(record(suite("consumer"), 20_000, rate=1000.0)[:, :3], axis=0)
    np.testing.assert_allclose(std, 0.35 * 2.0, rtol=0.03)


def test_random_walk_by_allan_deviation() -> None:
    """K sqrt(tau / 3)."""
    walk = RandomWalk(0.0, 0.1, 0.01, 8, stream(1, "walk")).draw(200_000, 8)
    for size in (100, 400):
        expected = 0.1 * math.sqrt(size * 0.01 / 3.0)
        assert np.sqrt(np.mean(allan_deviation(walk, size) ** 2)) == pytest.approx(expected, rel=0.05)


def test_bias_has_its_spread_and_stays() -> None:
    starts = [RandomWalk(2.0, 0.0, 0.01, 3, stream(seed, "b")).draw(2, 3) for seed in range(1500)]
    np.testing.assert_array_equal([s[0] for s in starts], [s[1] for s in starts])
    assert np.std(starts) == pytest.approx(2.0, rel=0.05)


def test_gauss_markov_correlation() -> None:
    """std² exp(-t / tau), stationary from the first sample."""
    paths = np.array(
        [
            [p.value.copy()] + [p.step().copy() for _ in range(20)]
            for p in (GaussMarkov(np.array([3.0, 1.0]), 2.0, 0.1, stream(seed, "g")) for seed in range(3000))
        ]
    )
    for lag in (0, 10, 20):
        correlation = np.mean(paths[:, 0] * paths[:, lag], axis=0) / [9.0, 1.0]
        np.testing.assert_allclose(correlation, math.exp(-lag / 20), rtol=0, atol=0.08)


def test_white_noise_is_white() -> None:
    samples = White(1.0, 0.01, stream(1, "w")).draw(50_000, 1)[:, 0]
    for lag in (1, 2, 5):
        assert abs(np.corrcoef(samples[:-lag], samples[lag:])[0, 1]) < 0.02


def test_quantisation_and_saturation() -> None:
    sensors = Sensors(accelerometer=Instrument(noise_density=1.0, resolution=0.25, range=10.0))
    rows = record(sensors, 5000)[:, :3]
    np.testing.assert_allclose(rows / 0.25, np.round(rows / 0.25), atol=1e-12)
    assert rows.max() == 10.0
    assert rows.min() == -10.0


def test_own_rate_holds_and_marks_only_new_readings() -> None:
    sensors = Sensors(magnetometer=Instrument(noise_density=1e-9, rate=50.0))
    truth = np.zeros(1, dtype=MEASUREMENT)
    instruments = Instruments(sensors, 1.0 / RATE, 1, truth, SLOPE, np.zeros(1, dtype=INSTRUMENTS))
    seen = []
    for tick in range(20):
        instruments.read(tick)
        seen.append(
            (int(instruments.reading["updated"][0]), float(instruments.reading["magnetometer"][0, 0]))
        )
    for tick, (bits, value) in enumerate(seen):
        assert bits == (0x1FFF if tick % 5 == 0 else 0x1FFF & ~0x1C0)
        assert value == seen[tick // 5 * 5][1]


@pytest.mark.parametrize("preset", ["ideal", "rtk", "consumer", "urban"])
def test_no_preset_lets_px4_think_the_magnetometer_dead(preset: str) -> None:
    """100 samples that agree to 1e-6 gauss (1e-10 T) count as stale; here not even five in a row do."""
    field = record(suite(preset), 5000)[:, 6:9]
    same = (np.abs(np.diff(field, axis=0)) <= 1e-10).all(axis=1).astype(int)
    assert np.convolve(same, np.ones(5)).max() < 5


def test_ideal_is_ideal() -> None:
    rows = record(suite("ideal"), 100)
    np.testing.assert_array_equal(rows[:, :6], 0.0)
    np.testing.assert_array_equal(rows[:, 9], 95600.0)
    assert np.abs(rows[:, 6:9]).max() < 1e-8


def test_a_stream_of_its_own_for_each_source() -> None:
    """Another noise, or a fault, in one sensor leaves every other as it was; another seed changes all."""
    base = record(suite("consumer"), 1000)
    changed = load_vehicle("iris", ["sensors.preset=consumer", "sensors.gyroscope.noise_density=1"]).sensors
    rows = record(changed, 1000)
    keep = [0, 1, 2, *range(6, CHANNELS)]
    np.testing.assert_array_equal(rows[:, keep], base[:, keep])
    assert not np.array_equal(rows[:, 3:6], base[:, 3:6])
    garbled = record(suite("consumer"), 1000, accelerometer=GARBAGE)
    np.testing.assert_array_equal(garbled[:, 3:], base[:, 3:])
    again, other = record(suite("consumer"), 1000), record(suite("consumer"), 1000, seed=2)
    np.testing.assert_array_equal(again, base)
    assert (other[:, [0, 4, 8, 9, 12]] != base[:, [0, 4, 8, 9, 12]]).mean() > 0.9


def test_failing_instruments() -> None:
    sensors = suite("consumer")
    base = record(sensors, 100)
    assert not record(sensors, 100, gyroscope=OFF)[:, 3:6].any()
    stuck = record(sensors, 100, gyroscope=STUCK)
    assert (stuck[:, 3:6] == stuck[0, 3:6]).all()
    np.testing.assert_allclose(record(sensors, 100, gyroscope=WRONG)[:, 3:6], base[:, 3:6] + 0.2, atol=2e-3)
    garbage = record(sensors, 500, gyroscope=GARBAGE)[:, 3:6]
    assert garbage.std() == pytest.approx(35.0 / math.sqrt(3), rel=0.1)
    assert np.array_equal(record(sensors, 100, gyroscope=WORKS), base)


def harmonics(home: Home, year: float) -> Array:
    """The World Magnetic Model's field, nT, ENU, summed anew from its coefficients (report, eqs. 1 to 17)."""
    lines = (Path(pygeomag.__file__).parent / "wmm" / "WMM_2025.COF").read_text().splitlines()
    epoch = float(lines[0].split()[0])
    latitude, longitude = math.radians(home.latitude), math.radians(home.longitude)
    a, e2 = 6378137.0, 6.69437999014e-3
    normal = a / math.sqrt(1 - e2 * math.sin(latitude) ** 2)
    axis = (normal + home.altitude) * math.cos(latitude)
    z = (normal * (1 - e2) + home.altitude) * math.sin(latitude)
    radius, geocentric = math.hypot(axis, z), math.atan2(z, axis)

    def potential(r: float, phi: float, lam: float) -> float:
        total = 0.0
        for line in lines[1:]:
            parts = line.split()
            if len(parts) != 6:
                break
            n, m = int(parts[0]), int(parts[1])
            g, h, g_rate, h_rate = map(float, parts[2:])
            g, h = g + (year - epoch) * g_rate, h + (year - epoch) * h_rate
            schmidt = math.sqrt((2 - (m == 0)) * math.factorial(n - m) / math.factorial(n + m)) * (-1) ** m
            wave = g * math.cos(m * lam) + h * math.sin(m * lam)
            total += 6371200.0 * (6371200.0 / r) ** (n + 1) * wave * schmidt * lpmv(m, n, math.sin(phi))
        return total

    # The field is the potential's gradient, by central differences of a metre or so.
    at, d = (radius, geocentric, longitude), 1e-6
    up = -(potential(at[0] + 10, *at[1:]) - potential(at[0] - 10, *at[1:])) / 20
    north = -(potential(radius, at[1] + d, at[2]) - potential(radius, at[1] - d, at[2])) / (2 * d * radius)
    east = -(potential(radius, at[1], at[2] + d) - potential(radius, at[1], at[2] - d)) / (2 * d * axis)
    turn = latitude - geocentric
    return np.array(
        [
            east,
            north * math.cos(turn) - up * math.sin(turn),
            up * math.cos(turn) + north * math.sin(turn),
        ]
    )


@pytest.mark.parametrize("place", [(47.397742, 8.545594, 488.0), (-33.9, 151.2, 20.0), (64.1, -21.9, 5000.0)])
def test_magnetic_model(place: tuple[float, float, float]) -> None:
    home = Home(latitude=place[0], longitude=place[1], altitude=place[2])
    np.testing.assert_allclose(np.array(field_at(home)) * 1e9, harmonics(home, EPOCH), rtol=0, atol=1.0)


def test_standard_atmosphere() -> None:
    """ISO 2533's table: 0, 1000 and 5000 m."""
    for altitude, pressure, temperature in (
        (0, 101325.0, 288.15),
        (1000, 89874.6, 281.65),
        (5000, 54019.9, 255.65),
    ):
        assert air_pressure(altitude) == pytest.approx(pressure, rel=1e-5)
        assert air_temperature(altitude) == pytest.approx(temperature)


def moving(ticks: int, gps: Gps, seed: int = 1, doing: dict[int, int] | None = None) -> list[Any]:
    """(tick, fix) of a receiver on something that goes east at 1 m a tick."""
    receiver, x, found = GpsReceiver(gps, 1.0 / RATE, seed), np.zeros(STATE_SIZE), []
    for tick in range(ticks):
        x[0] = tick
        receiver.doing = (doing or {}).get(tick, receiver.doing)
        fix = receiver.sample(tick, x)
        if fix is not None:
            found.append((tick, fix))
    return found


def test_gps_rate_and_delay() -> None:
    """A fix each 25 ticks, 28 ticks late, of where it was then."""
    found = moving(300, Gps(delay=0.112))
    assert [tick for tick, _ in found] == list(range(28, 300, 25))
    assert [fix.position[0] for _, fix in found] == [tick - 28 for tick, _ in found]
    assert all(fix.age == pytest.approx(0.112) for _, fix in found)


def test_gps_white_noise() -> None:
    gps = suite("consumer").gps
    found = moving(100_000, gps)
    late = round(gps.delay * RATE)
    errors = np.array([(*fix.position, *fix.velocity) for _, fix in found])
    errors[:, 0] -= [tick - late for tick, _ in found]
    np.testing.assert_allclose(errors.std(axis=0), [0.5, 0.5, 0.8, 0.1, 0.1, 0.15], rtol=0.06)
    assert np.abs([np.corrcoef(e[:-1], e[1:])[0, 1] for e in errors.T]).max() < 0.06


def test_urban_gps_wanders_and_drops_out() -> None:
    """Variance against averaging time: white noise averages out in seconds, the wander does not."""
    gps = suite("urban").gps
    found = moving(1_500_000, gps)  # 100 minutes
    late = round(gps.delay * RATE)
    good = np.array([fix.fix_type == FIX_3D for _, fix in found])
    east = np.array([fix.position[0] - (tick - late) for tick, fix in found])[:, None]
    second = allan_deviation(east, 10)[0] ** 2
    wander = gps.horizontal_wander**2 * (1.0 / gps.wander_time) * (2.0 / 3.0)  # of a Gauss-Markov at 1 s
    assert second == pytest.approx(0.5**2 / 10 + wander, rel=0.15)
    assert east.std() == pytest.approx(math.hypot(0.5, gps.horizontal_wander), rel=0.35)
    losses = np.count_nonzero(np.diff(good.astype(int)) < 0)
    assert losses == pytest.approx(30 / 60 * 100, rel=0.5)
    assert (~good).mean() == pytest.approx(30 * 4 / 3600, rel=0.6)


def test_failing_gps() -> None:
    ideal = Gps()
    assert [tick for tick, _ in moving(200, ideal, doing={60: OFF, 130: WORKS})] == [0, 25, 50, 150, 175]
    lost = dict(moving(200, ideal, doing={60: LOST}))
    assert [fix.fix_type for fix in lost.values()] == [FIX_3D] * 3 + [NO_FIX] * 5
    stuck = dict(moving(200, ideal, doing={60: STUCK}))
    assert [fix.position[0] for fix in stuck.values()] == [0, 25, 50] + [50] * 5
    wrong = dict(moving(200, ideal, doing={60: WRONG}))
    assert wrong[75].position[0] == pytest.approx(95.0)
    assert abs(dict(moving(200, ideal, doing={60: GARBAGE}))[75].position[1]) > 0.0


def test_tracker_sees_the_load_in_the_body() -> None:
    tracker, x = Tracker(rate=25.0, delay=0.04, field_of_view=0.5), np.zeros(STATE_SIZE)
    x[6:10] = math.cos(math.pi / 4), 0.0, 0.0, math.sin(math.pi / 4)  # nose to the north
    x[13:16] = 0.3, 0.0, -1.5
    camera = LoadTracker(tracker, 1.0 / RATE, 1)
    seen = [(tick, s) for tick in range(40) if (s := camera.sample(tick, x)) is not None]
    assert [tick for tick, _ in seen] == [10, 20, 30]
    np.testing.assert_allclose(seen[0][1].position, (0.0, -0.3, -1.5), atol=1e-12)
    camera.sample(41, x)
    x[13] = 1.0  # out of the field of view
    assert all(camera.sample(tick, x) is None for tick in range(60, 90))


@pytest.mark.parametrize("doing", [WORKS, OFF, STUCK, WRONG, GARBAGE])
def test_tracker_fails(doing: int) -> None:
    """The load moves 0.25 m forward from sighting to sighting; the fault begins after the second."""
    camera, x = LoadTracker(Tracker(rate=25.0, range=5.0), 1.0 / RATE, 1), np.zeros(STATE_SIZE)
    x[6], x[15] = 1.0, -2.0
    seen = []
    for tick in range(50):
        camera.doing = doing if tick > 15 else WORKS
        x[13] = tick / 40.0
        if (sighting := camera.sample(tick, x)) is not None:
            seen.append(sighting.position)
    begin, end = seen[:2], np.array(seen[2:])
    np.testing.assert_allclose(begin, [(0.0, 0.0, -2.0), (0.25, 0.0, -2.0)], atol=1e-12)
    true = np.array([(forward, 0.0, -2.0) for forward in (0.5, 0.75, 1.0)])
    if doing == OFF:
        assert not len(end)
    elif doing == GARBAGE:
        assert np.all(np.abs(end) <= 5.0)
        assert np.all(np.linalg.norm(end - true, axis=1) > 0.1)
    else:
        expected = {WORKS: true, STUCK: [begin[1]] * 3, WRONG: true + np.array([0.5, 0.0, 0.0])}
        np.testing.assert_allclose(end, expected[doing], atol=1e-12)


def test_tracker_noise() -> None:
    camera = LoadTracker(Tracker(rate=200.0, angle_noise=0.01, distance_noise=0.03), 1.0 / RATE, 1)
    x = np.zeros(STATE_SIZE)
    x[6], x[15] = 1.0, -2.0
    positions = np.array([s.position for tick in range(5000) if (s := camera.sample(tick, x)) is not None])
    np.testing.assert_allclose(positions.std(axis=0), [0.02, 0.02, 0.06], rtol=0.05)


def test_world_measures_specific_force_with_cable_and_ground() -> None:
    """At rest on the legs +g along body z; in hover the thrust alone over the vehicle's mass, less the
    cable's pull."""
    standing = World(load_vehicle("iris", IDEAL), RATE, 1)
    standing.advance(20)
    standing.measure(1, False)
    np.testing.assert_allclose(standing.measurement["accelerometer"][0], [0, 0, 9.81], atol=1e-6)
    hovering = World(load_vehicle("iris", ["initial.start=hover", *IDEAL]), RATE, 1)
    hovering.measure(1, False)
    np.testing.assert_allclose(hovering.measurement["accelerometer"][0], [0, 0, 9.81], atol=1e-6)
    hovering.release_cable()
    hovering.measure(2, False)
    np.testing.assert_allclose(hovering.measurement["accelerometer"][0], [0, 0, 9.81 * 1.8 / 1.5], rtol=1e-9)
    falling = World(load_vehicle("iris", ["initial.start=hover", *IDEAL]), RATE, 1)
    falling.release_cable()
    falling.command([0.0] * 16)
    falling.advance(200)
    falling.measure(1, False)
    drag = 0.25 * -falling.state[5] + 0.03 * falling.state[5] ** 2
    np.testing.assert_allclose(falling.measurement["accelerometer"][0], [0, 0, drag / 1.5], atol=1e-4)
