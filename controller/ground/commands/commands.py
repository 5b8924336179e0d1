"""Commands, by COMMAND_LONG and COMMAND_INT alike: one acknowledgement each, a reason with every refusal."""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Any, NamedTuple, Protocol

from pymavlink.dialects.v20 import common as mavlink

from controller.ground.commands.result import OK, UNSUPPORTED, UNSUPPORTED_FRAME, Verdict, deny, not_now
from controller.ground.flight.geometry import filled
from controller.ground.flight.modes import Machine, Reposition
from controller.ground.flight.patterns import LARGEST_RADIUS, FigureEight, Orbit, Yaw
from controller.ground.flight.payload.gripper import GRIPPER_ACTIONS, HOLD
from controller.ground.flight.px4_modes import Mode, find_mode, find_standard_mode
from sitl_bridge.frames import DEG_E7_PER_DEG, Geodetic, Triple, yaw_from_heading
from sitl_bridge.ids import COMPONENT_LOAD, COMPONENT_WINCH

FORCE = 21196.0
"""param2 of an arm or disarm command that is meant in any case"""
_SHUTDOWN = 2.0
_REBOOTS = (0.0, 1.0, _SHUTDOWN, 3.0)
"""PREFLIGHT_REBOOT_SHUTDOWN's param1; 3 would stay in a boot loader, which there is none of"""
DEFAULT_RADIUS = 10.0
"""m, of an orbit or figure of eight that says none"""
MEMORY = 5.0
"""s, in which the same command with a greater confirmation is taken for a retransmission"""
DOUBLED = 0.2
"""s, in which the same command with the same sequence number is taken for a datagram that came twice"""
_MOST_REMEMBERED = 64
_UNSET_INT = 0x7FFFFFFF
_CUSTOM_MODE_ENABLED = 1


class Command(NamedTuple):
    """A command as both messages mean it; NaN is unset."""

    number: int
    p1: float
    p2: float
    p3: float
    p4: float
    p5: float
    """Degrees of latitude where the command has a place"""
    p6: float
    """Degrees of longitude where the command has a place"""
    p7: float
    relative: bool
    """p7 is above home; else above mean sea level"""
    frame_fault: str
    """Why the frame cannot be used, or an empty string"""
    component: int
    """Whom it is for: autopilot, load or winch"""


_WITH_PLACE = frozenset(
    (
        mavlink.MAV_CMD_NAV_TAKEOFF,
        mavlink.MAV_CMD_NAV_LAND,
        mavlink.MAV_CMD_DO_REPOSITION,
        mavlink.MAV_CMD_DO_ORBIT,
        mavlink.MAV_CMD_DO_FIGURE_EIGHT,
        mavlink.MAV_CMD_DO_SET_HOME,
        mavlink.MAV_CMD_NAV_LOITER_UNLIM,
        mavlink.MAV_CMD_NAV_WAYPOINT,
    )
)


def command_of(message: Any, component: int) -> Command:
    """The command of a COMMAND_LONG or COMMAND_INT message."""
    p = (message.param1, message.param2, message.param3, message.param4)
    if message.id == mavlink.MAVLINK_MSG_ID_COMMAND_LONG:
        rest = (message.param5, message.param6, message.param7)
        return Command(message.command, *p, *rest, False, "", component)
    scale = DEG_E7_PER_DEG if message.command in _WITH_PLACE else 1.0
    x, y = (math.nan if v == _UNSET_INT else v / scale for v in (message.x, message.y))
    relative = message.frame in (
        mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT,
        mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
    )
    absolute = message.frame in (mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_FRAME_GLOBAL_INT)
    fault = "" if relative or absolute else f"Frame {message.frame} is not supported; use 0, 5 (AMSL), 3 or 6"
    return Command(message.command, *p, x, y, message.z, relative, fault, component)


class Requests(Protocol):
    """What commands can ask of other services; the station fills it in for the peer that asks."""

    def send_message(self, message_id: int, index: float) -> bool:
        """Send one message once; False if there is no such message."""

    def set_interval(self, message_id: float, microseconds: float) -> Verdict:
        """Stream a message at an interval."""

    def send_interval(self, message_id: float) -> None:
        """Send MESSAGE_INTERVAL."""

    def storage(self, action: float) -> Verdict:
        """Load (0), save (1) or reset (2) the parameters."""

    def inject_failure(self, parameters: tuple[float, ...]) -> None:
        """Pass MAV_CMD_INJECT_FAILURE on to the plant; its answer is the command's."""

    def restart(self, shut_down: bool) -> None:
        """Begin afresh, or end, once the acknowledgement is out."""

    def say(self, text: str) -> None:
        """A STATUSTEXT that comes with an acceptance."""


