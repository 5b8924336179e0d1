"""Pause, single steps and slow motion in the panel: what the person asks for, as parameters of the plant."""

from __future__ import annotations

from queue import Empty, SimpleQueue
from typing import Any, NamedTuple

from sitl.view.view import View
from sitl_bridge.plant.wire.speed import AS_FAST_AS_IT_GOES, SPEED, STEPS

SPEEDS = {
    "0.05 x": 0.05,
    "0.1 x": 0.1,
    "0.25 x": 0.25,
    "0.5 x": 0.5,
    "real time": 1.0,
    "2 x": 2.0,
    "5 x": 5.0,
}
SPEEDS["as fast as it goes"] = AS_FAST_AS_IT_GOES
STEP_SIZES = ("1", "5", "25", "125")
NO_PAUSE = "This flight runs in real time. To pause or slow down, fly with `--clock lockstep --speed 1`."


class Setting(NamedTuple):
    """A parameter of the plant, to be set."""

    name: str
    value: float


class Steering:
    """Controls of the plant's time. viser calls back in threads of its own; `asked` is read by the loop."""

    def __init__(self, gui: Any) -> None:
        self._asked: SimpleQueue[Setting] = SimpleQueue()
        self._paused = False
        self._folder = gui.add_folder("Time", visible=False)
        with self._folder:
            self._pause = gui.add_button("Pause", icon="player-pause")
            self._step = gui.add_button("Step", icon="player-track-next", disabled=True)
            self._size = gui.add_dropdown("Ticks a step", STEP_SIZES, initial_value="1")
            self._speed = gui.add_dropdown("Speed", list(SPEEDS), initial_value="real time")
        self._no_pause = gui.add_markdown(NO_PAUSE, visible=False)
        self._told: tuple[float | None, bool] = (None, False)
        self._pause.on_click(lambda event: self._on_pause())
        self._step.on_click(lambda event: self._ask(STEPS, float(self._size.value)))
        self._speed.on_update(lambda event: self._on_speed(event))

    def asked(self) -> list[Setting]:
        """What the person has asked for since the last time."""
        settings = []
        try:
            while True:
                settings.append(self._asked.get_nowait())
        except Empty:
            return settings

    def show(self, view: View) -> None:
        """Controls as the plant says that its time goes."""
        speed = view.speed
        if speed is None or (speed, view.steerable) == self._told:
            return
        self._told, self._paused = (speed, view.steerable), speed == 0.0
        self._folder.visible, self._no_pause.visible = view.steerable, not view.steerable
        self._pause.label = "Go on" if self._paused else "Pause"
        self._pause.icon = "player-play" if self._paused else "player-pause"
        self._step.disabled = not self._paused
        names = [name for name, value in SPEEDS.items() if abs(value - speed) < 1e-6]
        if names:
            self._speed.value = names[0]

    def _on_pause(self) -> None:
        self._ask(SPEED, SPEEDS[self._speed.value] if self._paused else 0.0)

    def _on_speed(self, event: Any) -> None:
        """A person's choice; one of our own says nothing. While paused it is the speed to go on with."""
        if event.client is not None and not self._paused:
            self._ask(SPEED, SPEEDS[self._speed.value])

    def _ask(self, name: str, value: float) -> None:
        self._asked.put(Setting(name, value))
