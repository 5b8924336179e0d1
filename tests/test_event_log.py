"""The diary of a flight: what was written is read back, in order, whatever was cut short."""

from __future__ import annotations

import itertools
import tempfile
from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

from sitl_bridge.event_log import FILE_NAME, Event, EventLog, read_events
from sitl_bridge.process import Speaker

EVENTS = st.builds(
    Event,
    st.none() | st.floats(0.0, 1e6),
    st.sampled_from(["plant", "controller"]),
    st.sampled_from(["message", "mode", "fault", "statustext"]),
    st.text(max_size=60),
)


@given(st.lists(EVENTS, max_size=12))
def test_what_two_processes_write_is_read_back_in_order_of_time(events: list[Event]) -> None:
    with tempfile.TemporaryDirectory() as name:
        diaries = itertools.cycle((EventLog(Path(name)), EventLog(Path(name))))
        for event in events:
            next(diaries).add(event)
        found = read_events(Path(name))
    assert sorted(found, key=repr) == sorted(events, key=repr)
    times = [-1.0 if event.time_s is None else event.time_s for event in found]
    assert times == sorted(times)


def test_lines_that_are_none_of_ours_are_left_out(tmp_path: Path) -> None:
    diary = EventLog(tmp_path)
    diary.add(Event(1.0, "plant", "fault", "rotor 1 has 0 % of its thrust"))
    with (tmp_path / FILE_NAME).open("ab") as file:
        file.write(b'{"time_s": 2.0, "source": "pl\n[1]\n"text"\n\xff\xfe\n{"time_s": "x"}\n{"time_s": 2.0')
    assert [event.time_s for event in read_events(tmp_path)] == [1.0]


def test_a_folder_without_a_diary_has_no_events(tmp_path: Path) -> None:
    assert read_events(tmp_path) == []


def test_a_diary_that_cannot_be_written_does_not_end_the_flight(tmp_path: Path) -> None:
    diary = EventLog(tmp_path / "gone")
    (tmp_path / "gone").rmdir()
    diary.add(Event(None, "plant", "message", "nobody reads this"))


def test_a_speaker_keeps_what_it_says_and_what_it_notes(tmp_path: Path) -> None:
    speaker = Speaker("plant", events=False)
    speaker.say("before")
    speaker.keep(EventLog(tmp_path), lambda: 2.5)
    speaker.say("aloud")
    speaker.note("mode", "Hold")
    assert read_events(tmp_path) == [
        Event(2.5, "plant", "message", "aloud"),
        Event(2.5, "plant", "mode", "Hold"),
    ]
