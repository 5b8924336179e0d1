"""Commands that ask for messages, checks, parameters, a reboot or a fault, and leave the flight as it is."""

from __future__ import annotations

import math

from controller.ground.commands.command import Command, Handler, Requests
from controller.ground.commands.result import OK, Verdict, deny, not_now
from controller.ground.flight.modes import Machine

_SHUTDOWN = 2.0
_REBOOTS = (0.0, 1.0, _SHUTDOWN, 3.0)
"""PREFLIGHT_REBOOT_SHUTDOWN's param1; 3 would stay in a boot loader, which there is none of"""


def prearm(c: Command, machine: Machine, requests: Requests, now: float) -> Verdict:
    """RUN_PREARM_CHECKS."""
    for fault in machine.arming_faults():
        requests.say(f"Not ready: {fault}")
    return OK


def interval(c: Command, machine: Machine, requests: Requests, now: float) -> Verdict:
    """SET_MESSAGE_INTERVAL."""
    if not math.isfinite(c.p1):
        return deny("Message interval denied: param1 must be a message ID")
    return requests.set_interval(c.p1, c.p2)


def get_interval(c: Command, machine: Machine, requests: Requests, now: float) -> Verdict:
    """GET_MESSAGE_INTERVAL."""
    if not (0 <= c.p1 <= 0xFFFF and c.p1 == int(c.p1)):
        return deny("Message interval denied: param1 must be a message ID")
    requests.send_interval(c.p1)
    return OK


def message(number: int | None = None) -> Handler:
    """REQUEST_MESSAGE, or a command that asks for one message by its number."""

    def handler(c: Command, machine: Machine, requests: Requests, now: float) -> Verdict:
        if number is None and not (math.isfinite(c.p1) and c.p1 == int(c.p1)):
            return deny("Message request denied: param1 must be a message ID")
        message_id = int(c.p1) if number is None else number
        if not requests.send_message(message_id, c.p2):
            return deny(f"Message {message_id} is not supported, or has no data yet")
        return OK

    return handler


def storage(c: Command, machine: Machine, requests: Requests, now: float) -> Verdict:
    """PREFLIGHT_STORAGE."""
    return requests.storage(c.p1)


def reboot(c: Command, machine: Machine, requests: Requests, now: float) -> Verdict:
    """PREFLIGHT_REBOOT_SHUTDOWN."""
    if c.p1 not in _REBOOTS:
        return deny(f"Reboot denied: param1 is {c.p1:g}; use 0 (nothing), 1 (reboot) or 2 (shut down)")
    if c.p1 == 0.0:
        return OK
    if machine.armed:
        return not_now("Reboot denied: armed; land and disarm first")
    requests.restart(shut_down=c.p1 == _SHUTDOWN)
    return OK


def calibrate(c: Command, machine: Machine, requests: Requests, now: float) -> Verdict:
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


def calibrate_magnetometer(c: Command, machine: Machine, requests: Requests, now: float) -> Verdict:
    """FIXED_MAG_CAL_YAW: as PREFLIGHT_CALIBRATION's."""
    only = (math.nan, 1.0, *(math.nan,) * 5)
    return calibrate(Command(c.number, *only, False, "", c.component), machine, requests, now)


def set_actuator(c: Command, machine: Machine, requests: Requests, now: float) -> Verdict:
    """DO_SET_ACTUATOR: accepted without one, as on PX4."""
    requests.say("No servo on this vehicle: the actuator's value has no effect")
    return OK


def inject_failure(c: Command, machine: Machine, requests: Requests, now: float) -> Verdict | None:
    """INJECT_FAILURE."""
    if machine.parameters.integer("SYS_FAILURE_EN") != 1:
        return deny("Failure not injected: set SYS_FAILURE_EN to 1 first")
    if machine.view is None:
        return not_now("Failure not injected: no plant yet; start it")
    requests.inject_failure((c.p1, c.p2, c.p3, c.p4, c.p5, c.p6, c.p7))
    return None
