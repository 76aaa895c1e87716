"""Which variant of each program a scene gets: Features → defines. Nothing else chooses one.

The scene's buffers and tables add the numbers that only their data give (rows, counts, bindings).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

from ..features.features import Features
from ..gpu import bindings, records
from ..gpu.device_traits import DeviceTraits
from ..gpu.map_channels import MapChannels
from ..gpu.scene_buffers import SceneBuffers
from ..gpu.splat_tables import CUMULATIVE_SAMPLES, DENSITY_CELLS
from ..gpu.splat_way import SplatWay
from ..gpu.texture_store import place_defines
from ..model.environment_light import lighting_environment
from .camera_tables import EMISSION_CELLS
from .picture_channels import Channels

Defines = dict[str, int | float | str]

MAX_DEPTH = 48
"""Surfaces that one camera path may meet."""
MAX_EVENTS = 160
"""Surfaces that all paths of a sample may meet together."""
STACK = 6
"""Paths of a sample that may wait while another is followed."""
ENDS_HELD = 8
"""Paths' ends of a sample that are looked at together."""
CUT_THRESHOLD = 0.004
"""Share of a sample's power above which both parts of a cut band are followed."""
HALT_ROUNDS = 5000
"""Rounds of its loops after which a sample halts on a software renderer; see camera/halts.glsl. Eight side by side that
have nothing in common then take 40,000 of the driver's 65,535, and what is left is for the surface they are at and the
ends of paths they hold."""
SPARE_ROUNDS = 0
"""Rounds that must be left when it halts or ends; where they are not, it is counted."""
MOST_IMAGES = 4
"""Of a footprint beyond its receiver's borders: across the two nearest ones, and across both."""
TINT_STEPS = 48
"""Stretches that the whole spectrum is cut into behind coloured glass."""

FAR_TOO_LARGE = 1e15
"""Texels: what float32 can still be asked of a footprint's columns; beyond, they are a numerical accident."""

(
    BIND_LIGHTS,
    BIND_OBJECT_COLOURS,
    BIND_CELL_CDF,
    BIND_RECEIVERS,
    BIND_PLACEMENTS,
    BIND_PICTURES,
    BIND_COUNTERS,
    BIND_LISTED,
    BIND_HALTED,
) = range(8, 17)
BIND_FLIGHTS, BIND_HAZE_COLOURS, BIND_HAZE = 8, 9, 10
"""Of the program that draws haze; the last is of uniform blocks."""
UNIT_DISTANCES = 0
UNIT_RECEIVER_LIGHT, UNIT_EMISSION, UNIT_PICTURES = 9, 10, 11
_BEYOND_ONLY = (
    "HAS_DISPERSION",
    "SPECTRAL_SWEEP",
    "RANDOM_WAVELENGTH",
    "EVEN_WAVELENGTHS",
    "MAP_BINS",
    "ABSORPTION",
    "NORMAL_DERIVATIVES",
    "POLARISED",
)
"""What only rays beyond glass and mirrors need."""


# -- light pass ---------------------------------------------------------------------------


def light_defines(features: Features, traits: DeviceTraits) -> Defines:
    """Defines common to the programs that emit, trace and queue rays."""
    copies = " ".join(
        f"photon.dposition_dvar{g} = vec4(path.dposition[SPATIAL + {g}], 0.0);" for g in range(features.spectral_groups)
    )
    defines: Defines = {
        "FLAG_FOOTPRINT_DROPPED": f"{records.FLAG_FOOTPRINT_DROPPED}u",
        "FLAG_BAND_FINAL": f"{records.FLAG_BAND_FINAL}u",
        "FLAG_INSIDE": f"{records.FLAG_INSIDE}u",
        "LATTICE_BIT": records.LATTICE_BIT,
        "TINT_BIT": records.TINT_BIT,
        "EDGE_BIT": records.EDGE_BIT,
        "MASK_SIZE": records.MASK_SIZE,
        "CATEGORY_COUNT": f"{len(records.CATEGORIES)}u",
        "FALLBACK_COUNT": f"{len(records.FALLBACKS)}u",
        "SPECTRAL_COPY": copies,
    }
    if features.tree and traits.loops_may_end:
        defines["LOOPS_MAY_END"] = 1
    if features.flights:
        defines["BIND_FLIGHTS"] = bindings.FLIGHTS
    return features.defines() | bindings.LIGHT_HALF_DEFINES | defines


