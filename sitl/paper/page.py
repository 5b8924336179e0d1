"""The page: one HTML file with everything in it. Blocks in, text out."""

from __future__ import annotations

import base64
import html
import re
from collections.abc import Iterable, Sequence
from typing import Any

from sitl.paper.record import CORRECTED, REPRODUCED, UNSUPPORTED, Ledger

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
.bad { color: #a01818; font-weight: 600; } nav { columns: 2; }
summary { cursor: pointer; }
"""

_CLASS = {REPRODUCED: "good", CORRECTED: "changed", UNSUPPORTED: "bad", "within": "good"}


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


def table(head: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """A table; numbers are formatted and set to the right, text may hold markup."""
    top = "".join(f"<th>{cell}</th>" for cell in head)
    body = "".join(f"<tr>{''.join(_cell(cell) for cell in row)}</tr>" for row in rows)
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


def _cell(cell: Any) -> str:
    if cell is None or isinstance(cell, (bool, int, float)):
        return f'<td class="n">{number(cell)}</td>'
    return f"<td>{cell}</td>"


def verdict_table(ledger: Ledger) -> str:
    """Every claim of the paper with its verdict."""
    rows = [(v.where, v.paper, v.ours, verdict(v.verdict), v.why) for v in ledger.verdicts]
    return table(("where", "the paper", "here", "verdict", "correction, or why"), rows)


def check_table(ledger: Ledger) -> str:
    """Every checked number with its expectation."""
    rows = []
    for key, check in ledger.checks.items():
        expected = f"{check['relation']} {number(check['expected'])}"
        if check["relation"].startswith("±"):
            expected = f"{number(check['expected'])} {check['relation']}"
        rows.append(
            (
                f"<code>{key}</code>",
                check["value"] if check["value"] is not None else "not finite",
                check["unit"],
                expected,
                check["source"],
                verdict(check["verdict"]),
            )
        )
    return table(("key in paper.json", "value", "unit", "expected", "from", "verdict"), rows)


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
