"""Writes the pages into the folder that is named on the command line."""

from __future__ import annotations

import sys
from pathlib import Path

from sitl.reference_pages.pages import PAGES

if __name__ == "__main__":
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    for name, markdown in PAGES.items():
        (folder / name).write_text(markdown(), encoding="utf-8")
