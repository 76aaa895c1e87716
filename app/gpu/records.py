"""Every record that crosses between Python and GLSL, with units.

"GPU space" is the scene moved and scaled by a power of two so that its refracting and
reflecting objects lie within about one unit of the origin (`gpu_space.GpuSpace`): float32
then resolves 1e-7 of the glass whatever the scene's own units and origin are.
Flux stays in watts of the scene; only lengths are scaled.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..features.features import Features
from ..model.tint_levels import LEVELS
from .schema import Field, Struct

NONE = 0xFFFFFFFF
"""Index that means 'there is none'."""

# Photon and ray flags.
FLAG_FOOTPRINT_DROPPED = 1
"""Columns overflowed: the photon keeps its flux and is splatted as one texel (counted)."""
FLAG_BAND_FINAL = 2
"""The band was just cut at total internal reflection: do not cut again at this surface."""
FLAG_INSIDE = 4
"""The ray travels on the inner side of `last_object`."""
FLAG_EXTRAORDINARY = 8
"""In a crystal, the ray is the extraordinary wave."""
FLAG_OFF_LATTICE = 16
"""Chance has turned the ray, and its neighbours on the lattice went elsewhere."""
TINT_BIT = 3
"""From here on, up to the next, a photon's flags are its level (`model.tint_levels`)."""
LATTICE_BIT = 8
"""From here on a photon's flags are the number of points of the golden-ratio lattice that it lies on; 0: on none."""
EDGE_BIT = 8
"""From here on a photon's depth is where its light's emission ends (`Features.light_edges`); 0: not near it."""


_COMPANIONS = (
    Field(
        "companion_x", "vec4", "xyz: spectral coordinates of the wavelengths that share the path, w: 1 while they do"
    ),
    Field("companion_throughput", "vec4", "xyz: their weights of the light's spectral power"),
)


def photon_record(groups: int, hero: bool = False, packs: bool = False, charts: bool = True) -> Struct:
    """One landing on a receiver. `groups`: number of spectral groups (0 where nothing disperses); `hero`: with the
    wavelengths that share its path; `packs`: `DeviceTraits.packs_records`; `charts`: receivers may be curved.

    The photon covers the spectral band [x_lo, x_hi]; its path was traced at x_anchor. At spectral
    coordinate x it lies at position + sum_g dposition_dvar[g] (var_g(x) - var_g(x_anchor)).
    """
    spectral = tuple(
        Field(f"dposition_dvar{g}", "vec4", "xyz: GPU space per unit of the group's variable", 1, "columns 18 xyz")
        for g in range(groups)
    )
    record = Struct(
        "PhotonRecord",
        (
            Field("position", "vec3", "GPU space"),
            Field("flux_w", "float", "accounted radiant flux of the band, W", 1, "float 27"),
            Field("dposition_ds", "vec3", "GPU space per lattice spacing (footprint axis)", 1, "columns 18"),
            Field("x_lo", "float", "band start, spectral coordinate", 1, "unit 21"),
            Field("dposition_dt", "vec3", "GPU space per lattice spacing (footprint axis)", 1, "columns 18"),
            Field("x_hi", "float", "band end, spectral coordinate", 1, "unit 21"),
            Field("throughput", "vec3", "weight of the light's power at x_lo, x_anchor, x_hi", 1, "columns 19"),
            Field("x_anchor", "float", "spectral coordinate of the traced path", 1, "unit 21"),
            Field("triangle", "uint", "global index of the receiver's triangle", 1, "" if charts else "= 0u"),
            Field("receiver", "uint", "number of the receiver's side", 1, "whole 16"),
            Field("photon_id", "uint", "index on the emission lattice of the pass"),
            Field("light_and_source", "uint", "bits 0-7 light, 8-15 spectral band of the pass, 16-31 object first met"),
            Field("branch_key", "uint", "hash of the choices of the path"),
            Field(
                "flags",
                "uint",
                "FLAG_*; from TINT_BIT on, level of its tint; from LATTICE_BIT on, points of its lattice",
            ),
            Field("depth", "uint", "specular events; from EDGE_BIT on where its light ends (`packed_edge`)"),
            Field("fan", "uint", "two halves: change of the footprint's W (lib/fan.glsl) per lattice spacing"),
            *spectral,
            *(_COMPANIONS if hero else ()),
        ),
        texels=True,
    )
    return replace(record, packs=packs)