class Key(NamedTuple):
    """What a retransmission has in common with the original: everything but the counters."""

    sender: Hashable
    content: Hashable


class _Remembered(NamedTuple):
    time: float
    """s, when it was carried out"""
    sequence: int
    """Of the frame"""
    confirmation: int
    verdict: Verdict


class Memory:
    """Recent commands of each sender with their results, to know a retransmission by."""

    def __init__(self) -> None:
        self._recent: OrderedDict[Key, _Remembered] = OrderedDict()
        """The oldest first"""

    def recall(self, key: Key, sequence: int, confirmation: int, now: float) -> Verdict | None:
        """The result of the command that this one repeats, None if it is a new one.

        A repetition has a greater confirmation, or is the same datagram once more.
        """
        found = self._recent.get(key)
        if found is None:
            return None
        age = now - found.time
        doubled = sequence == found.sequence and age <= DOUBLED and self._counts(key, sequence)
        repeated = doubled or (confirmation > found.confirmation and age <= MEMORY)
        return found.verdict if repeated else None

    def _counts(self, key: Key, sequence: int) -> bool:
        """Whether no other command that came since from the same sender has the same sequence number."""
        for other, since in reversed(self._recent.items()):
            if other == key:
                break
            if other.sender == key.sender and since.sequence == sequence:
                return False
        return True

    def store(self, key: Key, sequence: int, confirmation: int, verdict: Verdict, now: float) -> None:
        """Remember a command's result."""
        self._recent.pop(key, None)
        self._recent[key] = _Remembered(now, sequence, confirmation, verdict)
        while len(self._recent) > _MOST_REMEMBERED:
            self._recent.popitem(last=False)


def execute(command: Command, machine: Machine, requests: Requests, now: float) -> Verdict | None:
    """Carry a command out, or say why not; None: the verdict comes later."""
    handler = _HANDLERS.get(command.number)
    if handler is None:
        entry = mavlink.enums["MAV_CMD"].get(command.number)
        name = entry.name.removeprefix("MAV_CMD_") if entry else "unknown"
        return Verdict(UNSUPPORTED, f"Command {command.number} ({name}) is not supported")
    if command.component in _ONLY and command.number != _ONLY[command.component]:
        name = "load" if command.component == COMPONENT_LOAD else "winch"
        return Verdict(UNSUPPORTED, f"Command {command.number} is not the {name}'s; address the vehicle")
    placed = command.number in _WITH_PLACE and any(not math.isnan(p) for p in command[5:8])
    if placed and command.frame_fault:
        return Verdict(UNSUPPORTED_FRAME, f"Command denied: {command.frame_fault}")
    return handler(command, machine, requests, now)


def _arm(c: Command, machine: Machine, requests: Requests, now: float) -> Verdict:
    if c.p1 not in (0.0, 1.0):
        return deny(f"Arm or disarm denied: param1 is {c.p1:g}; use 1 or 0")
    # A forced arm is an ordinary one: nothing that keeps this vehicle on the ground can be waived safely.
    return machine.arm(now) if c.p1 == 1.0 else machine.disarm(c.p2 == FORCE)


def _takeoff(c: Command, machine: Machine, requests: Requests, now: float) -> Verdict:
    return machine.takeoff(_height(c, machine))


def _set_mode(c: Command, machine: Machine, requests: Requests, now: float) -> Verdict:
    # MAVSDK and QGroundControl set other bits of the base mode too; only this one says that 2 and 3 count.
    if not (0 <= c.p1 <= 255 and c.p1 == int(c.p1)) or not int(c.p1) & _CUSTOM_MODE_ENABLED:
        return deny(f"Mode denied: param1 is {c.p1:g}; use 1 (custom mode) with PX4's main and sub mode")
    numbers = [0.0 if math.isnan(p) else p for p in (c.p2, c.p3)]
    if not all(math.isfinite(number) for number in numbers):
        return deny("Mode denied: the mode is infinite")
    found = find_mode(*numbers)
    return deny(found) if isinstance(found, str) else machine.set_mode(found, now)


