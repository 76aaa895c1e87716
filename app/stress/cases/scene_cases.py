"""Whole scenes: every shipped one, gems of impossible glass, and the sweep over scenes; gathers all whole-scene
cases."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cache

from ...base.paths import assets_dir
from ...gpu.context import Context
from ...gpu.records import MAX_BANDS
from ...model.geometry.primitives import box, prism
from ...model.geometry.primitives_gem import brilliant
from ...model.geometry.primitives_round import sphere
from ...model.optics.glass import Dispersion, constant, from_abbe, table
from ...model.scene import Scene
from ..case import Case, Measurement
from ..rigs.probe import Held, measurement, probe
from ..rigs.scene_parts import SUN, solid, stage
from . import contact_cases, crowd_cases, light_cases, line_cases, loss_cases, mesh_file_cases
from .sweep_cases import against_single_wavelengths, scene_sweep

LEFT_IN_MAPS = {"lens_text": 0.05, "water": 0.05, "wine_glass": 0.03}
"""Where light falls over a receiver's whole width, or on curved ones, footprints reach over edges: that share is lost
and noted."""
MAP = 0.01
"""What a map may lack or have too much elsewhere: splats are cut off at four standard deviations and at windows'
borders."""
DROPPED = 0.01
"""Largest share of the deposited power splatted as one texel for want of a usable footprint: columns of light that is
trapped between curved faces (`ripples`, about 18 events) grow exponentially."""
FULL_SWEEP = "prism"
"""The scene whose sweep runs whole without being asked for."""
ALSO = {"achromat": ("scale", "rotation"), "brilliant": ("depth",)}
"""Parts of the sweep on scenes that are hard in that respect: smooth solids that touch; long chains."""


STEP = "a step from 1.7 to 1.5 within 1 nm"
ONE_BAND = 1.0 / MAX_BANDS
"""A band's light is swept evenly along its chord: a step of the index within it is smeared, at most that band's share
of the light."""


def gems() -> list[tuple[str, Dispersion]]:
    """Glasses that no maker sells."""
    return [
        ("n 2.2 (violet) to 1.2 (red)", table((380.0, 780.0), (2.2, 1.2), "rainbow gem")),
        ("n 1.2 (violet) to 2.2 (red)", table((380.0, 780.0), (1.2, 2.2), "reversed gem")),
        ("V_d −20, anomalous", from_abbe(1.6, -20.0, "anomalous")),
        (STEP, table((380.0, 549.5, 550.5, 780.0), (1.7, 1.7, 1.5, 1.5), "step")),
        ("n 4 and V_d 10", from_abbe(4.0, 10.0, "heavy")),
        ("n 1 + 1e-6", constant(1.0 + 1e-6, "hardly glass")),
    ]


def measure_gems(context: Context) -> Iterator[Measurement]:
    """A prism, a ball and a diamond of each glass, in the sun."""
    for number, (label, glass) in enumerate(gems(), 1):
        stones = (
            solid("prism", prism(side=0.8), glass, (-1.6, 0.0, 0.6)),
            solid("ball", sphere(0.4, 1280), glass, (0.0, 0.0, 0.8)),
            solid("diamond", brilliant(0.9), glass, (1.6, 0.0, 0.8)),
            solid("cube", box((0.5, 0.5, 0.5)), glass, (0.0, 1.2, 0.6)),
        )
        yield against_single_wavelengths(
            context, stage(*stones, lights=[SUN]), number, label, ONE_BAND if label == STEP else 0.0
        )


def measure_shipped(context: Context) -> Iterator[Measurement]:
    """Every scene that comes with the program."""
    for number, name in enumerate(shipped_names(), 1):
        found = probe(context, shipped(name))
        dropped = found.stats.dropped_w / max(found.stats.tally.ended["deposited"], 1e-300)
        held = Held(
            {"map": found.map_error, "footprints dropped": dropped},
            {"map": LEFT_IN_MAPS.get(name, MAP), "footprints dropped": DROPPED},
        )
        yield measurement(number, name, found, held)


def shipped_names() -> list[str]:
    """The scenes in `assets/scenes`, sorted."""
    return sorted(file.stem for file in (assets_dir() / "scenes").glob("*.toml"))


@cache
def shipped(name: str) -> Scene:
    """One of them."""
    from ...model.io.scene_file import load_scene

    return load_scene(assets_dir() / "scenes" / f"{name}.toml")


def sweeps(scenes: Sequence[tuple[str, Scene]]) -> tuple[Case, ...]:
    """The whole sweep over the named scenes."""
    return tuple(case for name, scene in scenes for case in scene_sweep(replace(scene, name=name), f"{name}/"))


def default_sweeps() -> tuple[Case, ...]:
    """What runs where no scene is asked for: one whole sweep, and parts of it where other scenes are harder."""
    chosen = sweeps([(name, shipped(name)) for name in ALSO])
    parts = tuple(case for case in chosen if case.name.split("/")[1] in ALSO[case.name.split("/")[0]])
    return sweeps([(FULL_SWEEP, shipped(FULL_SWEEP))]) + parts


CASES: tuple[Case, ...] = (
    *contact_cases.CASES,
    *light_cases.CASES,
    *loss_cases.CASES,
    *mesh_file_cases.CASES,
    *crowd_cases.CASES,
    *line_cases.CASES,
    Case(
        "gems",
        "A prism, a ball, a diamond and a cube of glass that no maker sells, against one-wavelength photons",
        "A splat sweeps over half the table, total reflection cuts bands at every face, dn/dλ changes its sign.",
        "glass",
        measure_gems,
        len(gems()),
        logarithmic=False,
    ),
    Case(
        "shipped",
        "Every shipped scene with few photons",
        "What works in a test scene must work in a real one.",
        "scene",
        measure_shipped,
        len(shipped_names()),
        logarithmic=False,
    ),
)
