"""Whole scenes: gems of impossible glass, every shipped scene, and which scenes are swept."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

from ...base.paths import assets_dir
from ...gpu.context import Context
from ...gpu.records import MAX_BANDS
from ...model.geometry.primitives import box, prism
from ...model.geometry.primitives_gem import brilliant
from ...model.geometry.primitives_round import sphere
from ...model.io.scene_file import load_scene
from ...model.optics.glass import Dispersion
from ...model.scene import Scene
from ..case import Case, Held, Measured, case
from ..rigs.probe import against_single_wavelengths, probe, rendered
from ..rigs.scene_parts import IMPOSSIBLE, STEP, SUN, solid, stage
from .sweeps import scene_sweep


@case("gems", "glass", list(IMPOSSIBLE.items()))
def gems(context: Context, glasses: Sequence[tuple[str, Dispersion]]) -> Measured:
    """A prism, a ball, a diamond and a cube of glass that no maker sells, against one-wavelength photons

    A splat sweeps over half the table, total reflection cuts bands at every face, dn/dλ changes its sign."""
    for number, (label, glass) in enumerate(glasses, 1):
        stones = (
            solid("prism", prism(side=0.8), glass, (-1.6, 0.0, 0.6)),
            solid("ball", sphere(0.4, 1280), glass, (0.0, 0.0, 0.8)),
            solid("diamond", brilliant(0.9), glass, (1.6, 0.0, 0.8)),
            solid("cube", box((0.5, 0.5, 0.5)), glass, (0.0, 1.2, 0.6)),
        )
        # A band's light is swept evenly along its chord: a step of the index within it is smeared, at most that band's
        # share of the light.
        smeared = 1.0 / MAX_BANDS if label == STEP else 0.0
        yield against_single_wavelengths(context, stage(*stones, lights=[SUN]), number, label, smeared)


# ---- shipped scenes ----------------------------------------------------------------------------

LEFT_IN_MAPS = {"lens_text": 0.05, "soap_bubble": 0.05, "water": 0.05, "wine_glass": 0.03}
"""Where light falls over a receiver's whole width, or on curved ones, footprints reach over edges: that share is lost
and noted. Of a table that reaches to the horizon the last texels of a small picture's map are wide, and count whole."""
MAP = 0.01
"""What a map may lack or have too much elsewhere: splats are cut off at four standard deviations and at windows'
borders."""
DROPPED = 0.01
"""Largest share of the deposited power splatted as one texel for want of a usable footprint: columns of light that is
trapped between curved faces (`ripples`, about 18 events) grow exponentially."""


@cache
def shipped(name: str) -> Scene:
    """A scene that comes with the program."""
    return load_scene(assets_dir() / "scenes" / f"{name}.toml")


SHIPPED = sorted(file.stem for file in (assets_dir() / "scenes").glob("*.toml"))


@case("shipped", "scene", SHIPPED)
def every_shipped(context: Context, names: Sequence[str]) -> Measured:
    """Every shipped scene with few photons

    What works in a test scene must work in a real one."""
    for number, name in enumerate(names, 1):
        found = probe(context, shipped(name))
        dropped = found.stats.dropped_w / max(found.stats.tally.ended["deposited"], 1e-300)
        held: Held = {"map": (found.map_error, LEFT_IN_MAPS.get(name, MAP)), "footprints dropped": (dropped, DROPPED)}
        yield rendered(number, name, found, held)


# ---- the sweep ---------------------------------------------------------------------------------

SWEPT = {"prism": None, "achromat": ("scale", "rotation"), "brilliant": ("depth",)}
"""The scene whose sweep runs whole by default, and parts of it on scenes that are hard in that respect:
smooth solids that touch; long chains."""


def sweeps(scenes: Sequence[tuple[str, Scene]]) -> tuple[Case, ...]:
    """The whole sweep over the named scenes."""
    return tuple(case for name, scene in scenes for case in scene_sweep(replace(scene, name=name), f"{name}/"))


def default_sweeps() -> tuple[Case, ...]:
    """What runs where no scene is given."""
    found: list[Case] = []
    for scene, parts in SWEPT.items():
        cases = sweeps([(scene, shipped(scene))])
        found += [case for case in cases if parts is None or case.name.split("/")[1] in parts]
    return tuple(found)
