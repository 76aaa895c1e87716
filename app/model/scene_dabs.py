"""What the dispersion brush painted, in the words of a scene file: `local_dispersion = [{ position, radius, … },
…]`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from .fields import Number, Vector, read_fields, write_fields
from .io.scene_table import SceneTable
from .scene import Dab, Material

KEY = "local_dispersion"
MAX_DAB_LOG2 = 60.0
"""Doublings one dab may ask for: more than any gain can use."""


def read_dabs(table: SceneTable, material: Material) -> tuple[Dab, ...]:
    """`local_dispersion` of an object's table, oldest first. Raises UserError on anything but a diffuse object."""
    if table.has(KEY) and not material.receives:
        table.fail(KEY, "is painted on what receives the caustic; this object is not diffuse")
    return tuple(_read_dab(entry) for entry in table.tables(KEY))


_FIELDS = (
    Vector("position"),
    Number("radius", above=0.0),
    Number("falloff", 0.5, at_least=0.0, at_most=1.0),
    # An eraser's own gain counts for nothing, but is kept where it is not the default.
    Number("log2_gain", 0.0, optional=True, at_least=-MAX_DAB_LOG2, at_most=MAX_DAB_LOG2),
    Number("erase", 0.0, optional=True, at_least=0.0, at_most=1.0),
)


def _read_dab(table: SceneTable) -> Dab:
    dab = Dab(**read_fields(_FIELDS, table))
    table.finish("a touch of the dispersion brush")
    return dab


def describe_dabs(dabs: Sequence[Dab]) -> list[dict[str, Any]]:
    """The tables that `read_dabs` makes into `dabs`."""
    return [write_fields(_FIELDS, dab) for dab in dabs]
