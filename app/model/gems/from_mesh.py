"""The faceting design that a convex mesh of flat facets was cut by: its planes, as tiers on an index gear.

A stone may lie turned in its scene, or in its file with y up, and away from its origin: of the ways to look at it, that
with the fewest tiers is taken.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ...base.errors import UserError
from ..geometry.mesh import Mesh, convex_planes_of
from ..naming import place_of
from ..scene import Scene, SceneObject
from .facet_design import MOST_FACETS, FacetDesign, Tier

GEARS = (96, 64, 80, 72, 120, 32)
"""In the order in which they are tried."""
_MISSED = 0.005
"""Teeth by which a facet may be off a whole one."""
_SAME_DEG, _SAME_SHARE = 2e-3, 3e-6
"""Angles, and distances as a share of the size, that are one tier's: files of float32 know no better."""
_USUAL_HALF_WIDTH = (0.2, 2.0)
"""Programs of facetting start with a block of rough of about this size."""


def design_in(scene: Scene, name: str) -> tuple[FacetDesign, str]:
    """The design of the object `name`, and what it holds, in words.

    Raises `UserError` where there is none of that name, it is no convex solid of flat facets, or these stand on no
    gear's teeth.
    """
    item = scene.objects[place_of(name, [each.name for each in scene.objects], f"scene '{scene.name}' has no object")]
    n_d = item.material.dispersion.n_d if item.material.transmits and item.material.is_solid else None
    found: list[FacetDesign] = []
    refusals: list[str] = []
    for mesh in _ways_to_look(item):
        planes = convex_planes_of(mesh, MOST_FACETS)
        if planes is None:
            raise UserError(f"'{name}' is no faceted stone: {_why_none(mesh)}; a design has flat facets, no hollows")
        for origin in (np.zeros(3), _centroid(mesh)):
            moved = np.column_stack([planes[:, :3], planes[:, 3] - planes[:, :3] @ origin])
            size = float(np.ptp(mesh.vertices, axis=0).max())
            if moved[:, 3].min() > 1e-3 * size:
                try:
                    found.append(_design(moved, size, FacetDesign(name, (), n_d=n_d)))
                except ValueError as error:
                    refusals.append(str(error))
    if not found:
        raise UserError(f"'{name}': {refusals[0]}; export it as a mesh (.glb), or turn its facets to whole teeth")
    design = min(found, key=lambda each: len(each.tiers))
    wide = float(np.linalg.norm(design.mesh().vertices[:, :2], axis=1).max())
    words = f"{len(design.facets)} facets in {len(design.tiers)} tiers on a gear of {design.gear} teeth"
    if not _USUAL_HALF_WIDTH[0] <= wide <= _USUAL_HALF_WIDTH[1]:
        design = replace(design, tiers=tuple(replace(t, distance=t.distance / wide) for t in design.tiers))
        words += f", {1.0 / wide:.6g} times its size in the scene: such files have no unit"
    return design, words


def _ways_to_look(item: SceneObject) -> list[Mesh]:
    """Its mesh in its own coordinates, stretched as it is in the scene but not turned, and as it stands there."""
    linear = item.object_to_world[:3, :3]
    own = item.stretch
    if np.linalg.det(linear) < 0.0:
        own = np.diag([-1.0, 1.0, 1.0]) @ own
    ways = [own] if np.allclose(own, linear, atol=1e-12 * np.linalg.norm(own)) else [own, linear]
    return [item.mesh.transformed(np.block([[way, np.zeros((3, 1))], [np.zeros(3), np.ones(1)]])) for way in ways]


def _centroid(mesh: Mesh) -> np.ndarray:
    """Middle of the solid, float64 (3,)."""
    middle = 0.5 * np.add(*mesh.bounds())
    corners = mesh.corners() - middle
    volumes = np.einsum("ij,ij->i", corners[:, 0], mesh.area_vectors())
    return middle + (volumes @ corners.mean(axis=1)) * 0.75 / volumes.sum()


def _why_none(mesh: Mesh) -> str:
    if not mesh.is_closed:
        return "its mesh is open"
    if not mesh.is_faceted:
        return "its surface is smooth"
    return f"it is not convex, or has more than {MOST_FACETS} facets"


