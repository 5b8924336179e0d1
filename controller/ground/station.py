"""The vehicle as ground control sees it: one object, datagrams in, datagrams and a guidance target out.

No sockets, no clock, no threads. `now` is in seconds of one monotonic clock throughout.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

from pymavlink.dialects.v20 import common as mavlink

from controller.ground.commands.result import WARNING, Notice
from controller.ground.commands.service import CommandService
from controller.ground.files.ftp import Ftp
from controller.ground.files.logs import LogProtocol, LogStore, NoLogs
from controller.ground.files.virtual import VirtualFiles
from controller.ground.flight import client_requests, plans
from controller.ground.flight.guidance import Stage
from controller.ground.flight.modes import Machine
from controller.ground.flight.motion.setpoint_types import Target
from controller.ground.flight.px4_modes import Mode
from controller.ground.inbox import Inbox
from controller.ground.link.datagrams import DatagramSplitter
from controller.ground.link.outbox import Outbox
from controller.ground.link.packing import CurrentMode, Packed, decoded, packed
from controller.ground.link.peers import Address, Peers
from controller.ground.link.ports import (
    ONBOARD_LINK,
    ONBOARD_LOCAL,
    ONBOARD_PEER,
    STATION_LINK,
    STATION_LOCAL,
    STATION_PEER,
)
from controller.ground.link.signing import Signing
from controller.ground.missions.plans import Plans
from controller.ground.parameters.file import ParameterFile
from controller.ground.parameters.protocol import Parameters, single
from controller.ground.parameters.storage import StoredParameters
from controller.ground.parameters.table import BY_NAME
from controller.ground.telemetry import messages as telemetry
from controller.ground.telemetry.load_relay import LoadRelay
from controller.ground.telemetry.message_rates import Streams
from controller.ground.telemetry.plant_clock import PlantClock
from controller.ground.telemetry.vehicle_state import Profile, VehicleView
from sitl_bridge.mavlink.framing import FLAG_SIGNED, Frame

GUIDANCE_PERIOD = 0.02
"""s, at most, between two looks of the mode machine at the vehicle"""
_HOUSEKEEPING = 1.0
"""s between two looks for silent peers"""
_BROADCAST = 0
_ON_CHANGE = (
    mavlink.MAVLINK_MSG_ID_HEARTBEAT,
    mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE,
    CurrentMode.id,
)
"""Sent at once when the mode changes, or armed changes"""


def standard_peers(instance: int) -> tuple[Address, ...]:
    """Where PX4 speaks to first: ground stations, then onboard computers."""
    return (
        Address(STATION_LINK, "127.0.0.1", STATION_PEER),
        Address(ONBOARD_LINK, "127.0.0.1", ONBOARD_PEER + instance),
    )


def local_ports(instance: int) -> tuple[int, int]:
    """The UDP ports of the two links."""
    return STATION_LOCAL + instance, ONBOARD_LOCAL + instance


def _own_defaults(profile: Profile) -> dict[str, float]:
    """Defaults that are this vehicle's own."""
    hover = BY_NAME["MPC_THR_HOVER"]
    own = {"MPC_THR_HOVER": single(min(max(profile.hover_thrust, hover.minimum), hover.maximum))}
    return own if profile.battery_cells is None else own | {"BAT1_N_CELLS": profile.battery_cells}


