"""Beams through facets that are hard to tell apart: nothing may be lost and nothing twice."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence

import numpy as np

from ...beams.convert import polygons_of
from ...beams.facets import beam_scene
from ...beams.find import Search, search
from ...beams.search import SUM_ENTERED, SUM_NUMERIC, SUM_ROULETTE
from ...beams.sources import emissions
from ...gpu.context import Context
from ...model.geometry.mesh import Mesh
from ...model.lights import PointLight
from ...model.lights.light import Light
from ...model.optics.spectral_tables import SpectralAxis
from ...model.optics.spectrum import constant
from ...model.scene import Camera, Diffuse, Scene, SceneObject
from ..case import Case, Measurement
from ..rigs.gpu_paths import beam_light, extruded, glass, placed, screen

_PLACES = 0.0, 0.4, 1.0
"""Of the spectrum, where beams of one index are followed."""
_ROUNDING = 1e-11
"""Share of the light that rounding may lose on the way."""
_FIRST_ORDER = {3.0: 5e-3, 0.5: 5e-3, 0.1: 0.1}
"""The same of a point's light by its distance. Polygons follow its brightness; what is said to escape takes that of the
middle of a beam, and beams from close by are wide."""


def kept(
    solids: Sequence[SceneObject], light: Light, severity: float, label: str, bound: float = _ROUNDING
) -> Measurement:
    """All light of `light` through `solids` onto a floor, at single indices: what enters ends somewhere once."""
    floor = screen([0.0, 0.0, -2.0], [0.0, 0.0, 1.0], 30.0)
    objects = (*solids, placed("floor", floor, Diffuse()))
    scene = Scene("stress", Camera((0, 0, 9), (0, 0, 0), up=(0, 1, 0)), (light,), objects)
    axis = SpectralAxis.build([o.material.dispersion for o in solids if o.material.dispersion])
    frames = {0: (np.array([0.0, 0.0, -2.0]), np.eye(3)[:2])}
    beams = beam_scene(scene, [o.mesh for o in objects], frames, axis, 1.0)
    beams.facets["texel"] = 1e-3
    total, bad, count = np.zeros(SUM_ENTERED + 1), 0, 0
    for emission in emissions(light, beams, lambda p: np.asarray(p, float), 1.0, axis, 1):
        lines = dataclasses.replace(emission, lines=_PLACES, line_shares=(1.0,) * len(_PLACES), is_continuous=False)
        leaves, sums, _ = search(beams, lines, Search(1e-5, 1, 64, 1e-3))
        polygons = polygons_of(leaves, beams, 0, 1.0)
        bad += sum(int(np.sum(~np.isfinite(values))) for values in (polygons.edges, polygons.density, polygons.hulls))
        total, count = total + sums[: SUM_ENTERED + 1], count + len(polygons)
    entered = total[SUM_ENTERED]
    ended = total[: SUM_ROULETTE + 1].sum()
    errors = {"lost or doubled": abs(ended - entered) / entered, "of no facet": total[SUM_NUMERIC] / entered}
    return Measurement(severity, label, bad, errors, dict.fromkeys(errors, bound), note=f"{count} polygons")


def _block(low: Sequence[float], high: Sequence[float]) -> Mesh:
    """A box along the axes."""
    section = np.array([(low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1])])
    mesh = extruded("block", section, 0.5 * (high[2] - low[2]))
    moved = np.eye(4)
    moved[2, 3] = 0.5 * (high[2] + low[2])
    return mesh.transformed(moved)


def measure_slivers(context: Context) -> Iterator[Measurement]:
    for width in (1e-1, 1e-3, 1e-5, 1e-7):
        section = np.array([(-0.4, -0.3), (0.4, -0.3), (0.4, -0.3 + width), (-0.4, 0.3)])
        solid = placed("splinter", extruded("splinter", section), glass("N-SF11"))
        yield kept([solid], beam_light((-0.6, 0.0, 2.0), (0.3, 0.05, -1.0), 0.35), width, f"{width:g} wide")


def measure_films(context: Context) -> Iterator[Measurement]:
    for thickness in (1e-1, 1e-3, 1e-5):
        solid = placed("film", _block((-0.5, -0.5, 0.0), (0.5, 0.5, thickness)), glass("diamond"))
        yield kept([solid], beam_light((-0.6, 0.0, 2.0), (0.3, 0.0, -1.0), 0.3), thickness, f"{thickness:g} thick")


def measure_contact(context: Context) -> Iterator[Measurement]:
    light = beam_light((-0.6, 0.0, 2.0), (0.3, 0.05, -1.0), 0.4)
    for gap in (1e-3, 1e-6, 0.0, -1e-6, -1e-3, -0.3):
        one = placed("one", _block((-0.5, -0.3, 0.0), (0.0, 0.3, 0.5)), glass("N-SF11"))
        other = placed("other", _block((gap, -0.3, 0.0), (0.5, 0.3, 0.5)), glass("N-BK7"))
        yield kept([one, other], light, gap, f"{gap:g} apart")


def measure_edge_on(context: Context) -> Iterator[Measurement]:
    for angle in (1e-2, 1e-5, 1e-8, 0.0):
        solid = placed("block", _block((-0.3, -0.3, 0.0), (0.3, 0.3, 0.5)), glass("N-SF11"))
        yield kept([solid], beam_light((0.1, 0.0, 2.0), (angle, 0.0, -1.0), 0.4), angle, f"{angle:g} rad")


def measure_near_points(context: Context) -> Iterator[Measurement]:
    solid = placed("block", _block((-0.5, -0.4, 0.0), (0.5, 0.4, 0.3)), glass("N-SF11"))
    for distance, bound in _FIRST_ORDER.items():
        light = PointLight("point", constant(1.0), position=(0.1, 0.05, 0.3 + distance))
        yield kept([solid], light, distance, f"{distance:g} above", bound)


CASES = (
    Case(
        "beam-slivers",
        "Beams through a facet ever thinner",
        "A beam cut to almost nothing has corners that rounding decides. What it loses its neighbour must get.",
        "width",
        measure_slivers,
        steps=4,
    ),
    Case(
        "beam-films",
        "Beams between parallel faces ever closer",
        "Dozens of events between faces that all but touch: none is skipped for being near, none met again.",
        "thickness",
        measure_films,
        steps=3,
    ),
    Case(
        "beam-contact",
        "Beams through solids apart, cemented, and one within the other",
        "Faces in one place are one interface; where solids overlap, which face is nearer changes along a line.",
        "gap",
        measure_contact,
        steps=6,
        logarithmic=False,
    ),
    Case(
        "beam-edge-on",
        "Facets seen from their edge",
        "A facet along the light catches none or a sliver of it, and never from its back.",
        "angle (rad)",
        measure_edge_on,
        steps=4,
        logarithmic=False,
    ),
    Case(
        "beam-near-points",
        "A point close to its facet",
        "Rays of a point are affine to first order only: beams are halved until a quarter of a texel does not show it.",
        "distance",
        measure_near_points,
        steps=3,
    ),
)
