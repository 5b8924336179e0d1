"""What the phases of a flight over a stack share: what is known, what is sent, and which phase it is."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from pymavlink.dialects.v20 import common as mavlink

from controller.feedback.truth import PathFrom
from controller.law.reference import Path
from controller.law.state import Array
from controller.over import dialects
from controller.over.ages import Ages
from controller.over.baseline import Baseline, message, target
from controller.over.dialects import DIALECTS, ModeNumbers
from controller.over.identify.probe import Probe
from controller.over.law import CompanionLaw, Setpoint
from controller.over.live.reference import LiveReference
from controller.over.load.source import LoadSource
from controller.over.model import Steering, design
from controller.over.setpoint_message import attitude_target
from controller.over.stack import AttitudeGains, Stack, full_thrust, thrust_setpoint
from controller.over.states import State, Step
from controller.over.telemetry import Telemetry
from sitl_bridge.frames import Geodetic, LocalOrigin, Triple
from sitl_bridge.mavlink.framing import Packer
from sitl_bridge.vehicle.description import Vehicle

OUR_SYSTEM = 200
RETRY_INTERVAL = 1.0
"""s between two commands of a kind."""
NEAR = 1000.0
"""m from the description's origin to the stack's."""
LAST_TEXTS = 3
"""STATUSTEXTs of the stack that a failure repeats."""


class Flight:
    """One flight over a stack. The phases change it; `Companion` carries its bytes."""

    def __init__(
        self,
        vehicle: Vehicle,
        stack: Stack,
        source: LoadSource,
        path_from: PathFrom,
        duration_s: float,
        say: Callable[[str], None],
        probe: Probe | None = None,
        baseline: Baseline | None = None,
        ages: Ages | None = None,
        live: LiveReference | None = None,
        steering: Steering = Steering.RATES,
    ) -> None:
        """path_from: the reference for a load at a place, world; duration_s: of the reference.

        probe: measures how the stack follows, while the reference is flown.
        baseline: the stack's own position control flies, and the law does not.
        ages: with a simulated world's time, where it is known.
        live: flown instead of path_from's reference.
        steering: what the stack is given besides the thrust.
        """
        self.vehicle, self.stack, self.source = vehicle, stack, source
        self.path_from, self.duration_s, self.say = path_from, duration_s, say
        self.probe, self.baseline, self.live = probe, baseline, live
        self.dialect = DIALECTS[stack.kind]
        self.steering = steering
        self.design = design(vehicle, stack, accurate=source.in_world)
        self.telemetry = Telemetry()
        self.ramp_time: float | None = None
        """s, in which the reference leaves its start, once it is planned."""
        self.law: CompanionLaw | None = None
        self.state = State.CONNECTING
        self.since = 0.0
        """When this phase began, s of `now`."""
        self.missing = ""
        """What this phase waits for, in words."""
        self.failure: str | None = None
        self.steps = 0
        self.last_step: Step | None = None
        self.begin_time: float | None = None
        """When the law's path began, s by the stack's clock."""
        self.still_since: float | None = None
        """Since when the vehicle has been at its height, or the load at rest, s of `now`."""
        self.ages = Ages() if ages is None else ages
        """Of `state`, the stack's, and `estimate`, what the law flies on."""
        self.next_try = 0.0
        self.out: list[bytes] = []
        self._full = full_thrust(vehicle, stack)
        self._packer = Packer(OUR_SYSTEM, mavlink.MAV_COMP_ID_ONBOARD_COMPUTER)

    # What is known.

    @property
    def system(self) -> int:
        """The stack's system; there has been a HEARTBEAT."""
        assert self.telemetry.system is not None
        return self.telemetry.system

    @property
    def stack_time(self) -> float:
        """s, of the newest state by the stack's clock; there is one."""
        assert self.telemetry.vehicle is not None
        return self.telemetry.vehicle.time_s

    def in_mode(self, numbers: ModeNumbers) -> bool:
        """Whether the stack says that it is in a mode."""
        return self.telemetry.custom_mode == numbers.custom

    def new_estimate(self, now: float) -> Array | None:
        """The law's state (18,), once for each new state of the stack; None: there is none to fly on."""
        if not self.telemetry.fresh:
            return None
        self.telemetry.fresh = False
        estimate = self.source.state(self.telemetry, now)
        if estimate is not None:
            self.ages.mark("estimate", now)
        return estimate

    def state_age(self, now: float) -> float:
        """s since the vehicle was as the stack's newest state says, by TIMESYNC where clocks keep pace."""
        t = self.telemetry
        age = self.ages.age("state", now)
        synchronised = None if t.vehicle is None else t.clock.age(t.vehicle.time_s, now)
        return age if synchronised is None or self.ages.simulated else max(age, synchronised)

    def state_origin(self) -> LocalOrigin | None:
        """Of the frame of the state, on Earth; None: not known."""
        home = self.vehicle.home
        if self.source.in_world:
            return LocalOrigin(home.latitude, home.longitude, home.altitude)
        return self.telemetry.origin

    def world_origin(self) -> Triple:
        """Where the scenario's origin is in the frame of the state, m ENU.

        It is where the description has it, if the stack is near; else where the vehicle stood at the start,
        the stack's home. A home is as wrong as the position was at arming.
        """
        t = self.telemetry
        if self.source.in_world:
            return (0.0, 0.0, 0.0)
        home = self.vehicle.home
        described = t.local(Geodetic(home.latitude, home.longitude, home.altitude))
        if described is not None and math.hypot(*described) < NEAR:
            return described
        if t.home is None:
            return (0.0, 0.0, 0.0)
        east, north, up = standing_place(self.vehicle)
        return (t.home[0] - east, t.home[1] - north, t.home[2] - up)

    def reference(self, load: Array) -> Path:
        """The reference for a load at a place (3,), m, in the frame of the state."""
        east, north, up = origin = self.world_origin()
        x, y, z = load.tolist()
        path = moved(self.path_from((x - east, y - north, z - up)), origin)
        path["start"] = load
        return path

    # What is sent.

    def pack(self, message: Any) -> None:
        """Send a message."""
        self.out.append(self._packer.pack(message))

    def ask_for_mode(self, numbers: ModeNumbers) -> None:
        """DO_SET_MODE."""
        self.pack(dialects.set_mode(self.system, numbers))

    def settle_design(self) -> None:
        """Design for the stack as it is, now that its parameters are known."""
        if self.steering is Steering.ATTITUDE:
            gains = self._attitude_gains()
            self.design = design(self.vehicle, self.stack, self.source.in_world, gains)

    def _attitude_gains(self) -> AttitudeGains:
        """As the stack's description has them, else its parameters, else its usual ones."""
        described, usual = (self.stack.attitude_gain, self.stack.yaw_gain), self.dialect.attitude_gains
        tilt, yaw = (
            self.telemetry.parameters.get(name, default) if own is None else own
            for own, name, default in zip(described, self.dialect.attitude_parameters, usual, strict=True)
        )
        return AttitudeGains(tilt, yaw)

    def due(self, now: float) -> bool:
        """Whether a command may be sent again."""
        if now < self.next_try:
            return False
        self.next_try = now + RETRY_INTERVAL
        return True

    def hover_setpoint(self) -> Setpoint:
        """What is streamed before the take-over: without effect then, and harmless."""
        return Setpoint(self.vehicle.hover_thrust, (0.0, 0.0, 0.0))

    def send(self, wanted: Setpoint) -> float:
        """SET_ATTITUDE_TARGET with thrust and body rates or attitude; the thrust set-point, 0 to 1."""
        curve = self.stack.thrust_curve
        if curve is None:
            dialect = self.dialect
            curve = self.telemetry.parameters.get(dialect.thrust_parameter or "", dialect.thrust_curve)
        thrust = thrust_setpoint(wanted.thrust, self._full, curve)
        milliseconds = round(self.stack_time * 1e3) & 0xFFFFFFFF
        self.pack(attitude_target(wanted, thrust, milliseconds, self.system))
        return thrust

    def _send_position(self, baseline: Baseline, law: CompanionLaw, time_s: float) -> None:
        """SET_POSITION_TARGET_LOCAL_NED of the vehicle."""
        wanted = target(baseline, law, self.vehicle.hover_length, time_s)
        yaw = float(law.path["yaw"][0])
        milliseconds = round(self.stack_time * 1e3) & 0xFFFFFFFF
        self.pack(message(wanted, self._stack_frame(), yaw, milliseconds, self.system))

    def _stack_frame(self) -> Triple:
        """Where the origin of the state's frame is in the stack's local one, m ENU."""
        if not self.source.in_world:
            return (0.0, 0.0, 0.0)
        home = self.vehicle.home
        found = self.telemetry.local(Geodetic(home.latitude, home.longitude, home.altitude))
        return (0.0, 0.0, 0.0) if found is None else found

    def fly(self, estimate: Array) -> None:
        """One step of the law."""
        assert self.law is not None
        assert self.begin_time is not None
        time_s = self.stack_time - self.begin_time
        if self.live is not None and self.live.flying:
            self.law.path = self.live.path(time_s)
        wanted = self.law.step(estimate, time_s)
        if self.baseline is not None:
            self._send_position(self.baseline, self.law, time_s)
        elif self.probe is None or self.state is not State.FLYING:
            self.send(wanted)
        else:
            wanted = self.probe.excited(wanted, time_s)
            self.probe.note(time_s, self.send(wanted), wanted, estimate, self.telemetry)
        self.steps += 1
        if self.state is State.FLYING:
            self.last_step = Step(time_s, estimate, self.law.reference)

    # How it goes on.

    def note_acks(self, what: str) -> None:
        """Say which commands were refused."""
        while self.telemetry.acks:
            command, result = self.telemetry.acks.popleft()
            if result in (mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_IN_PROGRESS):
                continue
            if command in (mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAV_CMD_REQUEST_MESSAGE):
                continue  # not every stack has every message
            self.say(f"{what}: the stack answers {dialects.command_name(command)} with {result_name(result)}")

    def go(self, state: State, now: float) -> None:
        """On to another phase."""
        self.state, self.since, self.next_try, self.missing = state, now, now, ""

    def fail(self, why: str, now: float) -> None:
        """It is over, and nothing more is sent."""
        self.failure = why
        self.say(why)
        self.go(State.FAILED, now)

    def give_up(self, waited: float, now: float) -> None:
        """What was waited for did not come: with the stack's last words, which may say why."""
        words = f"waited {waited:g} s for {self.missing or self.state.value}"
        said = list(self.telemetry.said)[-LAST_TEXTS:]
        if said:
            words += "; the stack's last words: " + " | ".join(said)
        self.fail(words, now)


def result_name(result: int) -> str:
    """A MAV_RESULT in words."""
    names = mavlink.enums["MAV_RESULT"]
    name = names[result].name.removeprefix("MAV_RESULT_") if result in names else str(result)
    return name.lower().replace("_", " ")


def standing_place(vehicle: Vehicle) -> Triple:
    """Where a description's vehicle stands before the flight, m, world: its centre above its legs."""
    ground = 0.0 if vehicle.ground is None else vehicle.ground.height - vehicle.ground.sink
    legs = -min((leg[2] for leg in vehicle.airframe.legs), default=0.0)
    return (0.0, 0.0, ground + legs)


def moved(path: Path, offset: Triple) -> Path:
    """A reference path with its centre moved by an offset, m."""
    path = path.copy()
    path["centre"] = path["centre"] + np.array(offset)
    return path
