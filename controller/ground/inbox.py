"""From a message that a peer has sent to the service that it is for."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import common as mavlink

from controller.ground.commands.result import WARNING, Notice
from controller.ground.commands.service import CommandService
from controller.ground.commands.setpoints import OFFSET_FRAMES, Anchor, attitude_setpoint_of, setpoint_of
from controller.ground.files.ftp import Client as FtpClient
from controller.ground.files.ftp import Ftp
from controller.ground.files.logs import MESSAGES as LOG_MESSAGES
from controller.ground.files.logs import LogProtocol
from controller.ground.flight import plans, steering
from controller.ground.flight.modes import Machine
from controller.ground.flight.motion.geometry import hanging_load
from controller.ground.flight.motion.sticks import axes_of
from controller.ground.link.outbox import Outbox
from controller.ground.link.packing import Packed
from controller.ground.link.peers import Peer, Peers
from controller.ground.missions import transfer as mission_protocol
from controller.ground.missions.plans import Plans
from controller.ground.missions.transfer import Client
from controller.ground.parameters.protocol import HASH_CHECK, Parameters, as_own_type
from controller.ground.telemetry import messages as telemetry
from controller.ground.telemetry.plant_clock import PlantClock
from sitl_bridge.frames import DEG_E7_PER_DEG, Geodetic, enu_to_ned, euler_from_quaternion
from sitl_bridge.ids import COMPONENT_AUTOPILOT, COMPONENT_LOAD, COMPONENT_WINCH
from sitl_bridge.mavlink.framing import Frame

_MISSION_COMPONENTS = (0, COMPONENT_AUTOPILOT, mavlink.MAV_COMP_ID_MISSIONPLANNER)
_BROADCAST = 0
_SAME_PLACE = 10
"""Degrees times 1e7 between two places that count as one, 0.1 m"""
_NO_SHELL = b"no shell here; use parameters and commands\n"
NOT_FLOWN = {
    mavlink.MAVLINK_MSG_ID_SET_ACTUATOR_CONTROL_TARGET: "Actuator set-points are not flown; send positions",
    mavlink.MAVLINK_MSG_ID_SETUP_SIGNING: "Signing keys are not taken over a link; use --signing-key FILE",
}


class Inbox:
    """One method for each kind of message."""

    def __init__(
        self,
        machine: Machine,
        parameters: Parameters,
        missions: Plans,
        commands: CommandService,
        ftp: Ftp,
        logs: LogProtocol,
        out: Outbox,
        peers: Peers,
        clock: PlantClock,
    ) -> None:
        self._profile = machine.profile
        self._machine = machine
        self._parameters = parameters
        self._missions = missions
        self._commands = commands
        self._ftp = ftp
        self._logs = logs
        self._out = out
        self._peers = peers
        self._clock = clock

    def dispatch(self, message: Any, frame: Frame, peer: Peer, now: float) -> None:
        """A message from a peer; what is for nobody here is left."""
        number = frame.message_id  # not message.id: some messages have a field of that name
        if number == mavlink.MAVLINK_MSG_ID_HEARTBEAT and message.type == mavlink.MAV_TYPE_GCS:
            self._peers.last_station = now
        handler = HANDLERS.get(number)
        if handler is not None:
            handler(self, message, frame, peer, now)
        elif number in mission_protocol.MESSAGES:
            self._mission(message, frame, peer, now)
        elif number in NOT_FLOWN:
            self._out.say_seldom(peer, NOT_FLOWN[number], now)

    def _addressed(self, message: Any, components: tuple[int, ...] = (0, COMPONENT_AUTOPILOT)) -> bool:
        """Whether a message is for the vehicle."""
        return (
            message.target_system in (_BROADCAST, self._profile.system)
            and message.target_component in components
        )

    def _to_load(self, message: Any) -> bool:
        return message.target_system == self._profile.load_system and message.target_component in (
            0,
            COMPONENT_LOAD,
        )

    def _command(self, message: Any, frame: Frame, peer: Peer, now: float) -> None:
        own = message.target_system == self._profile.system
        if self._to_load(message):
            self._commands.receive(message, frame, peer, COMPONENT_LOAD, now)
        elif self._addressed(message):
            self._commands.receive(message, frame, peer, COMPONENT_AUTOPILOT, now)
        elif own and message.target_component == COMPONENT_WINCH and self._profile.winch is not None:
            self._commands.receive(message, frame, peer, COMPONENT_WINCH, now)

    def _set_mode(self, message: Any, frame: Frame, peer: Peer, now: float) -> None:
        if message.target_system == self._profile.system:
            self._commands.set_mode(message, peer, now)

    def _parameter_list(self, message: Any, frame: Frame, peer: Peer, now: float) -> None:
        if self._addressed(message):
            self._parameters.request_list(peer.address, now)

    def _parameter_read(self, message: Any, frame: Frame, peer: Peer, now: float) -> None:
        if self._addressed(message):
            reply, say = self._talk(frame, peer, now)
            self._parameters.request_read(message.param_id, message.param_index, reply, say)

    def _parameter_set(self, message: Any, frame: Frame, peer: Peer, now: float) -> None:
        if not self._addressed(message):
            return
        if message.param_id == HASH_CHECK:
            self._parameters.stop_list(peer.address)
            return
        reply, say = self._talk(frame, peer, now)
        raw = frame.payload[:4].ljust(4, b"\0")
        kind = message.param_type
        if peer.address in self._ftp.packed_readers:
            kind, raw = as_own_type(message.param_id, kind, raw)
        if self._parameters.request_set(message.param_id, kind, raw, reply, say):
            self._out.broadcast(self._parameters.value_message(message.param_id), now)
        elif peer.speaks_v1:
            # PARAM_ERROR does not exist in MAVLink 1: the value as it stays says the same.
            self._parameters.request_read(message.param_id, -1, reply, say)

    def _talk(
        self, frame: Frame, peer: Peer, now: float
    ) -> tuple[Callable[[Any], None], Callable[[str], None]]:
        """How to reply to a frame's sender, and how to tell its user something."""

        def reply(message: Any) -> None:
            if not isinstance(message, Packed) and hasattr(message, "target_system"):
                message.target_system, message.target_component = frame.system, frame.component
            self._out.send(peer, message, now)

        return reply, lambda text: self._out.say(peer, Notice(WARNING, text), now)

    def _mission(self, message: Any, frame: Frame, peer: Peer, now: float) -> None:
        if self._addressed(message, _MISSION_COMPONENTS):
            client = Client(peer.address, frame.system, frame.component)
            reply, say = self._talk(frame, peer, now)
            self._missions.receive(message, client, now, reply, say)

    def _set_current_item(self, message: Any, frame: Frame, peer: Peer, now: float) -> None:
        if not self._addressed(message, _MISSION_COMPONENTS):
            return
        verdict = plans.set_current_item(self._machine, message.seq)
        if verdict.ok:
            current = telemetry.build(mavlink.MAVLINK_MSG_ID_MISSION_CURRENT, self._machine)
            self._out.broadcast(current, now)
        else:
            self._out.say(peer, Notice(WARNING, verdict.text), now)

    def _setpoint(self, message: Any, frame: Frame, peer: Peer, now: float) -> None:
        to_load = self._to_load(message)
        if not (to_load or self._addressed(message)):
            return
        view = self._machine.view
        if view is None:
            self._out.say_seldom(peer, "Set-point denied: no position yet; start the plant", now)
            return
        home = self._machine.home or (0.0, 0.0, 0.0)
        here = hanging_load(view, self._profile) if to_load else view.position
        anchor = Anchor(here, euler_from_quaternion(view.attitude)[2])
        if message.coordinate_frame in OFFSET_FRAMES and hasattr(message, "x"):
            timeout = self._machine.parameters["COM_OF_LOSS_T"]
            anchor = self._machine.offboard.anchor(message, anchor, now, timeout)
        found = setpoint_of(message, to_load, self._profile, home, anchor, view)
        sender = (peer.address, frame.system, frame.component)
        fault = found if isinstance(found, str) else steering.offer(self._machine, found, sender, now)
        if fault:
            self._out.say_seldom(peer, fault, now)

    def _attitude_setpoint(self, message: Any, frame: Frame, peer: Peer, now: float) -> None:
        if not self._addressed(message):
            return
        found = attitude_setpoint_of(message)
        sender = (peer.address, frame.system, frame.component)
        fault = (
            found if isinstance(found, str) else steering.offer_attitude(self._machine, found, sender, now)
        )
        if fault:
            self._out.say_seldom(peer, fault, now)

    def _follow_target(self, message: Any, frame: Frame, peer: Peer, now: float) -> None:
        numbers = (message.alt, *message.vel)
        degrees = (message.lat / DEG_E7_PER_DEG, message.lon / DEG_E7_PER_DEG)
        # est_capabilities: bit 0 is the position, bit 1 the velocity; some clients leave both out.
        if not all(math.isfinite(n) and abs(n) < 1e6 for n in numbers) or abs(degrees[0]) > 90.0:
            self._out.say_seldom(peer, "Target denied: its position or velocity is not a number", now)
            return
        position = self._profile.origin.local(Geodetic(*degrees, message.alt))
        steering.hear_target(self._machine, position, enu_to_ned(tuple(message.vel)))

    def _sticks(self, message: Any, frame: Frame, peer: Peer, now: float) -> None:
        axes = axes_of(message)
        if message.target not in (_BROADCAST, self._profile.system) or axes is None:
            return
        sender = (peer.address, frame.system, frame.component)
        fault = steering.move_sticks(self._machine, axes, sender, now)
        if fault:
            self._out.say_seldom(peer, fault, now)

    def _data_stream(self, message: Any, frame: Frame, peer: Peer, now: float) -> None:
        if self._addressed(message):
            on = message.start_stop == 1
            peer.streams.set_group(message.req_stream_id, message.req_message_rate, on, now)

    def _ping(self, message: Any, frame: Frame, peer: Peer, now: float) -> None:
        if message.target_system == 0 and message.target_component == 0:
            ping = mavlink.MAVLink_ping_message
            self._out.send(peer, ping(message.time_usec, message.seq, frame.system, frame.component), now)

    def _origin(self, message: Any, frame: Frame, peer: Peer, now: float) -> None:
        """SET_GPS_GLOBAL_ORIGIN: the origin is the description's home, and says so."""
        if message.target_system in (_BROADCAST, self._profile.system):
            place = (message.latitude, message.longitude)
            answer = telemetry.global_origin(self._machine)
            if math.dist(place, (answer.latitude, answer.longitude)) > _SAME_PLACE:
                text = "Origin denied: it is the vehicle's [home] from its description"
                self._out.say_seldom(peer, text, now)
            self._out.send(peer, answer, now)

    def _shell(self, message: Any, frame: Frame, peer: Peer, now: float) -> None:
        """SERIAL_CONTROL: there is no shell, which a line in it says."""
        if message.flags & mavlink.SERIAL_CONTROL_FLAG_REPLY or not message.count:
            return
        data = _NO_SHELL.ljust(70, b"\0")
        reply = mavlink.MAVLink_serial_control_message(
            message.device, mavlink.SERIAL_CONTROL_FLAG_REPLY, 0, 0, len(_NO_SHELL), list(data)
        )
        self._out.send(peer, reply, now)

    def _time_sync(self, message: Any, frame: Frame, peer: Peer, now: float) -> None:
        if message.tc1 == 0:
            # On the clock of the telemetry's time stamps, so that a companion knows the age of a state.
            time = self._clock.read(now)
            self._out.send(peer, mavlink.MAVLink_timesync_message(int(time * 1e9), message.ts1), now)

    def _file_transfer(self, message: Any, frame: Frame, peer: Peer, now: float) -> None:
        if message.target_system not in (_BROADCAST, self._profile.system):
            return
        client = FtpClient(peer.address, frame.system, frame.component)
        answer = self._ftp.receive(bytes(message.payload), client, now)
        if answer is not None:
            ftp = mavlink.MAVLink_file_transfer_protocol_message
            self._out.send(peer, ftp(0, frame.system, frame.component, answer), now)

    def _log(self, message: Any, frame: Frame, peer: Peer, now: float) -> None:
        if message.target_system in (_BROADCAST, self._profile.system):
            reply, say = self._talk(frame, peer, now)
            self._logs.receive(message, peer.address, now, reply, say)


