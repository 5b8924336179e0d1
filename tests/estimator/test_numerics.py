"""The covariance over a million updates, the transition against differences, and a loop without allocation.

What a tick costs is measured by `sitl bench` (`estimator_update_us`), not here: a test's machine may be busy.
"""

import gc
import sys
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy.spatial.transform import Rotation

from controller.estimator.correct.update import CORRECTION, SMALLEST_SWING, inject
from controller.estimator.filter import Estimator, eq31_jacobian
from controller.estimator.records import ERROR_SIZE, LOAD_ON_CABLE, PARTS, SENSORS, X_LOAD, Array
from sitl_bridge import compiled
from sitl_bridge.vehicle.description import hover_rotor_speed
from tests.estimator.flights import CONSUMER, PERIOD
from tests.estimator.test_accuracy import paper

FIX_EVERY = 25
"""ticks from one GPS fix to the next"""


def hovering(ticks: int, rest_length: float = 1.0) -> Estimator:
    """A filter that hovers with sensors that read what it expects, but for a tremor (see `load`)."""
    vehicle = paper(rest_length)
    estimator = Estimator(vehicle, PERIOD, CONSUMER)
    for k in range(200 + ticks):
        load(estimator, k)
        if k == 200:
            estimator.take_off()
        estimator.tick(k * PERIOD)
        if k >= 200:
            estimator.command(np.full(4, hover_rotor_speed(vehicle)))
    return estimator


def load(estimator: Estimator, k: int) -> None:
    """Give tick k what the sensors read; one that repeats itself to the last digit would count as stuck."""
    east, north, up = CONSUMER.field
    tremor = 1e-3 * (k % 3 - 1)
    estimator.imu((tremor, 0.0, 9.81), (0.1 * tremor, 0.0, 0.0))
    estimator.magnetometer((east + tremor, north, up))
    estimator.barometer(0.0)
    if k % FIX_EVERY == 0:
        estimator.gps(max(0.0, k * PERIOD - 0.108), (tremor, 0.0, 0.0), (0.0, 0.0, 0.0))


def test_covariance_over_a_million_updates() -> None:
    """Symmetric to the last bit after a prediction's worth, positive, and unchanged once it is steady."""
    estimator = hovering(5000)
    steady = estimator.error_covariance.copy()
    m = estimator.memory
    fused, refused = int(m["nis_count"].sum()), m["rejected"].copy()
    k = 5200
    while int(m["nis_count"].sum()) - fused < 1_000_000:
        load(estimator, k)
        estimator.tick(k * PERIOD)
        k += 1
    assert np.array_equal(m["rejected"], refused)  # all sensors took part
    cov = estimator.error_covariance
    scale = np.sqrt(np.diag(cov))
    known = scale > 0.0
    normalised = (cov / np.outer(scale, scale).clip(1e-300))[np.ix_(known, known)]
    assert np.abs(normalised - normalised.T).max() < 1e-9
    assert np.linalg.eigvalsh(normalised).min() > 1e-9
    assert np.all(np.diag(cov)[:12] <= 1.05 * np.diag(steady)[:12])
    assert np.all(np.isfinite(estimator.state()))
    assert m["rejected"].max() < 10  # at take-off; or not everything was fused


def test_ticks_neither_keep_memory_nor_compile(monkeypatch: pytest.MonkeyPatch) -> None:
    """Thousands of ticks, with every kind of update, keep no more memory than a few do, and compile nothing.

    The build refuses machine code that allocates, so what could grow is on Python's side of the call. numpy
    keeps some small blocks for use again: these do not grow with time.
    """
    estimator = hovering(2000)
    at = 2200

    def kept() -> int:
        """Bytes that our own lines hold; what a test runner's other threads do meanwhile is not ours."""
        gc.collect()
        traces = tracemalloc.take_snapshot().filter_traces(ours).traces
        return sum(trace.size for trace in traces)

    def run(ticks: int) -> int:
        """Bytes that so many ticks keep."""
        nonlocal at
        before = kept()
        for k in range(at, at + ticks):
            load(estimator, k)
            estimator.tick(k * PERIOD)
            estimator.command(speeds)
        at += ticks
        return kept() - before

    def refuse(entry: compiled.EntryPoint) -> None:
        raise AssertionError(f"{entry.name} is loaded or compiled in the loop")

    monkeypatch.setattr(compiled.EntryPoint, "_load", refuse)
    speeds = np.full(4, hover_rotor_speed(estimator.vehicle))
    root = Path(__file__).parents[2]
    ours = [tracemalloc.Filter(True, f"{root / part}*") for part in ("controller", "sitl_bridge", "tests")]
    tracemalloc.start()
    try:
        ticks = 10_000
        smallest_leak = sys.getsizeof(object()) * ticks // FIX_EVERY
        # A leak, if only of one object at every fix, shows each time; what is kept for use again does not.
        assert min(run(ticks) for _ in range(6)) < smallest_leak / 2
    finally:
        tracemalloc.stop()


