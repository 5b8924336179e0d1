"""When a vehicle is lost: turned over, on the ground in flight, or far away. The flight ends soon after."""

from __future__ import annotations

import math

from sitl_bridge.frames import rotate
from sitl_bridge.plant.physics.state import ATTITUDE, BODY_RATES, VEHICLE_POSITION, Array
from sitl_bridge.vehicle.description import Vehicle

FAR = 5000.0
"""m from where the vehicle started, beyond which nobody flies a scenario."""
TUMBLING = 5.0
"""rad/s, of roll and pitch: tilted and turning so fast, a vehicle is between two looks at it upside down."""
CRASHED_BELOW = 0.5
"""Cosine of the tilt, 60 degrees: a vehicle that touches the ground more tilted has crashed."""
GRACE = 3.0
"""s that a flight goes on after its vehicle is lost: what happened is in the log."""
LOOK_INTERVAL = 0.1
"""s between two looks."""
LOOKS = 4
"""In a row, after which a vehicle that is not upside down is lost: one that turns fast may catch itself."""


def condition(vehicle: Vehicle, x: Array, cable_holds: bool) -> str | None:
    """What happened to the vehicle of state x (19,), in words; None: it stands or flies with its load."""
    up = upright(x)
    height = math.inf if vehicle.ground is None else x[VEHICLE_POSITION][2] - vehicle.ground.height
    if height < _reach(vehicle) and (up < CRASHED_BELOW or is_lost(vehicle, x)):
        return "crashed"
    if up < 0.0:
        return "upside down"
    if not cable_holds:
        return "load lost"
    return "out of control" if is_lost(vehicle, x) else None


def upright(x: Array) -> float:
    """Cosine of the angle between the vehicle's up axis and the world's."""
    w, qx, qy, qz = x[ATTITUDE].tolist()
    return float(rotate((w, qx, qy, qz), (0.0, 0.0, 1.0))[2])


def _reach(vehicle: Vehicle) -> float:
    """Height of the centre, m, below which some part of a vehicle may touch the ground."""
    legs = max((math.hypot(*leg) for leg in vehicle.airframe.legs), default=0.0)
    return max(legs, *(math.hypot(*rotor.position) for rotor in vehicle.rotors))


def is_lost(vehicle: Vehicle, x: Array) -> bool:
    """Whether the vehicle of state x (19,) does not come back by itself."""
    up = upright(x)
    roll_rate, pitch_rate, _ = x[BODY_RATES].tolist()
    tumbles = math.hypot(roll_rate, pitch_rate) > TUMBLING and up < 0.7
    if up < 0.0 or tumbles:
        return True
    east, north, up = x[VEHICLE_POSITION].tolist()
    start = vehicle.initial_vehicle_position
    if not math.dist((east, north, up), start) < FAR:
        return True
    if vehicle.ground is None or vehicle.initial.start == "ground" or not vehicle.airframe.legs:
        return False
    legs = -min(leg[2] for leg in vehicle.airframe.legs)
    return bool(up < vehicle.ground.height + 0.8 * legs)
