"""Pages of the documentation, and the blocks of code in them."""

from __future__ import annotations

import re
from pathlib import Path

TOP = Path(__file__).parents[2]
DOCS = TOP / "docs"
TUTORIALS = DOCS / "tutorials"
_BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def blocks(page: Path, language: str) -> list[str]:
    """The blocks of a language on a page."""
    return [text for found, text in _BLOCK.findall(page.read_text(encoding="utf-8")) if found == language]


def commands(page: Path) -> list[str]:
    """Lines of its shell blocks, comments cut off."""
    lines = [line for block in blocks(page, "sh") for line in block.splitlines()]
    return [text for line in lines if (text := re.sub(r"(^|\s)#.*", "", line).strip())]
