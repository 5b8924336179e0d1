"""The formats of `sitl export`, by the name that a person types."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from sitl.export.mcap import write_mcap
from sitl.export.tables import write_csv, write_mat
from sitl.export.ulog import write_ulog
from sitl.recording.recording import Recording, read_recording

WRITERS: dict[str, tuple[str, Callable[[Recording, Path], None]]] = {
    "csv": ("flight.csv", write_csv),
    "mat": ("flight.mat", write_mat),
    "mcap": ("flight.mcap", write_mcap),
    "ulog": ("flight.ulg", write_ulog),
}
"""File name and writer of each format."""


def export(folder: Path, name: str, out: Path | None = None) -> Path:
    """Write a flight in another format, by default into its own folder; returns the file.

    Raises RecordingError for a folder that is not a finished flight's, OSError where nothing can be written.
    """
    file_name, write = WRITERS[name]
    recording = read_recording(folder)
    file = out or folder / file_name
    write(recording, file)
    return file
