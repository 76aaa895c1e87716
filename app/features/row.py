"""A row of the table of features: what decides one, what it is called, what it costs, and how it is proved absent.

    mirrors: bool = feature(
        "mirrors",
        lambda facts: bool(facts.having(lambda material: material.is_mirror)),
        symbol="HAS_MIRROR",
        ...
    )

declares a field of `Features`, typed for whoever reads it, together with all texts about it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, ParamSpec

from .facts import Facts

Sentence = str | Callable[[Facts], str]
P = ParamSpec("P")
ROW = "row"
"""Key of a field's row among its metadata."""


@dataclass(frozen=True)
class Sizes:
    """Bytes of records and tables, which rooms above know."""

    spectrum: int
    """A table over the spectrum."""
    splat: int
    triangle: int
    """With its share of the tree."""
    piece: int
    """A face of a curved solid."""
    texel: int = 16
    """Four float32 or uint32."""


@dataclass(frozen=True)
class Row:
    """One feature."""

    name: str
    """As `inspect` lists it; "": it is not listed."""
    needs: Callable[[Facts], bool | int]
    symbol: str = ""
    """Defined in programs where the feature is in; "": single programs have a switch of their own for it."""
    why: Sentence = ""
    """The reason it is in."""
    why_not: Sentence = ""
    """The reason it is out."""
    names: tuple[str, ...] = ()
    """Identifiers that only programs with the feature may hold. "light: NAME": among those of the light pass, where
    the camera, whose rays always carry a pixel's columns, shares the name; any other with a space is a pattern for a
    line."""
    cost: str | Callable[[Facts, Sizes], str] = ""
    """What it adds to tables and work; bytes of rays and photons are added up without it."""
    requires: tuple[str, ...] = ()
    """Fields of features whose code this one's is written on."""
    off: bool | int = False

    def cost_words(self, facts: Facts, sizes: Sizes) -> str:
        """`cost`, of these facts."""
        return self.cost if isinstance(self.cost, str) else self.cost(facts, sizes)

    def why_words(self, facts: Facts, *, is_in: bool) -> str:
        """`why` or `why_not`, of these facts."""
        sentence = self.why if is_in else self.why_not
        return sentence if isinstance(sentence, str) else sentence(facts)


def _as_field(row: Callable[P, Row]) -> Callable[P, Any]:
    def feature(*values: P.args, **named: P.kwargs) -> Any:
        made = row(*values, **named)
        return field(default=made.off, metadata={ROW: made})

    return feature


feature = _as_field(Row)
"""A field of `Features` with its row, of which it takes the values."""


def size_words(count: int) -> str:
    """Bytes for people."""
    if count < 2048:
        return f"{count} B"
    return f"{count / 1024:.0f} KiB" if count < 1 << 21 else f"{count / (1 << 20):.1f} MiB"
