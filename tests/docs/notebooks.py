"""Notebooks of tutorials: a code cell for each block of Python, everything else as it is on the page.

`python -m tests.docs.notebooks` writes them.
"""

from __future__ import annotations

import re

import nbformat
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook

from tests.docs.pages import TUTORIALS

NOTEBOOKS = ("paper", "px4")
_PYTHON = re.compile(r"^```python\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def notebook(name: str) -> nbformat.NotebookNode:
    """The notebook of a tutorial, without outputs."""
    cells = []
    parts = _PYTHON.split((TUTORIALS / f"{name}.md").read_text(encoding="utf-8"))
    for index, part in enumerate(parts):
        if part.strip():
            make = new_code_cell if index % 2 else new_markdown_cell
            cells.append(make(part.strip(), id=f"cell-{index}"))
    kernel = {"name": "python3", "display_name": "Python 3", "language": "python"}
    return new_notebook(cells=cells, metadata={"kernelspec": kernel})


if __name__ == "__main__":
    for name in NOTEBOOKS:
        nbformat.write(notebook(name), TUTORIALS / f"{name}.ipynb")
