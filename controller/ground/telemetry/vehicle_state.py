"""What the services know of the vehicle: its description once, its state as the control loop sees it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from sitl_bridge.frames import Geodetic, LocalOrigin, Quaternion, Triple
from sitl_bridge.ids import load_system, vehicle_system
from sitl_bridge.vehicle.description import Gripper, Vehicle, Winch


@dataclass(slots=True)
class Profile:
    """The facts about one vehicle that its services need. A winch changes the cable's lengths in flight."""

    name: str
    instance: int
    origin: LocalOrigin
    rest_length: float
    """m, of the cable"""
    hover_length: float
    """m, of the cable with the load at rest on it"""
    gravity: float
    """m/s²"""
    has_ground: bool
    """False: there is nothing to land on (`paper`)."""
    ground_height: float = 0.0
    """m ENU, of the ground's surface"""
    battery_cells: int | None = None
    """In series; None: there is no battery."""
    hover_thrust: float = 0.5
    """That carries vehicle and load, as a share of what the rotors can give"""
    gripper: Gripper | None = None
    """None: there is none."""
    winch: Winch | None = None
    """None: there is none."""

    @property
    def system(self) -> int:
        """MAVLink system of the vehicle."""
        return vehicle_system(self.instance)

    @property
    def load_system(self) -> int:
        """MAVLink system of the load."""
        return load_system(self.instance)


def profile_of(vehicle: Vehicle, instance: int = 0, has_ground: bool = True) -> Profile:
    """The profile of a described vehicle."""
    home = vehicle.home
    return Profile(
        vehicle.name,
        instance,
        LocalOrigin(home.latitude, home.longitude, home.altitude),
        vehicle.cable.rest_length,
        vehicle.hover_length,
        vehicle.gravity,
        has_ground,
        0.0 if vehicle.ground is None else vehicle.ground.height,
        None if vehicle.battery is None else vehicle.battery.cells,
        vehicle.hover_thrust / sum(r.thrust_coefficient * r.max_speed**2 for r in vehicle.rotors),
        vehicle.gripper,
        vehicle.winch,
    )


@dataclass(slots=True)
class Health:
    """Which sensors and estimates are there and good."""

    gyroscope: bool = True
    accelerometer: bool = True
    magnetometer: bool = True
    barometer: bool = True
    gps: bool = True
    attitude: bool = True
    position: bool = True
    load: bool = True
    wrong: str = ""
    """An inertial sensor with a lasting error, which is taken out; empty: there is none"""


@dataclass(slots=True)
class Gps:
    """What the receiver says; without a fix, next to nothing."""

    fix_type: int = 0
    """GPS_FIX_TYPE: 0 no receiver, 1 no fix, 3 a fix in three dimensions"""
    satellites: int = 255
    """255: not known"""
    horizontal_accuracy: float = math.nan
    """m"""
    vertical_accuracy: float = math.nan
    """m"""
    position: Geodetic | None = None
    """Of the last fix; None: there was none."""
    velocity: Triple = (math.nan, math.nan, math.nan)
    """m/s, ENU"""


@dataclass(slots=True)
class EstimateQuality:
    """What ESTIMATOR_STATUS says beyond `Health`; ratios are innovations as parts of their gates."""

    velocity: bool
    dead_reckoning: bool
    """No GPS for a while: the horizontal position drifts"""
    gps_glitch: bool
    velocity_ratio: float
    position_ratio: float
    height_ratio: float
    heading_ratio: float
    horizontal_accuracy: float
    """m, one standard deviation"""
    vertical_accuracy: float
    """m, one standard deviation"""


@dataclass(slots=True)
class VehicleView:
    """The vehicle as its control loop sees it now. ENU from the world's origin, the body FLU."""

    time: float
    """s since the autopilot's start, on the plant's clock"""
    position: Triple
    """m, ENU"""
    velocity: Triple
    """m/s, ENU"""
    attitude: Quaternion
    """FLU to ENU"""
    body_rates: Triple
    """rad/s, FLU"""
    load_position: Triple
    """m, ENU"""
    load_velocity: Triple
    """m/s, ENU"""
    load_attached: bool = True
    cable_taut: bool = True
    vehicle_on_ground: bool = False
    load_on_ground: bool = False
    health: Health = field(default_factory=Health)
    hil_age: float = 0.0
    """s since the last HIL_SENSOR; inf before the first"""
    throttle: float = 0.0
    """collective, 0..1"""
    rotors: tuple[float, ...] = ()
    """Command of each rotor, 0..1; empty: disarmed"""
    battery_voltage: float = math.nan
    """V"""
    battery_current: float = math.nan
    """A"""
    battery_remaining: float = math.nan
    """0..1"""
    acceleration: Triple = (0.0, 0.0, 9.81)
    """m/s², specific force in the body"""
    gps: Gps = field(default_factory=Gps)
    quality: EstimateQuality | None = None
    """None: the feedback is the truth"""
    estimated: bool = True
    """False: the vehicle fell over, and there is no estimate of it; its place is that of the last fix"""

    @property
    def in_reach(self) -> bool:
        """Whether the state is made of finite numbers within 1000 km."""
        size = math.hypot(*self.position, *self.velocity, *self.load_position, *self.load_velocity)
        return size < 1e6 and math.hypot(*self.attitude) < 2.0  # a NaN fails both
