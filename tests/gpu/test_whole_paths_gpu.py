"""Whole paths with everything that weakens them, GPU against float64: absorption, coloured mirrors, nested and
touching glass with priorities, Fresnel near total reflection, and bands that it cuts.

Each photon's position, flux, and throughput at the band's start, anchor and end are held against
exact paths at those three wavelengths through the same triangles.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest
from reference.path_check import ReferenceScene, choices_of
from spectrasplat.gpu.context import Context
from spectrasplat.model.geometry.primitives import box
from spectrasplat.model.geometry.primitives_round import sphere
from spectrasplat.model.lights import PointLight
from spectrasplat.model.optics import glass as dispersion
from spectrasplat.model.optics.colorimetry import VISIBLE_NM
from spectrasplat.model.optics.spectrum import constant
from spectrasplat.model.scene import (
    Absorption,
    Dielectric,
    Diffuse,
    Mirror,
    SceneObject,
)
from spectrasplat.reference import glasses
from spectrasplat.reference.glasses import D_NM
from spectrasplat.stress.rigs.gpu_paths import (
    CUT_HIGH,
    CUT_LOW,
    REFRACTED,
    beam_light,
    extruded,
    glass,
    placed,
    screen,
    trace_beam,
    trace_light,
)

pytestmark = pytest.mark.core

BAND = (579.0, 581.0)
"""So narrow that the columns' second order is below the tolerance, and what absorption gains by a path's change of
length; absorption steep enough to differ within it."""
HAZARD = 0.1
"""Paths with a smaller cosine at any surface are left to the stiff sweep."""


def ink(strength: float, slope_per_nm: float) -> Absorption:
    """Absorption that changes across `BAND` as dyes do over twenty times its width."""
    return Absorption(np.clip(strength + slope_per_nm * (VISIBLE_NM - 580.0), 0.0, 4.0))


def ball(
    material: Dielectric | Mirror, centre: tuple[float, float, float] = (0, 0, 0), radius: float = 1.0
) -> SceneObject:
    matrix = np.eye(4)
    matrix[:3, 3] = centre
    return placed(f"ball {centre} {radius}", sphere(radius, 320).transformed(matrix), material)


def gained(name: str, gain: float) -> Dielectric:
    """A glass with its dispersion scaled."""
    plain = glass(name)
    return replace(plain, dispersion=dispersion.with_gain(plain.dispersion, gain))


def touching() -> tuple[SceneObject, ...]:
    """A crown and a flint block cemented along a slant."""
    crown = np.array([[-1, -0.5], [-0.2, -0.5], [0.2, 0.5], [-1, 0.5]])
    flint = np.array([[-0.2, -0.5], [1, -0.5], [1, 0.5], [0.2, 0.5]])
    return (
        placed("crown", extruded("crown", crown), replace(glass("N-BK7"), absorption=ink(0.3, 0.02))),
        placed("flint", extruded("flint", flint), replace(glass("F2"), absorption=ink(0.2, -0.01))),
    )


LIGHT = PointLight("light", constant(1.0), position=(-3.0, 0.4, 0.3))


@dataclass(frozen=True)
class Case:
    """Objects in a closed room, and the least number of refractions of the paths compared."""

    objects: Callable[[], tuple[SceneObject, ...]]
    depth: int = 3
    refractions: int = 0
    tinted: bool = True
    """Whether throughput must differ within the band by much more than the tolerance."""
    covered: int = 0
    """Least number of compared paths that pass a surface which another solid covers."""
    lattice: int = 60
    tolerance: float = 1e-4
    """Relative. A mirror's colour has kinks at whole nanometres, which the spectral table rounds by 1e-3."""
    polarisation: bool = False
    compared: int = 24
    """Paths at most."""


