"""The ULog file format, as PX4's documentation describes it: definitions first, then data.

https://docs.px4.io/main/en/dev_log/ulog_file_format.html. The tests read it with pyulog.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

_MAGIC = b"ULog\x01\x12\x35\x01"
_TYPES = {"u8": "uint64_t", "u4": "uint32_t", "i4": "int32_t", "f4": "float", "f8": "double", "u1": "uint8_t"}
INFO = 6
"""Level of a logged message, as syslog has it."""


class ULogWriter:
    """Writes one file. Every topic has to be declared before the first sample."""

    def __init__(self, file: BinaryIO, start_usec: int = 0) -> None:
        self._file = file
        file.write(_MAGIC + struct.pack("<Q", start_usec))
        self._message("B", bytes(40))  # flag bits: nothing that a reader has to know

    def info(self, key: str, value: str) -> None:
        """An information message of type char[]."""
        data = value.encode()
        name = f"char[{len(data)}] {key}".encode()
        self._message("I", bytes([len(name)]) + name + data)

    def parameter(self, key: str, value: float) -> None:
        """A parameter, float32."""
        name = f"float {key}".encode()
        self._message("P", bytes([len(name)]) + name + struct.pack("<f", value))

    def declare(self, topic: str, dtype: np.dtype[np.void]) -> None:
        """The fields of a topic. dtype: packed, `timestamp` (us, u8) first."""
        fields = []
        for name in dtype.names or ():
            field = dtype[name]
            base, shape = (field.subdtype or (field, ()))[:2]
            of_type = _TYPES[base.str[1:]]
            fields.append(f"{of_type}{f'[{shape[0]}]' if shape else ''} {name};")
        self._message("F", f"{topic}:{''.join(fields)}".encode())

    def subscribe(self, topic: str, number: int, instance: int = 0) -> None:
        """The topic's samples come under this number."""
        self._message("A", struct.pack("<BH", instance, number) + topic.encode())

    def samples(self, numbered: Iterable[tuple[int, NDArray[np.void]]]) -> None:
        """Samples of all topics, each with its number, merged in order of their time stamps."""
        messages: list[tuple[int, bytes]] = []
        for number, records in numbered:
            size = records.dtype.itemsize
            header = struct.pack("<HcH", size + 2, b"D", number)
            data, times = records.tobytes(), records["timestamp"].tolist()
            messages += [(t, header + data[i * size : (i + 1) * size]) for i, t in enumerate(times)]
        messages.sort(key=lambda message: message[0])
        self._file.write(b"".join(message for _, message in messages))

    def text(self, time_usec: int, message: str, level: int = INFO) -> None:
        """A logged message."""
        self._message("L", struct.pack("<BQ", ord("0") + level, time_usec) + message.encode())

    def _message(self, kind: str, payload: bytes) -> None:
        self._file.write(struct.pack("<Hc", len(payload), kind.encode()) + payload)
