"""The page of a study: outcomes, verdicts, figures over what varied, the worst flights with commands."""

from __future__ import annotations

import base64
import html
import io
import shlex
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from sitl.report.outcome import FELL
from sitl.studies.sweep.study import Study
from sitl.studies.sweep.verdicts import Judged

FILE_NAME = "study.html"
WORST = 10
_STYLE = (
    "body{font:15px/1.5 system-ui,sans-serif;max-width:1100px;margin:2em auto;padding:0 1em}"
    "table{border-collapse:collapse;margin:1em 0}"
    "td,th{border-bottom:1px solid #ddd;padding:3px 10px;text-align:left}"
    "code{font-size:12px}.no{color:#b00;font-weight:600}img{max-width:100%}"
)


def write_page(
    out: Path, study: Study, file: Path, rows: Sequence[dict[str, Any]], verdicts: Sequence[Judged]
) -> Path:
    """Write the page; returns its path."""
    parts = [f"<h1>{html.escape(study.name)}</h1>", f"<p>{html.escape(study.description)}</p>"]
    parts.append(_verdicts(verdicts))
    parts.append(_outcomes(rows))
    parts.append(_figures(study, rows))
    parts += [_plot(study, vary.key, rows) for vary in study.vary]
    parts.append(_worst(study, file, rows))
    text = (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        f"<title>{html.escape(study.name)}</title><style>{_STYLE}</style></head><body>\n"
    )
    page = out / FILE_NAME
    page.write_text(text + "\n".join(parts) + "\n</body></html>\n", encoding="utf-8")
    return page


def _table(header: Sequence[str], body: Sequence[Sequence[str]]) -> str:
    head = "".join(f"<th>{html.escape(name)}</th>" for name in header)
    lines = ("<tr>" + "".join(f"<td>{cell}</td>" for cell in row) + "</tr>" for row in body)
    return f"<table><tr>{head}</tr>\n" + "\n".join(lines) + "</table>"


def _verdicts(verdicts: Sequence[Judged]) -> str:
    if not verdicts:
        return ""
    body = [
        (
            html.escape(v.text),
            html.escape(v.found),
            "holds" if v.holds else '<span class="no">does not hold</span>',
        )
        for v in verdicts
    ]
    return "<h2>Verdicts</h2>" + _table(("limit", "found", ""), body)


def _outcomes(rows: Sequence[dict[str, Any]]) -> str:
    designs = sorted({str(row.get("design")) for row in rows})
    counts = {d: Counter(row["outcome"] for row in rows if str(row.get("design")) == d) for d in designs}
    outcomes = sorted({str(row["outcome"]) for row in rows})
    body = [(html.escape(o), *(str(counts[d][o]) for d in designs)) for o in outcomes]
    return f"<h2>Outcomes of {len(rows)} flights</h2>" + _table(("outcome", *designs), body)


def _figures(study: Study, rows: Sequence[dict[str, Any]]) -> str:
    body = []
    for name in study.figures:
        values = sorted(float(row[name]) for row in rows if isinstance(row.get(name), (int, float)))
        if values:
            middle, high = values[len(values) // 2], values[min(len(values) - 1, int(0.95 * len(values)))]
            cells = (values[0], middle, high, values[-1])
            body.append((html.escape(name), str(len(values)), *(f"{value:.4g}" for value in cells)))
    return "<h2>Figures</h2>" + _table(("figure", "flights", "least", "median", "95 %", "most"), body)


def _plot(study: Study, key: str, rows: Sequence[dict[str, Any]]) -> str:
    """What a varied key does to each figure."""
    given = [row for row in rows if isinstance(row.get(key), (int, float))]
    names = [n for n in study.figures if any(isinstance(row.get(n), (int, float)) for row in given)][:6]
    if not given or not names:
        return ""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(
        1, len(names), figsize=(3.4 * len(names), 3.0), layout="constrained", squeeze=False
    )
    for ax, name in zip(axes[0], names, strict=True):
        for design in study.designs:
            own = [r for r in given if r.get("design") == design and isinstance(r.get(name), (int, float))]
            ax.plot([r[key] for r in own], [r[name] for r in own], ".", ms=4, label=design)
        ax.set_xlabel(key, fontsize="small")
        ax.set_title(name, fontsize="small")
        ax.grid(alpha=0.3)
    if len(study.designs) > 1:
        axes[0][0].legend(fontsize="small")
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=90)
    plt.close(figure)
    data = base64.b64encode(buffer.getvalue()).decode()
    return (
        f'<h2>Over {html.escape(key)}</h2><img alt="{html.escape(key)}" src="data:image/png;base64,{data}">'
    )


def _badness(row: dict[str, Any]) -> tuple[bool, bool, float]:
    lost = row["outcome"] in (*FELL, "raised")
    return (
        lost,
        row["outcome"] != "settled",
        float(row.get("overshoot_pct") or row.get("largest_tilt_deg") or 0.0),
    )


def _worst(study: Study, file: Path, rows: Sequence[dict[str, Any]]) -> str:
    worst = sorted(rows, key=_badness, reverse=True)[:WORST]
    body = []
    for row in worst:
        cause = str(row.get("outcome_cause") or "")
        body.append(
            (
                html.escape(str(row["outcome"])),
                html.escape(cause),
                f"<code>{html.escape(command(study, file, row))}</code>",
            )
        )
    return f"<h2>The worst {len(worst)}</h2>" + _table(("outcome", "cause", "the same flight alone"), body)


def command(study: Study, file: Path, row: dict[str, Any]) -> str:
    """A command that repeats one flight of a study."""
    return shlex.join(["sitl", "sweep", str(file), "--only", str(row["identity"])])
