"""Gratings as shaders read them (`shaders/lib/grating.glsl`): records, and tables for what has no closed form there."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..model.materials import Grating
from ..model.optics.colorimetry import VISIBLE_NM
from ..model.optics.gratings import line_quantiles, sinusoidal_shares
from ..model.scene import Scene, SceneObject
from .scene_records import GRATING, GRATING_ORDER


class GratingRows(NamedTuple):
    """Where the shares of a sinusoidal grating's orders stand in `grating_tables`."""

    first: int
    most_waves: float
    """What each row goes to, from 0 on."""


def grating_tables(scene: Scene, samples: int) -> tuple[dict[int, GratingRows], np.ndarray]:
    """By object, and the tables (rows, samples): `line_quantiles` if some light is spread, then of sinusoidal gratings
    one row an order, its share over `waves_of`."""
    found: dict[int, GratingRows] = {}
    spreads = any(item.material.spread_per_um for item in scene.objects)
    tables = [line_quantiles(samples)[None] if spreads else np.zeros((0, samples))]
    indices = [item.material.dispersion.index(VISIBLE_NM[0]) for item in scene.objects if item.material.transmits]
    for index, item in enumerate(scene.objects):
        material = item.material
        if isinstance(material, Grating) and material.profile == "sinusoidal":
            deepest = material.relief_index or 2.0 * max(1.0, *indices)
            most = material.relief * deepest / (1e-3 * VISIBLE_NM[0])
            found[index] = GratingRows(sum(map(len, tables)), most)
            tables.append(sinusoidal_shares(np.array(material.orders)[:, None], np.linspace(0.0, most, samples)))
    return found, np.concatenate(tables)


def grating_texels(item: SceneObject, rows: GratingRows | None) -> np.ndarray:
    """A GRATING and one GRATING_ORDER an order: uint32 (texels, 4)."""
    grating = item.material
    assert isinstance(grating, Grating)
    head = GRATING.zeros(1)
    head["lines"] = grating.lines_in_world(item.object_to_world)
    head["orders"] = len(grating.orders)
    head["lines_per_um"], head["spread_per_um"] = 1e-3 * grating.lines_per_mm, grating.spread_per_um
    head["relief"], head["index"], head["profile"] = grating.relief, grating.relief_index, grating.profile_code
    if rows is not None:
        head["row"], head["most_waves"] = rows
    orders = GRATING_ORDER.zeros(len(grating.orders))
    orders["shift_per_um"], orders["efficiency"] = grating.shift_per_um, grating.fixed_shares
    orders["left"], orders["number"] = grating.left, grating.orders
    return np.concatenate([record.view("<u4").reshape(-1, 4) for record in (head, orders)])
