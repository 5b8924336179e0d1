"""`flight.html`: a flight's report as one self-contained, interactive page (plotly), with no network needed.

Data and plotly's script are kept compressed in the page, and unpacked by the browser.
"""

from __future__ import annotations

import base64
import gzip
import html
import json
from collections.abc import Sequence
from importlib import resources
from typing import Any

from sitl_bridge.event_log import FILE_NAME as EVENTS_NAME
from sitl_bridge.event_log import Event

SCRIPT = "plotly/plotly-basic.min.js.gz"
"""Plotly's smallest bundle, for lines and bars: a quarter of the whole script. It is the file of the npm
package `plotly.js-basic-dist-min`, version 4.1.1, packed by `gzip -9n`; its licence lies beside it."""
MOST_EVENTS = 500
"""Rows of the diary on the page."""


def said(summary: dict[str, Any]) -> str:
    """Outcome, clock and link, in a short sentence each."""
    outcome = ", ".join(str(summary[key]) for key in ("outcome", "outcome_cause") if summary.get(key))
    ticks = [
        f"{summary[key]} ticks {what}"
        for key, what in (
            ("late_ticks", "late"),
            ("resent_ticks", "sent again"),
            ("unanswered_ticks", "without an answer"),
        )
        if summary.get(key)
    ]
    link = ", ".join(ticks) or "no tick late, sent again, or without an answer"
    clock = f"{summary.get('clock')} at {summary.get('rate_hz'):g} Hz" if summary.get("rate_hz") else ""
    return f"Outcome: {outcome or 'not known'}. {f'Clock: {clock}. ' if clock else ''}Link: {link}."


def _facts(summary: dict[str, Any]) -> str:
    """The summary as a table: plain values only."""
    rows = []
    for key, value in summary.items():
        if value is None or isinstance(value, (dict, list)):
            continue
        text = f"{value:.6g}" if isinstance(value, float) else str(value)
        rows.append(f"<tr><th>{html.escape(key)}</th><td>{html.escape(text)}</td></tr>")
    return "\n".join(rows)


def _events(events: Sequence[Event]) -> str:
    """The diary as a table's rows."""
    rows = []
    for event in events[:MOST_EVENTS]:
        time = "" if event.time_s is None else f"{event.time_s:.2f} s"
        cells = (time, event.source, event.kind, event.text)
        rows.append("<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in cells) + "</tr>")
    if len(events) > MOST_EVENTS:
        rows.append(f"<tr><td colspan=4>and {len(events) - MOST_EVENTS} more, in {EVENTS_NAME}</td></tr>")
    return "\n".join(rows)


def page(summary: dict[str, Any], figure: dict[str, Any], events: Sequence[Event]) -> str:
    """The page as text; figure: as plotly's script takes it."""
    script = resources.files(__package__).joinpath(SCRIPT).read_bytes()
    title = html.escape(f"{summary.get('scenario')}: {summary.get('vehicle')}")
    data = json.dumps(figure, allow_nan=False)
    facts = _facts(summary)
    outcome = html.escape(said(summary))
    return _TEMPLATE.format(
        title=title,
        said=outcome,
        events=_events(events),
        facts=facts,
        script=_text(script),
        data=_text(gzip.compress(data.encode(), 9, mtime=0)),
    )


def _text(packed: bytes) -> str:
    return base64.b64encode(packed).decode()


_TEMPLATE = """<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>
body {{ font: 15px/1.5 system-ui, sans-serif; margin: 2em auto; max-width: 1150px; padding: 0 1em; }}
table {{ border-collapse: collapse; font-size: 13px; columns: 2; }}
table.events {{ columns: 1; }}
td {{ padding-right: 1.5em; vertical-align: top; }}
th {{ text-align: left; font-weight: 500; padding-right: 1.5em; }}
</style>
</head>
<body>
<h1>{title}</h1>
<p>{said}</p>
<p>Where the plots are grey the cable is slack. A dotted line across all plots marks a flight mode or a fault.
The dashed line in the rotors' plot is their largest speed.
Click a name to hide its line, drag to zoom, double-click to go back.</p>
<div id="figure"></div>
<details open><summary>What happened, and what was said</summary><table class="events">
<tr><th>time</th><th>by</th><th>kind</th><th></th></tr>
{events}
</table></details>
<details><summary>All figures of the flight</summary><table>
{facts}
</table></details>
<script type="application/octet-stream" id="data">{data}</script>
<script type="application/octet-stream" id="plotly">{script}</script>
<script>
(async () => {{
  const unpacked = id => {{
    const bytes = Uint8Array.from(atob(document.getElementById(id).textContent), c => c.charCodeAt(0));
    return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).text();
  }};
  const script = document.createElement("script");
  script.textContent = await unpacked("plotly");
  document.head.appendChild(script);
  const figure = JSON.parse(await unpacked("data"));
  await Plotly.newPlot("figure", figure.data, figure.layout, {{responsive: true}});
  document.body.dataset.ready = "yes";
}})();
</script>
</body>
</html>
"""
