"""Scenes for beams, and for the rays that beams are held against: one text of a scene file makes both."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from spectrasplat.beams.convert import pieces_of, polygons_of
from spectrasplat.beams.facets import BeamScene, beam_scene
from spectrasplat.beams.find import Emission, Search, search
from spectrasplat.beams.sources import emissions, mask_at
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.optics.spectral_tables import SpectralAxis
from spectrasplat.model.optics.spectrum import Spectrum
from spectrasplat.model.scene import Scene
from spectrasplat.reference.photon_emission import scene_domains
from spectrasplat.reference.photon_kernel import land
from spectrasplat.reference.photon_scene import photon_scene
from spectrasplat.reference.rounds import TALLY_SIZE
from spectrasplat.reference.sampling import scrambled, scratch

FLOOR = """
[[objects]]
name = "floor"
shape = "plane"
width = 60.0
height = 60.0
position = [0.0, 0.0, {z}]
material = {{ kind = "diffuse", colour = 0.8 }}
"""


def scene_of(text: str, floor_z: float | None = 0.0) -> Scene:
    """A scene from the text of its file, with a floor."""
    if floor_z is not None:
        text += FLOOR.format(z=floor_z)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scene.toml"
        path.write_text(text)
        return load_scene(path)


@dataclass(frozen=True)
class Grid:
    """Cells on a receiver: places origin + u axes[0] + v axes[1], cells of `side` from `low` on."""

    receiver: int
    """Its object."""
    origin: np.ndarray
    axes: np.ndarray
    low: tuple[float, float]
    side: float
    shape: tuple[int, int]
    """Along u, along v."""


@dataclass(frozen=True)
class Landed:
    """What the reference's photons found, per unit of spectral power: mean and variance by cell, and of all of it."""

    flux: np.ndarray
    variance: np.ndarray
    total: float
    """On the receiver, inside the grid or not."""
    total_variance: float
    weight: float
    """Of a photon that landed, by mean square over mean."""


@dataclass
class Rig:
    """A scene in scene units (they are GPU units too), its beams and its rays."""

    scene: Scene
    texel: float = 1e-3

    def __post_init__(self) -> None:
        self.meshes = [o.mesh.transformed(o.object_to_world) for o in self.scene.objects]
        self.axis = SpectralAxis.build([o.material.dispersion for o in self.scene.objects if o.material.dispersion])
        self.receivers = [i for i, o in enumerate(self.scene.objects) if o.material.receives for _ in range(2)]
        self.frames = {}
        for number, i in enumerate(self.receivers):
            if self.scene.objects[i].mesh.is_flat:
                corners = self.meshes[i].vertices
                normal = self.meshes[i].face_normals()[0]
                u = np.cross(np.eye(3)[1] if abs(normal[1]) < 0.9 else np.eye(3)[0], normal)
                u /= np.linalg.norm(u)
                self.frames[number] = corners.mean(axis=0), np.stack([u, np.cross(normal, u)])
        self.beams: BeamScene = beam_scene(self.scene, self.meshes, self.frames, self.axis, 1.0)
        self.beams.facets["texel"] = 0.25 * self.texel

    def emissions(self, light: int = 0, parts: int = 1) -> list[Emission]:
        """A light as sources of beams."""
        lamp = self.scene.lights[light]
        inside = 0
        if lamp.has_place and not lamp.is_parallel:
            inside = mask_at(np.array(lamp.position), self.beams, self.meshes)
        return emissions(lamp, self.beams, lambda p: np.asarray(p, float), 1.0, self.axis, parts, inside)

    def find(self, emission: Emission, threshold: float, seed: int = 1, depth: int = 64, drift: float = 1.0):
        """(leaves, sums) of one source."""
        how = Search(threshold, seed, depth, 0.25 * self.texel, drift)
        [(leaves, sums)] = search(self.beams, [(emission, how)], 2)
        return leaves, sums

    def polygons(self, emission: Emission, threshold: float, seed: int = 1, depth: int = 64, drift: float = 1.0):
        """(polygons, sums) of one source."""
        leaves, sums = self.find(emission, threshold, seed, depth, drift)
        return polygons_of(leaves, self.beams, 0, 1.0), sums

    def pieces(self, emission: Emission, threshold: float, seed: int = 1, depth: int = 64):
        """(pieces, sums) of one source."""
        leaves, sums = self.find(emission, threshold, seed, depth)
        return pieces_of(leaves, self.beams, 0, 1.0), sums

    def grid(self, low: tuple[float, float], high: tuple[float, float], cells: int, receiver: int = 0) -> Grid:
        """Square cells, `cells` along u, from `low` to about `high`."""
        side = (high[0] - low[0]) / cells
        origin, axes = self.frames[receiver]
        return Grid(
            self.receivers[receiver], origin, axes, low, side, (cells, max(1, round((high[1] - low[1]) / side)))
        )


