"""Who is who on the wire: MAVLink system and component ids, UDP ports of instance N, number of controls."""

from __future__ import annotations

COMPONENT_AUTOPILOT = 1
COMPONENT_TRUTH = 191  # MAV_COMP_ID_ONBOARD_COMPUTER: the plant speaking about the vehicle
COMPONENT_LOAD = 35  # ArduPilot's precedent for a simulated slung payload
COMPONENT_WINCH = 169  # MAV_COMP_ID_WINCH: MAVSDK addresses DO_WINCH to it

ACTUATOR_CONTROLS = 16
"""Controls in HIL_ACTUATOR_CONTROLS: the most rotors that a vehicle can have."""

# Actuator controls after the rotors', where a vehicle has a gripper or a winch; see docs/plant.md.
GRIPPER_CONTROL, WINCH_CONTROL, CLUTCH_CONTROL = 0, 1, 2
"""Which of the controls that follow the last rotor's each is."""
HOIST_CONTROLS = 3

HIL_UDP_PORT = 14560
HIL_TCP_PORT = 4560


def vehicle_system(instance: int) -> int:
    """MAVLink system of the vehicle."""
    return instance + 1


def load_system(instance: int) -> int:
    """MAVLink system of the load."""
    return instance + 101


MOST_INSTANCES = 100
"""Instances 0..99: vehicles are systems 1..100, loads 101..200; never 0 or 255."""