def emit_defines(features: Features, kind: str, thins: bool = False) -> Defines:
    """What emit.comp has besides: the kind of its light's emission domain, whether some cells of that are thinned, and
    how it draws wavelengths."""
    random = features.point_spectrum and features.random_wavelength
    switches = {
        f"LIGHT_{kind.upper()}": True,
        "THINNED_CELLS": thins,
        "RANDOM_WAVELENGTH": random,
        "EVEN_WAVELENGTHS": random and features.even_wavelengths,
    }
    return {name: 1 for name, on in switches.items() if on}


class SplatFeatures(Protocol):
    """What decides the programs' variant (a part of `spectrasplat.features.features.Features`)."""

    @property
    def spectral_groups(self) -> int: ...
    @property
    def band_cuts(self) -> bool: ...
    @property
    def nested_windows(self) -> bool: ...
    @property
    def targets(self) -> int: ...
    @property
    def point_spectrum(self) -> bool: ...
    @property
    def charts(self) -> bool: ...
    @property
    def local_gain(self) -> bool: ...
    @property
    def reindexed(self) -> bool: ...
    @property
    def hero(self) -> bool: ...
    @property
    def contact_lines(self) -> bool: ...
    @property
    def border_images(self) -> bool: ...
    @property
    def tint_levels(self) -> int: ...
    @property
    def light_edges(self) -> bool: ...


def splat_defines(features: SplatFeatures) -> Defines:
    """Defines common to every program of the splat half."""
    switches = {
        "BAND_CUTS": features.band_cuts,
        "POINT_SPECTRUM": features.point_spectrum,
        # A splat that no wavelength moves is a Gaussian of one colour.
        "ONE_COLOUR": features.point_spectrum or features.spectral_groups == 0,
        "CHARTS": features.charts,
        "HERO": features.hero,
        "LIGHT_EDGES": features.light_edges,
    }
    counts: Defines = {"TARGETS": features.targets, "SLOTS": 2 if features.nested_windows else 1}
    if features.point_spectrum:
        counts["DENSITY_CELLS"] = f"{DENSITY_CELLS}u"
    return counts | {name: 1 for name, on in switches.items() if on}


def footprint_defines(features: SplatFeatures) -> Defines:
    """Defines of footprint.comp."""
    switches = {
        "LOCAL_GAIN": features.local_gain,
        "REINDEXED": features.reindexed,
        "CONTACT_LINES": features.contact_lines,
        "BORDER_IMAGES": features.border_images,
    }
    windows = 2 if features.nested_windows else 1
    return (
        splat_defines(features)
        | {
            "GROUPS": features.spectral_groups,
            "MOST_IMAGES": MOST_IMAGES,
            "IMAGE_SLOTS": MOST_IMAGES * windows if features.border_images else 0,
            "POWER_SAMPLES": CUMULATIVE_SAMPLES,
            "NONE": f"{records.NONE}u",
            "FLAG_FOOTPRINT_DROPPED": f"{records.FLAG_FOOTPRINT_DROPPED}u",
            "LATTICE_BIT": records.LATTICE_BIT,
            "EDGE_BIT": records.EDGE_BIT,
            "FAR_TOO_LARGE": FAR_TOO_LARGE,
        }
        | ({"TINT_LEVELS": features.tint_levels, "TINT_BIT": records.TINT_BIT} if features.tint_levels else {})
        | {name: 1 for name, on in switches.items() if on}
    )


def draw_variants(features: SplatFeatures) -> dict[int, tuple[str, Defines]]:
    """Kind of splat → its fragment shader and what sets its programs apart."""
    variants: dict[int, tuple[str, Defines]] = {
        1: ("light/splat_small.frag", {"SMALL": 1}),
        2: ("light/splat_swept.frag", {"SWEPT": 1}),
    }
    if features.band_cuts and not features.point_spectrum:
        variants[3] = ("light/splat_cut.frag", {"CUT": 1, "CLIPPED": 1})
    variants[4] = ("light/splat_swept.frag", {"SWEPT": 1, "EDGE": 1, "CLIPPED": 1, "FANS": 1})
    if features.contact_lines:
        # The same beside a line of contact; of swept ones those that an edge cuts as well.
        beside: Defines = {"CONTACT_LINES": 1}
        for kind, of in ((5, 1), (6, 4), (7, 3)):
            if of in variants:
                variants[kind] = (variants[of][0], variants[of][1] | beside)
    return variants


