"""How a receiver's surface is finished: a glossy coat over its diffuse base, and how rough that base is."""

from __future__ import annotations

from typing import Any

from ..fields import Animated, Number, Row
from ..io.scene_table import SceneTable

USUAL_ROUGHNESS = 0.25
"""Of a coat that somebody asks for without saying more: a polished table."""
USUAL_COAT_INDEX = 1.5
SMOOTH_ROUGHNESS = 0.03
"""A coat less rough than this is met as a perfectly smooth one: its lobe is narrower than a pixel."""

ROUGHNESS = Number(
    "roughness",
    None,
    optional=True,
    at_least=0.0,
    at_most=1.0,
    row=Row(
        "Roughness",
        "Of the coat: 0 is polished like glass, 0.25 a varnished table, 1 reflects to all sides.",
        0.0,
        1.0,
        USUAL_ROUGHNESS,
        "%.3f",
        is_slider=True,
    ),
    animated=Animated("Roughness of a receiver's coat", 0.0, 1.0),
)
COAT_INDEX = Number(
    "coat_index",
    USUAL_COAT_INDEX,
    optional=True,
    at_least=1.0,
    at_most=4.0,
    row=Row(
        "Coat's index",
        "Refractive index of the coat: how much it reflects, 4 % at 1.5 where it is seen from straight above.",
        1.0,
        4.0,
        USUAL_COAT_INDEX,
        "%.3f",
        is_slider=True,
    ),
    animated=Animated("Refractive index of a receiver's coat", 1.0, 4.0),
)
DIFFUSE_ROUGHNESS = Number(
    "diffuse_roughness",
    0.0,
    optional=True,
    at_least=0.0,
    at_most=1.0,
    row=Row(
        "Diffuse roughness",
        "0 is Lambertian; with 1 (plaster, clay, the moon) what is lit from behind the camera looks flat.",
        0.0,
        1.0,
        0.0,
        "%.3f",
        is_slider=True,
    ),
    animated=Animated("Roughness of a receiver's diffuse base", 0.0, 1.0),
)


def read_finish(table: SceneTable) -> dict[str, Any]:
    """`roughness`, `coat_index` and `diffuse_roughness` as attributes of a `Diffuse`."""
    found: dict[str, Any] = COAT_INDEX.read(table) | DIFFUSE_ROUGHNESS.read(table)
    if table.has("roughness"):
        found |= ROUGHNESS.read(table)
    elif table.has("coat_index"):
        table.fail("coat_index", "is that of a coat, and there is none; give its 'roughness' (0 to 1) as well")
    if found["diffuse_roughness"] > 0.0 and table.has("reflectance"):
        table.fail(
            "diffuse_roughness", "goes with 'colour' only; leave it out, or give a 'colour' in place of 'reflectance'"
        )
    return found
