"""MCAP for Foxglove and PlotJuggler: Foxglove's schemas for what is drawn, JSON for what is plotted.

Frames: `world` (ENU), `vehicle` (FLU) and `load`. Rates: see RATES_HZ; the state log keeps every tick.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from sitl.recording.recording import Array, Columns, Recording
from sitl.recording.sensors import SensorLog, read_sensors
from sitl_bridge.event_log import Event
from sitl_bridge.frames import LocalOrigin
from sitl_bridge.log_amount import Logs

FILE_NAME = "flight.mcap"
RATES_HZ: dict[Logs, float] = {"usual": 20.0, "all": 50.0}
"""Most samples a second of a channel, by how much a flight leaves."""
SLOW_HZ = 5.0
"""Of a map's positions and of the scene."""
ZSTD_LEVEL = 9
"""Of chunks: a tenth smaller than at the usual level in the same time; higher ones take seconds."""
NANOSECONDS = 1_000_000_000


def write_mcap(recording: Recording, file: Path, rate_hz: float = RATES_HZ["all"]) -> None:
    """Write the flight beside its other logs; an older file is replaced. rate_hz: most, of a channel."""
    with _writer(recording, file, rate_hz) as writer:
        for row in _rows(recording.times, rate_hz):
            writer.tick(row)
        for row in _rows(recording.times, SLOW_HZ):
            writer.slow(row)
        if recording.estimates is not None:
            writer.columns("/estimate", recording.estimates)
        if recording.terms is not None:
            writer.columns("/terms", recording.terms)
        if recording.tlog is not None:
            writer.sensors(read_sensors(recording.tlog))
        writer.events(recording.events)
        writer.outcome()


def _rows(times: Array, rate_hz: float) -> list[int]:
    """Indices of rows, at most so many a second on average, the first and the last among them."""
    if len(times) < 2:
        return list(range(len(times)))
    spacing = float(times[-1] - times[0]) / (len(times) - 1)  # not the first: a log may begin with a burst
    step = max(1.0, round(1.0 / (rate_hz * spacing), 9)) if spacing > 0.0 else 1.0
    return [*np.arange(0.0, len(times) - 1, step).round().astype(int).tolist(), len(times) - 1]


@contextmanager
def _writer(recording: Recording, file: Path, rate_hz: float) -> Iterator[_FlightWriter]:
    import foxglove
    from foxglove.mcap import MCAPWriteOptions

    context = foxglove.Context()
    options = MCAPWriteOptions(compression_level=ZSTD_LEVEL)
    sink = foxglove.open_mcap(file, allow_overwrite=True, context=context, writer_options=options)
    try:
        yield _FlightWriter(recording, context, rate_hz)
    finally:
        sink.close()


_NUMBER = {"type": ["number", "null"]}
BODIES = ("vehicle", "load")
REFERENCE = ("x_m", "y_m", "z_m", "error_m")