def landed(rig: Rig, x: float, grid: Grid, photons: int) -> Landed:
    """Photons of one spectral coordinate by the float64 reference (exact triangles, Fresnel by chance), which shares no
    code with beams: those that land on the grid's receiver, from above, by glass or mirrors."""
    line = Spectrum(np.zeros(401), ((float(rig.axis.nm_of_x(x)), 1.0),))
    scene = replace(rig.scene, lights=tuple(replace(light, spectral_power=line) for light in rig.scene.lights))
    traced, centre = photon_scene(scene)
    domains, colours = scene_domains(scene, traced, centre)
    side = np.full((len(scene.objects), 2), -1, np.int32)
    side[grid.receiver, 0] = 0
    count = photons // len(domains)
    points, watts, ends = np.empty((count, 3)), np.empty(count), np.empty((count, 4), np.int32)
    sums, squares, total = np.zeros(grid.shape), np.zeros(grid.shape), np.zeros(2)
    for number, (domain, colour) in enumerate(zip(domains, colours, strict=True)):
        one, start = np.zeros(len(colour.start_nm), np.int32), (scrambled(1, 0, number), 0, count, 1.0 / count)
        found = land(
            traced, domain, colour, one, side, *start, 64, np.zeros(TALLY_SIZE), points, watts, ends, scratch()
        )
        each = watts[:found]
        total += each.sum(), (each**2).sum()
        at = ((points[:found] + centre - grid.origin) @ grid.axes.T - grid.low) / grid.side
        cells = [np.arange(n + 1) for n in grid.shape]
        sums += np.histogramdd(at, cells, weights=each)[0]
        squares += np.histogramdd(at, cells, weights=each**2)[0]
    return Landed(sums, squares - sums**2 / photons, total[0], total[1] - total[0] ** 2 / photons, total[1] / total[0])


def at_index(emission: Emission, *x: float) -> Emission:
    """The source with emission lines alone, one at each of `x`, each of power 1."""
    return replace(emission, lines=tuple(x), line_shares=(1.0,) * len(x), is_continuous=False)


def grid_about(rig: Rig, polygons, side: int, least: float = 0.5, most: float = 5.0) -> Grid:
    """`side`² cells about where nine tenths of the hulls' corners lie."""
    low, high = np.percentile(polygons.hulls, 5, axis=0), np.percentile(polygons.hulls, 95, axis=0)
    middle, half = 0.5 * (low + high), float(np.clip(0.5 * (high - low).max(), least, most))
    return rig.grid(tuple(middle - half), tuple(middle + half), side)


def scores(
    found: np.ndarray, exact: np.ndarray, variance: np.ndarray, weight: float, least: float = 25.0
) -> np.ndarray:
    """Standard scores by cell of what rays of mean `weight` found; cells that expect fewer than `least` rays are
    one."""
    few = exact < least * weight
    # The weight of a ray in this cell: what varies with its number is only how many there are.
    each = np.where(found > 0.0, variance / np.where(found > 0.0, found, 1.0), weight)
    z = (found - exact)[~few] / np.sqrt((exact * each)[~few])
    rest = max(float((exact * weight)[few].sum()), weight * weight)
    return np.append(z, (found - exact)[few].sum() / np.sqrt(rest))
