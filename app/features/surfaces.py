"""Rows of the table: what surfaces light meets on its way, and how they are found."""

from __future__ import annotations

from dataclasses import dataclass

from ..model.contacts import contacts, overlapping_solids
from ..model.optics.thin_films import ABOVE
from ..model.settings import has_beams
from .facts import Facts, beam_objects, listed, names, why_no_beams
from .row import feature, size_words

MAX_LOOSE_TRIANGLES = 24
"""Up to so many triangles a plain loop beats a tree."""


@dataclass(frozen=True, kw_only=True)
class SurfaceFeatures:
    """Features of light's way from surface to surface."""

    dielectrics: bool = feature(
        "refraction",
        lambda facts: bool(facts.glass),
        symbol="HAS_DIELECTRIC",
        why="there is glass",
        why_not="there is no glass",
        names=("refract_direction", "cross_boundary", "cross_glass"),
        cost=lambda facts, sizes: (
            f"{size_words(sizes.spectrum * facts.distinct_glasses)} of indices; two children a surface"
        ),
    )
    sheets: bool = feature(
        "thin sheets",
        lambda facts: any(item.material.thin for item in facts.glass),
        symbol="HAS_SHEET",
        why=lambda facts: f"of {names(facts.having(lambda material: material.thin))}",
        why_not="no glass is thin",
        names=("both_faces", "KIND_SHEET"),
        cost="one more kind of surface; indices of both sides are looked up",
        requires=("dielectrics",),
    )
    """Some glass is a thin sheet, with one medium on both sides."""
    filters: bool = feature(
        "surface colours",
        lambda facts: any(item.material.filters for item in facts.glass),
        symbol="SURFACE_FILTERS",
        why=lambda facts: f"of {names(facts.having(lambda material: material.filters))}",
        why_not="no glass has a coloured surface",
        names=("filter_by", "passed"),
        cost=lambda facts, sizes: f"3 lookups a surface, {size_words(sizes.spectrum)} a colour",
        requires=("dielectrics",),
    )
    """Some surface of glass lets through only a share of what enters."""
    films: bool = feature(
        "thin films",
        lambda facts: bool(facts.films),
        symbol="HAS_FILM",
        why=lambda facts: f"on {names(facts.films)}",
        why_not="no surface has a film, and no mirror is of metal",
        names=("film_mean", "film_met", "film_over"),
        cost=lambda facts, sizes: (
            f"{size_words((ABOVE + 1) * sizes.spectrum)} and more a film; 16 lookups an event and lobe"
        ),
    )
    """Some surface carries thin films, or is of metal: its shares are looked up by wavelength and angle."""
    varied_films: bool = feature(
        "films of varying thickness",
        lambda facts: any(item.material.film.profile for item in facts.films),
        symbol="FILM_VARIES",
        why=lambda facts: f"on {names(item for item in facts.films if item.material.film.profile)}",
        why_not="no film's thickness varies",
        names=("wedge_at", "film_share_of_thickest"),
        cost="two lookups more for each of a film's",
        requires=("films",),
    )
    """Some film is thicker in one place than in another."""
    absorption: bool = feature(
        "absorption",
        lambda facts: bool(facts.absorbing),
        symbol="ABSORPTION",
        why="some glass absorbs",
        why_not="all glass is clear",
        names=("medium_weight_row", "light: absorb"),
        cost=lambda facts, sizes: f"3 lookups a flight, {size_words(sizes.spectrum * len(facts.absorbing))}",
        requires=("dielectrics",),
    )
    rough: bool = feature(
        "rough surfaces",
        lambda facts: bool(facts.having(lambda material: material.is_rough)),
        symbol="ROUGH_SURFACES",
        why=lambda facts: f"of {names(facts.having(lambda material: material.is_rough))}",
        why_not="all glass and all mirrors are polished",
        names=("lobe_axes", "smith_share", "microfacet_numbers", "regained"),
        requires=("dielectrics",),
    )
    """Some glass or mirror has a ground surface, whose microfacets turn paths by chance."""
    crystals: bool = feature(
        "crystals",
        lambda facts: bool(facts.crystals),
        symbol="HAS_CRYSTAL",
        why=lambda facts: f"{names(facts.crystals)} part(s) light into ordinary and extraordinary rays",
        why_not="all glass is isotropic",
        names=("crystal_event", "cross_interface", "uniaxial_at"),
        cost="up to four rays a surface, each a step of the queue; two complex 2 × 2 systems a place of the band",
        requires=("polarised",),
    )
    """Some solids are uniaxial crystals."""
    polarisers: bool = feature(
        "polarisers",
        lambda facts: bool(facts.polarisers),
        symbol="HAS_POLARISER",
        why=lambda facts: f"of {names(facts.polarisers)}",
        why_not="there is no polariser and no wave plate",
        names=("pass_polariser", "FRINGE_FADES"),
        requires=("polarised",),
    )
    """Some sheets are polarisers or wave plates."""
    polarised: bool = feature(
        "polarisation",
        lambda facts: facts.scene.polarised and bool(facts.glass or facts.films or facts.polarisers),
        symbol="POLARISED",
        why="the scene asks for it, and there is glass or metal to part s and p",
        why_not=lambda facts: (
            "there is no glass or metal to part s and p"
            if facts.scene.polarised
            else "[render] polarisation is not set"
        ),
        names=("stokes_q", "incidence_axis", "fresnel_reflection", "behind_interface", "see_polarised"),
        requires=("dielectrics",),
    )
    """Paths carry their light's state of polarisation from surface to surface."""
    mirrors: bool = feature(
        "mirrors",
        lambda facts: bool(facts.mirrors),
        symbol="HAS_MIRROR",
        why="there are mirrors",
        why_not="there are no mirrors",
        names=(r"\(kind == KIND_MIRROR\) ",),
        cost=lambda facts, sizes: f"{size_words(sizes.spectrum * len(facts.mirrors))} of reflectances",
    )
    gratings: bool = feature(
        "gratings",
        lambda facts: bool(facts.having(lambda material: material.is_grating)),
        symbol="HAS_GRATING",
        why="there are gratings",
        why_not="there is no grating",
        names=("grating_at", "diffract_direction", "GRATINGS_AT"),
        cost=lambda facts, sizes: f"{sizes.texel} B an order; a step of the queue for each",
    )
    grating_profiles: bool = feature(
        "profiles of gratings",
        lambda facts: bool(facts.having(lambda material: bool(material.profile_code))),
        symbol="GRATING_PROFILES",
        why=lambda facts: f"of {names(facts.having(lambda material: bool(material.profile_code)))}",
        why_not="no grating's efficiencies depend on wavelength and angle",
        names=("groove_waves", "profile_share"),
        cost="a sine or a lookup an order, three times a band",
        requires=("gratings",),
    )
    """Some grating's grooves share light out by wavelength and angle."""
    line_widths: bool = feature(
        "widths of spectral lines",
        lambda facts: bool(facts.having(lambda material: material.spread_per_um > 0.0)),
        symbol="LINE_WIDTHS",
        why=lambda facts: f"behind {names(facts.having(lambda material: material.spread_per_um > 0.0))}",
        why_not="there is no slit, and no grating says how many of its lines light covers",
        names=("place_on_line", "line_draw", "light: FLAG_OFF_LATTICE"),
        cost="a lookup an order",
        requires=("gratings",),
    )
    """Some slit, or the end of some grating, spreads light of one wavelength."""
    smooth_normals: bool = feature(
        "interpolated normals",
        lambda facts: bool(facts.smooth),
        symbol="SMOOTH_NORMALS",
        why="some specular surface is a smooth mesh",
        why_not="no specular surface is a smooth mesh",
        names=("corner_normal", "has_normals", "NORMALS_AT", "MIN_SHADING_COSINE"),
        cost=lambda facts, sizes: (
            f"{3 * sizes.texel} B a facet, {size_words(3 * sizes.texel * facts.smooth_triangles)}"
        ),
    )
    """Some specular surface has interpolated normals."""
    normal_derivatives: bool = feature(
        "normal derivatives",
        lambda facts: bool(facts.smooth or facts.curved) and (facts.has_columns or facts.groups > 0),
        symbol="NORMAL_DERIVATIVES",
        why="columns bend with the normals",
        why_not=lambda facts: "no columns" if facts.smooth or facts.curved else "all specular facets are flat",
        names=("light: summed_change", "light: gradient_u"),
        cost="one more vector a column and surface",
        requires=("footprints", "smooth_normals"),
    )
    """Interpolated normals, or those of curved solids, bend columns too."""
    medium_stack: bool = feature(
        "medium stack",
        lambda facts: bool(overlapping_solids(facts.scene)),
        symbol="MEDIUM_STACK",
        why=lambda facts: f"{names(facts.scene.objects[i] for i in overlapping_solids(facts.scene))} nest or touch",
        why_not="no two solids nest or touch",
        names=("medium_of", "stack_objects", "STACK_OBJECTS", "mask_before"),
        cost=lambda facts, sizes: f"{len(overlapping_solids(facts.scene))} bit(s) of a ray's mask",
        requires=("dielectrics",),
    )
    """Transparent solids nest or touch, so priorities decide the medium."""
    contacts: bool = feature(
        "contacts",
        lambda facts: bool(contacts(facts.scene)),
        symbol="CONTACTS",
        why=lambda facts: f"may touch: {_pair_names(facts)}",
        why_not="no mirror, receiver or blocker touches another surface",
        names=("accept_sheet", "crossed_in_contact", "comes_first", "left_normal"),
        cost=lambda facts, sizes: f"{len(contacts(facts.scene))} pair(s) that may touch",
        requires=("loose_triangles",),
    )
    """Other surfaces touch each other or glass: surfaces at one place are one interface."""
    loose_triangles: bool = feature("", lambda facts: facts.loose_triangles > 0, symbol="LOOSE_TRIANGLES")
    """There are triangles besides the convex solids."""
    tree: bool = feature(
        "triangle tree",
        lambda facts: facts.loose_triangles > MAX_LOOSE_TRIANGLES,
        symbol="HAS_TREE",
        why=lambda facts: f"{facts.loose_triangles} triangles",
        why_not=lambda facts: f"{facts.loose_triangles} loose triangle(s) are looped over",
        names=("intersect_tree", "box_entry", "LEAF_BIT", "TREE_AT", "TREE_STACK"),
        cost=lambda facts, sizes: f"about {size_words(facts.loose_triangles * sizes.triangle)}",
        requires=("loose_triangles",),
    )
    """Triangles are found through a tree; otherwise by a loop."""
    convex_solids: bool = feature(
        "half-space solids",
        lambda facts: bool(facts.half_spaces),
        symbol="CONVEX_SOLIDS",
        why=lambda facts: names(facts.scene.objects[i] for i in facts.half_spaces),
        why_not="no convex faceted solid",
        names=("intersect_solid", "planes", "solids", "SOLID_COUNT"),
        cost=lambda facts, sizes: _walk_words("planes", sum(map(len, facts.half_spaces.values())), sizes.texel),
    )
    """Convex faceted solids are intersected as half-spaces."""
    curved_solids: bool = feature(
        "curved solids",
        lambda facts: bool(facts.curved),
        symbol="CURVED_SOLIDS",
        why=lambda facts: f"met without triangles: {names(facts.scene.objects[i] for i in facts.curved)}",
        why_not="no ball, ellipsoid, lens or cylinder stands by itself",
        names=("intersect_curved", "piece_at", "PIECES_AT", "PIECE_COUNT"),
        cost=lambda facts, sizes: _walk_words("faces", sum(map(len, facts.curved.values())), sizes.piece),
    )
    """Balls, ellipsoids, lenses and cylinders are met as the quadrics they are, not as triangles."""
    beams: bool = feature(
        "beams",
        lambda facts: bool(facts.beam_objects),
        symbol="BEAMS",
        why=lambda facts: _beam_words(facts),
        why_not=lambda facts: _why_no_beams(facts),
        names=("is_beam_object",),
        cost=lambda facts, sizes: f"{len(facts.beam_objects)} object(s) searched on the processor; one bit an object",
    )
    """What meets certain flat-faceted objects first is left to beams (`spectrasplat.beams`): photons end there."""