def photon_record_of(features: Features, packs: bool = False) -> Struct:
    """`photon_record` as a scene's programs have it."""
    return photon_record(features.spectral_groups, features.hero, packs, features.charts)


def specular_events(photons: np.ndarray) -> np.ndarray:
    """Number of events on the path of each photon record (n,)."""
    return photons["depth"] & ((1 << EDGE_BIT) - 1)


PLACEMENT = Struct(
    "Placement",
    (
        Field("row_u", "vec4", "homogeneous texel x: dot(row_u.xyz, position) + row_u.w; position in GPU space"),
        Field("row_v", "vec4", "y likewise"),
        Field("row_w", "vec4", "the weight W by which both are divided, likewise; positive where anything is drawn"),
        Field("rect", "vec4", "x0, y0, x1, y1 in atlas texels: nothing is drawn outside"),
        Field("texel_area", "float", "scene unit² per texel where W is 1, times W³ elsewhere"),
        Field("next", "uint", "the coarser placement of the same receiver, or NONE"),
        Field("kind", "uint", "0 flat window, 1 chart triangle, 2 flat window on a picture's pixels"),
        Field("blurred", "uint", "the same window in wider texels, for broad splats, or NONE"),
    ),
)

RECEIVER = Struct(
    "Receiver",
    (
        Field("reflectance_rgb", "vec3", "linear Rec.709; 1 where the spectral table already holds it"),
        Field(
            "kind",
            "uint",
            "0 flat: `placement` is the finest window; 1 charts: placement + (triangle - first_triangle)",
        ),
        Field("placement", "uint", "index of the first placement"),
        Field("first_triangle", "uint", "global index of the object's first triangle"),
        Field("reflectance_class", "uint", "which reflectance the spectral tables were folded with"),
        Field("object", "uint", "scene object index"),
    ),
)

GAIN_BOX = Struct(
    "GainBox",
    (
        Field(
            "row_x",
            "vec4",
            "voxel x = dot(row_x.xyz, position) + row_x.w; position in GPU space; voxel centres at integers",
        ),
        Field("row_y", "vec4", "voxel y likewise"),
        Field("row_z", "vec4", "voxel z likewise"),
        Field(
            "voxels", "uvec4", "their numbers along x, y, z (0: no local gain), and the first one's index in the gains"
        ),
    ),
)
"""Where one receiver's local gains of dispersion lie (`model.local_dispersion.GainGrid`)."""


_POLARISATION = (
    Field("stokes_q", "vec3", "of intensity 1, at x_lo, x_anchor, x_hi; 1: along the axis"),
    Field("axis_x", "float", "unit vector across the ray"),
    Field("stokes_u", "vec3", "1: halfway from the axis to cross(direction, axis)"),
    Field("axis_y", "float"),
    Field("stokes_v", "vec3", "circular"),
    Field("axis_z", "float"),
)
_COMPANIONS_POLARISATION = tuple(
    Field(f"companion_{name}", "vec4", f"xyz: stokes_{name} of the wavelengths that share the path") for name in "quv"
)


