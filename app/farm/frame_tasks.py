"""What workers do for frames: each keeps a renderer, so that light which frames share is traced once a worker. Runs on
a `Desk`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.image_io import check_finite
from ..base.movie import frame_bytes
from ..edit.parameters import Stage
from ..model.settings import RenderSettings
from ..render.animate import developed
from ..render.frames import FrameRenderer
from ..render.notices import frame_notices
from .desk import Desk, Report


@dataclass(frozen=True)
class Frames:
    """What all jobs share."""

    stages: tuple[Stage, ...]
    settings: RenderSettings


@dataclass(frozen=True)
class Frame:
    """One that is done: its linear picture, or the file of the developed one."""

    rgb: np.ndarray | None
    png: bytes
    notices: tuple[str, ...]


def draw(desk: Desk, of: Frames, report: Report, index: int, base_ev: float | None) -> Frame | None:
    """A frame, developed with the exposure that all share; linear where that is not known yet. None where it is no
    longer wanted."""
    renderer = desk.kept.get("renderer")
    if renderer is None:
        renderer = desk.kept["renderer"] = FrameRenderer(desk.context, of.settings, of.stages)
    stage = of.stages[index]
    for share in renderer.steps(stage):
        report(share)
        if report.unwanted():
            renderer.release()  # half of its light is no light for another
            return None
    rgb = renderer.picture.rgb
    check_finite(f"frame {index + 1} of {len(of.stages)}", rgb)
    notices = tuple(frame_notices(renderer.light, stage.camera, of.settings, rgb))
    if base_ev is None:
        return Frame(rgb, b"", notices)
    codes = developed(rgb, base_ev + stage.exposure_ev, stage.scene.render)
    return Frame(None, frame_bytes(codes), notices)