def add_variants(features: SplatFeatures) -> dict[int, Defines]:
    """Kind of splat → what sets its program apart where compute shaders add splats."""
    return {kind: chosen | {"KIND": kind} for kind, (_, chosen) in draw_variants(features).items()}


def sum_defines(way: SplatWay) -> Defines:
    """Of programs that add to sums in a buffer: how."""
    return {"FLOAT_ATOMICS": 1} if way.extensions else {}


def beam_defines(targets: int, edges: int, is_still: bool, contact_lines: bool = False) -> Defines:
    """Defines of the programs that draw beam polygons of up to `edges` edges (0: any number), moving over their band or
    not, into maps in which lines of contact lie or not."""
    counts: Defines = {"TARGETS": targets, "EDGES": edges}
    switches = {"STILL": is_still, "CONTACT_LINES": contact_lines}
    return counts | {name: 1 for name, on in switches.items() if on}


# -- camera pass --------------------------------------------------------------------------
# Every scene has a program for what is seen directly. In one that shows glass or mirrors it lists the pixels that meet
# something specular first, and another is for those, which holds all that is expensive. A third is for samples of
# single wavelengths.


def camera_defines(scene: SceneBuffers, channels: Channels, layer: str, maps: MapChannels) -> Defines:
    """What the scene needs of the shader, for a picture in `channels` and `maps` of these channels; tables and pictures
    add theirs.

    `CAMERA_SPECULAR` is among them where rays go on beyond glass or mirrors: these are then for the listed pixels, and
    `direct_defines` has the others'.
    """
    lights, features = scene.scene.lights, scene.features
    beauty = layer != "caustic"
    specular = beauty and features.camera_specular
    disperses = specular and features.camera_disperses
    defines: Defines = {
        **features.defines(),
        **bindings.SCENE_DEFINES,
        **scene.defines,
        **place_defines(BIND_PICTURES, UNIT_PICTURES),
    }
    # A method that follows single wavelengths has no columns for them; nor has a scene where nothing disperses.
    groups = features.spectral_groups if disperses else 0
    defines |= {
        "TARGETS": channels.targets,
        "MAP_TARGETS": maps.targets,
        "SPECTRAL_GROUPS": groups,
        "BIND_LIGHTS": BIND_LIGHTS,
        "BIND_OBJECT_COLOURS": BIND_OBJECT_COLOURS,
        "BIND_CELL_CDF": BIND_CELL_CDF,
        "BIND_COUNTERS": BIND_COUNTERS,
        "BIND_LISTED": BIND_LISTED,
        "BIND_RECEIVERS": BIND_RECEIVERS,
        "BIND_PLACEMENTS": BIND_PLACEMENTS,
        "UNIT_RECEIVER_LIGHT": UNIT_RECEIVER_LIGHT,
        "UNIT_EMISSION": UNIT_EMISSION,
        "EMISSION_CELLS": EMISSION_CELLS,
        "TINT_STEPS": TINT_STEPS,
        "BIN_TARGET": maps.first_target,
        "BIN_COUNT": maps.count,
        "BIN_OVERLAP": 1 if maps.edges_nm is not None else 0,
        "LIGHT_COUNT": len(lights),
        "LIGHT_ROOM": len(lights) + 1,
        "MAX_DEPTH": MAX_DEPTH,
        "MAX_EVENTS": MAX_EVENTS if specular else 1,
        "STACK": STACK,
        "CUT_THRESHOLD": CUT_THRESHOLD,
        "ENDS_HELD": ENDS_HELD,
    }
    materials = [item.material for item in scene.scene.objects]
    coloured = features.filters or any(m.is_mirror and m.is_coloured for m in materials)
    absorbs = any(m.absorption is not None for m in materials)
    lit = features.environment_lights and lighting_environment(scene.scene) is not None
    switches = {
        "LAYER_BEAUTY": beauty,
        "CAMERA_SPECULAR": specular,
        "RECEIVER_LIGHT": beauty and (lit or features.bounces > 0),
        "HAS_DISPERSION": disperses,
        "SPECTRAL_SWEEP": groups > 0,
        "RANDOM_WAVELENGTH": features.random_wavelength,
        "EVEN_WAVELENGTHS": features.even_wavelengths,
        "RGB_CHANNELS": channels.edges_nm is None,
        "MAP_BINS": disperses and maps.count > 0,
        "HAS_RECEIVERS": any(not m.is_specular for m in materials),
        "VISIBLE_LIGHTS": beauty and any(light.has_extent for light in lights),
        "ABSORPTION": specular and (coloured or absorbs),
        "NORMAL_DERIVATIVES": features.smooth_normals or features.curved_solids or features.rough,
        "POLARISED": specular and features.polarised,
        "COATS": features.coats,
        "ROUGH_DIFFUSE": features.rough_diffuse,
        "ANCHOR_WEIGHTS": False,
    }
    for name in switches:
        defines.pop(name, None)
    return defines | {name: 1 for name, on in switches.items() if on}


