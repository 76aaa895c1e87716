"""What of a file's materials is not shown, or was taken for something else: one sentence for each kind of it."""

from __future__ import annotations

from ..staging import listed


class Unshown:
    """Collects kinds, each with the names of the materials that have it."""

    def __init__(self) -> None:
        self._names: dict[str, dict[str, None]] = {}

    def add(self, kind: str, name: str) -> None:
        """`kind`: a sentence without its end, which the names are."""
        self._names.setdefault(kind, {})[name] = None

    def notes(self) -> list[str]:
        """A sentence for each kind, in the order in which they were met."""
        return [f"{kind}: {listed(list(names))}." for kind, names in self._names.items()]
