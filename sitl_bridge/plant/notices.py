"""Messages to the person at the terminal: each kind said once, until its cause is gone."""

from __future__ import annotations

from collections.abc import Callable


class Notices:
    """Says each kind of thing once; `clear` lets it be said again."""

    def __init__(self, say: Callable[[str], None]) -> None:
        self._say = say
        self._said: set[str] = set()

    def once(self, kind: str, text: str) -> None:
        """Say `text` unless something of this kind stands said."""
        if kind not in self._said:
            self._said.add(kind)
            self._say(text)

    def clear(self, kind: str) -> bool:
        """The cause is gone; returns whether it had been said."""
        if kind in self._said:
            self._said.discard(kind)
            return True
        return False

    def now(self, text: str) -> None:
        """Say `text` in any case."""
        self._say(text)