@given(hnp.arrays(float, 3, elements=st.floats(-0.5, 0.5)), st.integers(0, 2**32 - 1))
def test_a_correction_turns_the_hanging_load(correction: Array, seed: int) -> None:
    """What lies along the cable stretches it, the rest turns it, and the covariance turns with it."""
    estimator = Estimator(paper(1.0), PERIOD, CONSUMER)
    estimator.memory["load_mode"] = LOAD_ON_CABLE
    f = estimator.arrays[0].view(np.recarray)[0]
    part = PARTS["load"]
    random = np.random.default_rng(seed)
    place = random.normal(loc=(0.0, 0.0, -3.0))
    root = random.normal(size=(ERROR_SIZE, ERROR_SIZE))
    before = root @ root.T
    along = place / np.linalg.norm(place)
    f.x[X_LOAD : X_LOAD + 3], f.P[...] = place, before
    f.vectors[CORRECTION] = 0.0
    f.vectors[CORRECTION][part] = correction
    inject(f)
    now = np.array(f.x[X_LOAD : X_LOAD + 3])
    assert np.linalg.norm(now) == pytest.approx(np.linalg.norm(place) + along @ correction, abs=1e-8)
    across = correction - along * (along @ correction)
    angle = np.linalg.norm(across) / np.linalg.norm(place)
    rotation = Rotation.from_rotvec(angle * np.cross(along, across / max(1e-300, np.linalg.norm(across))))
    assert now / np.linalg.norm(now) == pytest.approx(rotation.apply(along), abs=1e-9)
    turned = np.eye(ERROR_SIZE)
    turned[part, part] = rotation.as_matrix()
    assert np.abs(f.P - turned @ before @ turned.T).max() < 200.0 * SMALLEST_SWING
    assert np.array_equal(f.P, f.P.T)


def test_covariance_in_the_order_of_eq_31() -> None:
    """The load's absolute variance has both parts and their correlation; attitude is in Euler angles."""
    estimator = hovering(1000)
    cov, error = estimator.covariance(), estimator.error_covariance
    assert cov.shape == (18, 18)
    assert cov[3, 3] == pytest.approx(error[0, 0] + 2.0 * error[0, 19] + error[19, 19])
    assert eq31_jacobian(0.0, 0.0)[15:18, 6:9] == pytest.approx(np.eye(3))


def test_transition_against_differences() -> None:
    """The transition matrix that a tick used, against differences of the prediction itself."""
    estimator = hovering(50)
    nominal = estimator.nominal
    nominal[6:10] = np.array([0.98, 0.1, -0.12, 0.1]) / np.linalg.norm([0.98, 0.1, -0.12, 0.1])
    nominal[10:13] = (0.3, -0.2, 0.1)
    nominal[20:23] = (0.4, -0.3, -1.8)
    nominal[23:26] = (0.3, 0.5, -0.4)
    nominal[26:29] = (0.2, 0.1, -0.1)
    start = nominal.copy()
    now = float(estimator.memory["time"])

    def predicted(delta: np.ndarray) -> np.ndarray:
        nominal[:] = moved(start, delta)
        estimator.memory["time"] = now
        estimator.tick(now + PERIOD)
        return nominal.copy()

    base = predicted(np.zeros(ERROR_SIZE))
    transition = estimator._filter["transition"][0].copy()
    step = 1e-5
    for column in [*range(12), *range(19, 28)]:
        delta = np.zeros(ERROR_SIZE)
        delta[column] = step
        forward = difference(predicted(delta), base)
        delta[column] = -step
        backward = difference(predicted(delta), base)
        numeric = (forward - backward) / (2.0 * step)
        rows = np.r_[0:12, 19:28]
        # second order in the step: what is left is of third order, 0.004 s times rates of at most 20 / s
        assert transition[rows, column] == pytest.approx(numeric[rows], abs=4e-4), column


def moved(nominal: np.ndarray, delta: np.ndarray) -> np.ndarray:
    """The nominal state plus an error."""
    out = nominal.copy()
    out[0:6] += delta[0:6]
    out[10:] += delta[9:]
    x, y, z = 0.5 * delta[6:9]
    w, i, j, k = nominal[6:10]
    turned = np.array(
        [
            w - i * x - j * y - k * z,
            i + w * x + j * z - k * y,
            j + w * y + k * x - i * z,
            k + w * z + i * y - j * x,
        ]
    )
    out[6:10] = turned / np.linalg.norm(turned)
    return out


def difference(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """a minus b as an error (34,)."""
    w, i, j, k = b[6:10]
    conjugate = np.array([[w, i, j, k], [-i, w, k, -j], [-j, -k, w, i], [-k, j, -i, w]])
    turn = conjugate @ a[6:10]
    return np.concatenate([a[0:6] - b[0:6], 2.0 * turn[1:] / turn[0], a[10:] - b[10:]])


def test_health_names_every_sensor() -> None:
    health = hovering(100).health()
    assert set(health.sensors) == set(SENSORS)
    assert health.aligned
    assert health.position
    assert not health.dead_reckoning
