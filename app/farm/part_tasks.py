"""What workers do for one picture: count its rounds, trace a part, see what was traced. Runs on a `Desk`."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..model.scene import Scene
from ..model.settings import RenderSettings
from ..render.part_file import part_bytes
from ..render.parts import PartHeader, Share, check_maps, merged_light, parts_at_most, trace_part
from ..render.still import RenderResult, render
from .desk import Desk, Report


@dataclass(frozen=True)
class Picture:
    """What all jobs of one picture share."""

    scene: Scene
    settings: RenderSettings
    scene_file: str


def count_parts(desk: Desk, of: Picture, report: Report) -> int:
    """Into how many parts it can be divided."""
    return parts_at_most(desk.context, of.scene, of.settings)


def trace(desk: Desk, of: Picture, report: Report, share: Share) -> bytes:
    """One part, as its file; empty where it is no longer wanted."""
    part = trace_part(desk.context, of.scene, of.settings, share, of.scene_file, report, report.unwanted)
    return b"" if part is None else part_bytes(part)


def see(
    desk: Desk, of: Picture, report: Report, headers: list[PartHeader], sums: list[np.ndarray], spp: int | None
) -> RenderResult:
    """The picture of some parts or all, from the sums of their maps; `spp`: camera samples a pixel where not the
    settings' own."""
    settings = of.settings if spp is None else replace(of.settings, spp=spp)
    fill = merged_light(headers, sums, lambda light: check_maps(light, headers[0], "a part"))
    return render(of.scene, settings, report, report.unwanted, desk.context, fill=fill)