CASES = {
    "absorption": Case(lambda: (ball(replace(glass("F2"), absorption=ink(0.4, 0.02))),), refractions=1),
    "absorption without dispersion": Case(
        lambda: (ball(Dielectric(dispersion.constant(1.5), ink(0.4, 0.02))),), refractions=1
    ),
    "coloured mirror": Case(
        lambda: (ball(Mirror((1.0, 0.1, 0.02)), (0, 0.5, 0)), ball(glass("water"), (-0.6, -1.4, 0.2), 0.7)),
        depth=4,
        tolerance=1e-3,
    ),
    "touching": Case(touching, refractions=3, lattice=200),
    "nested, the inner decides": Case(
        lambda: (
            ball(replace(glass("water"), absorption=ink(0.2, 0.02))),
            ball(replace(glass("N-SF11"), absorption=ink(0.6, -0.02), priority=1), (0.2, 0.1, 0), 0.5),
        ),
        depth=4,
        refractions=3,
    ),
    "nested, the outer decides": Case(
        lambda: (
            ball(replace(glass("water"), absorption=ink(0.4, 0.02), priority=1)),
            ball(replace(glass("N-SF11"), absorption=ink(3.0, 0.1)), (0.2, 0.1, 0), 0.5),
        ),
        refractions=2,
        covered=5,
    ),
    "overlapping": Case(
        lambda: (
            ball(replace(glass("water"), absorption=ink(0.4, 0.02), priority=1), (0, 0.4, 0), 0.8),
            ball(replace(glass("F2"), absorption=ink(0.2, 0.02)), (0.3, -0.3, 0), 0.8),
        ),
        refractions=2,
        covered=5,
    ),
    "two gains of one glass": Case(
        lambda: (ball(gained("F2", 4.0), (0, 0.7, 0), 0.65), ball(gained("F2", 0.25), (0, -0.7, 0), 0.65)),
        refractions=1,
        tinted=False,
        lattice=120,
    ),
    "steep Fresnel": Case(lambda: (ball(glass("N-SF11"), (0, 0, 0), 1.0),), tinted=False, lattice=120),
}


def weights_agree(gl: Context, case: Case) -> None:
    """Compare; AssertionError where a path is elsewhere or weaker."""
    objects = (*case.objects(), placed("room", box((16.0, 16.0, 16.0)), Diffuse()))
    photons = trace_light(gl, objects, LIGHT, [BAND], case.lattice, case.depth, polarisation=case.polarisation)
    reference = replace(ReferenceScene.of(objects), polarisation=case.polarisation)
    choices = choices_of(photons, case.depth)
    compared, covered, skipped, spread = 0, 0, 0, []
    rows = [
        i for i in np.random.default_rng(2).permutation(len(choices)) if choices[i].count(REFRACTED) >= case.refractions
    ]
    for i in rows[: case.compared]:
        lo, anchor, hi = photons.nm[i]
        path = reference.path(photons, photons.q[i], choices[i], reference.bodies(anchor))
        if np.linalg.norm(path.ray.position - photons.position[i]) > 1e-3 or len(path.reflections) != len(choices[i]):
            skipped += 1  # float32 chose the neighbouring triangle at an edge
            continue
        if path.margin < HAZARD:
            continue
        compared += 1
        covered += len(path.triangles) - 1 > len(path.reflections)
        assert np.linalg.norm(path.ray.position - photons.position[i]) < 1e-4, "position"
        ends = [
            reference.path(photons, photons.q[i], choices[i], reference.bodies(nm), path.triangles).transmittance
            for nm in (lo, hi)
        ]
        want = photons.weight[i] * np.array([ends[0], path.transmittance, ends[1]])
        got = photons.records["throughput"][i]
        assert (np.abs(got - want) <= case.tolerance * want).all(), f"throughput after {choices[i]}: {got / want - 1}"
        assert photons.records["flux_w"][i] == pytest.approx(want[1], rel=case.tolerance), f"flux after {choices[i]}"
        spread.append(np.ptp(want) / want[1])
    assert compared >= 12 and covered >= case.covered and skipped <= 2, (
        f"paths differ: {compared} the same, {covered} of them through covered surfaces, {skipped} others"
    )
    assert not case.tinted or np.sort(spread)[-4] > 20 * case.tolerance, spread


@pytest.mark.parametrize("name", CASES)
def test_position_and_throughput_at_three_wavelengths(gl, name: str) -> None:
    weights_agree(gl, CASES[name])