class Station:
    """Every service of one vehicle.

    A control loop calls `update` at every tick and flies the target it gets. It hands in what peers and plant
    say (`receive`, `hear_plant`), and sends what `to_send` gives, at the latest at `next_deadline`.
    """

    def __init__(
        self,
        profile: Profile,
        now: float,
        storage: ParameterFile | None = None,
        signing: Signing | None = None,
        peers: tuple[Address, ...] | None = None,
        logs: LogStore | None = None,
        on_statustext: Callable[[str], None] = lambda text: None,
    ) -> None:
        """on_statustext: told each STATUSTEXT that goes to every peer."""
        self.profile = profile
        self._on_statustext = on_statustext
        self.parameters = Parameters(_own_defaults(profile))
        self.machine = Machine(profile, self.parameters)
        self.missions = Plans(
            partial(plans.accept_mission, self.machine),
            partial(plans.accept_fence, self.machine),
            partial(plans.accept_rally, self.machine),
            partial(client_requests.go_to_item, self.machine),
        )
        standard = standard_peers(profile.instance) if peers is None else peers
        self.peers = Peers(standard, now, self._forget)
        self.datagrams = DatagramSplitter()
        self.plant_clock = PlantClock()
        self.dropped = 0
        """Datagrams and frames that were not taken"""
        self._signing = signing
        self._out = Outbox(self.peers, profile, signing)
        self._load = LoadRelay(profile)
        stored = StoredParameters(
            self.parameters, storage, lambda text: self.machine.notices.append(Notice(WARNING, text))
        )
        self._commands = CommandService(self.machine, self._out, stored, self._built, self._show_state)
        self.plant_commands = self._commands.plant
        self._logs = LogProtocol(logs or NoLogs())
        self._ftp = Ftp(VirtualFiles(self.parameters, self._logs))
        self._inbox = Inbox(
            self.machine,
            self.parameters,
            self.missions,
            self._commands,
            self._ftp,
            self._logs,
            self._out,
            self.peers,
            self.plant_clock,
        )
        self._housekeeping = now
        self._due = now
        """When something is to be sent next"""
        self._stirred = True
        """Something has come in that the mode machine may have to react to"""
        self._next_look = (-math.inf, -math.inf)
        self.refresh: Callable[[], None] = lambda: None
        """Brings the view up to date, before anybody is shown it"""
        self._announced = self._state()

    # In

    def receive(self, datagram: bytes, address: Address, now: float) -> None:
        """A datagram from a peer. Never raises, whatever is in it."""
        for frame in self.datagrams.frames(datagram, address):
            self.receive_frame(frame, address, now)

    def receive_frame(self, frame: Frame, address: Address, now: float) -> None:
        """One frame of a peer's datagram."""
        self._stirred = True
        self._due = now
        self.refresh()
        if not self._takes(frame, now):
            self.dropped += 1
            return
        peer = self.peers.find(address, now)
        if peer is None:
            self.dropped += 1
            return
        peer.hear(frame, now)
        message = decoded(frame)
        if message is None:
            self.dropped += 1
            return
        self._inbox.dispatch(message, frame, peer, now)

    def _takes(self, frame: Frame, now: float) -> bool:
        if frame.version == 2 and frame.raw[2] & ~FLAG_SIGNED:
            return False  # an incompatibility flag that we do not know: the standard says to drop it
        source = (frame.system, frame.component)
        if frame.system == _BROADCAST or source in (self._out.vehicle, self._out.load):
            return False  # nobody, or ourselves; a companion computer may share the vehicle's system
        return self._signing is None or self._signing.accepts(frame, now)

    def _forget(self, address: Address) -> None:
        """A peer is no more: what was under way with it ends."""
        self.missions.forget(address)
        self._load.forget(address)
        self._ftp.forget(address)

    def hear_plant(self, frame: Frame, now: float) -> None:
        """What the plant says: the load's own messages, and answers to what was passed on to it."""
        if self._load.accept(frame, now):
            self._due = now
        elif frame.message_id == mavlink.MAVLINK_MSG_ID_COMMAND_ACK:
            message = decoded(frame)
            if message is not None:
                self.plant_commands.heard(message, now)
                self._due = now

    # The control loop

    def update(self, view: VehicleView, now: float) -> Target:
        """What the law is to do now; the same object as before for as long as nothing changes.

        Made to be called at every tick: it looks at the state every GUIDANCE_PERIOD, of the plant's time or
        of ours, and at once when something has come in.
        """
        machine = self.machine
        self.plant_clock.note(view.time, now)
        machine.view = view
        if not self._stirred and view.time < self._next_look[0] and now < self._next_look[1]:
            return machine.target
        self._stirred = False
        self._next_look = (view.time + GUIDANCE_PERIOD, now + GUIDANCE_PERIOD)
        self._restart_if_asked(now)
        target = machine.update(view, now, self.peers.last_station)
        self._hasten_state(now)
        if machine.notices:
            notices, machine.notices = machine.notices, []
            for notice in notices:
                self.announce(notice, now)
        if machine.mission.reached:
            reached, machine.mission.reached = machine.mission.reached, []
            self._due = now
            for seq in reached:
                self._out.broadcast(mavlink.MAVLink_mission_item_reached_message(seq), now)
        return target

    @property
    def looks_at(self) -> float:
        """The plant's time, s, from which on `update` looks at the state again."""
        return self._next_look[0]

    def looks_now(self, now: float) -> bool:
        """Whether it does so at the next tick, whatever the plant's time is."""
        return self._stirred or now >= self._next_look[1]

    @property
    def shut_down(self) -> bool:
        """Whether a client has asked for the end of the process."""
        return self._commands.restart == "shut down" and not self.machine.armed

    def _restart_if_asked(self, now: float) -> None:
        if self._commands.restart == "reboot":
            self._commands.restart = ""
            self.machine.restart()
            for peer in self.peers:
                peer.streams = Streams(now, onboard=peer.address.link == ONBOARD_LINK)

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

    def _show_state(self, now: float) -> None:
        if self._hasten_state(now):
            self._send_streams(now)

    @property
    def mode_title(self) -> str:
        """The mode's name for a person; `disarmed` until it acts."""
        return self.machine.mode.title if self.armed else "disarmed"

    @property
    def armed(self) -> bool:
        """Whether the rotors may turn."""
        return self.machine.armed and not self.machine.terminated

    def announce(self, notice: Notice, now: float) -> None:
        """A STATUSTEXT to every peer."""
        self._due = now
        self._on_statustext(notice.text)
        self._out.announce(notice, now)

    # Out

    def to_send(self, now: float) -> list[tuple[Address, bytes]]:
        """Every frame that is due, as datagrams: (to whom, bytes). Costs nothing when nothing is."""
        if now < self._due:
            return []
        self.refresh()
        if now >= self._housekeeping:
            self._housekeeping = now + _HOUSEKEEPING
            self.peers.forget_silent(now)
        self._send_streams(now)
        table = {peer.address: peer for peer in self.peers}
        for address, message in self.parameters.to_send(table, now):
            self._out.send(table[address], message, now)
        for client, message, text in self.missions.to_send(now):
            if client.peer in table:
                self._out.send(table[client.peer], message, now)
                if text:
                    self._out.say(table[client.peer], Notice(WARNING, text), now)
        for address, data in self._logs.to_send(table.__contains__, now):
            self._out.send(table[address], data, now)
        for reader, part in self._ftp.to_send(table.__contains__, now):
            ftp = mavlink.MAVLink_file_transfer_protocol_message
            self._out.send(table[reader.peer], ftp(0, reader.system, reader.component, part), now)
        out: list[tuple[Address, bytes]] = []
        for peer in table.values():
            out.extend((peer.address, raw) for raw in peer.queue)
            peer.queue.clear()
        self._due = min(
            self._housekeeping,
            self.parameters.next_deadline(),
            self.missions.next_deadline(),
            self._logs.next_deadline(),
            self._ftp.next_deadline(),
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
                    message = self._built(message_id, now)
                    built[message_id] = None if message is None else packed(message)
                as_packed = built[message_id]
                if as_packed is not None:
                    self._out.send(peer, as_packed, now)
            self._load.pass_on(peer, self._out, now)

    def _built(self, message_id: int, now: float) -> Any:
        if message_id == mavlink.MAVLINK_MSG_ID_ADSB_VEHICLE:
            return self._load.as_traffic(now)
        return telemetry.build(message_id, self.machine)
