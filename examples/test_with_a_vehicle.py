"""Test your own software against a vehicle: the fixture comes with the package. Run it with pytest."""

from pymavlink import mavutil

from sitl.testing import SimulatedVehicle


def test_the_vehicle_stands_disarmed_and_says_so(sitl_vehicle: SimulatedVehicle) -> None:
    link = mavutil.mavlink_connection(sitl_vehicle.mavproxy)
    beat = link.wait_heartbeat(timeout=10)
    assert beat is not None
    assert not beat.base_mode & mavutil.mavlink.MAV_MODE_FLAG_SAFETY_ARMED