def ray_record(
    columns: int,
    hero: bool = False,
    polarised: bool = False,
    flights: bool = False,
    tinted: bool = False,
    packs: bool = False,
) -> Struct:
    """State of one ray between two surfaces; `columns` derivative columns, spatial ones first; `hero` as above;
    `polarised`: with its state of polarisation; `flights`: with how far it has come through haze; `tinted`: and through
    the glass whose tint has levels. `packs`: `DeviceTraits.packs_records`."""
    fields = [
        Field("position", "vec3", "GPU space"),
        Field("flux_w", "float", "accounted radiant flux of the band, W"),
        Field("direction", "vec3", "unit, propagation"),
        Field("footprint_scale", "float", "grows as 1/sqrt(survival) where roulette thinned the lattice"),
        Field("throughput", "vec3", "weight of the light's spectral power at x_lo, x_anchor, x_hi"),
        Field("x_anchor", "float", "spectral coordinate of the traced path"),
        Field("x_lo", "float", "band start"),
        Field("x_hi", "float", "band end"),
        Field("survival", "float", "share of the emitted weight still carried, before roulette's boost"),
        Field("photon_id", "uint", "index on the emission lattice of the pass"),
        Field("light_and_source", "uint", "as in PhotonRecord"),
        Field("branch_key", "uint", "hash of the choices so far"),
        Field("flags", "uint", "FLAG_*"),
        Field("depth", "uint", "specular events so far"),
        Field("last_primitive", "uint", "facet the ray left, or NONE"),
        Field("inside_mask", "uint", "medium stack: one bit a solid the ray is inside of"),
        Field("last_object", "uint", "its object, or NONE", 1, "index 16"),
        Field("inside_object", "uint", "without a medium stack: the solid it is inside of, or NONE", 1, "index 16"),
    ]
    if columns:
        fields += [
            Field(
                "dposition",
                "vec4",
                "xyz: GPU space per lattice spacing, or per unit of a group's variable; w of the first: where its light"
                " ends (`packed_edge`), as a number",
                columns,
                "columns 19 xyz, first 32 w",
            ),
            Field("ddirection", "vec4", "xyz: per the same", columns, "columns 19 xyz"),
        ]
    fields += _COMPANIONS if hero else ()
    fields += _POLARISATION if polarised else ()
    fields += _COMPANIONS_POLARISATION if hero and polarised else ()
    fields += (Field("flown", "vec4", "x: way outside glass so far, GPU units"),) if flights else ()
    fields += (Field("tinted", "vec4", "x: way through that glass so far, times its rate"),) if tinted else ()
    return Struct("RayRecord", tuple(fields), True, packs)


def ray_record_of(features: Features, packs: bool = False) -> Struct:
    """`ray_record` as a scene's programs have it."""
    is_tinted = features.tint_levels > 0
    return ray_record(features.columns, features.hero, features.polarised, features.flights, is_tinted, packs)


FLIGHT = Struct(
    "Flight",
    (
        Field("position", "vec3", "where it begins, GPU space"),
        Field("distance", "float", "to what it meets, GPU units; FAR_DISTANCE where it meets nothing"),
        Field("direction", "vec3", "unit, propagation"),
        Field("flux_w", "float", "of its band, W; 0: inside glass"),
        Field("dposition_ds", "vec3", "GPU space per lattice spacing"),
        Field("flown", "float", "way outside glass before it, GPU units"),
        Field("dposition_dt", "vec3", "likewise"),
        Field("light_and_source", "uint", "as in PhotonRecord"),
        Field("ddirection_ds", "vec3", "change of the direction per lattice spacing"),
        Field("x_lo", "float", "band, spectral coordinates"),
        Field("ddirection_dt", "vec3", "likewise"),
        Field("x_hi", "float"),
        Field("dposition_dband", "vec3", "from one end of the band to the other"),
        Field("photon_id", "uint", "as in PhotonRecord"),
        Field("ddirection_dband", "vec3", "likewise"),
        Field("what", "uint", "bit 0: it ends on glass or a mirror; from bit 8: specular events before it"),
    ),
    texels=True,
)
"""A stretch between two surfaces, of rays that are traced for haze (`Features.flights`)."""


OUTCOME = Struct(
    "Outcome",
    (
        Field(
            "what",
            "uint",
            "bits 0, 1: child rays; 2: photon; 3: `flux_w` starts here; 8-15: fall-backs; 16-23: where `flux_w` went",
        ),
        Field("flux_w", "float", "flux that ended (emission: started) here, W"),
        Field("absorbed_w", "float", "flux absorbed on the way here, W"),
        Field("roulette_w", "float", "flux that roulette took (> 0) or gave (< 0), W"),
    ),
    texels=True,
)

CATEGORIES = ("deposited", "absorbed", "escaped", "direct", "lost_depth", "lost_numeric", "beams")
"""Where flux may end. `direct`: met a receiver without any specular event (the camera pass draws it). `beams`: met an
object first whose light beams carry."""

FALLBACKS = ("footprint_dropped", "shading_normal", "band_cut", "queue_overflow")
"""Counted fall-backs, in the order of `Outcome.what`'s bits from 8."""

