"""Switches by which variants of one program differ, besides those of the scene (`Features`).

Every name that shaders test as 1 or 0 is here or in the table of features: a name that a pass misspells is refused, and
a name that nobody set is known to be 0.
"""

from __future__ import annotations

Defines = dict[str, int | float | str]
PROGRAM_SWITCHES = frozenset(
    # Emission: the light's domain, cells of it that are thinned. A driver that ends long loops; rays followed for
    # several events in a dispatch.
    ("LIGHT_AREA", "LIGHT_PLANE", "LIGHT_POINT", "LIGHT_PROFILE", "THINNED_CELLS", "LOOPS_MAY_END", "RAY_POOL")
    # What the paths of a walk carry; the walk's own file defines them by features.
    + ("HAS_NORMAL_COLUMNS", "WIDENED_BY_LOBES")
    # Light of the environment and of other receivers, by way of glass.
    + ("FOLLOWS_SPECULAR", "OF_RECEIVERS", "GATHERED_SPECTRUM")
    # Kinds of splats, beams that no wavelength moves, sums by atomics, of pieces of splats, seams between charts.
    + ("SMALL", "SWEPT", "CUT", "EDGE", "CLIPPED", "FANS", "CONTACT_LINES", "STILL", "FLOAT_ATOMICS", "IN_PIECES")
    + ("FROM_SUMS", "FROM_SCRATCH", "SEAMS", "IN_BULK")
    # Layers of the picture.
    + ("LAYER_BEAUTY", "RGB_CHANNELS", "MAP_BINS", "RECEIVER_LIGHT", "VISIBLE_LIGHTS")
    # Camera rays beyond glass, and the program for what is seen directly.
    + ("CAMERA_SPECULAR", "HAS_DISPERSION", "SPECTRAL_SWEEP", "LENS", "HALTS", "FOLLOWED", "LISTS_SPECULAR")
    + ("IN_MOTION", "DISTANCES", "PAIRS")
    # Where data lies.
    + ("LIGHTS_IN_STORAGE", "SOLIDS_IN_STORAGE", "SCENE_IMAGE", "TEXTURES_IMAGE", "PACKS")
    + ("HAS_IMAGES", "HAS_TEXTURES", "HAS_ENVIRONMENT_MAP")
    # Display and glare.
    + ("ANTIALIAS", "AS_IMAGE", "SAME_SIZE", "BESIDE_IS_NEXT", "HALO")
    + ("SHOW_ERROR",)
    + ("TONE_ACES", "TONE_FALSE_COLOUR", "TONE_REINHARD", "TONE_SPECTRASPLAT")
    + ("HALVE", "SHRINK", "SOFTEN", "SPREAD")
)


def switched(**switches: object) -> Defines:
    """Defines of those that are on. Raises KeyError for a name that is not listed."""
    if unknown := switches.keys() - PROGRAM_SWITCHES:
        raise KeyError(f"no switch of a program: {', '.join(sorted(unknown))}")
    return {name: 1 for name, on in switches.items() if on}