def _set_standard_mode(c: Command, machine: Machine, requests: Requests, now: float) -> Verdict:
    if not math.isfinite(c.p1):
        return deny("Mode denied: the mode is not finite")
    found = find_standard_mode(c.p1)
    return deny(found) if isinstance(found, str) else machine.set_mode(found, now)


def _mode(mode: Mode) -> _Handler:
    return lambda c, machine, requests, now: machine.set_mode(mode, now)


def _reposition(c: Command, machine: Machine, requests: Requests, now: float) -> Verdict:
    if math.isnan(c.p5) != math.isnan(c.p6):
        return deny("Reposition denied: latitude without longitude; send both or neither")
    if abs(c.p5) > 90 or abs(c.p6) > 180:
        return deny(f"Reposition denied: {c.p5:g}, {c.p6:g} is no place; use degrees")
    home = machine.profile.origin.home
    east, north, _ = machine.profile.origin.local(Geodetic(c.p5, c.p6, home.altitude))
    yaw = math.nan if math.isnan(c.p4) else yaw_from_heading(c.p4) if math.isfinite(c.p4) else c.p4
    speed = c.p1 if c.p1 > 0 else math.nan
    where = Reposition(c.component == COMPONENT_LOAD, (east, north, _height(c, machine)), yaw, speed)
    return machine.reposition(where, c.p2 == 1.0)


def _orbit(c: Command, machine: Machine, requests: Requests, now: float) -> Verdict:
    centre = _centre(c, machine, "Orbit")
    if isinstance(centre, Verdict):
        return centre
    if math.isinf(c.p1) or math.isinf(c.p2) or math.isinf(c.p4):
        return deny("Orbit denied: radius, speed or turns are infinite")
    radius = _or(c.p1, DEFAULT_RADIUS)
    speed = _or(c.p2, machine.parameters["MPC_XY_CRUISE"])
    kind = 0.0 if math.isnan(c.p3) else c.p3
    if kind not in tuple(Yaw) or radius == 0.0 or speed == 0.0:
        return deny(f"Orbit denied: radius {radius:g} m, speed {speed:g} m/s, heading {kind:g}; see DO_ORBIT")
    most = machine.parameters["MPC_XY_VEL_MAX"]
    orbit = Orbit(centre, radius, math.copysign(min(abs(speed), most), speed), Yaw(int(kind)), _or(c.p4, 0.0))
    verdict = machine.fly_pattern(orbit)
    if verdict.ok and orbit.speed < abs(speed) - 0.01:
        requests.say(f"Orbit limited to {orbit.speed:.1f} m/s")
    return verdict


def _figure_eight(c: Command, machine: Machine, requests: Requests, now: float) -> Verdict:
    centre = _centre(c, machine, "Figure eight")
    if isinstance(centre, Verdict):
        return centre
    if any(math.isinf(p) for p in (c.p1, c.p2, c.p4)):
        return deny("Figure eight denied: a radius or the orientation is infinite")
    major = _or(c.p1, DEFAULT_RADIUS)
    minor = _or(c.p2, 0.5 * abs(major))
    if not 1.0 <= abs(major) <= LARGEST_RADIUS or not 0.5 <= abs(minor) <= abs(major):
        return deny(f"Figure eight denied: radii {major:g} m and {minor:g} m; from 1 m, the longer first")
    speed = machine.parameters["MPC_XY_CRUISE"]
    return machine.fly_pattern(FigureEight(centre, major, minor, yaw_from_heading(_or(c.p4, 0.0)), speed))


def _centre(c: Command, machine: Machine, name: str) -> Triple | Verdict:
    """Of a pattern, m ENU of the vehicle; what is NaN is where the vehicle is."""
    if math.isnan(c.p5) != math.isnan(c.p6):
        return deny(f"{name} denied: latitude without longitude; send both or neither")
    if abs(c.p5) > 90 or abs(c.p6) > 180 or math.isinf(c.p7):
        return deny(f"{name} denied: {c.p5:g}, {c.p6:g}, {c.p7:g} is no place; use degrees")
    if machine.view is None:
        return not_now(f"{name} denied: no position yet; start the plant")
    home = machine.profile.origin.home
    east, north, _ = machine.profile.origin.local(Geodetic(c.p5, c.p6, home.altitude))
    here = machine.view.position
    # PX4 reads the altitude above mean sea level in any frame, and MAVSDK sends it so in a relative one.
    readings = (_height(c, machine), c.p7 - home.altitude)
    return filled((east, north, min(readings, key=lambda z: abs(z - here[2]))), here)


