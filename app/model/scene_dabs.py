"""What the dispersion brush painted, in the words of a scene file: `local_dispersion = [{ position, radius, … },
…]`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from .io.scene_table import SceneTable
from .scene import Dab, Diffuse, Material

KEY = "local_dispersion"
MAX_DAB_LOG2 = 60.0
"""Doublings one dab may ask for: more than any gain can use."""


def read_dabs(table: SceneTable, material: Material) -> tuple[Dab, ...]:
    """`local_dispersion` of an object's table, oldest first. Raises UserError on anything but a diffuse object."""
    if table.has(KEY) and not isinstance(material, Diffuse):
        table.fail(KEY, "is painted on what receives the caustic; this object is not diffuse")
    return tuple(_read_dab(entry) for entry in table.tables(KEY))


def _read_dab(table: SceneTable) -> Dab:
    dab = Dab(
        position=table.vector("position"),
        radius=table.number("radius", above=0.0),
        log2_gain=table.number("log2_gain", 0.0, at_least=-MAX_DAB_LOG2, at_most=MAX_DAB_LOG2),
        falloff=table.number("falloff", 0.5, at_least=0.0, at_most=1.0),
        erase=table.number("erase", 0.0, at_least=0.0, at_most=1.0),
    )
    table.finish("a touch of the dispersion brush")
    return dab


def describe_dabs(dabs: Sequence[Dab]) -> list[dict[str, Any]]:
    """The tables that `read_dabs` makes into `dabs`."""
    told = []
    for dab in dabs:
        values: dict[str, Any] = {"position": list(dab.position), "radius": dab.radius, "falloff": dab.falloff}
        # An eraser's own gain counts for nothing, but is kept where it is not the default.
        if dab.log2_gain != 0.0:
            values["log2_gain"] = dab.log2_gain
        if dab.erase != 0.0:
            values["erase"] = dab.erase
        told.append(values)
    return told
