"""Messages to the person at the terminal: each kind said once, until its cause is gone."""

from __future__ import annotations

from collections.abc import Callable


class Notices:
    """Says each kind of thing once; `over` lets it be said again."""

    def __init__(self, say: Callable[[str], None]) -> None:
        self._say = say
        self._said: set[str] = set()

    def once(self, kind: str, text: str) -> None:
        """Say `text` unless something of this kind stands said."""
        if kind not in self._said:
            self._said.add(kind)
            self._say(text)

    def over(self, kind: str, text: str) -> None:
        """The cause is gone: say `text` if it had been said, and let it be said again."""
        if kind in self._said:
            self._said.discard(kind)
            self._say(text)
