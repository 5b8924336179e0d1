"""The vehicle as ground control sees it: one object, datagrams in, datagrams and a guidance target out.

No sockets, no clock, no threads. `now` is in seconds of one monotonic clock throughout.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Hashable
from typing import Any

from pymavlink.dialects.v20 import common as mavlink

from controller.ground import missions as mission_protocol
from controller.ground import telemetry
from controller.ground.commands import Command, Memory, Requests, command_of, execute
from controller.ground.missions import Client, Missions
from controller.ground.modes import Machine, Stage
from controller.ground.parameter_file import ParameterFile
from controller.ground.parameters import Parameters
from controller.ground.peers import Address, Peer, Peers
from controller.ground.plant_commands import Answer, PlantCommands
from controller.ground.px4_modes import Mode
from controller.ground.setpoints import setpoint_of
from controller.ground.signing import Signing
from controller.ground.streams import STREAMABLE
from controller.ground.targets import Target
from controller.ground.verdict import INFO, OK, WARNING, Notice, Verdict, deny, not_now
from controller.ground.view import LOAD_COMPONENT, VEHICLE_COMPONENT, Profile, VehicleView
from controller.ground.wire import AvailableModes, CurrentMode, Packed, decoded, packed
from sitl_bridge.mavlink.framing import FLAG_SIGNED, Frame, split

STATION_LINK, ONBOARD_LINK = 0, 1
GUIDANCE_PERIOD = 0.02
"""s, at most, between two looks of the mode machine at the vehicle"""
TEXT_LENGTH = 50
"""Characters of one STATUSTEXT; longer texts go in pieces"""
TEXT_PAUSE = 2.0
"""s, in which the same text is not said twice to a peer"""
LOAD_SILENCE = 2.0
"""s after which the load's last message is too old to be passed on"""
_HOUSEKEEPING = 1.0
"""s between two looks for silent peers"""
_MISSION_COMPONENTS = (0, VEHICLE_COMPONENT, mavlink.MAV_COMP_ID_MISSIONPLANNER)
_BROADCAST = 0
_LOAD_MESSAGES = {mavlink.MAVLINK_MSG_ID_HEARTBEAT: 1.0, mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 5.0}
"""Hz, at most, at which the load's own messages are passed on"""
_ON_CHANGE = (
    mavlink.MAVLINK_MSG_ID_HEARTBEAT,
    mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE,
    CurrentMode.id,
)
"""Sent at once when the mode changes, or armed changes"""
_NOT_FLOWN = {
    mavlink.MAVLINK_MSG_ID_SET_ATTITUDE_TARGET: "Attitude set-points are not supported; send positions",
    mavlink.MAVLINK_MSG_ID_SET_ACTUATOR_CONTROL_TARGET: "Actuator set-points are not supported",
    mavlink.MAVLINK_MSG_ID_SETUP_SIGNING: "Signing keys are not taken over a link; use --signing-key FILE",
}


def standard_peers(instance: int) -> tuple[Address, ...]:
    """Where PX4 speaks to first: ground stations on 14550, onboard computers on 14540+N."""
    return (
        Address(STATION_LINK, "127.0.0.1", 14550),
        Address(ONBOARD_LINK, "127.0.0.1", 14540 + instance),
    )


def local_ports(instance: int) -> tuple[int, int]:
    """The UDP ports of the two links."""
    return 18570 + instance, 14580 + instance