def cuts_agree(gl: Context, polarisation: bool = False) -> None:
    """A band that total reflection cuts at a face where it arrives dispersed in place and direction; both parts against
    exact paths."""
    apex, n = np.pi / 3, float(glasses.index("N-BK7", 503.0))
    turned = np.arcsin(n * np.sin(apex - np.arcsin(1 / n))) - apex / 2
    along, across = np.array([[np.cos(turned), np.sin(turned)], [-np.sin(turned), np.cos(turned)]])
    entry = np.array([-0.3, 0.35])
    # A slanting plate shifts colours against each other and leaves their direction, so the prism still cuts at 503 nm.
    plate = np.array(
        [
            entry - 2.2 * along + u * along + v * (across + 0.5 * along)
            for u, v in ((0, -0.8), (1.2, -0.8), (1.2, 0.8), (0, 0.8))
        ]
    )
    prism = np.array([[-0.5, 0.0], [0.5, 0.0], [0.0, np.sqrt(0.75)]])
    solids = (
        placed("plate", extruded("plate", plate), glass("F2")),
        placed("prism", extruded("prism", prism), glass("N-BK7")),
    )
    objects = (*solids, placed("room", box((16.0, 16.0, 16.0)), Diffuse()))
    light = beam_light(np.append(entry - 4 * along, 0.0), np.append(along, 0.0), 0.1)
    photons = trace_light(gl, objects, light, [(500.0, 506.0)], 150, 5, polarisation=polarisation)
    reference = replace(ReferenceScene.of(objects), polarisation=polarisation)
    choices = choices_of(photons, 7)
    parts = {
        part: [i for i, made in enumerate(choices) if made[:4] == (REFRACTED, REFRACTED, REFRACTED, part)]
        for part in (CUT_LOW, CUT_HIGH)
    }
    assert min(map(len, parts.values())) > 10
    # The longer part gets out and begins where nothing passes; the shorter one is reflected whole.
    for i in parts[CUT_HIGH][:8] + parts[CUT_LOW][:8]:
        events = choices[i]
        lo, anchor, hi = photons.nm[i]
        path = reference.path(photons, photons.q[i], events, reference.bodies(anchor))
        assert len(path.reflections) == len(events) - 1, "path"
        assert np.linalg.norm(path.ray.position - photons.position[i]) < 2e-5, f"position after {events}"
        ends = [reference.path(photons, photons.q[i], events, reference.bodies(nm), path.triangles) for nm in (lo, hi)]
        # Exactly at the cut either may happen; what is reflected there does not get out.
        shares = [end.transmittance if end.reflections == path.reflections else 0.0 for end in (ends[0], path, ends[1])]
        want = photons.weight[i] * np.array(shares)
        got = photons.records["throughput"][i]
        # Next to the cut T goes by a square root: 1e-7 of cosine² is 3e-4 of cosine, and four times that of T.
        assert np.abs(got - want).max() < 3e-3 * photons.weight[i], (
            f"throughput after {events}: {got / photons.weight[i]}, {want / photons.weight[i]}"
        )


@pytest.mark.parametrize("polarisation", [False, True], ids=["unpolarised", "polarised"])
def test_cut_bands_against_exact_paths(gl, polarisation: bool) -> None:
    cuts_agree(gl, polarisation)


@pytest.mark.parametrize(("scale", "offset"), [(1e-4, 0.0), (1e4, 0.0), (1.0, 1e4), (1e-2, -300.0)])
def test_the_same_scene_elsewhere_and_in_other_units(gl, scale: float, offset: float) -> None:
    """A ball's photons do not depend on the unit of length or on where the origin is."""
    centre = np.array([offset, -0.7 * offset, 0.3 * offset])
    matrix = np.diag([scale, scale, scale, 1.0])
    matrix[:3, 3] = centre
    plain, moved = (
        trace_beam(
            gl,
            sphere(1.0, 1280).transformed(m),
            glass("N-BK7"),
            screen([1.2, 0, 0], [1, 0, 0]).transformed(m),
            m[:3] @ [-3, 0, 0, 1],
            [1, 0, 0],
            0.8 * m[0, 0],
            D_NM,
            count=300,
        ).of_depth(2)
        for m in (np.eye(4), matrix)
    )
    plain, moved = (photons.where(np.argsort(photons.records["photon_id"])) for photons in (plain, moved))
    assert np.array_equal(plain.records["photon_id"], moved.records["photon_id"])
    assert len(plain.records) > 200
    assert np.abs((moved.start - centre) / scale - plain.start).max() < 1e-10
    # Corners rounded elsewhere turn facets of width 0.05 by 1e-6.
    assert np.abs((moved.position - centre) / scale - plain.position).max() < 4e-5
    assert np.abs(moved.dposition_dn / scale - plain.dposition_dn).max() < 4e-6
    assert moved.records["flux_w"] / scale**2 == pytest.approx(plain.records["flux_w"], rel=2e-6)
