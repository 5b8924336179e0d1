"""What `flight.html` shows: a flight's panels as a plotly figure."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from controller.law.terms import TERMS
from sitl.recording.recording import Array, Columns, Recording
from sitl.report.page import page
from sitl_bridge.event_log import Event

FILE_NAME = "flight.html"
MOST_MARKS = 100
MOST_POINTS = 1500
"""Of a line; between them the smallest and largest value of each stretch are kept."""
LOAD = 3
"""Row of the load's position in the covariance of the estimate."""
_COLOURS = {"x": "#d62728", "y": "#2ca02c", "z": "#1f77b4"}
LOAD_PANEL = "load and set-point [m]"
DISTANCE = "load from set-point [m]"
ANGLES = "swing and tilt [°]"
TENSION = "cable tension [N]"
ROTORS = "rotors, share of<br>the largest speed"
_TERM_PANELS = {
    "thrust by term [N]": {"": "thrust_N"},
    "moments by term [N m]": {" about x": "moment_x_N_m", " about y": "moment_y_N_m"},
}
"""Of flights whose law tells its terms: what is drawn of them."""
MOST_TERM_POINTS = 500
"""Of a line"""
_TERM_COLOURS = dict(zip(TERMS, ("#7f7f7f", "#1f77b4", "#2ca02c", "#9467bd", "#d62728"), strict=True))


def write_html(recording: Recording, file: Path) -> None:
    """Write the report of a flight."""
    figure = _figure(recording)
    file.write_text(page(recording.summary, figure, recording.events), encoding="utf-8")


