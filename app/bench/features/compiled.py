"""What features leave in programs and records: the proof that what a scene does not need is absent, and bytes.

Every program of a small rendering is recorded as it is given to the driver, then searched for the names that a feature
alone uses. A test keeps the names true: each must occur in some program where its feature is in.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

from ...features.facts import Facts
from ...features.features import ROWS, Features
from ...features.row import Sizes
from ...gpu.dead_code import words
from ...gpu.records import photon_record, ray_record_of
from ...gpu.scene_records import PIECE, TRIANGLE
from ...gpu.shader import Source
from ...gpu.spectral_groups import SAMPLES
from ...passes.footprint import SPLAT
from ..programs import compiled_programs
from .results import Absence, ProgramSize

if TYPE_CHECKING:
    from ...gpu.context import Context
    from ...model.scene import Scene
    from ...model.settings import RenderSettings

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


PROVED = {row.name: row.names for row in ROWS.values() if row.names}
"""By name of a feature: the names that it alone uses."""


def compiled_sources(context: Context, scene: Scene, settings: RenderSettings) -> list[Source]:
    """The source of every program that a rendering of `scene` builds, each once."""
    sources = (stage for built in compiled_programs(context, scene, settings) for stage in built.stages)
    return list({(source.name, source.text): source for source in sources}.values())


def program_sizes(sources: Iterable[Source]) -> list[ProgramSize]:
    """What each source holds."""
    return [
        ProgramSize(
            source.name,
            len(source.text.splitlines()),
            source.flattened_lines,
            [name for name, symbols in PROVED.items() if occurring(source, symbols)],
        )
        for source in sources
    ]


def occurring(source: Source, names: Sequence[str]) -> tuple[str, ...]:
    """Those of `names` (`Row.names`) that occur in a source."""
    present = words(source.text)

    def occurs(name: str) -> bool:
        if name.startswith(_LIGHT):
            return source.name.startswith("light/") and name.removeprefix(_LIGHT) in present
        return re.search(name, source.text) is not None if " " in name else name in present

    return tuple(filter(occurs, names))


def prove(programs: Sequence[ProgramSize], included: Mapping[str, bool]) -> list[Absence]:
    """One proof a feature that has names of its own: absent from every program where it is out, somewhere where it is
    in; `included`: which is what, by name."""
    found = {
        name: tuple(dict.fromkeys(program.name for program in programs if name in program.features)) for name in PROVED
    }
    return [
        Absence(name, included[name], symbols, found[name], bool(found[name]) == included[name])
        for name, symbols in PROVED.items()
    ]
