"""Names that are each given once, numbered where a file repeats them."""

from __future__ import annotations


class Names(set[str]):
    """The names that are taken."""

    def __init__(self) -> None:
        super().__init__()
        self._last: dict[str, int] = {}

    def unique(self, name: str) -> str:
        """`name`, or with the first number from 2 on that is free ("ball 2"); taken from now on."""
        chosen, number = name, self._last.get(name, 1)
        while chosen in self:
            number += 1
            chosen = f"{name} {number}"
        # Lower ones stay taken: ten thousand equal names are not searched from the start each time.
        self._last[name] = number
        self.add(chosen)
        return chosen
