"""Proof that what a scene does not need is absent: its symbols are not in the text that was compiled.

Every program of a small rendering is recorded as it is handed to the driver, then searched for the names
that a feature alone uses. The names are kept true by a test: each must occur in some program where its
feature is in.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ...gpu.dead_code import words
from ...gpu.shader import Source
from ..programs import compiled_programs

if TYPE_CHECKING:
    from ...gpu.context import Context
    from ...model.scene import Scene
    from ...model.settings import RenderSettings

FEATURE_SYMBOLS: dict[str, tuple[str, ...]] = {
    "spectral columns": (
        "variable_step",
        "index_ratio_derivative",
        "medium_slope",
        "dposition_dvar0",
        "spectral_variable",
        "VARIABLE_ROW",
    ),
    "shared spectral variable": ("SLOPE_ROW",),
    "weights over the band": (r"interface_indices\(boundary, band_of",),
    "band cuts": (
        "part_of_band",
        "total_reflection_onset",
        "passes_x",
        "MIN_CUT_BAND",
        "FELL_BAND",
        "is_cut",
        "energy_below",
    ),
    "landing cuts": ("meet_with_band", "lands_broadly"),
    "spatial columns": (
        r"ray\.dposition\[c\]\.xyz = transfer_column",
        r"photon\.dposition_ds = ray",
        r"ray\.ddirection\[0\]\.xyz = ",
    ),
    "refraction": (
        "refract_direction",
        "cross_boundary",
        "cross_glass",
    ),
    "polarisation": ("stokes_q", "incidence_axis", "fresnel_reflection", "behind_interface", "polarise_path"),
    "coats": ("coat_pdf", "coat_weight", "coat_response"),
    "rough diffuse": ("rough_response", "rough_albedo"),
    "rough surfaces": ("lobe_axes", "smith_share", "microfacet_numbers", "regained"),
    "light edges": ("packed_edge", "unpacked_edge", "cut_at_edge"),
    "lamp columns": ("cover_sides", "LAMP"),
    "mirrors": (r"\(kind == KIND_MIRROR\) ",),
    "thin sheets": ("both_faces", "KIND_SHEET"),
    "surface colours": ("filter_by", "passed"),
    "gratings": ("grating_at", "diffract_direction", "GRATINGS_AT"),
    "interpolated normals": (
        "corner_normal",
        "has_normals",
        "NORMALS_AT",
        "MIN_SHADING_COSINE",
    ),
    "normal derivatives": (r"normal_columns\[c\] = normal_column\(frame, ray",),
    "absorption": ("medium_weight_row", r"vec3 alpha = "),
    "tint levels": ("tint_level", "TINT_LEVELS"),
    "contacts": ("accept_sheet", "crossed_in_contact", "comes_first", "left_normal"),
    "medium stack": ("medium_of", "stack_objects", "STACK_OBJECTS", "mask_before"),
    "triangle tree": ("intersect_tree", "box_entry", "LEAF_BIT", "TREE_AT", "TREE_STACK"),
    "half-space solids": ("intersect_solid", "planes", "solids", "SOLID_COUNT"),
    "curved solids": ("intersect_curved", "piece_at", "PIECES_AT", "PIECE_COUNT"),
    "charts": ("RECEIVER_CHARTS", "PLACED_CHART"),
    "nested windows": ("is_only_fine", "outer"),
    "contact lines": ("contact_words", "takes_side", "side_of_contact"),
    "border images": ("put_images", "border_distance", "mirrored_step"),
    "local gain": ("gain_boxes", "local_gain"),
    "photons by index": ("traced_bands", "v_path"),
    "camera refraction": ("meet_surface", "reflect_path", "path_stack", "stack_size", "listed_entry"),
    "camera spectral taps": (r"restrict_to_band\(path, pixel_key\)", "taps_of", "onset_of"),
    "spectral maps": ("BIN_ROW", "BIN_SPECTRUM_ROW", "BIN_TARGET"),
    "beams": ("is_beam_object",),
    "environment light": ("EnvironmentAsked",),
    "bounces": ("gathered", "cosine_direction"),
    "haze": ("henyey_greenstein", "blur_1d", "store_flight", "flown"),
    "lens": ("lens_place", "by_lens", "begin_on_lens"),
    "light profiles": ("profile_intensity", "profile_stretch"),
    "spectral bins": ("define TARGETS [2-9]", "define TARGETS 1[0-9]"),
}
"""By `explain`'s names. Names that only this feature uses; one with a space is a pattern for a line, where the camera,
whose rays always carry a pixel's columns and weights over a band, uses a name that in the light pass belongs to a
feature."""


@dataclass(frozen=True)
class ProgramText:
    """One compiled source."""

    name: str
    lines: int
    flattened_lines: int
    """Before what cannot run was left out."""
    found: dict[str, tuple[str, ...]]
    """By feature: which of its symbols occur."""


@dataclass(frozen=True)
class Proof:
    """One feature over all programs."""

    feature: str
    included: bool
    symbols: tuple[str, ...]
    programs: tuple[str, ...]
    """Those that hold at least one of the symbols."""

    @property
    def holds(self) -> bool:
        """Absent from every program where it is out; somewhere where it is in."""
        return bool(self.programs) == self.included


def compiled_sources(context: Context, scene: Scene, settings: RenderSettings) -> list[Source]:
    """The source of every program that a rendering of `scene` builds, each once."""
    sources = (stage for built in compiled_programs(context, scene, settings) for stage in built.stages)
    return list({(source.name, source.text): source for source in sources}.values())


def program_texts(sources: Iterable[Source]) -> list[ProgramText]:
    """What each source holds."""
    return [
        ProgramText(
            source.name,
            len(source.text.splitlines()),
            source.flattened_lines,
            {
                feature: found
                for feature, symbols in FEATURE_SYMBOLS.items()
                if (found := occurring(source.text, symbols))
            },
        )
        for source in sources
    ]


def occurring(text: str, symbols: Sequence[str]) -> tuple[str, ...]:
    """Those of `symbols` that occur in GLSL text."""
    present = words(text)
    return tuple(s for s in symbols if (re.search(s, text) if " " in s else s in present))


def prove(texts: Sequence[ProgramText], included: dict[str, bool]) -> list[Proof]:
    """One proof a feature of `FEATURE_SYMBOLS`; `included`: what `explain` says of each."""
    return [
        Proof(
            feature,
            included[feature],
            symbols,
            tuple(dict.fromkeys(text.name for text in texts if feature in text.found)),
        )
        for feature, symbols in FEATURE_SYMBOLS.items()
    ]
