"""Every program that a scene needs, as it is passed to the driver: for tables, proofs and strict compilers."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from ..gpu.shader import Built, recorded

if TYPE_CHECKING:
    from ..gpu.context import Context
    from ..model.scene import Scene
    from ..model.settings import RenderSettings

_PHOTONS = 4096


def compiled_programs(context: Context, scene: Scene, settings: RenderSettings) -> list[Built]:
    """Every program that a small rendering of `scene` builds, each once."""
    from ..render.still import render

    small = replace(settings, width=128, height=72, photons=_PHOTONS, spp=1, seconds=None)
    with recorded() as programs:
        render(scene, small, context=context)
    return unique(programs)


def unique(programs: list[Built]) -> list[Built]:
    """Each program once: the one that took longest, since others were kept."""
    by_texts: dict[tuple[str, ...], Built] = {}
    for built in programs:
        known = by_texts.get(built.texts)
        by_texts[built.texts] = built if known is None or built.seconds > known.seconds else known
    return list(by_texts.values())
