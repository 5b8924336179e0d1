"""The second half of a tick: the sensors measure, and the tick's datagram is written. No I/O."""

from __future__ import annotations

import math
from collections.abc import Callable

from sitl_bridge.mavlink.hil import SENSOR_RESET
from sitl_bridge.plant.physics.battery import BatteryReading
from sitl_bridge.plant.physics.world import World
from sitl_bridge.plant.sensors.gps import GpsFix
from sitl_bridge.plant.sensors.tracker import Sighting
from sitl_bridge.plant.stages import EVER, Stage, never_due, run
from sitl_bridge.plant.wire.messages import TickWriter
from sitl_bridge.plant.wire.slow_frames import SlowFrames


class Diverged(ArithmeticError):
    """The state is not finite any more: what was described cannot be simulated."""


class Sensing:
    """What the plant says of each tick, whether the vehicle is held or flies."""

    def __init__(
        self, world: World, writer: TickWriter, slow: SlowFrames, on_fresh: Callable[[], None]
    ) -> None:
        """on_fresh: called when the sensors have begun afresh."""
        self.first_tick = 0
        """Number of the tick at which the sensors began, or will begin, afresh."""
        self.due = False
        """Whether they are to begin afresh."""
        self._world, self._writer, self._slow, self._on_fresh = world, writer, slow, on_fresh
        self._fresh = False  # from the current tick on
        self._tick = 0  # of the sensors
        self._time_usec = 0
        self._held = True
        self._power: BatteryReading | None = None
        self._wanted = 0
        self._fix: GpsFix | None = None
        self._sighting: Sighting | None = None
        self._slow_frames = b""
        self._datagram = b""
        self.stages = (
            Stage("finite state", self._check_state, never_due),
            Stage("sensors begin afresh", self._freshen, lambda: 0 if self.due else EVER),
            Stage("instruments", self._read_instruments, lambda: world.instruments.ticks_left(self._tick)),
            Stage("GPS", self._read_gps, lambda: world.gps.ticks_left(self._tick)),
            Stage("tracker", self._read_tracker, self._tracker_ticks_left),
            Stage("slow frames", self._say_slowly, lambda: slow.ticks_left(self._tick)),
            Stage("datagram", self._write_datagram, never_due),
        )
        """In their order."""

    def datagram(
        self, tick: int, time_usec: int, held: bool, power: BatteryReading | None, wanted: int
    ) -> bytes:
        """The frames of a tick; to be called once for each that is flown stage by stage.

        held: a held vehicle measures as if it stood; power: of the battery now; wanted: as for
        `TickWriter.datagram`. Raises Diverged.
        """
        self._tick, self._time_usec, self._held = tick - self.first_tick, time_usec, held
        self._power, self._wanted = power, wanted
        run(self.stages)
        return self._datagram

    def begin_afresh(self) -> None:
        """Reset every sensor, with fresh random streams."""
        self._world.reset_sensors()
        self.due = False
        self._on_fresh()

    def _check_state(self) -> None:
        if not math.isfinite(sum(self._world.state.tolist())):
            raise Diverged("the state is not finite any more")

    def _freshen(self) -> None:
        self._fresh = self.due and self._tick >= 0
        if self._fresh:
            self.begin_afresh()

    def _read_instruments(self) -> None:
        self._world.measure(self._tick, self._held)
        if self._fresh:
            self._world.measurement["updated"] |= SENSOR_RESET

    def _read_gps(self) -> None:
        self._fix = self._world.gps.sample(self._tick, self._world.state)

    def _read_tracker(self) -> None:
        tracker = self._world.tracker
        self._sighting = None if tracker is None else tracker.sample(self._tick, self._world.state)

    def _tracker_ticks_left(self) -> int:
        tracker = self._world.tracker
        return EVER if tracker is None else tracker.ticks_left(self._tick)

    def _say_slowly(self) -> None:
        self._slow_frames = self._slow.frames(
            self._tick, self._time_usec, self._world.state, self._power, self._sighting, self._world.reel
        )

    def _write_datagram(self) -> None:
        self._datagram = self._slow_frames + self._writer.datagram(self._time_usec, self._fix, self._wanted)
