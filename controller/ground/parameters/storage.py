"""Parameters that are kept: MAV_CMD_PREFLIGHT_STORAGE."""

from __future__ import annotations

from collections.abc import Callable

from controller.ground.commands.result import OK, Verdict, deny, not_now
from controller.ground.parameters.file import ParameterFile
from controller.ground.parameters.protocol import Parameters

LOAD, SAVE, RESET = 0, 1, 2


class StoredParameters:
    """Between the values and their file, if there is one."""

    def __init__(
        self, parameters: Parameters, file: ParameterFile | None, warn: Callable[[str], None]
    ) -> None:
        self._parameters = parameters
        self._file = file
        self._warn = warn
        if file is not None:
            self._load(file)

    def _load(self, file: ParameterFile) -> bool:
        values, fault = file.load()
        faults = ([fault] if fault else []) + self._parameters.load(values)
        for text in faults:
            self._warn(f"Parameters: {text}")
        return not faults

    def act(self, action: float, flying: bool) -> Verdict:
        """Load, save or reset."""
        if action == RESET:
            if flying:
                return not_now("Parameters not reset: in flight; land first")
            self._parameters.reset()
            return OK
        if action not in (LOAD, SAVE):
            return deny(
                f"Parameter storage denied: param1 is {action:g}; use 0 (load), 1 (save) or 2 (reset)"
            )
        if self._file is None:
            return deny("Parameters have no file to be kept in; start the controller with --parameters FILE")
        if action == LOAD:
            return OK if self._load(self._file) else not_now("Parameters read with faults")
        fault = self._file.save(self._parameters.values())
        return not_now(f"Parameters not saved: {fault}") if fault else OK