class _FlightWriter:
    """The channels of one file."""

    def __init__(self, recording: Recording, context: Any, rate_hz: float) -> None:
        from foxglove import channels, messages

        from sitl.export import scene

        self._m, self._scene, self._context = messages, scene, context
        self._recording, self._rate_hz = recording, rate_hz
        self._epoch = round((recording.summary.get("first_command_unix_s") or 0.0) * NANOSECONDS)
        self._transforms = channels.FrameTransformsChannel("/tf", context=context)
        self._bodies = channels.SceneUpdateChannel("/scene", context=context)
        self._cable = channels.SceneUpdateChannel("/scene/cable", context=context)
        self._log = channels.LogChannel("/log", context=context)
        self._poses = {b: channels.PoseInFrameChannel(f"/{b}/pose", context=context) for b in BODIES}
        self._fixes = {b: channels.LocationFixChannel(f"/{b}/location", context=context) for b in BODIES}
        self._state_names = [name for name in recording.states if name != "time_s"]
        self._rotor_names = [f"rotor_{i + 1}" for i in range(len(recording.vehicle.rotors))]
        self._states = self._channel("/state", self._state_names)
        self._reference = self._channel("/reference", REFERENCE)
        self._controls = self._channel("/controls", self._rotor_names)
        home = recording.vehicle.home
        self._origin = LocalOrigin(home.latitude, home.longitude, home.altitude)
        self._positions = {body: _single(recording.vectors(f"{body}_{{}}_m")) for body in BODIES}
        self._nodes = _single(recording.nodes())
        self._attitude = _single(recording.vectors("attitude_q{}", "wxyz"))
        self._control_rows = recording.controls()
        errors = np.linalg.norm(self._positions["load"] - recording.reference, axis=1)
        self._reference_rows = np.column_stack((recording.reference, errors))
        weight = recording.vehicle.load.mass * recording.vehicle.gravity
        self._load_shares = recording.states["cable_tension_N"] / weight

    def _channel(self, topic: str, names: Sequence[str]) -> Any:
        """A channel of numbers with these names."""
        import foxglove

        schema = {"type": "object", "title": topic[1:], "properties": dict.fromkeys(names, _NUMBER)}
        return foxglove.Channel(topic, schema=schema, context=self._context)

    def tick(self, row: int) -> None:
        """What moves: frames, poses, cable, and the rows of numbers."""
        log_time, stamp = self._time(float(self._recording.times[row]))
        self._log_poses(row, log_time, stamp)
        top, bottom = (self._positions[body][row].tolist() for body in BODIES)
        points = [top, *self._nodes[row].tolist(), bottom]
        entity = self._scene.cable_entity(stamp, points, float(self._load_shares[row]))
        self._cable.log(self._m.SceneUpdate(entities=[entity]), log_time=log_time)
        states = self._recording.states
        self._states.log({name: _finite(states[name][row]) for name in self._state_names}, log_time=log_time)
        self._reference.log(_numbers(REFERENCE, self._reference_rows[row]), log_time=log_time)
        self._controls.log(_numbers(self._rotor_names, self._control_rows[row]), log_time=log_time)

    def _log_poses(self, row: int, log_time: int, stamp: Any) -> None:
        m = self._m
        w, x, y, z = self._attitude[row].tolist()
        turns = {"vehicle": m.Quaternion(x=x, y=y, z=z, w=w), "load": m.Quaternion(x=0, y=0, z=0, w=1)}
        transforms = []
        for body, channel in self._poses.items():
            at = m.Vector3(**dict(zip("xyz", self._positions[body][row].tolist(), strict=True)))
            pose = m.Pose(position=at, orientation=turns[body])
            channel.log(m.PoseInFrame(timestamp=stamp, frame_id="world", pose=pose), log_time=log_time)
            transforms.append(
                m.FrameTransform(
                    timestamp=stamp,
                    parent_frame_id="world",
                    child_frame_id=body,
                    translation=at,
                    rotation=turns[body],
                )
            )
        self._transforms.log(m.FrameTransforms(transforms=transforms), log_time=log_time)

    def slow(self, row: int) -> None:
        """Where vehicle and load are on a map, and the bodies as they are drawn."""
        m = self._m
        log_time, stamp = self._time(float(self._recording.times[row]))
        for body, channel in self._fixes.items():
            x, y, z = self._positions[body][row].tolist()
            latitude, longitude, altitude = self._origin.geodetic((x, y, z))
            fix = m.LocationFix(
                timestamp=stamp, frame_id=body, latitude=latitude, longitude=longitude, altitude=altitude
            )
            channel.log(fix, log_time=log_time)
        vehicle = self._recording.vehicle
        bodies = [self._scene.vehicle_entity(stamp, vehicle), self._scene.load_entity(stamp, vehicle)]
        self._bodies.log(m.SceneUpdate(entities=bodies), log_time=log_time)

    def columns(self, topic: str, columns: Columns) -> None:
        """A log of the autopilot's: its estimate, the terms of its law."""
        names = [name for name in columns if name != "time_s"]
        channel = self._channel(topic, names)
        for row in _rows(columns["time_s"], self._rate_hz):
            numbers = {name: _finite(columns[name][row]) for name in names}
            channel.log(numbers, log_time=self._time(float(columns["time_s"][row]))[0])

    def sensors(self, log: SensorLog) -> None:
        """HIL_SENSOR and HIL_GPS in wire units and frames."""
        for topic, records, times in (
            ("/sensors", log.sensors, log.sensor_times),
            ("/gps", log.fixes, log.fix_times),
        ):
            names = [name for name in records.dtype.names or () if name != "time_usec"]
            channel = self._channel(topic, names)
            for row in _rows(times, self._rate_hz):
                numbers = {name: _finite(records[name][row]) for name in names}
                channel.log(numbers, log_time=self._time(float(times[row]))[0])

    def events(self, events: Sequence[Event]) -> None:
        """What was said and what happened; faults and the plant's own words by their source."""
        for event in events:
            log_time, stamp = self._time(event.time_s or 0.0)
            level = self._m.LogLevel.Warning if event.kind == "fault" else self._m.LogLevel.Info
            text = f"mode: {event.text}" if event.kind == "mode" else event.text
            message = self._m.Log(timestamp=stamp, level=level, message=text, name=event.source)
            self._log.log(message, log_time=log_time)

    def outcome(self) -> None:
        """How it ended, in words."""
        summary, m = self._recording.summary, self._m
        log_time, stamp = self._time(float(self._recording.times[-1]))
        settled = bool(summary.get("settled"))
        ended = "settled" if settled else "did not settle"
        text = summary.get("outcome") or summary.get("failure") or ended
        level = m.LogLevel.Info if settled else m.LogLevel.Warning
        message = m.Log(timestamp=stamp, level=level, message=str(text), name="sitl fly")
        self._log.log(message, log_time=log_time)

    def _time(self, time_s: float) -> tuple[int, Any]:
        """A scenario time as ns since the Unix epoch, and as a time stamp."""
        log_time = self._epoch + round(time_s * NANOSECONDS)
        return log_time, self._m.Timestamp(sec=log_time // NANOSECONDS, nsec=log_time % NANOSECONDS)


def _single(values: Array) -> Array:
    """Rounded to single precision, in which doubles pack to half their size."""
    return values.astype(np.float32).astype(np.float64)


def _numbers(names: Sequence[str], row: Array) -> dict[str, float | None]:
    return dict(zip(names, map(_finite, row), strict=True))


def _finite(value: Any) -> float | None:
    """A number as JSON has it: with seven digits, but whole numbers with all of theirs."""
    number = float(value)
    if number.is_integer():
        return number
    return float(f"{number:.7g}") if math.isfinite(number) else None