def envelope(times: Array, values: Array, most: int = MOST_POINTS) -> tuple[Array, Array]:
    """A line (n,) with fewer points that looks the same: the extremes of each stretch, in their order."""
    count = len(times)
    if count <= most:
        return times, values
    edges = np.linspace(0, count, most // 2 + 1).astype(int)
    kept = {0, count - 1}
    for start, stop in itertools.pairwise(edges.tolist()):
        kept |= {start + int(np.argmin(values[start:stop])), start + int(np.argmax(values[start:stop]))}
    rows = sorted(kept)
    return times[rows], values[rows]


def swing_deg(recording: Recording) -> Array:
    """(n,): angle of the line from vehicle to load against the vertical, degrees."""
    down = recording.vectors("vehicle_{}_m") - recording.vectors("load_{}_m")
    return np.degrees(np.arctan2(np.hypot(down[:, 0], down[:, 1]), down[:, 2]))


def tilt_deg(recording: Recording) -> Array:
    """(n,): angle of the vehicle's z axis against the vertical, degrees."""
    x, y = recording.states["attitude_qx"], recording.states["attitude_qy"]
    return np.degrees(np.arccos(np.clip(1.0 - 2.0 * (x * x + y * y), -1.0, 1.0)))


def two_sigma(covariance: Columns, axis: int, most: int = MOST_POINTS) -> tuple[Array, Array]:
    """Times (n,) and two standard deviations (n,) of the load's position along an axis of the world, m."""
    row = LOAD + axis
    every = max(1, len(covariance["time_s"]) // most)
    variance = covariance[f"covariance_{row}_{row}"][::every]
    return covariance["time_s"][::every], 2.0 * np.sqrt(np.maximum(variance, 0.0))


def slack_spans(times: Array, tension: Array) -> list[tuple[float, float]]:
    """Stretches of time in which the cable carries nothing."""
    slack = np.concatenate(([0], (tension <= 0.0).astype(int), [0]))
    starts, stops = np.flatnonzero(np.diff(slack) == 1), np.flatnonzero(np.diff(slack) == -1)
    return [(float(times[a]), float(times[b - 1])) for a, b in zip(starts, stops, strict=True)]


def _figure(recording: Recording) -> dict[str, Any]:
    """The figure as plotly's script takes it: traces and layout."""
    times, states = recording.times, recording.states
    load = recording.vectors("load_{}_m")
    traces: list[dict[str, Any]] = []
    panels = _panels(recording)

    def line(title: str, name: str, values: Array, **style: Any) -> None:
        x, y = envelope(times, values)
        panel = panels.index(title) + 1
        axis = "" if panel == 1 else str(panel)
        trace = _points(x, y) | {"name": name, "type": "scatter", "mode": "lines"}
        traces.append({**trace, "xaxis": "x", "yaxis": f"y{axis}", "legend": f"legend{axis}", **style})

    for index, letter in enumerate("xyz"):
        colour = _COLOURS[letter]
        line(LOAD_PANEL, f"{letter} of the load", load[:, index], line={"color": colour})
        dashed = {"color": colour, "dash": "dash", "width": 1}
        if DISTANCE in panels:
            line(LOAD_PANEL, f"{letter} of the set-point", recording.reference[:, index], line=dashed)
        _add_band(traces, recording, letter, colour)
    if DISTANCE in panels:
        line(DISTANCE, "distance", np.linalg.norm(load - recording.reference, axis=1))
    line(ANGLES, "swing of the load", swing_deg(recording))
    line(ANGLES, "tilt of the vehicle", tilt_deg(recording))
    line(TENSION, "tension", states["cable_tension_N"])
    controls = recording.controls()
    for rotor in range(controls.shape[1]):
        line(ROTORS, f"rotor {rotor + 1}", controls[:, rotor], line={"width": 1})
    _add_terms(traces, recording, panels)
    return {"data": traces, "layout": _layout(recording, panels)}


def _points(x: Array, y: Array, digits: int = 6) -> dict[str, list[float]]:
    """A line's points, with as many digits as can be seen."""
    return {key: [float(f"{v:.{digits}g}") for v in values.tolist()] for key, values in (("x", x), ("y", y))}


def _panels(recording: Recording) -> list[str]:
    """Titles from the top; without a reference there is no distance from it."""
    distance = [DISTANCE] if np.isfinite(recording.reference).all() else []
    terms = _TERM_PANELS if recording.terms is not None else ()
    return [LOAD_PANEL, *distance, ANGLES, TENSION, ROTORS, *terms]


def _add_terms(traces: list[dict[str, Any]], recording: Recording, panels: Sequence[str]) -> None:
    """What the law's commands were made of; terms that were 0 all the time are left out."""
    log = recording.terms
    if log is None:
        return
    for title, parts in _TERM_PANELS.items():
        panel = panels.index(title) + 1
        for (about, part), term in itertools.product(parts.items(), TERMS):
            if not log[f"{term}_{part}"].any():
                continue
            x, y = envelope(log["time_s"], log[f"{term}_{part}"], MOST_TERM_POINTS)
            style = {
                "color": _TERM_COLOURS[term],
                "width": 1,
                "dash": "dot" if about == " about y" else "solid",
            }
            trace = {"type": "scatter", "mode": "lines", "legend": f"legend{panel}", "line": style}
            traces.append(
                {**trace, **_points(x, y, 4), "name": term + about, "xaxis": "x", "yaxis": f"y{panel}"}
            )


def _add_band(traces: list[dict[str, Any]], recording: Recording, letter: str, colour: str) -> None:
    """The estimate of one coordinate of the load, with its band of two standard deviations."""
    estimates = recording.estimates
    if estimates is None:
        return
    common = {"type": "scatter", "mode": "lines", "yaxis": "y", "legend": "legend"}
    x, y = envelope(estimates["time_s"], estimates[f"load_{letter}_m"])
    dotted = {"color": colour, "width": 1, "dash": "dot"}
    traces.append({**common, **_points(x, y), "name": f"{letter}, estimated", "line": dotted})
    if recording.covariance is None:
        return
    times, deviations = two_sigma(recording.covariance, "xyz".index(letter))
    middle = np.interp(times, estimates["time_s"], estimates[f"load_{letter}_m"])
    edge = {**common, "line": {"width": 0}, "hoverinfo": "skip", "showlegend": False}
    lower, upper = _points(times, middle - deviations), _points(times, middle + deviations)
    traces.append({**edge, **lower, "name": f"{letter}, lower edge"})
    band = {"fill": "tonexty", "fillcolor": colour + "22", "showlegend": True, "name": f"{letter}, ±2 σ"}
    traces.append({**edge, **upper, **band})


def _layout(recording: Recording, panels: Sequence[str]) -> dict[str, Any]:
    """Panels below each other on one time axis, each with its legend; slack stretches shaded."""
    gap = 0.03
    height = (1.0 - gap * (len(panels) - 1)) / len(panels)
    layout: dict[str, Any] = {
        "height": 230 * len(panels),
        "margin": {"l": 70, "r": 20, "t": 60, "b": 50},
        "hovermode": "x unified",
        "xaxis": {"title": {"text": "time [s]"}, "anchor": f"y{len(panels)}"},
        "shapes": [
            *_shading(slack_spans(recording.times, recording.states["cable_tension_N"])),
            _limit(panels.index(ROTORS) + 1),
            *(_mark(event) for event in marked_events(recording.events)),
        ],
    }
    for index, title in enumerate(panels):
        top = 1.0 - index * (height + gap)
        axis = {"domain": [top - height, top], "title": {"text": title}}
        number = "" if index == 0 else str(index + 1)
        layout[f"yaxis{number}"] = axis
        layout[f"legend{number}"] = {"y": top, "yanchor": "top", "font": {"size": 11}}
    return layout


def _shading(spans: Iterable[tuple[float, float]]) -> list[dict[str, Any]]:
    return [
        {
            "type": "rect",
            "xref": "x",
            "yref": "paper",
            "x0": start,
            "x1": stop,
            "y0": 0,
            "y1": 1,
            "fillcolor": "rgba(120,120,120,0.2)",
            "line": {"width": 0},
        }
        for start, stop in list(spans)[:200]
    ]


def marked_events(events: Sequence[Event], most: int = MOST_MARKS) -> list[Event]:
    """Modes and faults, which get a line in the panels; those before the scenario began have no place."""
    return [e for e in events if e.kind in ("mode", "fault") and e.time_s is not None][:most]


def _mark(event: Event) -> dict[str, Any]:
    colour = "#c0392b" if event.kind == "fault" else "#8e44ad"
    across = {"type": "line", "xref": "x", "yref": "paper", "y0": 0, "y1": 1}
    font = {"size": 10, "color": colour}
    label = {"text": event.text, "textangle": -90, "textposition": "end", "font": font}
    line = {"color": colour, "width": 1, "dash": "dot"}
    return {**across, "x0": event.time_s, "x1": event.time_s, "line": line, "label": label}


def _limit(panel: int) -> dict[str, Any]:
    """A dashed line at the largest speed of the rotors."""
    line = {"color": "#555", "width": 1, "dash": "dash"}
    across = {"type": "line", "xref": "paper", "x0": 0, "x1": 1}
    return {**across, "yref": f"y{panel}", "y0": 1.0, "y1": 1.0, "line": line}