def lens_defines(shown: Mapping[str, int | float | str]) -> Defines:
    """For a camera with a lens."""
    return dict(shown) | {"LENS": 1}


def halting_defines(beyond: Mapping[str, int | float | str]) -> Defines:
    """For listed pixels whose samples halt when their loops have run long."""
    return dict(beyond) | {
        "HALTS": 1,
        "HALT_ROUNDS": HALT_ROUNDS,
        "SPARE_ROUNDS": SPARE_ROUNDS,
        "BIND_HALTED": BIND_HALTED,
    }


def halted_bytes(beyond: Mapping[str, int | float | str]) -> int:
    """Room that surely holds one halted sample: its paths, and what it knows besides."""
    columns = int(beyond["SPECTRAL_GROUPS"]) + 2 * int("LENS" in beyond)
    path = 312 + 40 * columns + 4 * int(beyond.get("ABSORBERS", 0)) + 64 * int("POLARISED" in beyond)
    path += 16 * int("COATS" in beyond)
    return (STACK + 1) * path + 16 * int(beyond["TARGETS"]) + 64


def direct_defines(beyond: Mapping[str, int | float | str]) -> Defines:
    """For what is seen directly, from what the listed pixels are compiled with."""
    left_out = {"CAMERA_SPECULAR", *_BEYOND_ONLY}
    followed = {"FOLLOWED": 1} if "CAMERA_SPECULAR" in beyond else {}
    return {name: value for name, value in beyond.items() if name not in left_out} | {
        **followed,
        "SPECTRAL_GROUPS": 0,
        "LISTS_SPECULAR": 1,
        "MAX_EVENTS": 1,
    }


def moving_defines(beyond: Mapping[str, int | float | str]) -> Defines:
    """For pictures in motion: what is seen directly, and which pixels see glass or mirrors."""
    return direct_defines(beyond) | {
        "IN_MOTION": 1,
        "THE_SAMPLE": "4u",
        "NUMBER_BITS": 27,
        "LATTICE_MAPS": "0xffffu",
        "LATTICE_OBJECTS": "0x10000u",
    }


def single_defines(beyond: Mapping[str, int | float | str]) -> Defines:
    """For listed pixels whose samples are of one wavelength each."""
    return {name: value for name, value in beyond.items() if name != "SPECTRAL_SWEEP"} | {
        "SPECTRAL_GROUPS": 0,
        "RANDOM_WAVELENGTH": 1,
        "EVEN_WAVELENGTHS": 1,
    }


def haze_defines(targets: int) -> Defines:
    """Of the program that draws beams of light in haze, into so many textures."""
    return {
        "TARGETS": targets,
        "BIND_PARAMETERS": bindings.PARAMETERS,
        "BIND_FLIGHTS": BIND_FLIGHTS,
        "BIND_HAZE_COLOURS": BIND_HAZE_COLOURS,
        "BIND_HAZE": BIND_HAZE,
        "UNIT_DISTANCES": UNIT_DISTANCES,
    }
