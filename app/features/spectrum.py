"""Rows of the table: how photons stand for a stretch of the spectrum and of the light's emission."""

from __future__ import annotations

from dataclasses import dataclass

from ..model.tint_bands import tint_curves
from ..model.tint_levels import LEVELS, MAX_LIGHTS
from .facts import MAX_GROUPS, Facts, names
from .row import feature, size_words


@dataclass(frozen=True, kw_only=True)
class SpectrumFeatures:
    """Features of photon records."""

    point_spectrum: bool = feature("", lambda facts: facts.is_single, symbol="POINT_SPECTRUM")
    """Each photon has one wavelength instead of a band."""
    random_wavelength: bool = feature("", lambda facts: facts.is_random, symbol="RANDOM_WAVELENGTH")
    """That wavelength is drawn at random …"""
    even_wavelengths: bool = feature(
        "", lambda facts: facts.settings.method == "stochastic-even", symbol="EVEN_WAVELENGTHS"
    )
    """… by a low-discrepancy sequence instead of chance …"""
    draws_by_power: bool = feature("", lambda facts: facts.is_random and facts.settings.bins is not None)
    """… by radiant power instead of brightness: for maps of spectral bins."""
    hero: bool = feature("", lambda facts: facts.settings.method == "hero", symbol="HERO")
    """Three more wavelengths share the path of the one that is followed, as long as it is theirs too."""
    footprints: bool = feature(
        "spatial columns",
        lambda facts: facts.has_columns,
        symbol="FOOTPRINTS",
        why="footprints are anisotropic",
        why_not="the method splats single texels",
        names=("fan_where_it_landed", "keep_columns_within", r"ray\.ddirection\[0\]\.xyz = "),
    )
    """Photons carry spatial columns."""
    spectral_groups: int = feature(
        "spectral columns",
        lambda facts: facts.groups,
        why=lambda facts: f"{facts.groups} column(s): {names(facts.dispersive)}",
        why_not=lambda facts: "one wavelength a photon" if facts.is_single else "nothing disperses",
        names=(
            "variable_step",
            "index_ratio_derivative",
            "index_slope",
            "dposition_dvar0",
            "spectral_variable",
            "VARIABLE_ROW",
        ),
        requires=("footprints",),
        off=0,
    )
    """Spectral columns carried by every photon (0: nothing disperses, or the method needs none)."""
    merged_groups: bool = feature(
        "shared spectral variable",
        lambda facts: (
            facts.groups > 0 and (facts.settings.method == "srd-lambda" or len(facts.dispersive) > MAX_GROUPS)
        ),
        symbol="MERGED_GROUPS",
        why="more glasses than columns, or method srd-lambda",
        why_not="each glass has a column of its own",
        names=("SLOPE_ROW",),
        cost=lambda facts, sizes: (
            f"one lookup of the slope a refraction, {size_words(sizes.spectrum * facts.distinct_glasses)}"
        ),
        requires=("spectral_groups",),
    )
    """More dispersive materials than columns (or the paper's λ-column): some columns are by a shared variable."""
    band_cuts: bool = feature(
        "band cuts",
        lambda facts: facts.groups > 0,
        symbol="BAND_CUTS",
        why="total internal reflection, or a border, may cut a band",
        why_not="no band to cut",
        names=(
            "part_of_band",
            "total_reflection_onset",
            "passes_x",
            "MIN_CUT_BAND",
            "FELL_BAND",
            "is_cut",
            "energy_below",
            "meet_with_band",
        ),
        cost="one program more, two rays more a landing or escape; a cut ray becomes two",
        requires=("spectral_groups",),
    )
    """Total internal reflection may cut a band, or a border that parts what its wavelengths meet."""
    reindexed: bool = feature(
        "photons by index",
        lambda facts: facts.is_reindexed,
        symbol="REINDEXED",
        why="an edit or the brush may move wavelengths between paths",
        why_not="every path keeps its wavelengths",
        names=("traced_bands", "v_path"),
        cost="32 B a band",
        requires=("spectral_groups",),
    )
    """Photons stand for intervals of the one index that disperses, and carry whatever wavelengths an edit puts
    there."""
    tint_levels: int = feature(
        "tint levels",
        lambda facts: LEVELS if facts.has_tint_levels else 0,
        symbol="TINT_LEVELS",
        why="one band holds a whole tint",
        why_not=lambda facts: _why_no_tint_levels(facts),
        names=("tint_level", "TINT_LEVELS"),
        cost=f"{LEVELS} tables a light and band instead of one",
        requires=("absorption",),
        off=0,
    )
    """Steps of the way through one tinted glass that photons count (`model.tint_levels`)."""
    lamp_columns: bool = feature(
        "lamp columns",
        lambda facts: (
            facts.has_columns
            and not facts.is_random
            and facts.is_by_photons
            and any(light.has_extent for light in facts.scene.lights)
        ),
        symbol="LAMP_COLUMNS",
        why=lambda facts: f"photons know how broad {names(lamp for lamp in facts.scene.lights if lamp.has_extent)} is",
        why_not=lambda facts: _why_no_lamp_columns(facts),
        names=("cover_sides", "LAMP"),
        requires=("footprints",),
    )
    """Some light is extended: photons carry how far from theirs the light of its other points lands."""
    light_edges: bool = feature(
        "light edges",
        lambda facts: (
            facts.has_columns
            and not facts.is_single
            and facts.is_by_photons
            and any(light.has_hard_edge for light in facts.scene.lights)
        ),
        symbol="LIGHT_EDGES",
        why=lambda facts: (
            f"footprints end where {names(lamp for lamp in facts.scene.lights if lamp.has_hard_edge)} ends"
        ),
        why_not="no light of photons with columns ends at a hard edge",
        names=("packed_edge", "unpacked_edge", "cut_at_edge"),
        cost="splats next to an edge have another program; one more number a fragment",
        requires=("footprints",),
    )
    """Some light's emission ends at a hard edge: photons next to it carry where, and their footprints are cut off
    there."""
    light_profiles: bool = feature(
        "light profiles",
        lambda facts: any(light.profile is not None for light in facts.scene.lights),
        symbol="LIGHT_PROFILES",
        why=lambda facts: f"measured lamps: {names(lamp for lamp in facts.scene.lights if lamp.profile is not None)}",
        why_not="no light comes from a photometric file",
        names=("profile_intensity", "profile_stretch"),
    )
    """Some light shines by a table of intensities over directions."""


def _why_no_tint_levels(facts: Facts) -> str:
    if not facts.absorbing:
        return "all glass is clear"
    if facts.is_single:
        return "a photon has one wavelength"
    if facts.beam_objects and not facts.groups:
        return "beams need bands that are cut for tints"
    if facts.no_haze is None:
        return "haze knows tints at three wavelengths a band"
    if facts.settings.editable:
        return "in the viewer photons know tints at three wavelengths a band"
    if len(facts.scene.lights) > MAX_LIGHTS:
        return f"there are more than {MAX_LIGHTS} lights"
    return "several tints need bands all the same" if len(tint_curves(facts.scene)) else "tints are too faint"


def _why_no_lamp_columns(facts: Facts) -> str:
    if not any(light.has_extent for light in facts.scene.lights):
        return "every light is a point or parallel"
    if facts.is_random or not facts.has_columns:
        return "the method draws places on lights by chance"
    return "beams carry all light"
