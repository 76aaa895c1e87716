"""What each program of the light pass is compiled with: the scene's features, and which of its own variants it is.

The scene's buffers and tables add the numbers that only their data give (rows, counts, bindings).
"""

from __future__ import annotations

from ..features.features import Features
from ..features.program_switches import Defines, switched
from ..features.receivers import MOST_IMAGES
from ..gpu import bindings, records
from ..gpu.device_traits import DeviceTraits
from ..gpu.splat_tables import CUMULATIVE_SAMPLES, DENSITY_CELLS
from ..gpu.splat_way import SplatWay

FAR_TOO_LARGE = 1e15
"""Texels: the most that float32 can evaluate of a footprint's columns; beyond, they are a numerical accident."""
_FLAGS: Defines = {
    "FLAG_FOOTPRINT_DROPPED": f"{records.FLAG_FOOTPRINT_DROPPED}u",
    "FLAG_BAND_FINAL": f"{records.FLAG_BAND_FINAL}u",
    "FLAG_INSIDE": f"{records.FLAG_INSIDE}u",
    "FLAG_OFF_LATTICE": f"{records.FLAG_OFF_LATTICE}u",
    "FLAG_EXTRAORDINARY": f"{records.FLAG_EXTRAORDINARY}u",
    "LATTICE_BIT": records.LATTICE_BIT,
    "TINT_BIT": records.TINT_BIT,
    "EDGE_BIT": records.EDGE_BIT,
}


def light_defines(features: Features, traits: DeviceTraits) -> Defines:
    """Defines of the programs that emit, trace and queue rays."""
    copies = " ".join(
        f"photon.dposition_dvar{g} = vec4(path.dposition[SPATIAL + {g}], 0.0);" for g in range(features.spectral_groups)
    )
    return (
        features.defines()
        | bindings.LIGHT_HALF_DEFINES
        | _FLAGS
        | switched(LOOPS_MAY_END=features.tree and traits.loops_may_end, RAY_POOL=bool(traits.ray_events))
        | {
            "MASK_SIZE": records.MASK_SIZE,
            "CATEGORY_COUNT": f"{len(records.CATEGORIES)}u",
            "FALLBACK_COUNT": f"{len(records.FALLBACKS)}u",
            "SPECTRAL_COPY": copies,
            "BIND_FLIGHTS": bindings.FLIGHTS,
            "DISPATCHES": len(traits.ray_events),
            "RAY_EVENTS": ", ".join(f"{count}u" for count in traits.ray_events),
        }
    )


def footprint_defines(features: Features) -> Defines:
    """Defines of footprint.comp."""
    return (
        features.defines()
        | switched(CONTACT_LINES=features.contact_lines)
        | {
            "DENSITY_CELLS": f"{DENSITY_CELLS}u",
            "GROUPS": features.spectral_groups,
            "MOST_IMAGES": MOST_IMAGES,
            "IMAGE_SLOTS": image_slots(features),
            "POWER_SAMPLES": CUMULATIVE_SAMPLES,
            "NONE": f"{records.NONE}u",
        }
        | _FLAGS
        | {"FAR_TOO_LARGE": FAR_TOO_LARGE}
    )


def image_slots(features: Features) -> int:
    """Images that a photon's splats may have beyond borders."""
    return MOST_IMAGES * (1 + features.nested_windows) if features.border_images else 0


def draw_variants(features: Features) -> dict[int, tuple[str, Defines]]:
    """Kind of splat → its fragment shader and what its programs are compiled with."""
    kinds: dict[int, tuple[str, Defines]] = {
        1: ("light/splat_small.frag", switched(SMALL=True)),
        2: ("light/splat_swept.frag", switched(SWEPT=True)),
        4: ("light/splat_swept.frag", switched(SWEPT=True, EDGE=True, CLIPPED=True, FANS=True)),
    }
    if features.band_cuts and not features.point_spectrum:
        kinds[3] = ("light/splat_cut.frag", switched(CUT=True, CLIPPED=True))
    common: Defines = {**features.defines(), "DENSITY_CELLS": f"{DENSITY_CELLS}u"}
    # Swept splats (2) have no line near them.
    lines = {kind: switched(CONTACT_LINES=features.contact_lines and kind != 2) for kind in kinds}
    return {kind: (kinds[kind][0], common | kinds[kind][1] | lines[kind]) for kind in sorted(kinds)}


def sum_defines(way: SplatWay) -> Defines:
    """Defines of programs that add to sums in a buffer."""
    return switched(FLOAT_ATOMICS=way.extensions)
