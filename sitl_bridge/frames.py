"""The only place where ENU/FLU meets NED/FRD, where metres meet degrees, and SI meets wire units.

Inside the code the world is ENU with z up, the body FLU, SI units. On the wire MAVLink wants NED/FRD,
degrees times 1e7, gauss, hPa, millimetres and centimetres. Quaternions are (w, x, y, z) and rotate
body vectors into the world.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from sitl_bridge.compiled import kernel

Triple = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]

# World Geodetic System 1984: semi-major axis (m) and first eccentricity squared.
WGS84_SEMI_MAJOR_AXIS = 6378137.0
WGS84_ECCENTRICITY_SQUARED = 6.69437999014e-3

# Wire units: multiply an SI value to get the integer or float field of a message.
DEG_E7_PER_DEG = 1e7
MILLIMETRES_PER_METRE = 1e3
CENTIMETRES_PER_METRE = 1e2
CENTIDEGREES_PER_RADIAN = 100.0 * 180.0 / math.pi
MILLISECONDS_PER_SECOND = 1e3
MICROSECONDS_PER_SECOND = 1e6
HECTOPASCALS_PER_PASCAL = 1e-2
GAUSS_PER_TESLA = 1e4
MILLIVOLTS_PER_VOLT = 1e3
CENTIAMPERES_PER_AMPERE = 1e2
MILLIAMPERE_HOURS_PER_AMPERE_HOUR = 1e3
PERCENT = 1e2
STANDARD_GRAVITY = 9.80665
MILLI_G_PER_METRE_PER_SECOND_SQUARED = 1e3 / STANDARD_GRAVITY

_HALF = math.sqrt(0.5)


@kernel
def enu_to_ned(v: Triple) -> Triple:
    """World vector, ENU to NED; its own inverse."""
    return (v[1], v[0], -v[2])


@kernel
def flu_to_frd(v: Triple) -> Triple:
    """Body vector, FLU to FRD; its own inverse."""
    return (v[0], -v[1], -v[2])


@kernel
def attitude_to_ned_frd(q: Quaternion) -> Quaternion:
    """Attitude (FLU to ENU) as MAVLink has it (FRD to NED): C·R·D as a product of quaternions.

    C turns by 180 degrees about the bisector of east and north, D by 180 degrees about the body's x.
    The result has w >= 0.
    """
    w, x, y, z = q
    out = (-_HALF * (w + z), -_HALF * (x + y), _HALF * (y - x), _HALF * (z - w))
    return out if out[0] >= 0.0 else (-out[0], -out[1], -out[2], -out[3])


attitude_to_enu_flu = (
    attitude_to_ned_frd  # C and D are their own inverses, so the same product serves both ways
)


@kernel
def rotate(q: Quaternion, v: Triple) -> Triple:
    """Rotate a body vector into the world by a unit quaternion."""
    w, x, y, z = q
    tx, ty, tz = 2 * (y * v[2] - z * v[1]), 2 * (z * v[0] - x * v[2]), 2 * (x * v[1] - y * v[0])
    return (
        v[0] + w * tx + y * tz - z * ty,
        v[1] + w * ty + z * tx - x * tz,
        v[2] + w * tz + x * ty - y * tx,
    )


@kernel
def rotate_inverse(q: Quaternion, v: Triple) -> Triple:
    """Rotate a world vector into the body by a unit quaternion."""
    return rotate((q[0], -q[1], -q[2], -q[3]), v)


Matrix = tuple[float, float, float, float, float, float, float, float, float]


@kernel
def rotation_matrix(qw: Any, qx: Any, qy: Any, qz: Any) -> Matrix:
    """Body to world, row by row, of a unit quaternion."""
    return (
        1 - 2 * (qy * qy + qz * qz),
        2 * (qx * qy - qw * qz),
        2 * (qx * qz + qw * qy),
        2 * (qx * qy + qw * qz),
        1 - 2 * (qx * qx + qz * qz),
        2 * (qy * qz - qw * qx),
        2 * (qx * qz - qw * qy),
        2 * (qy * qz + qw * qx),
        1 - 2 * (qx * qx + qy * qy),
    )


@kernel
def euler_from_quaternion(q: Quaternion) -> Triple:
    """Roll, pitch, yaw in rad, for R = Rz(yaw)·Ry(pitch)·Rx(roll)."""
    w, x, y, z = q
    return (
        math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)),
        math.asin(max(-1.0, min(1.0, 2 * (w * y - z * x)))),
        math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)),
    )


def quaternion_from_euler(euler: Triple) -> Quaternion:
    """Unit quaternion from roll, pitch, yaw in rad, for R = Rz(yaw)·Ry(pitch)·Rx(roll)."""
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(a / 2), math.sin(a / 2)) for a in euler)
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


def heading_from_yaw(yaw: float) -> float:
    """Compass heading (rad, clockwise from north, -pi..pi) from ENU yaw (anticlockwise from east)."""
    return math.remainder(math.pi / 2 - yaw, 2 * math.pi)


yaw_from_heading = heading_from_yaw  # the same reflection serves both ways


class Geodetic(NamedTuple):
    """WGS 84 latitude and longitude in degrees, altitude in m above mean sea level."""

    latitude: float
    longitude: float
    altitude: float


class LocalOrigin:
    """The tangent plane at home: ENU metres to latitude, longitude and altitude, and back.

    Equirectangular about home, with the ellipsoid's radii of curvature there; height along the plumb line.
    """

    def __init__(self, latitude: float, longitude: float, altitude: float) -> None:
        self.home = Geodetic(latitude, longitude, altitude)
        sine = math.sin(math.radians(latitude))
        curvature = 1.0 - WGS84_ECCENTRICITY_SQUARED * sine * sine
        normal = WGS84_SEMI_MAJOR_AXIS / math.sqrt(curvature)
        meridional = normal * (1.0 - WGS84_ECCENTRICITY_SQUARED) / curvature
        self._degrees_per_metre_north = math.degrees(1.0 / (meridional + altitude))
        self._degrees_per_metre_east = math.degrees(
            1.0 / ((normal + altitude) * math.cos(math.radians(latitude)))
        )

    @property
    def degrees_per_metre(self) -> tuple[float, float]:
        """Of longitude to the east, and of latitude to the north."""
        return self._degrees_per_metre_east, self._degrees_per_metre_north

    def geodetic(self, position: Triple) -> Geodetic:
        """Position in ENU metres from home, as latitude and longitude (deg) and altitude (m)."""
        return Geodetic(
            self.home.latitude + position[1] * self._degrees_per_metre_north,
            self.home.longitude + position[0] * self._degrees_per_metre_east,
            self.home.altitude + position[2],
        )

    def local(self, point: Geodetic) -> Triple:
        """Latitude and longitude (deg) and altitude (m) as ENU metres from home."""
        return (
            (point.longitude - self.home.longitude) / self._degrees_per_metre_east,
            (point.latitude - self.home.latitude) / self._degrees_per_metre_north,
            point.altitude - self.home.altitude,
        )


def fix_from_wire(gps: Any, origin: LocalOrigin) -> tuple[Triple, Triple]:
    """Position (m) and velocity (m/s), ENU from home, of a HIL_GPS record."""
    point = Geodetic(
        int(gps["lat"]) / DEG_E7_PER_DEG,
        int(gps["lon"]) / DEG_E7_PER_DEG,
        int(gps["alt"]) / MILLIMETRES_PER_METRE,
    )
    north, east, down = (int(gps[name]) / CENTIMETRES_PER_METRE for name in ("vn", "ve", "vd"))
    return origin.local(point), enu_to_ned((north, east, down))
