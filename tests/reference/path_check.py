"""Photons of the GPU against float64 paths over the same triangles: position, weight, and every column by differences.

A photon's choices are read from its branch key, so the reference takes the same branches. Columns
are judged by central differences of whole paths, from the light on: no derivative formula is shared.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from reference.tracer import (
    RECEIVER,
    Body,
    Path,
    TriangleList,
    central_difference,
    follow,
    make_ray,
)
from spectrasplat.model.optics.colorimetry import VISIBLE_NM, mirror_reflectance
from spectrasplat.model.optics.glass import Dispersion
from spectrasplat.model.scene import Dielectric, Diffuse, Mirror, SceneObject
from spectrasplat.reference import glasses
from spectrasplat.reference.random_numbers import hash_combine
from spectrasplat.stress.rigs.gpu_paths import CUT_HIGH, CUT_LOW, MIRRORED, REFLECTED, REFRACTED, Photons, branch_key

CHOICES = (REFLECTED, REFRACTED, MIRRORED, CUT_LOW, CUT_HIGH)

STEP = 1e-4
"""Of all differences; fourth order leaves 1e-12 of round-off and less of truncation."""

IndexOf = Callable[[Dispersion], float]


@dataclass(frozen=True, eq=False)
class ReferenceScene:
    """Objects as the reference tracer takes them: glasses first, then mirrors from the end, receivers last."""

    objects: tuple[SceneObject, ...]
    triangles: TriangleList
    around_light: frozenset[int] = frozenset()
    """Glasses that the light stands in."""
    polarisation: bool = False
    """Paths carry their light's polarisation."""

    @staticmethod
    def of(objects: Sequence[SceneObject]) -> ReferenceScene:
        solids = [o for o in objects if isinstance(o.material, Dielectric)]
        mirrors = [o for o in objects if isinstance(o.material, Mirror)]
        corners, material, normals = [], [], []
        for item in objects:
            number = (
                solids.index(item)
                if item in solids
                else RECEIVER - 1 - mirrors.index(item)
                if item in mirrors
                else RECEIVER
            )
            corners.append(item.mesh.corners())
            material.append(np.full(len(item.mesh.triangles), number))
            smooth = item.mesh.corner_normals is not None and not isinstance(item.material, Diffuse)
            normals.append(item.mesh.corner_normals if smooth else np.zeros((len(item.mesh.triangles), 3, 3)))
        triangles = TriangleList(np.concatenate(corners), np.concatenate(material), np.concatenate(normals))
        return ReferenceScene((*solids, *reversed(mirrors)), triangles)

    def bodies(self, nm: float, index_of: IndexOf | None = None) -> list[Body]:
        """All materials at one wavelength, by default with the indices of the reference's own glasses."""
        index_of = index_of or (lambda glass: _own_index(glass, nm))
        found = []
        for item in self.objects:
            match item.material:
                case Dielectric(dispersion, absorption, priority):
                    per_unit = 0.0 if absorption is None else float(np.interp(nm, VISIBLE_NM, absorption.coefficient))
                    found.append(Body(index_of(dispersion), per_unit, priority=priority))
                case Mirror(rgb):
                    found.append(Body(reflectance=float(mirror_reflectance(rgb, np.array(nm))), kind="mirror"))
        return [*found, Body(kind="receiver")]

    def path(
        self,
        photons: Photons,
        q: np.ndarray,
        choices: Sequence[int],
        bodies: list[Body],
        along: Sequence[int] | None = None,
    ) -> Path:
        """The path from the emission domain's point `q` that takes a photon's choices."""
        events = [choice for choice in choices if choice in (REFLECTED, REFRACTED, MIRRORED)]
        position, direction = photons.emitter.start(q)
        return follow(
            make_ray(position, direction),
            self.triangles,
            bodies,
            lambda k: k < len(events) and events[k] == REFLECTED,
            len(events),
            along,
            self.around_light,
            self.polarisation,
        )

    def columns(self, photons: Photons, i: int, choices: Sequence[int], along: Sequence[int]) -> np.ndarray:
        """(2 + groups, 3): ∂position/∂s, /∂t and by each group's variable at photon i's anchor, by central
        differences."""
        nm = float(photons.nm[i, 1])
        same = self.bodies(nm)
        sides = [lambda x, e=e: self.path(photons, photons.q[i] + x * e, choices, same, along) for e in np.eye(2)]
        spectral = [
            lambda x, g=g: self.path(
                photons, photons.q[i], choices, self.bodies(nm, shifted_indices(photons, g, nm, x)), along
            )
            for g in range(photons.groups.count)
        ]
        return np.array([central_difference(path_of, STEP) for path_of in (*sides, *spectral)])


def choices_of(photons: Photons, longest: int) -> list[tuple[int, ...]]:
    """Each photon's choices, at most `longest` of them; KeyError where a path made more."""
    wanted = set(zip(photons.band.tolist(), photons.records["branch_key"].tolist(), strict=True))
    table = {}
    for band in np.unique(photons.band).tolist():
        keys = np.array([branch_key((), band)])
        for length in range(1, longest + 1):
            keys = hash_combine(keys[:, None], np.array(CHOICES)).ravel()
            for place in np.flatnonzero(np.isin(keys, photons.records["branch_key"])).tolist():
                if (band, int(keys[place])) in wanted:
                    digits = np.unravel_index(place, (len(CHOICES),) * length)
                    table[band, int(keys[place])] = tuple(CHOICES[digit] for digit in digits)
    return [table[key] for key in zip(photons.band.tolist(), photons.records["branch_key"].tolist(), strict=True)]


def shifted_indices(photons: Photons, group: int, nm: float, step: float) -> IndexOf:
    """Indices when the variable of one spectral group is `step` more than at `nm`."""
    groups = photons.groups
    members = [glass.name for glass, owner in zip(groups.glasses, groups.group, strict=True) if owner == group]
    moved_nm, added = nm, 0.0
    if groups.by_wavelength:
        moved_nm = nm + 1000.0 * step
    elif len(members) == 1:
        added = step
    else:
        moved_nm = float(photons.axis.nm_of_x(photons.axis.x_of_nm(nm) + step))

    def index_of(glass: Dispersion) -> float:
        if glass.name not in members:
            return float(glasses.index(glass.name, nm))
        return float(glasses.index(glass.name, moved_nm)) + added

    return index_of


def _own_index(glass: Dispersion, nm: float) -> float:
    """n of a scene's glass by the reference's own data, its dispersion scaled about the d line as the scene asks."""
    if glass.kind == "constant":
        return glass.n_d
    n, n_d = (float(glasses.index(glass.name, each)) for each in (nm, glasses.D_NM))
    return n_d + glass.gain * (n - n_d)
