"""How much work a dispatch is given, so that it takes about the time it should."""

from __future__ import annotations

from dataclasses import dataclass

DISPATCH_S = 0.02
"""What a dispatch or draw may take on a GPU: drivers end what takes two seconds, and screens wait meanwhile. The
processor has no such limit."""
_GROWTH = 4
"""Most by which a portion grows at a time."""
_MIN_S = 1e-4
"""Times shorter than this are mostly the dispatch itself."""


@dataclass
class DispatchBudget:
    """Units of work of one dispatch; `learn` from what they took."""

    units: int
    whole: int
    """`units` is a multiple of this."""
    most: int
    """Largest `units`, unless `whole` is larger."""

    def learn(self, units: int, took_s: float, wanted_s: float) -> None:
        """A dispatch of `units` took `took_s` and should have taken `wanted_s`.

        A rest that was less than a whole portion says little, unless it took too long."""
        if units < self.units and took_s < wanted_s:
            return
        fitting = int(units * wanted_s / max(took_s, _MIN_S)) // self.whole * self.whole
        self.units = max(self.whole, min(fitting, _GROWTH * self.units, self.most))