def _walk_words(what: str, count: int, size: int) -> str:
    return f"{count} {what}, {size_words(count * size)}: each ray walks through all"


def _pair_names(facts: Facts) -> str:
    objects = facts.scene.objects
    return listed([f"{objects[i].name} and {objects[j].name}" for i, j in contacts(facts.scene)])


def _beam_words(facts: Facts) -> str:
    carried = names(facts.scene.objects[i] for i in facts.beam_objects)
    others = "; ".join(_not_beams(facts))
    return f"light from {carried} goes as polygons, unless a survey finds that photons are cheaper" + (
        f"; photons for {others}" if others else ""
    )


def _why_no_beams(facts: Facts) -> str:
    if not has_beams(facts.settings.method):
        return f"method {facts.settings.method} follows photons"
    if not beam_objects(facts.scene):
        return "; ".join(_not_beams(facts)) or "there is neither glass nor mirror"
    if not facts.flat_receivers:
        return "no receiver is flat"
    if facts.is_painted:
        return "the dispersion brush was used on a receiver"
    return "no light can be followed as beams"


def _not_beams(facts: Facts) -> list[str]:
    """Glass and mirrors whose light photons carry, and why."""
    specular = facts.having(lambda material: material.is_specular)
    return [f"{item.name}: {why}" for item in specular if (why := why_no_beams(item))]
