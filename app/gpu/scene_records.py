"""Records of what is in a scene, as shaders read them. Gratings (`shaders/lib/grating.glsl`) come with tables for what
has no closed form there."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..model.materials import Grating
from ..model.optics.colorimetry import VISIBLE_NM
from ..model.optics.gratings import line_quantiles, sinusoidal_shares
from ..model.scene import Scene, SceneObject
from .schema import Field, Struct

TRIANGLE = Struct(
    "Triangle",
    (
        Field("vertex", "vec3", "first corner, GPU space"),
        Field("object", "uint", "scene object index"),
        Field("edge1", "vec3", "second corner minus first"),
        Field("normals", "uint", "first of three corner normals, or NONE for a flat facet"),
        Field("edge2", "vec3", "third corner minus first"),
        Field("source", "uint", "global index before the tree reordered them: objects in scene order"),
    ),
    texels=True,
)
SOLID = Struct(
    "Solid",
    (Field("first_plane", "uint"), Field("plane_count", "uint"), Field("object", "uint"), Field("reserved", "uint")),
)
PIECE = Struct(
    "Piece",
    (
        Field("row_x", "vec3", "where |rows · q|² - 2 linear · q - constant <= 0, q from `origin`, GPU space"),
        Field("object", "uint", "scene object index"),
        Field("row_y", "vec3"),
        Field("is_last", "uint", "1: the next one is another solid's"),
        Field("row_z", "vec3"),
        Field("constant", "float"),
        Field("origin", "vec3"),
        Field("is_plane", "uint", "1: the rows are zero"),
        Field("linear", "vec3"),
        Field("reserved", "uint"),
    ),
    texels=True,
)
OBJECT = Struct(
    "Object",
    (
        Field("kind", "uint", "0 black, 1 diffuse, 2 mirror, 3 dielectric, 4 grating, 5 thin sheet, 6 polariser"),
        Field(
            "medium",
            "uint",
            "row of the index table (dielectric, sheet; grating: its wavelength); of others 0 where the mesh is closed",
        ),
        Field(
            "weight_row", "uint", "row of absorption (1/GPU unit) or reflectance over x, texel of a grating, or NONE"
        ),
        Field(
            "stack_bit", "uint", "bit of this solid in a ray's inside mask, by priority; NONE where it overlaps nothing"
        ),
        Field(
            "receiver",
            "uint",
            "number of its front, its back's is next; dielectric, polariser: texel of its Crystal; or NONE",
        ),
        Field("group", "uint", "spectral group of the glass, or NONE"),
        Field("first_triangle", "uint", "global source index of its first triangle"),
        Field(
            "texture",
            "uint",
            "its picture in the texture store; of glass: row of what its surface lets through; or NONE",
        ),
        Field(
            "colour",
            "vec4",
            "linear Rec.709 reflectance (diffuse); of what is specular GGX's width (0: polished; below 0: - 1 - the "
            "texel of its film's Wedge), its film, 1 + its "
            "first row (0: none), its size (half of its bounds' diagonal, GPU units), its width's table's row",
        ),
    ),
    texels=True,
)
GRATING = Struct(
    "Grating",
    (
        Field("lines", "vec3", "unit, along the lines"),
        Field("orders", "uint", "how many follow it in the same section, one GratingOrder each"),
        Field("lines_per_um", "float"),
        Field("spread_per_um", "float", "one over the width that light covers, 1/µm; 0: its lines have no width"),
        Field("relief", "float", "of its grooves (`gratings.waves_of`)"),
        Field("index", "float", "of what they are in; 0: the grating reflects"),
        Field("profile", "uint", "PROFILE_…"),
        Field("row", "uint", "of a sine's first order's shares, from GRATING_ROW on"),
        Field("most_waves", "float", "where those rows end"),
        Field("reserved", "float"),
    ),
    texels=True,
)
GRATING_ORDER = Struct(
    "GratingOrder",
    (
        Field("shift_per_um", "float", "added to a direction's tangential part, per micrometre of wavelength: m / Λ"),
        Field("efficiency", "float", "share of the light, or with a profile a factor of it"),
        Field("left", "float", "share that the orders before have left"),
        Field("number", "float", "m"),
    ),
    texels=True,
)
WEDGE = Struct(
    "Wedge",
    (
        Field("origin", "vec3", "GPU space"),
        Field("bend", "float", "of a film's thickness, as a share of the thickest place's: 1/GPU unit²"),
        Field("slope", "vec3", "likewise, 1/GPU unit"),
        Field("least", "float", "thickness at the origin"),
    ),
    texels=True,
)
CRYSTAL = Struct(
    "Crystal",
    (
        Field("axis", "vec3", "unit, in the world: of the optic axis; of a polariser"),
        Field("extraordinary", "uint", "row of the index table: n_e; of a polariser the wavelength, um"),
        Field("passed_along", "float", "polariser: share of what is polarised along its axis"),
        Field("passed_across", "float", "likewise across it"),
        Field("retardance_um", "float", "how far that is behind"),
        Field("group", "uint", "spectral group of n_e, or NONE"),
    ),
    texels=True,
)
SCENE_STRUCTS = (TRIANGLE, SOLID, PIECE, OBJECT, GRATING, GRATING_ORDER, WEDGE, CRYSTAL)


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
