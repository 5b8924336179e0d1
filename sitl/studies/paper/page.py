"""The page: one HTML file with everything in it. Blocks in, text out."""

from __future__ import annotations

import base64
import html
import re
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

from sitl.studies.paper.record import CORRECTED, NOT_JUDGED, REPRODUCED, UNSUPPORTED, WITHIN, Ledger

STYLE = """
:root { color-scheme: light; }
body { font: 16px/1.5 system-ui, sans-serif; color: #1c1c1c;
  max-width: 62rem; margin: 2rem auto; padding: 0 1rem; }
h1 { line-height: 1.2; } h2 { margin-top: 3rem; border-bottom: 1px solid #ccc; } h3 { margin-top: 2rem; }
figure { margin: 1.5rem 0; } figure img { width: 100%; height: auto; } figcaption { color: #333; }
table { border-collapse: collapse; margin: 1rem 0; font-size: 0.9rem; } .wide { overflow-x: auto; }
th, td { border: 1px solid #ddd; padding: 0.25rem 0.6rem; text-align: left; vertical-align: top; }
th { background: #f4f4f4; } td.n { text-align: right; font-variant-numeric: tabular-nums; }
code { font-size: 0.88em; background: #f4f4f4; padding: 0.1em 0.3em; overflow-wrap: anywhere; }
pre { background: #f4f4f4; padding: 0.6rem; overflow-x: auto; font-size: 0.72rem; line-height: 1.35; }
.good { color: #14632a; font-weight: 600; } .changed { color: #7a5200; font-weight: 600; }
.bad { color: #a01818; font-weight: 600; } .plain { color: #555; } nav { columns: 2; }
summary { cursor: pointer; }
"""

_CLASS = {REPRODUCED: "good", CORRECTED: "changed", UNSUPPORTED: "bad", WITHIN: "good", NOT_JUDGED: "plain"}


class Cell(NamedTuple):
    """A number in a table: what the ledger has under a key, so that it stands in paper.json, too."""

    key: str
    """Dotted; a number in it leads into a list"""
    scale: float = 1.0
    """Shown is the value times this, e.g. 1000 for milliseconds"""


def text(words: str) -> str:
    """A paragraph; `words` may hold markup."""
    return f"<p>{words}</p>"


def heading(words: str) -> str:
    """A heading within a section."""
    return f"<h3>{words}</h3>"


def figure(png: bytes, caption: str, commands: Sequence[str] = ()) -> str:
    """A picture with its caption, and the commands that fly it again."""
    data = base64.b64encode(png).decode("ascii")
    again = "".join(f"<br><code>{html.escape(command)}</code>" for command in commands)
    title = re.sub("<[^>]*>", "", caption)
    alt = html.escape(title.split(". ")[0], quote=True)
    return (
        f'<figure><img alt="{alt}" src="data:image/png;base64,{data}">'
        f"<figcaption>{caption}{again}</figcaption></figure>"
    )


def table(ledger: Ledger, head: Sequence[str], rows: Iterable[Sequence[str | Cell]]) -> str:
    """A table of texts, which may hold markup, and of numbers, which only the ledger has."""
    return _table(head, ("".join(_cell(ledger, cell) for cell in row) for row in rows))


def _table(head: Sequence[str], rows: Iterable[str]) -> str:
    top = "".join(f"<th>{cell}</th>" for cell in head)
    body = "".join(f"<tr>{row}</tr>" for row in rows)
    return f'<div class="wide"><table><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table></div>'


def listing(words: str, summary: str) -> str:
    """Text as it stands, folded away."""
    return f"<details><summary>{summary}</summary><pre>{html.escape(words)}</pre></details>"


def number(value: Any) -> str:
    """A number for people: four significant digits."""
    if value is None:
        return "none"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int):
        return str(value)
    return f"{value:.4g}"


def verdict(words: str) -> str:
    """A verdict in its colour."""
    return f'<span class="{_CLASS.get(words, "bad")}">{html.escape(words)}</span>'


def _cell(ledger: Ledger, cell: str | Cell) -> str:
    if isinstance(cell, str):
        return f"<td>{cell}</td>"
    value = ledger.value(cell.key)
    shown = number(value if cell.scale == 1.0 or value is None else cell.scale * value)
    return f'<td class="n" data-key="{cell.key}" data-scale="{cell.scale:g}">{shown}</td>'


def verdict_table(ledger: Ledger) -> str:
    """Every claim of the paper with its verdict."""
    rows = [(v.where, v.paper, v.ours, verdict(v.verdict), v.why) for v in ledger.verdicts]
    return table(ledger, ("where", "the paper", "here", "verdict", "correction, or why"), rows)


def check_table(ledger: Ledger) -> str:
    """Every recorded number with its expectation, or why there is none."""
    rows = []
    for key, check in ledger.checks.items():
        if isinstance(check["value"], (list, str)):
            value: str | Cell = array_text(check["value"])
        else:
            value = Cell(key)
        words = check["unit"], expectation(check), check["source"], verdict(check["verdict"])
        rows.append((f"<code>{key}</code>", value, *words))
    head = ("key in paper.json", "value", "unit", "expected", "from, or why none", "verdict")
    return table(ledger, head, rows)


def array_text(value: Any) -> str:
    """What stands for an array in the table of all numbers: its size."""
    if isinstance(value, str):
        return html.escape(value)
    size = [len(value)]
    while isinstance(value[0], list):
        value = value[0]
        size.append(len(value))
    return f"{' × '.join(map(str, size))} numbers"


def expectation(check: dict[str, Any]) -> str:
    """What was expected of a number, in words."""
    if check["relation"] == "none":
        return "–"
    if isinstance(check["expected"], list):
        return f"each entry {check['relation']} of those in paper.json"
    expected = check["expected"] if isinstance(check["expected"], str) else number(check["expected"])
    if check["relation"].startswith("±"):
        return f"{expected} {check['relation']}"
    return f"{check['relation']} {expected}"


def document(title: str, lead: str, sections: Sequence[tuple[str, str]]) -> str:
    """The whole page; sections: (title, content)."""
    contents = "".join(f'<li><a href="#s{i}">{name}</a></li>' for i, (name, _) in enumerate(sections, 1))
    body = "".join(
        f'<section id="s{i}"><h2>{name}</h2>{content}</section>'
        for i, (name, content) in enumerate(sections, 1)
    )
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{title}</title><style>{STYLE}</style></head><body>"
        f"<h1>{title}</h1>{lead}<nav><ol>{contents}</ol></nav>{body}</body></html>\n"
    )
