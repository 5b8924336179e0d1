"""Results of pure functions of a description: equal inputs are not computed twice in a process.

A command that flies keeps them on disk, too (`kept`).

In a study most flights have the same vehicle, or the same way to go. Inputs count to the last bit.
"""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable
from functools import wraps
from typing import Any, TypeVar

import numpy as np
from pydantic import BaseModel

from controller.design import kept

F = TypeVar("F", bound=Callable[..., Any])


def remembered(most: int) -> Callable[[F], F]:
    """Decorate a pure function of descriptions, arrays and plain values that returns an array.

    most: results that are kept, those used last. Callers get copies, which they may change.
    """

    def decorate(function: F) -> F:
        known: OrderedDict[Hashable, Any] = OrderedDict()
        lock = threading.Lock()
        name = f"{function.__module__}.{function.__qualname__}"

        @wraps(function)
        def call(*arguments: Any, **named: Any) -> Any:
            key = (_bits(arguments), _bits(tuple(sorted(named.items()))))
            with lock:
                if key in known:
                    known.move_to_end(key)
                    return known[key].copy()
            found = kept.find(name, key)
            if found is None:
                found = function(*arguments, **named)
                kept.keep(name, key, found)
            with lock:
                known[key] = found.copy()
                if len(known) > most:
                    known.popitem(last=False)
            return found

        return call  # type: ignore[return-value]  # the same signature

    return decorate


def _bits(value: Any) -> Hashable:
    """What is the same only for inputs that are the same to the last bit: 0.0 is not -0.0."""
    if isinstance(value, BaseModel):
        return value.model_dump_json()
    if isinstance(value, np.ndarray):
        return value.dtype.str, value.shape, value.tobytes()
    if isinstance(value, tuple):
        return tuple(map(_bits, value))
    return repr(value) if isinstance(value, float) else value
