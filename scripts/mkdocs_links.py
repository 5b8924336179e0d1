"""For the site: links from the documentation to files beside it lead to the repository."""

from __future__ import annotations

import re
from typing import Any

LINK = re.compile(r"\]\(((?:\.\./)+)([^)]+)\)")


def on_page_markdown(markdown: str, page: Any, config: Any, **_: Any) -> str:
    """Replace those that leave `docs/`; a folder deeper, one more `../` stays inside."""
    depth = page.file.src_uri.count("/")

    def replace(match: re.Match[str]) -> str:
        ups = match[1].count("../")
        if ups <= depth:
            return match[0]
        return f"]({config['repo_url']}/blob/HEAD/{match[2]})"

    return LINK.sub(replace, markdown)
