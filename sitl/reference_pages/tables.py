"""Markdown tables."""

from __future__ import annotations

from collections.abc import Iterable, Sequence


def table(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """Lines of a table; a bar inside a cell is escaped."""
    lines = ["| " + " | ".join(headings) + " |", "|" + "---|" * len(headings)]
    for row in rows:
        lines.append("| " + " | ".join(cell.replace("|", "\\|").replace("\n", " ") for cell in row) + " |")
    return lines


def page(title: str, source: str, *parts: Iterable[str]) -> str:
    """A page; source: what it is made from."""
    made = f"Made from {source} (`python -m sitl.reference_pages docs/reference`); do not edit."
    lines = [f"# {title}", "", made]
    for part in parts:
        lines += ["", *part]
    return "\n".join(lines) + "\n"