class Station:
    """Every service of one vehicle. See docs/ground-control.md for how a control loop uses it."""

    def __init__(
        self,
        profile: Profile,
        now: float,
        storage: ParameterFile | None = None,
        signing: Signing | None = None,
        peers: tuple[Address, ...] | None = None,
    ) -> None:
        self.profile = profile
        self.parameters = Parameters()
        self.machine = Machine(profile, self.parameters)
        self.missions = Missions(self.machine.accept_plan)
        self.peers = Peers(standard_peers(profile.instance) if peers is None else peers, now)
        self._vehicle = (profile.system, VEHICLE_COMPONENT)
        self._load_source = (profile.load_system, LOAD_COMPONENT)
        self.dropped = 0
        """Datagrams and frames that were not taken"""
        self._storage = storage
        self._signing = signing
        self.plant_commands = PlantCommands()
        self._memory = Memory()
        self._under_way: set[Hashable] = set()
        """Commands whose verdict is still to come"""
        self._load: dict[int, tuple[Packed, float]] = {}
        self._load_sent: dict[tuple[Address, int], float] = {}
        self._housekeeping = now
        self._due = now
        """When something is to be sent next"""
        self._stirred = True
        """Something has come in that the mode machine may have to react to"""
        self._next_look = (-math.inf, -math.inf)
        self._announced = self._state()
        if storage is not None:
            self._load_parameters(storage)

    # In

    def receive(self, datagram: bytes, address: Address, now: float) -> None:
        """A datagram from a peer. Never raises, whatever is in it."""
        self._stirred = True
        self._due = now
        for frame in split(datagram[:0xFFFF]).frames:
            if self._takes(frame, now):
                self._receive_frame(frame, address, now)
            else:
                self.dropped += 1

    def _takes(self, frame: Frame, now: float) -> bool:
        if frame.version == 2 and frame.raw[2] & ~FLAG_SIGNED:
            return False  # an incompatibility flag that we do not know: the standard says to drop it
        source = (frame.system, frame.component)
        if frame.system == _BROADCAST or source in (self._vehicle, self._load_source):
            return False  # nobody, or ourselves; a companion computer may share the vehicle's system
        return self._signing is None or self._signing.accepts(frame, now)

    def _receive_frame(self, frame: Frame, address: Address, now: float) -> None:
        peer = self.peers.find(address, now)
        if peer is None:
            self.dropped += 1
            return
        peer.hear(frame, now)
        message = decoded(frame)
        if message is None:
            self.dropped += 1
            return
        number = frame.message_id  # not message.id: some messages have a field of that name
        if number == mavlink.MAVLINK_MSG_ID_HEARTBEAT and message.type == mavlink.MAV_TYPE_GCS:
            peer.last_station_heartbeat = now
        handler = _HANDLERS.get(number)
        if handler is not None:
            handler(self, message, frame, peer, now)
        elif number in mission_protocol.MESSAGES:
            self._mission(message, frame, peer, now)
        elif number in _NOT_FLOWN:
            self._say_seldom(peer, _NOT_FLOWN[number], now)

    def relay(self, frame: Frame, now: float) -> None:
        """The load's own message, from the plant's link: it is passed on as from the load."""
        if frame.system == self.profile.load_system and frame.message_id in _LOAD_MESSAGES:
            message = decoded(frame)
            as_packed = None if message is None else packed(message)
            if as_packed is not None:
                self._load[frame.message_id] = (as_packed, now)
                self._due = now

    def hear_plant(self, frame: Frame, now: float) -> None:
        """The plant's COMMAND_ACK to what was passed on to it."""
        message = decoded(frame)
        if message is not None:
            self.plant_commands.heard(message, now)

    # The control loop

    def update(self, view: VehicleView, now: float) -> Target:
        """What the law is to do now; the same object as before for as long as nothing changes.

        Made to be called at every tick: it looks at the state every GUIDANCE_PERIOD, of the plant's time or
        of ours, and at once when something has come in.
        """
        machine = self.machine
        machine.view = view
        if not self._stirred and view.time < self._next_look[0] and now < self._next_look[1]:
            return machine.target
        self._stirred = False
        self._next_look = (view.time + GUIDANCE_PERIOD, now + GUIDANCE_PERIOD)
        target = machine.update(view, now, self.peers.last_station)
        self._hasten_state(now)
        if self.machine.notices:
            notices, self.machine.notices = self.machine.notices, []
            for notice in notices:
                self.announce(notice, now)
        reached = self.machine.mission.reached
        if reached:
            self.machine.mission.reached = []
            for seq in reached:
                self._broadcast(mavlink.MAVLink_mission_item_reached_message(seq), now)
        return target

    def _state(self) -> tuple[bool, Mode, Stage]:
        return self.machine.armed, self.machine.mode, self.machine.stage

    def _hasten_state(self, now: float) -> bool:
        """Let everybody know at once, if what HEARTBEAT and the like say has changed."""
        if self._state() == self._announced:
            return False
        self._announced = self._state()
        self._due = now
        for peer in self.peers:
            peer.streams.hasten(_ON_CHANGE, now)
        return True

    @property
    def armed(self) -> bool:
        """Whether the rotors may turn."""
        return self.machine.armed and not self.machine.terminated

    def announce(self, notice: Notice, now: float) -> None:
        """A STATUSTEXT to every peer."""
        self._due = now
        for peer in self.peers:
            self._say(peer, notice, now)

    # Out

    def to_send(self, now: float) -> list[tuple[Address, bytes]]:
        """Every frame that is due, as datagrams: (to whom, bytes). Costs nothing when nothing is."""
        if now < self._due:
            return []
        if now >= self._housekeeping:
            self._housekeeping = now + _HOUSEKEEPING
            for address in self.peers.forget_silent(now):
                self.missions.forget(address)
                for key in [key for key in self._load_sent if key[0] == address]:
                    del self._load_sent[key]
        self._send_streams(now)
        table = {peer.address: peer for peer in self.peers}
        for address, message in self.parameters.to_send(table, now):
            self._send(table[address], message, now)
        for client, message, text in self.missions.to_send(now):
            if client.peer in table:
                self._send(table[client.peer], message, now)
                if text:
                    self._say(table[client.peer], Notice(WARNING, text), now)
        out: list[tuple[Address, bytes]] = []
        for peer in table.values():
            out.extend((peer.address, raw) for raw in peer.queue)
            peer.queue.clear()
        self._due = min(
            self._housekeeping,
            self.parameters.next_deadline(),
            self.missions.next_deadline(),
            *(peer.streams.next for peer in table.values()),
        )
        return out

    def next_deadline(self, now: float) -> float:
        """When `to_send` has something again, if nothing comes in before; at the latest in a second."""
        return max(now, self._due)

    def _send_streams(self, now: float) -> None:
        built: dict[int, Packed | None] = {}
        for peer in self.peers:
            for message_id in peer.streams.due(now):
                if message_id not in built:
                    built[message_id] = self._built(message_id, now)
                message = built[message_id]
                if message is not None:
                    self._send(peer, message, now)
            if self._load:
                self._pass_on_load(peer, now)

    def _pass_on_load(self, peer: Peer, now: float) -> None:
        for message_id, (message, time) in self._load.items():
            last = self._load_sent.get((peer.address, message_id), -math.inf)
            if time > last and now - last >= 0.999 / _LOAD_MESSAGES[message_id]:
                self._load_sent[peer.address, message_id] = now
                peer.send(message, *self._load_source, self._signing, now)

    def _built(self, message_id: int, now: float) -> Packed | None:
        if message_id == mavlink.MAVLINK_MSG_ID_ADSB_VEHICLE:
            message = self._load_as_traffic(now)
        else:
            message = telemetry.build(message_id, self.machine)
        return None if message is None else packed(message)

    def _load_as_traffic(self, now: float) -> Any:
        """ADSB_VEHICLE for the load, which QGroundControl draws no other way."""
        found = self._load.get(mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT)
        if found is None or now - found[1] > LOAD_SILENCE:
            return None
        place = mavlink.MAVLink_global_position_int_message
        _, lat, lon, alt, _, vx, vy, vz, _ = place.unpacker.unpack(found[0].payload)
        course = math.degrees(math.atan2(vy, vx)) % 360
        flags = (
            mavlink.ADSB_FLAGS_VALID_COORDS
            | mavlink.ADSB_FLAGS_VALID_ALTITUDE
            | mavlink.ADSB_FLAGS_VALID_HEADING
            | mavlink.ADSB_FLAGS_VALID_VELOCITY
            | mavlink.ADSB_FLAGS_VALID_CALLSIGN
            | mavlink.ADSB_FLAGS_SIMULATED
        )
        return mavlink.MAVLink_adsb_vehicle_message(
            self.profile.load_system,
            lat,
            lon,
            mavlink.ADSB_ALTITUDE_TYPE_GEOMETRIC,
            alt,
            int(course * 100) % 36000,
            min(int(math.hypot(vx, vy)), 0xFFFF),
            -vz if vz > -0x8000 else 0x7FFF,
            f"LOAD{self.profile.instance}".encode(),
            mavlink.ADSB_EMITTER_TYPE_LIGHTER_AIR,
            1,
            flags,
            0,
        )

    # Sending to one peer

    def _send(self, peer: Peer, message: Any, now: float, of_load: bool = False) -> None:
        as_packed = packed(message)
        if as_packed is None:
            return
        source = self._load_source if of_load else self._vehicle
        peer.send(as_packed, *source, self._signing, now)

    def _broadcast(self, message: Any, now: float) -> None:
        as_packed = packed(message)
        self._due = now
        for peer in self.peers:
            self._send(peer, as_packed, now)

    def _say_seldom(self, peer: Peer, text: str, now: float) -> None:
        """Something that a stream of messages gives rise to again and again."""
        last = peer.last_texts.get(text)
        if last is None or now - last >= TEXT_PAUSE:
            if len(peer.last_texts) > 64:
                peer.last_texts.clear()
            peer.last_texts[text] = now
            self._say(peer, Notice(WARNING, text), now)

    def _say(self, peer: Peer, notice: Notice, now: float) -> None:
        text = notice.text.encode("ascii", "replace")
        pieces = [text[i : i + TEXT_LENGTH] for i in range(0, len(text), TEXT_LENGTH)]
        number = 0
        if len(pieces) > 1:
            peer.text_id = peer.text_id % 0xFFFF + 1
            number = peer.text_id
            if len(pieces[-1]) == TEXT_LENGTH:
                pieces.append(b"")  # the receiver knows the end by a piece that is not full
        for index, piece in enumerate(pieces):
            self._send(peer, mavlink.MAVLink_statustext_message(notice.severity, piece, number, index), now)

    # Handlers of messages

    def _addressed(self, message: Any, components: tuple[int, ...] = (0, VEHICLE_COMPONENT)) -> bool:
        """Whether a message is for the vehicle."""
        return (
            message.target_system in (_BROADCAST, self.profile.system)
            and message.target_component in components
        )

    def _to_load(self, message: Any) -> bool:
        return message.target_system == self.profile.load_system and message.target_component in (
            0,
            LOAD_COMPONENT,
        )

    def _command(self, message: Any, frame: Frame, peer: Peer, now: float) -> None:
        to_load = self._to_load(message)
        if not to_load and not self._addressed(message):
            return
        command = command_of(message, to_load)
        # What the retransmission has in common with the original: everything but the counters.
        sender = (peer.address, frame.system, frame.component)
        numbers = struct.pack("<7d", *_finite(command))
        key = (sender, message.id, to_load, command.number, numbers)
        confirmation = getattr(message, "confirmation", 0)
        sequence = frame.raw[4 if frame.version == 2 else 2]

        def acknowledge(verdict: Verdict, now: float) -> None:
            ack = mavlink.MAVLink_command_ack_message
            message = ack(command.number, verdict.result, 0, 0, frame.system, frame.component)
            self._send(peer, message, now, of_load=to_load)

        def finish(verdict: Verdict, now: float) -> None:
            self._under_way.discard(key)
            self._memory.store(key, sequence, confirmation, verdict, now)
            if not verdict.ok:
                self._say(peer, Notice(WARNING, verdict.text), now)
            # A client that waits for a mode after its command is accepted must not see the old one then.
            if self._hasten_state(now):
                self._send_streams(now)
            acknowledge(verdict, now)
            self._due = now

        before = self._memory.recall(key, sequence, confirmation, now)
        if before is not None:
            acknowledge(before, now)
        elif key not in self._under_way:
            verdict = execute(command, self.machine, _PeerRequests(self, peer, now, finish), now)
            if verdict is None:
                self._under_way.add(key)
            else:
                finish(verdict, now)

    def _old_set_mode(self, message: Any, frame: Frame, peer: Peer, now: float) -> None:
        """SET_MODE, which some clients still send instead of DO_SET_MODE."""
        if message.target_system != self.profile.system:
            return
        main, sub = message.custom_mode >> 16 & 0xFF, message.custom_mode >> 24 & 0xFF
        command = Command(176, message.base_mode, main, sub, *(math.nan,) * 4, False, "", False)
        verdict = execute(command, self.machine, _PeerRequests(self, peer, now, lambda *_: None), now)
        if verdict is not None and not verdict.ok:
            self._say(peer, Notice(WARNING, verdict.text), now)

    def _parameter_list(self, message: Any, frame: Frame, peer: Peer, now: float) -> None:
        if self._addressed(message):
            self.parameters.request_list(peer.address, now)

    def _parameter_read(self, message: Any, frame: Frame, peer: Peer, now: float) -> None:
        if self._addressed(message):
            reply, say = self._talk(frame, peer, now)
            self.parameters.request_read(message.param_id, message.param_index, reply, say)

    def _parameter_set(self, message: Any, frame: Frame, peer: Peer, now: float) -> None:
        if not self._addressed(message):
            return
        reply, say = self._talk(frame, peer, now)
        raw = frame.payload[:4].ljust(4, b"\0")
        if self.parameters.request_set(message.param_id, message.param_type, raw, reply, say):
            self._broadcast(self.parameters.value_message(message.param_id), now)
        elif peer.speaks_v1:
            # PARAM_ERROR does not exist in MAVLink 1: the value as it stays says the same.
            self.parameters.request_read(message.param_id, -1, reply, say)

    def _talk(
        self, frame: Frame, peer: Peer, now: float
    ) -> tuple[Callable[[Any], None], Callable[[str], None]]:
        """How to reply to a frame's sender, and how to tell its user something."""

        def reply(message: Any) -> None:
            if not isinstance(message, Packed) and hasattr(message, "target_system"):
                message.target_system, message.target_component = frame.system, frame.component
            self._send(peer, message, now)

        return reply, lambda text: self._say(peer, Notice(WARNING, text), now)

    def _mission(self, message: Any, frame: Frame, peer: Peer, now: float) -> None:
        if self._addressed(message, _MISSION_COMPONENTS):
            client = Client(peer.address, frame.system, frame.component)
            reply, say = self._talk(frame, peer, now)
            self.missions.receive(message, client, now, reply, say)

    def _set_current_item(self, message: Any, frame: Frame, peer: Peer, now: float) -> None:
        if not self._addressed(message, _MISSION_COMPONENTS):
            return
        verdict = self.machine.set_current_item(message.seq)
        if verdict.ok:
            self._broadcast(telemetry.build(mavlink.MAVLINK_MSG_ID_MISSION_CURRENT, self.machine), now)
        else:
            self._say(peer, Notice(WARNING, verdict.text), now)

    def _setpoint(self, message: Any, frame: Frame, peer: Peer, now: float) -> None:
        to_load = self._to_load(message)
        view = self.machine.view
        if view is None or not (to_load or self._addressed(message)):
            return
        home = self.machine.home or (0.0, 0.0, 0.0)
        found = setpoint_of(message, to_load, self.profile, home, view)
        sender = (peer.address, frame.system, frame.component)
        fault = found if isinstance(found, str) else self.machine.offer(found, sender, now)
        if fault:
            self._say_seldom(peer, fault, now)

    def _data_stream(self, message: Any, frame: Frame, peer: Peer, now: float) -> None:
        if self._addressed(message):
            on = message.start_stop == 1
            peer.streams.set_group(message.req_stream_id, message.req_message_rate, on, now)

    def _ping(self, message: Any, frame: Frame, peer: Peer, now: float) -> None:
        if message.target_system == 0 and message.target_component == 0:
            answer = mavlink.MAVLink_ping_message(
                message.time_usec, message.seq, frame.system, frame.component
            )
            self._send(peer, answer, now)

    def _time_sync(self, message: Any, frame: Frame, peer: Peer, now: float) -> None:
        if message.tc1 == 0:
            self._send(peer, mavlink.MAVLink_timesync_message(int(now * 1e9), message.ts1), now)

    def _refuse_ftp(self, message: Any, frame: Frame, peer: Peer, now: float) -> None:
        """FTP's negative acknowledgement, at once: clients then use the other protocols."""
        if message.target_system != self.profile.system:
            return
        request = bytes(message.payload)
        sequence = int.from_bytes(request[:2], "little") + 1 & 0xFFFF
        # Sequence, session, NAK, size 1, requested opcode, burst, padding, offset; UnknownCommand.
        answer = sequence.to_bytes(2, "little") + bytes((request[2], 129, 1, request[3], 0, 0, 0, 0, 0, 0, 7))
        ftp = mavlink.MAVLink_file_transfer_protocol_message
        self._send(peer, ftp(0, frame.system, frame.component, answer.ljust(251, b"\0")), now)

    # Parameters on disk

    def _load_parameters(self, storage: ParameterFile) -> list[str]:
        values, fault = storage.load()
        faults = ([fault] if fault else []) + self.parameters.load(values)
        for text in faults:
            self.machine.notices.append(Notice(WARNING, f"Parameters: {text}"))
        return faults

    def store_parameters(self, action: float) -> Verdict:
        """MAV_CMD_PREFLIGHT_STORAGE."""
        if action == 2:
            if self.machine.flying:
                return not_now("Parameters not reset: in flight; land first")
            self.parameters.reset()
            return OK
        if action not in (0, 1):
            return deny(
                f"Parameter storage refused: param1 is {action:g}; use 0 (load), 1 (save) or 2 (reset)"
            )
        if self._storage is None:
            return deny("Parameters have no file to be kept in; start the controller with --parameters FILE")
        if action == 0:
            return not_now("Parameters read with faults") if self._load_parameters(self._storage) else OK
        fault = self._storage.save(self.parameters.values())
        return not_now(f"Parameters not saved: {fault}") if fault else OK