def _or(value: float, default: float) -> float:
    return default if math.isnan(value) else value


def _gripper(c: Command, machine: Machine, requests: Requests, now: float) -> Verdict:
    if c.p2 not in GRIPPER_ACTIONS:
        return deny(f"Gripper denied: action {c.p2:g}; use 0 (release), 1 (grab) or 2 (hold)")
    return OK if c.p2 == HOLD and machine.payload.gripper is not None else machine.grip(int(c.p2))


def _winch(c: Command, machine: Machine, requests: Requests, now: float) -> Verdict:
    return machine.reel(c.p2, c.p3, c.p4)


def _pause(c: Command, machine: Machine, requests: Requests, now: float) -> Verdict:
    if c.p1 == 0.0:
        return machine.set_mode(Mode.HOLD, now)
    if c.p1 == 1.0 and machine.mission.items:
        return machine.set_mode(Mode.MISSION, now)
    return deny(f"Pause or go on denied: param1 is {c.p1:g}; use 0, or 1 with a mission")


def _change_speed(c: Command, machine: Machine, requests: Requests, now: float) -> Verdict:
    if c.p1 not in (0.0, 1.0) and not math.isnan(c.p1):
        return deny(
            f"Speed of kind {c.p1:g} cannot be set; use 0 or 1 (horizontal), or MPC_Z_VEL_MAX_UP and _DN"
        )
    return machine.change_speed(c.p2)


def _mission_start(c: Command, machine: Machine, requests: Requests, now: float) -> Verdict:
    if c.p1 > 0:
        verdict = _set_item(c, machine, requests, now)
        if not verdict.ok:
            return verdict
    return machine.set_mode(Mode.MISSION, now)


def _set_item(c: Command, machine: Machine, requests: Requests, now: float) -> Verdict:
    if not (math.isfinite(c.p1) and c.p1 == int(c.p1)):
        return deny(f"Mission item {c.p1:g} does not exist; use its number")
    reset = c.number == mavlink.MAV_CMD_DO_SET_MISSION_CURRENT and c.p2 == 1.0
    return machine.set_current_item(int(c.p1), reset)


def _set_home(c: Command, machine: Machine, requests: Requests, now: float) -> Verdict:
    if machine.view is None:
        return not_now("Home denied: no position yet; start the plant")
    if c.p1 == 1.0:
        return machine.set_home_to(machine.view.position)
    if not (abs(c.p5) <= 90 and abs(c.p6) <= 180) or math.isinf(c.p7):
        return deny(f"Home denied: {c.p5:g}, {c.p6:g}, {c.p7:g} is no place; use degrees, or param1 = 1")
    east, north, _ = machine.profile.origin.local(Geodetic(c.p5, c.p6, machine.profile.origin.home.altitude))
    return machine.set_home_to((east, north, _height(c, machine)))


def _terminate(c: Command, machine: Machine, requests: Requests, now: float) -> Verdict:
    if c.p1 != 1.0:
        return deny(f"Termination denied: param1 is {c.p1:g}; use 1")
    return machine.terminate()


def _prearm(c: Command, machine: Machine, requests: Requests, now: float) -> Verdict:
    for fault in machine.arming_faults():
        requests.say(f"Not ready: {fault}")
    return OK


def _interval(c: Command, machine: Machine, requests: Requests, now: float) -> Verdict:
    if not math.isfinite(c.p1):
        return deny("Message interval denied: param1 has to be a message's number")
    return requests.set_interval(c.p1, c.p2)


def _get_interval(c: Command, machine: Machine, requests: Requests, now: float) -> Verdict:
    if not (0 <= c.p1 <= 0xFFFF and c.p1 == int(c.p1)):
        return deny("Message interval denied: param1 has to be a message's number")
    requests.send_interval(c.p1)
    return OK


def _message(number: int | None = None) -> _Handler:
    def handler(c: Command, machine: Machine, requests: Requests, now: float) -> Verdict:
        if number is None and not (math.isfinite(c.p1) and c.p1 == int(c.p1)):
            return deny("Message request denied: param1 has to be a message's number")
        message_id = int(c.p1) if number is None else number
        if not requests.send_message(message_id, c.p2):
            return deny(f"Message {message_id} does not exist here, or there is nothing to say in it yet")
        return OK

    return handler


def _storage(c: Command, machine: Machine, requests: Requests, now: float) -> Verdict:
    return requests.storage(c.p1)


