"""Frames, attitudes and geodesy, against scipy's rotations and an earth-centred computation."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from sitl_bridge import frames
from sitl_bridge.frames import Geodetic, LocalOrigin, Quaternion, Triple

Array = NDArray[np.float64]

lengths = st.floats(-1e4, 1e4)
vectors = st.tuples(lengths, lengths, lengths)
angles = st.floats(-math.pi, math.pi)
pitches = st.floats(-1.5, 1.5)
eulers = st.tuples(angles, pitches, angles)

# Columns: where the axes of one frame point in the other.
NED_FROM_ENU = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1]])
FRD_FROM_FLU = np.diag([1, -1, -1])


@st.composite
def quaternions(draw: st.DrawFn) -> Quaternion:
    """Unit quaternions over the whole sphere, half turns and poles among them."""
    parts = draw(st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda q: math.hypot(*q) > 1e-3))
    norm = math.hypot(*parts)
    return (parts[0] / norm, parts[1] / norm, parts[2] / norm, parts[3] / norm)


def rotation(q: Quaternion) -> Rotation:
    return Rotation.from_quat(q, scalar_first=True)


def matrix(q: Quaternion) -> Array:
    return np.asarray(rotation(q).as_matrix())


def test_unit_vectors() -> None:
    east, north, up = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    assert frames.enu_to_ned(north) == (1, 0, 0)
    assert frames.enu_to_ned(east) == (0, 1, 0)
    assert frames.enu_to_ned(up) == (0, 0, -1)
    forward, left = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
    assert frames.flu_to_frd(forward) == (1, 0, 0)
    assert frames.flu_to_frd(left) == (0, -1, 0)
    assert frames.flu_to_frd(up) == (0, 0, -1)


@given(vectors)
def test_vectors_against_matrices_and_back(v: Triple) -> None:
    assert frames.enu_to_ned(v) == tuple(NED_FROM_ENU @ v)
    assert frames.flu_to_frd(v) == tuple(FRD_FROM_FLU @ v)
    assert frames.enu_to_ned(frames.enu_to_ned(v)) == v
    assert frames.flu_to_frd(frames.flu_to_frd(v)) == v


@given(quaternions())
def test_the_matrix_of_an_attitude(q: Quaternion) -> None:
    np.testing.assert_allclose(np.reshape(frames.rotation_matrix(*q), (3, 3)), matrix(q), atol=1e-14)


@pytest.mark.parametrize(
    ("yaw_enu", "yaw_ned"), [(0.0, 90.0), (90.0, 0.0), (180.0, -90.0), (-90.0, 180.0), (45.0, 45.0)]
)
def test_level_attitudes_on_the_wire(yaw_enu: float, yaw_ned: float) -> None:
    """East is 0 degrees of yaw in ENU and 90 in NED."""
    q = frames.attitude_to_ned_frd(frames.quaternion_from_euler((0, 0, math.radians(yaw_enu))))
    expected = Rotation.from_euler("Z", yaw_ned, degrees=True)
    assert (rotation(q) * expected.inv()).magnitude() < 1e-12


@given(quaternions())
def test_attitude_on_the_wire_is_the_product_of_matrices(q: Quaternion) -> None:
    wire = frames.attitude_to_ned_frd(q)
    np.testing.assert_allclose(matrix(wire), NED_FROM_ENU @ matrix(q) @ FRD_FROM_FLU, atol=1e-14)
    assert wire[0] >= 0
    assert math.hypot(*wire) == pytest.approx(1, abs=1e-15)


@given(quaternions())
def test_attitude_comes_back_from_the_wire(q: Quaternion) -> None:
    back = frames.attitude_to_enu_flu(frames.attitude_to_ned_frd(q))
    assert min(math.dist(back, q), math.dist(back, tuple(-part for part in q))) < 1e-15


@given(quaternions(), vectors)
def test_rotate_against_scipy(q: Quaternion, v: Triple) -> None:
    scale = max(1.0, math.hypot(*v))
    world, body = frames.rotate(q, v), frames.rotate_inverse(q, v)
    np.testing.assert_allclose(world, rotation(q).apply(v), rtol=0, atol=1e-14 * scale)
    np.testing.assert_allclose(body, rotation(q).inv().apply(v), rtol=0, atol=1e-14 * scale)
    np.testing.assert_allclose(frames.rotate_inverse(q, world), v, rtol=0, atol=1e-14 * scale)


@given(quaternions(), vectors)
def test_rotating_then_converting_is_converting_then_rotating(q: Quaternion, v: Triple) -> None:
    one = frames.enu_to_ned(frames.rotate(q, v))
    other = frames.rotate(frames.attitude_to_ned_frd(q), frames.flu_to_frd(v))
    np.testing.assert_allclose(one, other, rtol=0, atol=1e-14 * max(1.0, math.hypot(*v)))


@given(eulers)
def test_quaternion_from_euler_against_scipy(euler: Triple) -> None:
    """R = Rz(yaw) Ry(pitch) Rx(roll): intrinsic rotations about Z, then Y, then X."""
    expected = Rotation.from_euler("ZYX", euler[::-1])
    q = frames.quaternion_from_euler(euler)
    np.testing.assert_allclose(matrix(q), expected.as_matrix(), atol=1e-14)
    assert math.hypot(*q) == pytest.approx(1, abs=1e-15)


@given(eulers)
def test_euler_angles_come_back(euler: Triple) -> None:
    back = frames.euler_from_quaternion(frames.quaternion_from_euler(euler))
    # Asin loses digits towards a pitch of 90 degrees, as 1 / cos(pitch).
    tolerance = 1e-14 / math.cos(euler[1])
    for angle, returned in zip(euler, back, strict=True):
        assert abs(math.remainder(angle - returned, 2 * math.pi)) < tolerance


@given(quaternions())
def test_euler_angles_are_those_of_the_matrix_up_to_the_pole(q: Quaternion) -> None:
    r = matrix(q)
    roll, pitch, yaw = frames.euler_from_quaternion(q)
    assert math.sin(pitch) == pytest.approx(-r[2, 0], abs=1e-14)
    assert -math.pi / 2 <= pitch <= math.pi / 2
    # (sin, cos) of roll and yaw times cos(pitch) are entries of R (eq. 2, corrected).
    across = math.hypot(r[2, 1], r[2, 2])
    np.testing.assert_allclose([across * math.sin(roll), across * math.cos(roll)], r[2, 1:], atol=1e-13)
    np.testing.assert_allclose([across * math.cos(yaw), across * math.sin(yaw)], r[:2, 0], atol=1e-13)


@given(angles)
def test_heading(yaw: float) -> None:
    heading = frames.heading_from_yaw(yaw)
    assert -math.pi <= heading <= math.pi
    # A nose at this yaw points so far north and east.
    assert math.cos(heading) == pytest.approx(math.sin(yaw), abs=1e-15)
    assert math.sin(heading) == pytest.approx(math.cos(yaw), abs=1e-15)
    assert abs(math.remainder(frames.yaw_from_heading(heading) - yaw, 2 * math.pi)) < 1e-15


def test_wire_units() -> None:
    assert pytest.approx(473977420) == 47.397742 * frames.DEG_E7_PER_DEG
    assert 1.5 * frames.MILLIMETRES_PER_METRE == 1500
    assert 1.5 * frames.CENTIMETRES_PER_METRE == 150
    assert math.pi * frames.CENTIDEGREES_PER_RADIAN == pytest.approx(18000)
    assert 0.25 * frames.MILLISECONDS_PER_SECOND == 250
    assert 0.004 * frames.MICROSECONDS_PER_SECOND == 4000
    assert pytest.approx(1013.25) == 101325 * frames.HECTOPASCALS_PER_PASCAL
    assert pytest.approx(0.5) == 50e-6 * frames.GAUSS_PER_TESLA
    assert 16.25 * frames.MILLIVOLTS_PER_VOLT == 16250
    assert 1.25 * frames.CENTIAMPERES_PER_AMPERE == 125
    assert 2.5 * frames.MILLIAMPERE_HOURS_PER_AMPERE_HOUR == 2500
    assert 0.25 * frames.PERCENT == 25
    assert frames.STANDARD_GRAVITY == 9.80665
    assert pytest.approx(2000) == 2 * 9.80665 * frames.MILLI_G_PER_METRE_PER_SECOND_SQUARED


def test_a_degree_at_the_equator_and_a_degree_of_the_meridian() -> None:
    """WGS 84 at sea level: 111319.491 m of longitude; 110574.276 m of latitude at 0°, 111131.777 m at 45°."""
    equator, middle = LocalOrigin(0.0, 0.0, 0.0), LocalOrigin(45.0, 0.0, 0.0)
    east, north = (1.0 / per_metre for per_metre in equator.degrees_per_metre)
    assert east == pytest.approx(math.radians(6378137.0), abs=1e-3)
    assert north == pytest.approx(math.radians(6335439.327), abs=1e-3)
    assert 1.0 / middle.degrees_per_metre[1] == pytest.approx(math.radians(6367381.816), abs=1e-2)
    assert 1.0 / LocalOrigin(0.0, 0.0, 1000.0).degrees_per_metre[0] == pytest.approx(math.radians(6379137.0))


def test_a_fix_from_the_wire() -> None:
    origin = LocalOrigin(47.0, 8.0, 488.0)
    gps = {"lat": 470001000, "lon": 80002000, "alt": 490500, "vn": 120, "ve": -50, "vd": 25}
    position, velocity = frames.fix_from_wire(gps, origin)
    assert velocity == (-0.5, 1.2, -0.25)
    assert position == pytest.approx(origin.local(Geodetic(47.0001, 8.0002, 490.5)))
    assert position[2] == 2.5


def test_rotations_about_each_axis() -> None:
    half = math.sqrt(0.5)
    assert frames.rotate((half, half, 0, 0), (1, 2, 3)) == pytest.approx((1, -3, 2))
    assert frames.rotate((half, 0, half, 0), (1, 2, 3)) == pytest.approx((3, 2, -1))
    assert frames.rotate((half, 0, 0, half), (1, 2, 3)) == pytest.approx((-2, 1, 3))
    assert frames.rotate_inverse((half, 0, 0, half), (1, 2, 3)) == pytest.approx((2, -1, 3))


def ecef(point: Geodetic) -> Array:
    """Earth-centred, earth-fixed coordinates in m on the ellipsoid WGS 84 (from its semi-axes)."""
    a, b = 6378137.0, 6356752.314245
    latitude, longitude = math.radians(point.latitude), math.radians(point.longitude)
    cosine, sine = math.cos(latitude), math.sin(latitude)
    radius = a * a / math.hypot(a * cosine, b * sine)
    return np.array(
        [
            (radius + point.altitude) * cosine * math.cos(longitude),
            (radius + point.altitude) * cosine * math.sin(longitude),
            (b * b / (a * a) * radius + point.altitude) * sine,
        ]
    )


def tangent_plane(home: Geodetic, point: Geodetic) -> Array:
    """ENU metres of a point from home, through earth-centred coordinates."""
    latitude, longitude = math.radians(home.latitude), math.radians(home.longitude)
    east = np.array([-math.sin(longitude), math.cos(longitude), 0])
    up = np.array(
        [
            math.cos(latitude) * math.cos(longitude),
            math.cos(latitude) * math.sin(longitude),
            math.sin(latitude),
        ]
    )
    return np.array([east, np.cross(up, east), up]) @ (ecef(point) - ecef(home))


homes = st.builds(Geodetic, st.floats(-80, 80), st.floats(-180, 180), st.floats(-400, 5000))
places = st.tuples(st.floats(-100, 100), st.floats(-100, 100), st.floats(-100, 100))


@given(homes, places)
def test_geodesy_against_earth_centred_coordinates(home: Geodetic, place: Triple) -> None:
    """Within 100 m the earth's curvature and the meridians' convergence are all that differs."""
    expected = tangent_plane(home, LocalOrigin(*home).geodetic(place))
    across = math.hypot(place[0], place[1])
    radius = 6.35e6
    drop = across**2 / (2 * radius)
    # East-west lengths change along the meridian as tan(latitude) / radius; lengths at height as 1 / radius.
    bend = across * (abs(math.tan(math.radians(home.latitude))) * across + abs(place[2])) / radius
    assert abs(expected[2] - place[2]) < 1.1 * drop + 1e-8
    assert np.linalg.norm(expected[:2] - place[:2]) < 1.1 * bend + across**3 / radius**2 + 1e-8


@given(homes, places)
def test_geodesy_is_exact_to_first_order(home: Geodetic, place: Triple) -> None:
    """Close to home (centimetres) nothing but rounding (1 nm of 6 400 km) is left."""
    near = (place[0] * 1e-4, place[1] * 1e-4, place[2] * 1e-4)
    expected = tangent_plane(home, LocalOrigin(*home).geodetic(near))
    np.testing.assert_allclose(expected, near, rtol=0, atol=1e-8)


@given(homes, st.tuples(lengths, lengths, lengths))
def test_geodesy_comes_back(home: Geodetic, place: Triple) -> None:
    origin = LocalOrigin(*home)
    np.testing.assert_allclose(origin.local(origin.geodetic(place)), place, rtol=0, atol=1e-8)


def test_home_is_the_origin() -> None:
    origin = LocalOrigin(47.397742, 8.545594, 488.0)
    assert origin.geodetic((0, 0, 0)) == origin.home
    assert origin.local(origin.home) == (0, 0, 0)
    north, east = origin.geodetic((0, 1, 0)), origin.geodetic((1, 0, 0))
    assert north.latitude > origin.home.latitude
    assert north.longitude == origin.home.longitude
    assert east.longitude > origin.home.longitude
    assert origin.geodetic((0, 0, 1)).altitude == 489