_Handler = Callable[[Inbox, Any, Frame, Peer, float], None]
HANDLERS: dict[int, _Handler] = {
    mavlink.MAVLINK_MSG_ID_COMMAND_LONG: Inbox._command,
    mavlink.MAVLINK_MSG_ID_COMMAND_INT: Inbox._command,
    mavlink.MAVLINK_MSG_ID_SET_MODE: Inbox._set_mode,
    mavlink.MAVLINK_MSG_ID_PARAM_REQUEST_LIST: Inbox._parameter_list,
    mavlink.MAVLINK_MSG_ID_PARAM_REQUEST_READ: Inbox._parameter_read,
    mavlink.MAVLINK_MSG_ID_PARAM_SET: Inbox._parameter_set,
    mavlink.MAVLINK_MSG_ID_MISSION_SET_CURRENT: Inbox._set_current_item,
    mavlink.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED: Inbox._setpoint,
    mavlink.MAVLINK_MSG_ID_SET_POSITION_TARGET_GLOBAL_INT: Inbox._setpoint,
    mavlink.MAVLINK_MSG_ID_SET_ATTITUDE_TARGET: Inbox._attitude_setpoint,
    mavlink.MAVLINK_MSG_ID_FOLLOW_TARGET: Inbox._follow_target,
    mavlink.MAVLINK_MSG_ID_MANUAL_CONTROL: Inbox._sticks,
    mavlink.MAVLINK_MSG_ID_REQUEST_DATA_STREAM: Inbox._data_stream,
    mavlink.MAVLINK_MSG_ID_PING: Inbox._ping,
    mavlink.MAVLINK_MSG_ID_SET_GPS_GLOBAL_ORIGIN: Inbox._origin,
    mavlink.MAVLINK_MSG_ID_SERIAL_CONTROL: Inbox._shell,
    **dict.fromkeys(LOG_MESSAGES, Inbox._log),
    mavlink.MAVLINK_MSG_ID_TIMESYNC: Inbox._time_sync,
    mavlink.MAVLINK_MSG_ID_FILE_TRANSFER_PROTOCOL: Inbox._file_transfer,
}