def _reboot(c: Command, machine: Machine, requests: Requests, now: float) -> Verdict:
    if c.p1 not in _REBOOTS:
        return deny(f"Reboot denied: param1 is {c.p1:g}; use 0 (nothing), 1 (reboot) or 2 (shut down)")
    if c.p1 == 0.0:
        return OK
    if machine.armed:
        return not_now("Reboot denied: armed; land and disarm first")
    requests.restart(shut_down=c.p1 == _SHUTDOWN)
    return OK


def _calibrate(c: Command, machine: Machine, requests: Requests, now: float) -> Verdict:
    """Simulated sensors need none: each is done at once, in the words that clients wait for."""
    if machine.armed:
        return not_now("Calibration denied: armed; disarm first")
    for asked, name in (
        (c.p1 == 1.0, "gyro"),
        (c.p2 == 1.0, "mag"),
        (c.p3 == 1.0, "baro"),
        (c.p5 in (1.0, 4.0), "accel"),
        (c.p5 == 2.0, "level"),
    ):
        if asked:
            for text in (f"calibration started: 2 {name}", "progress <100>", f"calibration done: {name}"):
                requests.say(f"[cal] {text}")
    return OK


def _inject_failure(c: Command, machine: Machine, requests: Requests, now: float) -> Verdict | None:
    if machine.parameters.integer("SYS_FAILURE_EN") != 1:
        return deny("Failure not injected: set SYS_FAILURE_EN to 1 first")
    if machine.view is None:
        return not_now("Failure not injected: no plant yet; start it")
    requests.inject_failure((c.p1, c.p2, c.p3, c.p4, c.p5, c.p6, c.p7))
    return None


_Handler = Callable[[Command, Machine, Requests, float], Verdict | None]
_HANDLERS: dict[int, _Handler] = {
    mavlink.MAV_CMD_COMPONENT_ARM_DISARM: _arm,
    mavlink.MAV_CMD_NAV_TAKEOFF: _takeoff,
    mavlink.MAV_CMD_NAV_LAND: _mode(Mode.LAND),
    mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: _mode(Mode.RTL),
    mavlink.MAV_CMD_NAV_LOITER_UNLIM: _mode(Mode.HOLD),
    mavlink.MAV_CMD_DO_SET_MODE: _set_mode,
    mavlink.MAV_CMD_DO_SET_STANDARD_MODE: _set_standard_mode,
    mavlink.MAV_CMD_DO_REPOSITION: _reposition,
    mavlink.MAV_CMD_DO_ORBIT: _orbit,
    mavlink.MAV_CMD_DO_FIGURE_EIGHT: _figure_eight,
    mavlink.MAV_CMD_DO_GRIPPER: _gripper,
    mavlink.MAV_CMD_DO_WINCH: _winch,
    mavlink.MAV_CMD_DO_PAUSE_CONTINUE: _pause,
    mavlink.MAV_CMD_DO_CHANGE_SPEED: _change_speed,
    mavlink.MAV_CMD_MISSION_START: _mission_start,
    mavlink.MAV_CMD_DO_SET_MISSION_CURRENT: _set_item,
    mavlink.MAV_CMD_DO_SET_HOME: _set_home,
    mavlink.MAV_CMD_DO_FLIGHTTERMINATION: _terminate,
    mavlink.MAV_CMD_RUN_PREARM_CHECKS: _prearm,
    mavlink.MAV_CMD_SET_MESSAGE_INTERVAL: _interval,
    mavlink.MAV_CMD_GET_MESSAGE_INTERVAL: _get_interval,
    mavlink.MAV_CMD_REQUEST_MESSAGE: _message(),
    mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: _message(mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION),
    mavlink.MAV_CMD_PREFLIGHT_STORAGE: _storage,
    mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN: _reboot,
    mavlink.MAV_CMD_PREFLIGHT_CALIBRATION: _calibrate,
    mavlink.MAV_CMD_INJECT_FAILURE: _inject_failure,
}
_ONLY = {COMPONENT_LOAD: mavlink.MAV_CMD_DO_REPOSITION, COMPONENT_WINCH: mavlink.MAV_CMD_DO_WINCH}
"""The one command that load or winch take"""


def _height(c: Command, machine: Machine) -> float:
    """p7 as a height, m ENU; NaN if unset."""
    home = machine.home[2] if machine.home is not None else 0.0
    return home + c.p7 if c.relative else c.p7 - machine.profile.origin.home.altitude
