"""MAVLink messages that the vehicle and the plant send and take."""

from __future__ import annotations

import re
from collections.abc import Iterable
from importlib import resources

from pymavlink.dialects.v20 import common as dialect

from controller.ground.inbox import HANDLERS, NOT_FLOWN
from controller.ground.link.packing import CurrentMode, FigureEightStatus
from controller.ground.missions.transfer import MESSAGES as MISSION_MESSAGES
from controller.ground.telemetry.message_rates import DEFAULT_RATES, ON_REQUEST, ONBOARD_RATES
from sitl.reference_pages.tables import page, table

LATER = {CurrentMode.id: "CURRENT_MODE", FigureEightStatus.id: "FIGURE_EIGHT_EXECUTION_STATUS"}
"""Messages of the standard that pymavlink's dialect does not have yet."""
PLANT_SENDS = {
    "HIL_SENSOR": "at every tick, last in its datagram",
    "HIL_GPS": "at the receiver's rate",
    "HIL_STATE_QUATERNION": "the truth, when SET_MESSAGE_INTERVAL asks for it; to viewers (`--truth-to`)",
    "ODOMETRY": "the truth of vehicle and load, when SET_MESSAGE_INTERVAL asks for it; to viewers",
    "HIL_ACTUATOR_CONTROLS": "the rotors, to viewers",
    "HEARTBEAT": "of the load, once a second; of the plant, four times a second, while it is paused",
    "GLOBAL_POSITION_INT": "of the load, five times a second; also `--load-to`",
    "BATTERY_STATUS": "twice a second, of a vehicle with a battery; to viewers, too",
    "NAMED_VALUE_FLOAT": "`tension` (N) and `scenario` (s since it began), to viewers",
    "DEBUG_FLOAT_ARRAY": "`chain`: the nodes of a chain (m, NED, from the top), to viewers",
    "WIND_COV": "at the vehicle, to viewers",
    "PARAM_VALUE": "of SIM_SPEEDUP and SIM_STEPS, to a viewer that asks",
    "LANDING_TARGET": "of the load, by a vehicle with a load tracker",
    "WINCH_STATUS": "twenty times a second, of a vehicle with a winch",
    "COMMAND_ACK": "to COMMAND_LONG",
}
PLANT_TAKES = {
    "HIL_ACTUATOR_CONTROLS": "the answer to a tick: rotor commands, and whether it is armed",
    "COMMAND_LONG": "SET_MESSAGE_INTERVAL for truth, INJECT_FAILURE; anything else is refused",
    "HEARTBEAT": "needs no reaction",
}
VIEWERS_SEND = {
    "PARAM_SET": "of SIM_SPEEDUP, SIM_STEPS: pause, slow motion, steps, in lockstep ([view](../view.md))",
    "PARAM_REQUEST_READ": "answered by PARAM_VALUE",
    "PARAM_REQUEST_LIST": "answered by PARAM_VALUE",
}
ABOUT = "https://mavlink.io/en/messages/common.html"


def markdown() -> str:
    """The page."""
    ground_sent = _constructed("controller", "ground")
    unasked = DEFAULT_RATES | ONBOARD_RATES
    replies = ground_sent - set(unasked) - set(ON_REQUEST) - {dialect.MAVLINK_MSG_ID_COMMAND_LONG}
    rates = [(number, f"{rate:g} Hz") for number, rate in DEFAULT_RATES.items()]
    rates += [(number, f"{rate:g} Hz, to companions") for number, rate in ONBOARD_RATES.items()]
    asked = [(number, "SET_MESSAGE_INTERVAL, REQUEST_MESSAGE") for number in ON_REQUEST]
    taken = [(number, "acted on") for number in {*HANDLERS, *MISSION_MESSAGES} - set(NOT_FLOWN)]
    declined = [(number, NOT_FLOWN[number]) for number in NOT_FLOWN]
    return page(
        "MAVLink messages",
        "the message tables and the code that packs messages",
        ["Both directions, by link. [Ground control](../ground-control.md) says what commands do."],
        ["## From the vehicle to ground stations, unasked", "", *_table("rate", rates)],
        ["## From the vehicle, on request", "", *_table("asked for by", asked)],
        ["## From the vehicle, as answers and events", "", *_table("", [(n, "") for n in replies])],
        ["## To the vehicle", "", *_table("", [*taken, *declined])],
        [
            "## From the plant to the autopilot (HIL link), and to viewers",
            "",
            *_table("when", _hil(PLANT_SENDS)),
        ],
        ["## From the autopilot to the plant (HIL link)", "", *_table("", _hil(PLANT_TAKES))],
        ["## From viewers to the plant (`--truth-to`)", "", *_table("", _hil(VIEWERS_SEND))],
    )


def plant_sends() -> set[int]:
    """Numbers of the messages that the plant's code makes."""
    ticks = _source("sitl_bridge", "plant/wire", "messages.py")
    code = _source("sitl_bridge", "plant/wire") + _source("sitl_bridge", "plant", "simulation.py")
    return _numbers([*re.findall(r"\b(HIL_[A-Z_]+|ODOMETRY)\.message_id", ticks), *_made(code)])


def _hil(messages: dict[str, str]) -> list[tuple[int, str]]:
    return [(number, text) for name, text in messages.items() if (number := _number(name)) is not None]


def _constructed(package: str, folder: str) -> set[int]:
    """Numbers of the messages that code in a folder makes."""
    return _numbers(_made(_source(package, folder)))


def _made(code: str) -> list[str]:
    return [name.upper() for name in re.findall(r"MAVLink_([a-z0-9_]+)_message\(", code)]


def _numbers(names: Iterable[str]) -> set[int]:
    return {number for number in map(_number, names) if number is not None}


def _number(name: str) -> int | None:
    number = getattr(dialect, f"MAVLINK_MSG_ID_{name}", None)
    return number if isinstance(number, int) else None


def _source(package: str, folder: str, *files: str) -> str:
    top = resources.files(package).joinpath(folder)
    pending, texts = [top], []
    while pending:
        for entry in sorted(pending.pop().iterdir(), key=lambda item: item.name):
            if entry.is_dir():
                pending.append(entry)
            elif entry.name.endswith(".py") and (not files or entry.name in files):
                texts.append(entry.read_text(encoding="utf-8"))
    return "\n".join(texts)


def _table(last: str, rows: Iterable[tuple[int, str]]) -> list[str]:
    named = sorted({(_name(number), number, text) for number, text in rows})
    shown = [(f"[{name}]({ABOUT}#{name})", str(number), text) for name, number, text in named]
    if not any(text for _, _, text in shown):
        return table(("message", "id"), [row[:2] for row in shown])
    return table(("message", "id", last or "what becomes of it"), shown)


def _name(number: int) -> str:
    return LATER.get(number) or str(dialect.mavlink_map[number].msgname)