WATTS = len(CATEGORIES) + 3
"""Sums of flux in a tally."""

CHUNK_COUNT = Struct(
    "ChunkCount",
    (
        Field("rays", "uint"),
        Field("photons", "uint"),
        Field("ray_base", "uint", "exclusive prefix sum"),
        Field("photon_base", "uint", "exclusive prefix sum"),
        Field("flux_w", "float", "ended flux by CATEGORIES, W; sums over the whole batch", len(CATEGORIES)),
        Field("absorbed_w", "float", "absorbed in glass, W"),
        Field("roulette_w", "float", "balance of roulette, W"),
        Field("emitted_w", "float", "flux emitted, W"),
        Field("fallbacks", "uint", "by FALLBACKS", len(FALLBACKS)),
    ),
)
QUEUE_STATE = Struct(
    "QueueState",
    (
        Field("alive", "uint", "rays of the running step"),
        Field("next_alive", "uint"),
        Field("dispatched", "uint", "rays of the step whose outcomes are being listed"),
        Field("ray_capacity", "uint"),
        Field("photon_first", "uint", "photons of earlier steps of the batch"),
        Field("photons_new", "uint", "photons of this step"),
        Field("photon_capacity", "uint"),
        Field("overflow", "uint", "rays and photons that found no room"),
        Field("trace_groups", "uvec4", "indirect dispatch sizes"),
        Field("chunk_groups", "uvec4", "over the outcomes of this step"),
        Field("next_chunk_groups", "uvec4", "over the outcomes of the next step"),
        Field("gather_groups", "uvec4"),
        Field("flights", "uint", "of all rays, up to what they meet, since the batch began"),
        Field("reserved", "uint", "", 3),
    ),
)
POOL_TALLY = Struct(
    "PoolTally",
    (
        Field("watts", "float", "ended flux by CATEGORIES, then absorbed, roulette's balance, emitted; W", WATTS),
        Field("fallbacks", "uint", "by FALLBACKS", len(FALLBACKS)),
    ),
)
"""What one work group has counted of a batch."""

POOL_STATE = Struct(
    "PoolState",
    (
        Field("alive", "uint", "rays of the running dispatch"),
        Field("survivors", "uint", "of these, rays of earlier dispatches; the rest is new"),
        Field("born_first", "uint", "place in the ring of free slots of the first new one"),
        Field("capacity", "uint", "slots for rays"),
        Field("taken", "uint", "place in the ring of the next free slot"),
        Field("taken_before", "uint", "when the dispatch began"),
        Field("free_end", "uint", "place behind the last slot that was free then"),
        Field("returned", "uint", "place where the next slot is given back"),
        Field("next_survivors", "uint"),
        Field("photons", "uint", "landed since the batch began"),
        Field("photon_capacity", "uint"),
        Field("flights", "uint", "of all rays, up to what they meet, since the batch began"),
        Field("trace_groups", "uvec4", "indirect dispatch size"),
        Field("groups_done", "uint", "of the running dispatch"),
        Field("dispatches", "uint", "that had a ray"),
        Field("lent", "uint", "of the free slots those at the end, to whoever follows all that becomes of a ray"),
        Field("overflow", "uint", "rays and photons that found no room"),
        Field("drawn", "uint", "photons to be drawn: 0 where the batch has to be traced again"),
        Field("watts", "float", "tally of all groups", WATTS),
        Field("fallbacks", "uint", "likewise", len(FALLBACKS)),
        Field("emitted", "uint", "rays that the batch began with"),
    ),
)
MASK_SIZE = 64
"""Side of the emission mask in cells."""

MAX_BANDS = 32
"""Spectral bands of one light's pass."""

