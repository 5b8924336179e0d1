"""From the first HEARTBEAT to the height at which the load hangs still."""

from __future__ import annotations

from pymavlink.dialects.v20 import common as mavlink

from controller.over import dialects
from controller.over.flight import Flight
from controller.over.model import RATE_HZ, Steering
from controller.over.states import State

STREAMS = (
    (mavlink.MAVLINK_MSG_ID_ODOMETRY, RATE_HZ),
    (mavlink.MAVLINK_MSG_ID_HIGHRES_IMU, RATE_HZ),
    (mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION, RATE_HZ),
    (mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED, 50.0),
    (mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, 5.0),
    (mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE, 2.0),
    (mavlink.MAVLINK_MSG_ID_HOME_POSITION, 1.0),
)
ASKED_FOR = (mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN, mavlink.MAVLINK_MSG_ID_HOME_POSITION)
"""By MAV_CMD_REQUEST_MESSAGE: not every stack streams them."""
LONGEST_PATIENCE = 0.3
"""s, of a stack whose set-points stop; at 1 rad/s it then leans by 17° more."""
PARAMETER_TIME = 3.0
"""s, in which a stack's parameters come, if it has them."""
CLEARANCE = 2.5
"""m, of the load above the ground after take-off."""
OFF_THE_GROUND = 0.5
"""m above home; below, take-off is asked for again."""
HEIGHT_TOLERANCE = 0.4
"""m"""
STILL_TIME = 3.0
"""s at the height before the take-over."""


def connect(flight: Flight, now: float) -> None:
    """Wait for a HEARTBEAT of an autopilot."""
    flight.missing = "a HEARTBEAT of an autopilot; start the stack, and let it send to this address"
    if flight.telemetry.system is not None:
        flight.dialect = dialects.dialect_of(flight.telemetry.autopilot, flight.dialect)
        flight.say(f"{flight.dialect.name} is there (system {flight.telemetry.system})")
        flight.go(State.PREPARING, now)


def prepare(flight: Flight, now: float) -> None:
    """Ask for what the law flies on, and wait for it."""
    t = flight.telemetry
    if flight.due(now):
        for message_id, rate in STREAMS:
            flight.pack(dialects.message_interval(flight.system, message_id, rate))
        for message_id in ASKED_FOR:
            flight.pack(dialects.request_message(flight.system, message_id))
        for name in _unknown_parameters(flight):
            message = mavlink.MAVLink_param_request_read_message(flight.system, 1, name.encode(), -1)
            flight.pack(message)
    t.acks.clear()
    flight.missing = _missing(flight, now)
    if flight.missing:
        return
    wrong = _wrong_options(flight)
    if wrong is not None:
        flight.fail(wrong, now)
        return
    _advise(flight)
    flight.settle_design()
    flying = t.armed and t.landed == mavlink.MAV_LANDED_STATE_IN_AIR
    flight.go(State.STREAMING if flying else State.ARMING, now)


def _missing(flight: Flight, now: float) -> str:
    """What there has to be before the stack is armed; empty: everything is there."""
    t = flight.telemetry
    wanted = []
    if t.vehicle is None:
        wanted.append("the stack's ODOMETRY, or LOCAL_POSITION_NED and ATTITUDE_QUATERNION")
    if t.altitude_msl is None or t.home_altitude is None:
        wanted.append("the stack's GLOBAL_POSITION_INT")
    options = flight.dialect.options
    unknown = _unknown_parameters(flight)
    if unknown and now - flight.since < PARAMETER_TIME:  # not every version has every parameter
        wanted.append(f"the stack's parameters {', '.join(unknown)}")
    elif options is not None and options[0] in unknown:
        wanted.append(f"the stack's parameter {options[0]}")
    source = flight.source.missing(t, now, hanging=False)
    if source is not None:
        wanted.append(source)
    return ", ".join(wanted)


def _unknown_parameters(flight: Flight) -> list[str]:
    """Names of what is wanted of the stack's parameters and has not come."""
    dialect = flight.dialect
    options = None if dialect.options is None else dialect.options[0]
    holds = None if dialect.holds is None else dialect.holds[0]
    gains = dialect.attitude_parameters if flight.steering is Steering.ATTITUDE else ()
    names = (dialect.thrust_parameter, dialect.patience_parameter, options, holds, *gains)
    return [name for name in names if name is not None and name not in flight.telemetry.parameters]


def _advise(flight: Flight) -> None:
    """Say what the stack would do if this companion died, where there is something safer."""
    parameters, dialect = flight.telemetry.parameters, flight.dialect
    patience = parameters.get(dialect.patience_parameter or "", 0.0)
    if patience > 1.01 * LONGEST_PATIENCE:  # it came as a single-precision number
        flight.say(
            f"{dialect.patience_parameter} is {patience:g} s: should this companion die, the vehicle "
            f"turns on with its last rates for so long; {LONGEST_PATIENCE:g} s is safer"
        )
    if dialect.holds is not None:
        name, value = dialect.holds
        if parameters.get(name, value) != value:
            flight.say(
                f"{name} is {parameters[name]:g}: should this companion die, the stack may land instead "
                f"of holding; {value} holds"
            )


def _wrong_options(flight: Flight) -> str | None:
    """Why the stack would misunderstand set-points; None: it does not."""
    if flight.dialect.options is None:
        return None
    name, bits, meaning = flight.dialect.options
    value = int(flight.telemetry.parameters[name])
    if value & bits == bits:
        return None
    return f"{name} is {value}: the {meaning}; expected {value | bits}"


def arm(flight: Flight, now: float) -> None:
    """Ask until the stack arms."""
    flight.missing = "the stack to arm"
    flight.note_acks("arming")
    if flight.telemetry.armed:
        flight.go(State.TAKING_OFF, now)
    elif flight.due(now):
        mode = flight.dialect.takeoff_mode
        if mode is not None and not flight.in_mode(mode):
            flight.ask_for_mode(mode)
        flight.pack(dialects.arm(flight.system))


def take_off(flight: Flight, now: float) -> None:
    """Rise until the load is clear of the ground and hangs still."""
    flight.missing = "the vehicle to reach its height"
    flight.note_acks("take-off")
    t = flight.telemetry
    height = flight.vehicle.hover_length + CLEARANCE
    assert t.home_altitude is not None
    assert t.altitude_msl is not None
    above_home = t.altitude_msl - t.home_altitude
    if flight.due(now):
        if not t.armed:
            flight.fail("the stack disarmed before it took off: nothing more is sent", now)
            return
        if above_home < OFF_THE_GROUND:
            altitude = height if flight.dialect.relative_takeoff else t.home_altitude + height
            flight.pack(dialects.take_off(flight.system, altitude))
    flight.new_estimate(now)  # keeps a filter of the load going
    if abs(above_home - height) > HEIGHT_TOLERANCE:
        flight.still_since = None
    elif flight.still_since is None:
        flight.still_since = now
    elif now - flight.still_since > STILL_TIME:
        flight.go(State.STREAMING, now)