class _PeerRequests(Requests):
    """What a command can ask for, on behalf of the peer that sent it."""

    def __init__(self, station: Station, peer: Peer, now: float, finish: Answer) -> None:
        self._station, self._peer, self._now = station, peer, now
        self._finish = finish

    def send_message(self, message_id: int, index: float) -> bool:
        """Send one message once; False if there is no such message."""
        station, peer, now = self._station, self._peer, self._now
        if message_id == AvailableModes.id:
            modes = telemetry.available_modes(0.0 if math.isnan(index) else index)
            for mode in modes:
                station._send(peer, mode, now)
            return bool(modes)
        if message_id == mavlink.MAVLINK_MSG_ID_MESSAGE_INTERVAL:
            if not (0 <= index <= 0xFFFF):
                return False
            self.send_interval(index)
            return True
        message = station._built(message_id, now)
        if message is not None:
            station._send(peer, message, now)
        return message is not None

    def set_interval(self, message_id: float, microseconds: float) -> Verdict:
        """Stream a message at an interval."""
        return self._peer.streams.set_interval(message_id, microseconds, self._now)

    def send_interval(self, message_id: float) -> None:
        """Send MESSAGE_INTERVAL: 0 for a message that cannot be streamed, -1 for one that is off."""
        interval = self._peer.streams.interval(int(message_id))
        off = -1 if message_id in STREAMABLE else 0
        microseconds = off if interval is None else round(interval * 1e6)
        message = mavlink.MAVLink_message_interval_message(int(message_id), microseconds)
        self._station._send(self._peer, message, self._now)

    def storage(self, action: float) -> Verdict:
        """Load, save or reset the parameters."""
        return self._station.store_parameters(action)

    def inject_failure(self, parameters: tuple[float, ...]) -> None:
        """Pass MAV_CMD_INJECT_FAILURE on to the plant."""
        self._station.plant_commands.inject_failure(parameters, self._now, self._finish)

    def say(self, text: str) -> None:
        """A STATUSTEXT that comes with an acceptance."""
        self._station._say(self._peer, Notice(INFO, text), self._now)


