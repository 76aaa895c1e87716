"""What the search for beams costs by facets and by threshold, and where photons take over.

Stones of one size in one narrow beam of daylight above a table: a box, a brilliant, and convex hulls of evenly spread
points, whose facets are triangles. What is counted does not depend on the machine; seconds do.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import msgspec
import numpy as np

from ..base.generators import finished
from ..beams.search import SUM_ENTERED, SUM_LEFT
from ..gpu.context import Context
from ..model.geometry.mesh import Mesh
from ..model.geometry.primitives import box, plane
from ..model.geometry.primitives_gem import brilliant
from ..model.lights import CollimatedLight
from ..model.optics.catalogue import find
from ..model.optics.spectrum import illuminant
from ..model.scene import Camera, Dielectric, Diffuse, Scene, SceneObject
from ..model.settings import RenderSettings
from ..render.beam_light import BeamLight
from ..render.device_scene import scene_buffers
from ..render.shown_spectra import ShownSpectra

FACETS = (6, 57, 200, 1_000, 4_000, 10_000)
THRESHOLDS = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)
MOST_SECONDS = 20.0
"""Once a search took longer, finer ones are left out."""
TEXEL = 0.01
"""Side of a map's texel, scene units."""
_DEPTH = 64


class BeamCost(msgspec.Struct, frozen=True):
    """One search."""

    facets: int
    threshold: float
    seconds: float
    beams: int
    polygons: int
    pieces: int
    left: float = msgspec.field(name="handed")
    """Share of the light that entered, that is left to photons."""
    by_beams: bool
    """A rendering would follow beams."""
    why_not: str


def measure(context: Context, facets: tuple[int, ...] = FACETS) -> Iterator[BeamCost]:
    """Every stone by thresholds from coarse to fine."""
    for count in facets:
        scene = scene_of(stone(count))
        settings = RenderSettings(width=480, height=270)
        buffers = scene_buffers(context, scene, settings)
        shown = ShownSpectra(context.ctx, scene, buffers, None)
        beams = BeamLight(context, scene, buffers, shown, _DEPTH)
        try:
            if not beams.finder.lights:
                why_not = beams.finder.scene.why_not.get(0, "")
                yield BeamCost(count, THRESHOLDS[0], 0.0, 0, 0, 0, 1.0, False, why_not)
                continue
            for _ in beams.surveying():
                pass
            beams.finder.set_texels(dict.fromkeys(beams.frames, TEXEL * buffers.space.scale))
            for threshold in THRESHOLDS:
                cost = _searched(beams, count, threshold)
                yield cost
                if cost.seconds > MOST_SECONDS:
                    break
        finally:
            beams.release()
            shown.release()
            buffers.release()


def stone(facets: int) -> Mesh:
    """A convex solid of about so many facets, a unit wide."""
    if facets <= 6:
        return box((0.8, 0.8, 0.8))
    if facets <= 57:
        return brilliant(1.0)
    from scipy.spatial import ConvexHull

    # A Fibonacci spiral; a hull of V points in general position has 2 V - 4 triangles.
    k = np.arange(facets // 2 + 2)
    z, turn = 1.0 - (2.0 * k + 1.0) / len(k), k * np.pi * (3.0 - np.sqrt(5.0))
    ring = np.sqrt(1.0 - z * z)
    points = 0.5 * np.stack([ring * np.cos(turn), ring * np.sin(turn), z], axis=1)
    triangles = ConvexHull(points).simplices
    a, b, c = (points[triangles[:, i]] for i in range(3))
    outward = np.einsum("ij,ij->i", np.cross(b - a, c - a), a + b + c) > 0.0
    return Mesh(f"{facets} facets", points, np.where(outward[:, None], triangles, triangles[:, ::-1]))


def scene_of(mesh: Mesh) -> Scene:
    """A stone of diamond, tilted, in a narrow beam above a table."""
    turned, raised = np.eye(4), np.eye(4)
    for axes, angle in (((1, 2), 0.21), ((0, 2), 0.13)):
        step = np.eye(4)
        step[np.ix_(axes, axes)] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
        turned = step @ turned
    raised[2, 3] = 1.0
    lamp = CollimatedLight("lamp", illuminant("D65"), position=(0.0, 0.0, 4.0), direction=(0.0, 0.0, -1.0), radius=0.4)
    return Scene(
        name=mesh.name,
        camera=Camera((0.0, -6.0, 4.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
        lights=(lamp,),
        objects=(
            SceneObject("stone", mesh, Dielectric(find("diamond")), raised @ turned),
            SceneObject("table", plane(30.0, 30.0), Diffuse((0.8, 0.8, 0.8)), np.eye(4)),
        ),
    )


def _searched(beams: BeamLight, facets: int, threshold: float) -> BeamCost:
    start = time.perf_counter()
    found = finished(beams.finder.find(threshold, _DEPTH, 1, tails=True))
    seconds = time.perf_counter() - start
    (sums,) = found.sums.values()
    return BeamCost(
        facets,
        threshold,
        seconds,
        int(found.followed()),
        0 if found.polygons is None else len(found.polygons),
        0 if found.pieces is None else len(found.pieces),
        float(sums[SUM_LEFT] / sums[SUM_ENTERED]),
        bool(beams.carried),
        beams.why_not,
    )


def plot(costs: list[BeamCost], stem: Path) -> None:
    """Seconds by beams followed, and what is left to photons by threshold, a line a stone: `stem`.png and .svg."""
    import matplotlib.pyplot as plt

    from .report import style

    names = ("srd", "srd-lambda", "stochastic", "regular-7", "progressive", "hero")
    with style.plot_style():
        figure, (left, right) = plt.subplots(1, 2, figsize=(9.0, 3.6), constrained_layout=True)
        for name, facets in zip(names, sorted({cost.facets for cost in costs}), strict=False):
            mine = [cost for cost in costs if cost.facets == facets and cost.by_beams]
            if not mine:
                continue
            colour, x = style.PALETTE[name][0], [cost.threshold for cost in mine]
            label = f"{facets:,d} facets"
            left.loglog(x, [cost.seconds for cost in mine], "o-", color=colour, label=label)
            right.semilogx(x, [cost.left for cost in mine], "o-", color=colour, label=label)
        left.set(xlabel="threshold, share of the light", ylabel="seconds of the search")
        right.set(xlabel="threshold, share of the light", ylabel="light left to photons")
        for axes in (left, right):
            axes.set_xticks(THRESHOLDS, [f"{threshold:g}" for threshold in THRESHOLDS])
            axes.minorticks_off()
            axes.invert_xaxis()
        left.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
        right.legend(frameon=False)
        style.save(figure, stem)
        plt.close(figure)


def line(cost: BeamCost) -> str:
    """One line of the table."""
    return (
        f"{cost.facets:7,d}  {cost.threshold:9.0e}  {cost.seconds:8.3f}  {cost.beams:9,d}  {cost.polygons:9,d}  "
        f"{cost.pieces:8,d}  {cost.left:7.4f}  {'beams' if cost.by_beams else 'photons: ' + cost.why_not}"
    )


HEAD = " facets  threshold   seconds      beams   polygons    pieces     left  a rendering follows"