EMIT_PARAMETERS = Struct(
    "EmitParameters",
    (
        Field("origin", "vec3", "point, spot, area: light centre; plane: centre of the domain; GPU space"),
        Field("weight", "float", "domain measure per lattice point: sr, unit², or sr·unit²"),
        Field("axis", "vec3", "axis of the azimuthal plane, or the beam's direction"),
        Field("lamp_step", "float", "footprint sides per extent of what a point stands for on the light; 0: a point"),
        Field("tangent", "vec3", "domain's first axis"),
        Field("back", "float", "plane: how far before the plane rays start, GPU space"),
        Field("bitangent", "vec3", "domain's second axis"),
        Field("is_disc", "uint", "shape of light or aperture"),
        Field("light_axis", "vec3", "spot axis, or area light's normal"),
        Field("seed", "uint"),
        Field("light_u", "vec3", "area: half extent; aperture: 1 / half extent (0: none), GPU space; profile: its C0"),
        Field("light", "uint"),
        Field("light_v", "vec3", "likewise"),
        Field("lattice_count", "uint", "points of one sub-lattice"),
        Field("aperture_centre", "vec3", "GPU space"),
        Field("first", "uint", "first lattice point of the batch"),
        Field("rect", "vec4", "domain corner and size"),
        Field(
            "cone",
            "vec2",
            "spot: inner, outer half angle, rad; plane: tangents of half a disc's angle, 0; of a rectangle's",
        ),
        Field("shift", "uvec2", "lattice shift modulo 2^32"),
        Field("shift_light", "uvec2", "shift of the points on the light"),
        Field("light_place", "vec2", "where on the light in [0, 1]² when there is a single point"),
        Field("shift_spectral", "uint"),
        Field("stride", "uint", "step between the batch's lattice points"),
        Field("count", "uint", "rays of the batch: lattice points times sub-lattices"),
        Field("band_count", "uint"),
        Field("light_points", "uint", "points on the light (sun's disc, area light); each has a sub-lattice per band"),
        Field("profile", "uint", "where the light's intensity table begins"),
        Field("spacing", "vec2", "of one sub-lattice along the domain's axes, domain coordinates"),
        Field("bands", "vec4", "x_lo, x_hi, x_anchor, W per unit weight", MAX_BANDS),
        Field(
            "mask",
            "uint",
            "one bit a cell of the domain: may a ray from it meet a specular object?",
            MASK_SIZE * MASK_SIZE // 32,
        ),
        Field("thinned", "uint", "one bit a cell: are only some of its points emitted?", MASK_SIZE * MASK_SIZE // 32),
        Field("thinned_chance", "float", "of a point in such a cell to be emitted"),
        Field("row_s", "float", "what the first side of a footprint gains along itself where a point stands for a row"),
        Field("row_t", "float", "the second"),
        Field("row_st", "float", "each along the other"),
    ),
)


def trace_parameters(objects: int = 0) -> Struct:
    """What rays of one light are traced by, in a scene of so many objects."""
    return Struct(
        "TraceParameters",
        (
            Field("max_depth", "uint", "specular events"),
            Field("split_threshold", "float", "survival below which a child plays roulette"),
            Field("power_row", "uint", "row of the light's cumulative power over x"),
            Field("lattices", "uint", "sub-lattices of the pass: photon_id = lattice point · lattices + sub-lattice"),
            Field("lattice_bits", "uint", "points of each sub-lattice, from LATTICE_BIT on; 0: rays lie on none"),
            Field("lattice_shift", "uint", "of the first sub-lattice's points across, as emitted"),
            Field("lattices_together", "uint", "so many sub-lattices after each other have one shift"),
            Field("surface_key", "uint", "of the numbers for microfacets of rough surfaces"),
            Field("tint_rate", "float", "1/GPU unit: a way w through the glass whose tint has levels counts rate · w"),
            Field("tint_row", "uint", "row of its absorption"),
            Field("tint_key", "uint", "of the numbers by which levels are rounded"),
            Field(
                "widest_on_surface", "float", "side of a footprint, of the size of the glass or mirror that it is on"
            ),
            Field("widest_turn", "float", "of a footprint's directions behind a surface, rad a side"),
            Field("paths", "float", "of the pass, over all of its sub-lattices: each has microfacets of its own"),
            Field("widest_sweep", "float", "of a ray's directions over its band, rad"),
            Field("narrowest_landing", "float", "band that is cut where it meets two surfaces, or one and none"),
            Field("tint_halfway", "vec4", "odds for the next level, of a way in the middle between both", LEVELS // 4),
            Field(
                "beam_objects",
                "uvec4",
                "one bit an object: who meets it first is left to beams",
                max(2, -(-objects // 128)),
            ),
        ),
    )
