"""The fire that a stone throws on a table under a lamp: the caustic, and how much of it is coloured."""

from __future__ import annotations

import numpy as np

from ..base.generators import finished
from ..edit.parameters import Stage
from ..gpu.context import Context
from ..model.gems.figures import Cancelled, Report, Stone
from ..model.gems.in_scene import TABLE, under_lamp
from ..model.gems.report import TableFire
from ..model.settings import RenderSettings
from .bake import bake_map

_SIDE = 512
_PHOTONS = 200_000


def table_fire(context: Context, stone: Stone, report: Report, stop: Cancelled) -> TableFire:
    """What was done when `stop()` turned true counts. Raises `UserError`."""
    scene = under_lamp(stone)
    settings = RenderSettings(width=_SIDE, height=_SIDE, photons=_PHOTONS, max_depth=scene.render.max_depth)
    steps = bake_map(context, Stage(scene, scene.camera), settings, TABLE, stop)
    baked = finished(steps, lambda share: report(share, "light on the table"))
    rgb = np.asarray(baked.pictures[0].rgb, np.float64)
    total = float(rgb.mean(axis=-1).sum())
    # Spectral colours have negative parts: no white in them.
    white = float(np.maximum(rgb.min(axis=-1), 0.0).sum())
    return TableFire(baked.pictures[0].rgb, 1.0 - white / total if total > 0.0 else 0.0, baked.photons)
