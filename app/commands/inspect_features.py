"""What features leave in programs and records: bytes, and the proof that what a scene does not need is absent.

Every program of a small rendering, as it is given to the driver, is searched for the names that a feature alone uses. A
test keeps the names true: each must occur in some program where its feature is in.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

from ..features.facts import Facts
from ..features.features import ROWS, Features
from ..features.row import Sizes
from ..gpu.dead_code import words
from ..gpu.records import photon_record, ray_record_of
from ..gpu.scene_records import PIECE, TRIANGLE
from ..gpu.shader import Source
from ..gpu.spectral_groups import SAMPLES
from ..passes.footprint import SPLAT

_TEXEL = 16
_LIGHT = "light: "
_SIZES = Sizes(SAMPLES * 8, SPLAT.stride, TRIANGLE.stride + 2 * _TEXEL, PIECE.stride, _TEXEL)


def record_words(features: Features) -> str:
    """How large records are, one line for people."""
    ray, photon = _record_sizes(features)
    splats = (1 + features.nested_windows) * SPLAT.stride
    return (
        f"A ray is {ray} bytes with {features.columns} derivative column(s), a photon record {photon}, "
        f"its splats {splats}, a map's texel {features.targets * _TEXEL}."
    )


def static_costs(facts: Facts, features: Features) -> dict[str, str]:
    """By name: what the features that are in add to records, tables and work."""
    ray, photon = _record_sizes(features)
    found = {}
    for field, row in ROWS.items():
        if not row.name or not getattr(features, field):
            continue
        without = _record_sizes(features.changed(**{field: row.off}))
        of_records = [
            f"{more} B a {what}" for more, what in ((ray - without[0], "ray"), (photon - without[1], "photon")) if more
        ]
        found[row.name] = ", ".join(filter(None, (*of_records, row.cost_words(facts, _SIZES))))
    return found


def _record_sizes(features: Features) -> tuple[int, int]:
    """Bytes of a ray and of a photon."""
    return ray_record_of(features).stride, photon_record(features.spectral_groups, features.hero).stride


# -- proof --------------------------------------------------------------------------------


class Proof(NamedTuple):
    """Where the names of one feature were found."""

    feature: str
    included: bool
    programs: tuple[str, ...]
    """The sources that hold any of the feature's own names."""

    @property
    def holds(self) -> bool:
        """What the scene does not need is in no program; what it may need, a rendering can do without."""
        return self.included or not self.programs


def prove(sources: Sequence[Source], features: Features) -> list[Proof]:
    """One proof a feature that has names of its own, over the sources of programs that were built for `features`."""
    return [
        Proof(
            row.name,
            bool(getattr(features, field)),
            tuple(dict.fromkeys(source.name for source in sources if occurring(source, row.names))),
        )
        for field, row in ROWS.items()
        if row.names
    ]


def occurring(source: Source, names: Sequence[str]) -> tuple[str, ...]:
    """Those of `names` (`Row.names`) that occur in a source."""
    present = words(source.text)

    def occurs(name: str) -> bool:
        if name.startswith(_LIGHT):
            return source.name.startswith("light/") and name.removeprefix(_LIGHT) in present
        return re.search(name, source.text) is not None if " " in name else name in present

    return tuple(filter(occurs, names))
