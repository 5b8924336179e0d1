"""Flying on the estimate over the HIL link, without sockets: neither boot time nor loss leaves a trace."""

from __future__ import annotations

import numpy as np
import pytest

from controller.design.names import ON_ESTIMATE
from controller.feedback.estimate import ALIGNMENT_TIME, EstimateFeedback
from controller.hil.session import HilSession, new_session
from controller.hil.ticks import TickReader
from controller.law.reference import setpoint
from controller.pilot.autopilot import Autopilot
from sitl_bridge.mavlink.framing import split
from sitl_bridge.mavlink.hil import HIL_SENSOR, SENSOR_RESET
from sitl_bridge.plant.clocks.lockstep import Lockstep
from sitl_bridge.plant.log.notices import Notices
from sitl_bridge.plant.simulation import Simulation
from sitl_bridge.vehicle.description import Vehicle
from sitl_bridge.vehicle.files import load_vehicle
from tests.plant.network import Faults, Network, Rows

RATE_HZ = 250.0


@pytest.fixture(scope="module")
def vehicle() -> Vehicle:
    return load_vehicle("paper", ["disturbance.force_std=5", "sensors.preset=consumer"])


class Flight:
    """A lockstep plant and an autopilot that flies on its estimate, on a network in memory."""

    def __init__(self, vehicle: Vehicle, faults: Faults, duration: float) -> None:
        self.rows = Rows()
        self.simulation = Simulation(vehicle, RATE_HZ, 3, duration_s=duration, recorder=self.rows)
        self.clock = Lockstep(self.simulation, Notices(lambda text: None), 0)
        self.feedback = EstimateFeedback(vehicle, RATE_HZ)
        self.session: HilSession = new_session(
            lambda controls: Autopilot(
                vehicle, ON_ESTIMATE, RATE_HZ, lambda start: setpoint((1.0, 2.0, 1.0), start), controls
            ),
            0,
            lambda text: None,
            self.feedback,
        )
        self.network = Network(self.clock, self.session, faults)
        self.clock.start(self.network.now)

    def fly(self) -> bytes:
        self.network.run(lambda: self.clock.finished)
        return self.rows.bytes()


def test_neither_boot_time_nor_loss_leaves_a_trace(vehicle: Vehicle) -> None:
    undisturbed = Flight(vehicle, Faults(), 1.0).fly()
    assert Flight(vehicle, Faults(drop=0.3, duplicate=0.2, jitter_s=0.01, seed=1), 1.0).fly() == undisturbed
    late = Flight(vehicle, Faults(drop=0.1, seed=2), 1.0)
    late.network.stalled.add("autopilot")
    began = late.network.now
    late.network.run(lambda: late.network.now > began + 0.777)
    late.network.stalled.clear()
    assert late.fly() == undisturbed
    assert Flight(load_vehicle("paper", ["disturbance.force_std=5"]), Faults(), 1.0).fly() != undisturbed


def test_the_sensors_begin_once_and_say_so(vehicle: Vehicle) -> None:
    flight = Flight(vehicle, Faults(), 0.2)
    flight.fly()
    sensors = [
        frame
        for datagram in flight.network.sent["plant"]
        for frame in split(datagram).frames
        if frame.message_id == HIL_SENSOR.message_id
    ]
    bits = [int.from_bytes(frame.payload[60:64].ljust(4, b"\0"), "little") for frame in sensors]
    marked = [index for index, value in enumerate(bits) if value & SENSOR_RESET]
    assert marked == [1]  # the second tick: the first was answered
    held = len(bits) - 1 - round(0.2 * RATE_HZ)
    assert held == round(ALIGNMENT_TIME * RATE_HZ)


def test_readings_are_in_si_units_and_the_autopilots_frames() -> None:
    attitude = "initial.attitude=[0.1, -0.2, 0.5]"
    simulation = Simulation(load_vehicle("paper", [attitude]), RATE_HZ, 3)
    reader = TickReader(0)
    simulation.heard()
    simulation.next_tick()
    tick = reader.read(simulation.datagram())
    measured, sensed = simulation.world.measurement[0], reader.sensed[0]
    assert sensed["has_imu"]
    assert sensed["has_magnetometer"]
    assert sensed["has_altitude"]
    assert sensed["has_begun"]
    assert tick.gps
    for name in ("accelerometer", "gyroscope", "magnetometer"):
        np.testing.assert_allclose(sensed[name], measured[name], rtol=1e-6, atol=1e-9)
    assert float(sensed["altitude"]) == pytest.approx(float(measured["pressure_altitude"]), abs=1e-4)


def test_a_tracker_sharpens_the_load() -> None:
    sharp = load_vehicle(
        "paper",
        [
            "disturbance.force_std=5",
            "sensors.preset=consumer",
            "sensors.tracker.angle_noise=0.005",
            "sensors.tracker.distance_noise=0.01",
            "sensors.tracker.delay=0.05",
        ],
    )
    flight = Flight(sharp, Faults(), 4.0)
    flight.fly()
    tracker = flight.feedback.estimator.health().sensors["tracker"]
    assert tracker.age < 0.1
    assert tracker.rejected == 0
    assert tracker.nis == pytest.approx(1.0, abs=0.4)


def test_it_flies_where_it_is_told(vehicle: Vehicle) -> None:
    flight = Flight(vehicle, Faults(), 15.0)
    flight.fly()
    load = np.array([row[14:17] for row in flight.rows.rows[-1250:]])
    assert np.sqrt(np.mean((load - [1.0, 2.0, 1.0]) ** 2, axis=0)) == pytest.approx(np.zeros(3), abs=0.25)
    truth = flight.simulation.world.state
    relative = flight.feedback.estimator.nominal[20:23]
    assert relative == pytest.approx(truth[13:16] - truth[0:3], abs=0.06)
