"""A finished flight's folder as data: what logs, reports and viewers of it are made from.

In: the folder that `sitl fly` leaves. Out: a `Recording`, or a `RecordingError` that names the missing file.
Knows nothing of how a flight is drawn.
"""
