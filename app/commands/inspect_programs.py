"""What each program of a scene asks of the device and whose code it holds, for `inspect --programs`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..gpu import strict_compilers
from ..gpu.limits import NEEDED
from ..gpu.program_use import StageUse, uses
from .printing import table

if TYPE_CHECKING:
    from rich.console import RenderableType
    from rich.table import Table

    from ..gpu.live_state import LiveState
    from ..gpu.shader import Built
    from ..model.scene import Scene
    from .inspect_features import Proof

HEADINGS = (
    "program",
    "lines",
    "kB",
    "storage blocks",
    "uniform blocks",
    "textures",
    "images",
    "shared B",
    "live words",
    "array words",
    "driver s",
)
"""Columns of a table of programs; numbers but for the first."""


@dataclass(frozen=True)
class ProgramRow:
    """One shader of one program."""

    use: StageUse
    live: LiveState | None
    """None where the tools that count them are not installed."""
    seconds: float | None
    """The driver's, of the whole program; None for a program's further stages."""

    def cells(self) -> tuple[str, ...]:
        """In the order of `HEADINGS`."""
        use = self.use
        return (
            use.name,
            f"{use.lines:,}",
            f"{use.bytes / 1000:.1f}",
            str(len(use.storage)),
            str(len(use.uniform)),
            str(use.textures),
            str(use.images),
            f"{use.shared_bytes:,}",
            "" if self.live is None else f"{self.live.registers:,}",
            "" if self.live is None else f"{self.live.scratch:,}",
            "" if self.seconds is None else f"{self.seconds:.2f}",
        )


def program_rows(programs: Sequence[Built]) -> list[ProgramRow]:
    """The largest programs first, each with its stages together."""
    largest = sorted(programs, key=lambda built: -sum(map(len, built.texts)))
    known = not strict_compilers.missing()
    rows = []
    for built in largest:
        stages = uses(built)
        live = strict_compilers.live_states(built) if known else (None,) * len(stages)
        rows += [
            ProgramRow(use, held, None if at else built.seconds)
            for at, (use, held) in enumerate(zip(stages, live, strict=True))
        ]
    return rows


def beyond_promises(programs: Sequence[Built]) -> list[str]:
    """A sentence for each limit that a program needs beyond what is asked of a driver."""
    return [sentence for built in programs for use in uses(built) for sentence in use.over(NEEDED)]


def programs_text(scene: Scene) -> RenderableType:
    """The table of all programs that a small rendering of `scene` builds. Raises `UserError` without OpenGL."""
    from rich.console import Group

    from ..bench.programs import compiled_programs
    from ..features.features import Features
    from ..gpu.context import create_context
    from ..model.settings import RenderSettings
    from .inspect_features import prove

    settings = RenderSettings(max_depth=scene.render.max_depth)
    with create_context() as context:
        programs = compiled_programs(context, scene, settings)
        renderer = context.renderer
    headings = (HEADINGS[0], *(f">{heading}" for heading in HEADINGS[1:]))
    rows = [row.cells() for row in program_rows(programs)]
    seconds = sum(built.seconds for built in programs)
    return Group(
        table(f"Programs, as compiled by {renderer}", headings, rows),
        f"{len(programs)} programs, {seconds:.1f} s in the driver; some drivers compile the rest when a program first "
        "runs.",
        _live_words_told(),
        *beyond_promises(programs),
        _proofs_table(prove([stage for built in programs for stage in built.stages], Features.of(scene, settings))),
    )


def _proofs_table(proofs: Sequence[Proof]) -> Table:
    rows = [
        (
            proof.feature,
            "in" if proof.included else "out" if proof.holds else "out, yet found",
            ", ".join(proof.programs) or "no program",
        )
        for proof in proofs
    ]
    return table("Parts of the programs, by the names that each part alone uses", ("part", " ", "found in"), rows)


def _live_words_told() -> str:
    if absent := strict_compilers.missing():
        return f"Live words and array words are not known: {absent}."
    return (
        "Live words: 32 bits each, held at once by an invocation where it holds most, as an optimiser of SPIR-V leaves "
        "it (GPUs have some 255 registers for them). Array words: its own arrays, together; they are in memory."
    )