def _finite(command: Command) -> tuple[float, ...]:
    """The parameters as numbers that can be compared and packed."""
    numbers = (command.p1, command.p2, command.p3, command.p4, command.p5, command.p6, command.p7)
    return tuple(math.nan if math.isnan(number) else number for number in numbers)


_Handler = Callable[[Station, Any, Frame, Peer, float], None]
_HANDLERS: dict[int, _Handler] = {
    mavlink.MAVLINK_MSG_ID_COMMAND_LONG: Station._command,
    mavlink.MAVLINK_MSG_ID_COMMAND_INT: Station._command,
    mavlink.MAVLINK_MSG_ID_SET_MODE: Station._old_set_mode,
    mavlink.MAVLINK_MSG_ID_PARAM_REQUEST_LIST: Station._parameter_list,
    mavlink.MAVLINK_MSG_ID_PARAM_REQUEST_READ: Station._parameter_read,
    mavlink.MAVLINK_MSG_ID_PARAM_SET: Station._parameter_set,
    mavlink.MAVLINK_MSG_ID_MISSION_SET_CURRENT: Station._set_current_item,
    mavlink.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED: Station._setpoint,
    mavlink.MAVLINK_MSG_ID_SET_POSITION_TARGET_GLOBAL_INT: Station._setpoint,
    mavlink.MAVLINK_MSG_ID_REQUEST_DATA_STREAM: Station._data_stream,
    mavlink.MAVLINK_MSG_ID_PING: Station._ping,
    mavlink.MAVLINK_MSG_ID_TIMESYNC: Station._time_sync,
    mavlink.MAVLINK_MSG_ID_FILE_TRANSFER_PROTOCOL: Station._refuse_ftp,
}
