"""Failures that ground control asks for are the plant's to carry out, and its answer is the answer."""

from __future__ import annotations

from typing import Any

import pytest
from pymavlink.dialects.v20 import common as mavlink

from controller.ground.commands.plant_commands import PATIENCE, REPEAT
from sitl_bridge.mavlink.framing import Packer, split
from tests.controller.ground.rig import NAN, Client, Rig

MOTOR_OFF = (101.0, 1.0, 2.0)
PLANT = Packer(1, 1)


def rig_with_failures(enabled: int = 1) -> tuple[Rig, Client]:
    rig = Rig()
    client = rig.client()
    rig.station.parameters.set("SYS_FAILURE_EN", enabled)
    rig.run(0.1)
    return rig, client


def inject(client: Client, *params: float, confirmation: int = 0) -> None:
    values = [*params, *[NAN] * (7 - len(params))]
    client.send(mavlink.MAVLink_command_long_message(1, 1, 420, confirmation, *values))


def plant_says(rig: Rig, result: int) -> None:
    message = mavlink.MAVLink_command_ack_message(420, result, 0, 0, 1, 1)
    rig.station.hear_plant(split(PLANT.pack(message)).frames[0], rig.now)


def to_plant(rig: Rig) -> list[Any]:
    return rig.station.plant_commands.to_plant(rig.now)


@pytest.mark.parametrize(
    ("result", "words"),
    [(0, ""), (3, "docs/plant.md, Faults"), (4, "MAV_RESULT 4")],
    ids=["done", "unknown", "failed"],
)
def test_the_plants_answer_is_the_answer(result: int, words: str) -> None:
    rig, client = rig_with_failures()
    inject(client, *MOTOR_OFF)
    (sent,) = to_plant(rig)
    assert (sent.command, sent.param1, sent.param2, sent.param3) == (420, *MOTOR_OFF)
    rig.run(0.1)
    assert client.got("COMMAND_ACK") == []
    plant_says(rig, result)
    plant_says(rig, result)  # to a repetition
    rig.run(0.1)
    assert [ack.result for ack in client.got("COMMAND_ACK")] == [result]
    assert words in "".join(client.texts())
    assert to_plant(rig) == []


def test_a_late_answer_to_one_failure_is_not_taken_for_the_next_ones() -> None:
    rig, client = rig_with_failures()
    inject(client, *MOTOR_OFF)
    to_plant(rig)
    rig.run(1.5 * REPEAT)
    assert len(to_plant(rig)) == 1  # sent twice, so answered twice
    inject(client, 0.0, 1.0, 99.0)
    plant_says(rig, 0)
    (sent,) = to_plant(rig)
    assert sent.param3 == 99.0
    plant_says(rig, 0)  # late, to the first
    rig.run(0.05)
    plant_says(rig, 3)
    rig.run(0.05)
    assert [ack.result for ack in client.got("COMMAND_ACK")] == [0, 3]


def test_it_is_sent_again_until_it_is_answered_and_the_client_may_ask_again() -> None:
    rig, client = rig_with_failures()
    inject(client, *MOTOR_OFF)
    assert len(to_plant(rig)) == 1
    rig.run(REPEAT + 0.02)
    assert len(to_plant(rig)) == 1
    inject(client, *MOTOR_OFF, confirmation=1)  # MAVSDK after half a second
    assert to_plant(rig) == []
    plant_says(rig, 0)
    inject(client, *MOTOR_OFF, confirmation=2)
    rig.run(0.1)
    assert [ack.result for ack in client.got("COMMAND_ACK")] == [0, 0]
    assert to_plant(rig) == []


def test_a_plant_that_does_not_answer() -> None:
    rig, client = rig_with_failures()
    inject(client, *MOTOR_OFF)
    inject(client, 0.0, 1.0, 0.0)
    for _ in range(round(3 * PATIENCE / REPEAT)):
        to_plant(rig)
        rig.run(REPEAT)
    assert [ack.result for ack in client.got("COMMAND_ACK")] == [mavlink.MAV_RESULT_FAILED] * 2
    assert "does not answer" in client.texts()[-1]


def test_unless_it_is_enabled_it_is_refused() -> None:
    rig, client = rig_with_failures(enabled=0)
    inject(client, *MOTOR_OFF)
    rig.run(0.1)
    assert client.got("COMMAND_ACK")[0].result == mavlink.MAV_RESULT_DENIED
    assert "SYS_FAILURE_EN" in client.texts()[-1]
    assert to_plant(rig) == []