def _design(planes: np.ndarray, size: float, start: FacetDesign) -> FacetDesign:
    """`start` with the tiers of `planes`. Raises ValueError with a reason where they stand on no gear."""
    across = np.linalg.norm(planes[:, :2], axis=1)
    polar = np.degrees(np.arctan2(across, planes[:, 2]))
    groups = [
        group
        for alike in _alike(np.arange(len(planes)), polar, _SAME_DEG)
        for group in _alike(alike, planes[:, 3], _SAME_SHARE * size)
    ]
    angles = [_snapped(float(polar[group].mean())) for group in groups]
    flat = [group for group, angle in zip(groups, angles, strict=True) if angle in (0.0, 180.0)]
    level = np.concatenate([np.zeros(0, int), *flat])
    standing = np.setdiff1d(np.arange(len(planes)), level)
    turns = np.arctan2(planes[:, 1], planes[:, 0]) / (2.0 * math.pi) + 0.25
    gear, location = _gear(turns[standing], across[standing], polar[standing])
    teeth = np.rint(turns * gear + location).astype(int) % gear
    teeth[level] = 0
    parts: dict[str, list[Tier]] = {"P": [], "G": [], "C": []}
    for group, angle in sorted(zip(groups, angles, strict=True), key=lambda each: abs(each[1] - 90.0)):
        part = "P" if angle > 90.0 else "G" if angle == 90.0 else "C"
        name = {0.0: "T", 180.0: "Culet"}.get(angle, f"{part}{len(parts[part]) + 1}")
        indices = tuple(float(tooth or gear) for tooth in np.sort((teeth[group] - 1) % gear) + 1)
        signed = angle - 180.0 if angle > 90.0 else angle
        signed = -0.0 if angle == 180.0 else signed
        distance = float(planes[group, 3].mean())
        parts[part].append(Tier(signed, distance, indices, name))
    tiers = (*parts["P"], *parts["G"], *parts["C"])
    fold, is_mirrored = _symmetry(gear, [{int(i) % gear for i in t.indices} for t in tiers if t.angle_deg != 0.0])
    return replace(start, tiers=tiers, gear=gear, location=location, symmetry=fold, is_mirrored=is_mirrored)


def _alike(members: np.ndarray, values: np.ndarray, tolerance: float) -> list[np.ndarray]:
    """`members` parted where their sorted `values` have a gap."""
    order = members[np.argsort(values[members], kind="stable")]
    return np.split(order, np.flatnonzero(np.diff(values[order]) > tolerance) + 1)


def _snapped(polar: float) -> float:
    """A facet's angle from the table's normal, flat and upright ones exact."""
    return next((exact for exact in (0.0, 90.0, 180.0) if abs(polar - exact) < _SAME_DEG), polar)


def _gear(turns: np.ndarray, weights: np.ndarray, polar: np.ndarray) -> tuple[int, float]:
    """Teeth and location of the first gear on whose whole teeth all `turns` are. Raises ValueError."""
    misses: list[tuple[float, int, int]] = []
    for gear in GEARS:
        whole = (weights * np.exp(2j * np.pi * gear * turns)).sum()
        location = -float(np.angle(whole)) / (2.0 * math.pi) if abs(whole) > 1e-6 * weights.sum() else 0.0
        location = 0.0 if abs(location) < 1e-9 * gear else location
        off = np.abs(turns * gear + location - np.rint(turns * gear + location))
        worst = int((off * weights).argmax()) if len(off) else 0
        if not len(off) or off[worst] * weights[worst] <= _MISSED:
            return gear, location
        misses.append((float(off[worst]), gear, worst))
    miss, gear, worst = min(misses)
    angle = min(polar[worst], 180.0 - polar[worst])
    raise ValueError(
        f"its facets are on no whole teeth of a gear of {', '.join(map(str, sorted(GEARS)))}: on {gear}, which fits "
        f"best, a facet of {angle:.4g}° is {miss:.3g} of a tooth off"
    )


def _symmetry(gear: int, tiers: list[set[int]]) -> tuple[int, bool]:
    """How often a turn that leaves all `tiers` as they are goes into a whole one, and whether a mirror leaves them."""

    def holds(sign: int, step: int) -> bool:
        return all({(sign * index + step) % gear for index in tier} == tier for tier in tiers)

    fold = next(n for n in range(gear, 0, -1) if gear % n == 0 and holds(1, gear // n))
    return fold, any(holds(-1, step) for step in range(gear))
