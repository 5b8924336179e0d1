"""The numpy layouts of the HIL messages against pymavlink's pack and unpack."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from pymavlink.dialects.v20 import common

from sitl_bridge.mavlink import framing, hil
from sitl_bridge.mavlink.hil import Layout

LAYOUTS = {name: value for name, value in vars(hil).items() if isinstance(value, Layout)}
every_layout = pytest.mark.parametrize("layout", LAYOUTS.values(), ids=LAYOUTS.keys())

# The whole range of every integer, every finite float32.
ELEMENTS = {"f": {"allow_nan": False, "allow_infinity": False}}


def field_values(layout: Layout, data: st.DataObject) -> dict[str, Any]:
    values = {}
    for name in layout.dtype.names or ():
        field = layout.dtype[name]
        elements = hnp.from_dtype(field.base, **ELEMENTS.get(field.base.kind, {}))
        array = data.draw(hnp.arrays(field.base, field.shape, elements=elements), label=name)
        values[name] = array.tolist()
    return values


def filled(layout: Layout, values: dict[str, Any]) -> np.ndarray[Any, Any]:
    record, payload = layout.record()
    for name, value in values.items():
        record[0][name] = value
    return payload


def message_class(layout: Layout) -> Any:
    return common.mavlink_map[layout.message_id]


@every_layout
def test_the_fields_are_those_of_the_dialect(layout: Layout) -> None:
    kind = message_class(layout)
    assert layout.dtype.itemsize == kind.unpacker.size
    assert list(layout.dtype.names or ()) == list(kind.ordered_fieldnames)


def test_the_names_are_the_messages_names() -> None:
    assert {"HIL_SENSOR", "HIL_GPS", "HIL_ACTUATOR_CONTROLS", "ODOMETRY"} <= set(LAYOUTS)
    for name, layout in LAYOUTS.items():
        assert message_class(layout).msgname == name


@every_layout
@settings(max_examples=40)
@given(data=st.data())
def test_a_record_is_pymavlinks_payload(layout: Layout, data: st.DataObject) -> None:
    values = field_values(layout, data)
    link = common.MAVLink(None, srcSystem=1, srcComponent=1)
    expected = bytes(message_class(layout)(**values).pack(link))
    out = np.zeros(framing.LARGEST_FRAME, dtype=np.uint8)
    end = framing.write_frame(out, 0, filled(layout, values), layout.message_id, 0, 1, 1)
    assert bytes(out[:end]) == expected


@every_layout
@settings(max_examples=40)
@given(data=st.data())
def test_pymavlink_reads_a_record_and_the_record_reads_pymavlink(layout: Layout, data: st.DataObject) -> None:
    values = field_values(layout, data)
    out = np.zeros(framing.LARGEST_FRAME, dtype=np.uint8)
    end = framing.write_frame(out, 0, filled(layout, values), layout.message_id, 0, 1, 1)
    received = framing.decode(framing.split(bytes(out[:end])).frames[0])
    for name, value in values.items():
        assert getattr(received, name) == value, name

    wire = bytes(message_class(layout)(**values).pack(common.MAVLink(None)))
    record, payload = layout.record()
    payload[:] = 0xAA  # what stood there before must not show through where zeros were cut off
    table = np.zeros((2, framing.TABLE_COLUMNS), dtype=np.int32)
    framing.scan(np.frombuffer(wire, dtype=np.uint8), table, len(wire))
    framing.read_payload(np.frombuffer(wire, dtype=np.uint8), table[0], payload)
    for name, value in values.items():
        assert record[0][name].tolist() == value, name


def test_constants_are_the_dialects() -> None:
    assert hil.MODE_FLAG_ARMED == common.MAV_MODE_FLAG_SAFETY_ARMED
    assert hil.FLAG_LOCKSTEP == common.HIL_ACTUATOR_CONTROLS_FLAGS_LOCKSTEP
    assert hil.FRAME_LOCAL_NED == common.MAV_FRAME_LOCAL_NED
    assert hil.FRAME_BODY_FRD == common.MAV_FRAME_BODY_FRD
    groups = [f for name, f in vars(common).items() if name.startswith("HIL_SENSOR_UPDATED_")]
    sensors = [flag for flag in groups if isinstance(flag, int) and 0 < flag < 1 << 13]
    assert sum(sensors) == hil.SENSOR_ALL_FIELDS
