"""Every record that crosses between Python and GLSL, with units.

"GPU space" is the scene moved and scaled by a power of two so that its refracting and
reflecting objects lie within about one unit of the origin (`scene_buffers.GpuSpace`): float32
then resolves 1e-7 of the glass whatever the scene's own units and origin are.
Flux stays in watts of the scene; only lengths are scaled.
"""

from __future__ import annotations

from app.gpu.schema import Field, Struct

NONE = 0xFFFFFFFF
"""Index that means 'there is none'."""

# Photon and ray flags.
FLAG_FOOTPRINT_DROPPED = 1
"""Columns overflowed: the photon keeps its flux and is splatted as one texel (counted)."""
FLAG_BAND_FINAL = 2
"""The band was just cut at total internal reflection: do not cut again at this surface."""
FLAG_INSIDE = 4
"""The ray travels on the inner side of `last_object`."""


def photon_record(groups: int) -> Struct:
    """One landing on a receiver. `groups`: number of spectral groups (0 where nothing disperses).

    The photon covers the spectral band [x_lo, x_hi]; its path was traced at x_anchor. At spectral
    coordinate x it lies at position + sum_g dposition_dvar[g] (var_g(x) - var_g(x_anchor)).
    """
    spectral = tuple(Field(f"dposition_dvar{g}", "vec4", "xyz: GPU space per unit of the group's variable") for g in range(groups))
    return Struct(
        "PhotonRecord",
        (
            Field("position", "vec3", "GPU space"),
            Field("flux_w", "float", "accounted radiant flux of the band, W"),
            Field("dposition_ds", "vec3", "GPU space per lattice spacing (footprint axis)"),
            Field("x_lo", "float", "band start, spectral coordinate"),
            Field("dposition_dt", "vec3", "GPU space per lattice spacing (footprint axis)"),
            Field("x_hi", "float", "band end, spectral coordinate"),
            Field("throughput", "vec3", "weight of the light's spectral power at x_lo, x_anchor, x_hi"),
            Field("x_anchor", "float", "spectral coordinate of the traced path"),
            Field("triangle", "uint", "global index of the receiver's triangle"),
            Field("receiver", "uint", "index of the receiver"),
            Field("photon_id", "uint", "index on the emission lattice of the pass"),
            Field("light_and_source", "uint", "bits 0-7 light, 8-15 spectral band of the pass, 16-31 object first met"),
            Field("branch_key", "uint", "hash of the choices of the path"),
            Field("flags", "uint", "FLAG_*"),
            Field("depth", "uint", "specular events on the path"),
            Field("cosine", "float", "|cos| of incidence on the receiver"),
            *spectral,
        ),
    )


PLACEMENT = Struct(
    "Placement",
    (
        Field("row_u", "vec4", "texel x = dot(row_u.xyz, position) + row_u.w; position in GPU space"),
        Field("row_v", "vec4", "texel y likewise"),
        Field("rect", "vec4", "x0, y0, x1, y1 in atlas texels: nothing is drawn outside"),
        Field("texel_area", "float", "scene unit² per texel"),
        Field("next", "uint", "the coarser placement of the same receiver, or NONE"),
        Field("kind", "uint", "0 flat window, 1 chart triangle"),
        Field("reserved", "uint", ""),
    ),
)

RECEIVER = Struct(
    "Receiver",
    (
        Field("reflectance_rgb", "vec3", "linear Rec.709; 1 where the spectral table already holds it"),
        Field("kind", "uint", "0 flat: `placement` is the finest window; 1 charts: placement + (triangle - first_triangle)"),
        Field("placement", "uint", "index of the first placement"),
        Field("first_triangle", "uint", "global index of the object's first triangle"),
        Field("reflectance_class", "uint", "which reflectance the spectral tables were folded with"),
        Field("object", "uint", "scene object index"),
    ),
)
