"""Scenes for beams, and for the rays that beams are held against: one text of a scene file makes both."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from spectrasplat.beams.convert import pieces_of, polygons_of
from spectrasplat.beams.facets import BeamScene, beam_scene
from spectrasplat.beams.find import Emission, Search, search
from spectrasplat.beams.sources import RIM, emissions, mask_at
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.optics.colorimetry import VISIBLE_NM, rgb_basis
from spectrasplat.model.optics.spectral_tables import SpectralAxis
from spectrasplat.model.scene import Scene

from .facet_rays import BLACK, GLASS, MIRROR, RECEIVER, Grid, Lamp, World

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
        [(leaves, sums, blocked)] = search(self.beams, [(emission, how)], 2)
        assert not blocked
        return leaves, sums

    def polygons(self, emission: Emission, threshold: float, seed: int = 1, depth: int = 64, drift: float = 1.0):
        """(polygons, sums) of one source."""
        leaves, sums = self.find(emission, threshold, seed, depth, drift)
        return polygons_of(leaves, self.beams, 0, 1.0), sums

    def pieces(self, emission: Emission, threshold: float, seed: int = 1, depth: int = 64):
        """(pieces, sums) of one source."""
        leaves, sums = self.find(emission, threshold, seed, depth)
        return pieces_of(leaves, self.beams, 0, 1.0), sums

    def world(self, x: float) -> World:
        """Its triangles at one spectral coordinate."""
        nm = float(self.axis.nm_of_x(x))
        objects = self.scene.objects
        count = len(objects)
        glass = sorted(
            (i for i, o in enumerate(objects) if o.material.transmits), key=lambda i: (objects[i].material.priority, i)
        )
        rank = np.full(count, -1, np.int64)
        rank[glass] = np.arange(len(glass))
        kind, index, absorption, rho = np.zeros(count, np.int64), np.ones(count), np.zeros(count), np.zeros(count)
        for i, item in enumerate(objects):
            material = item.material
            if material.transmits:
                kind[i], index[i] = GLASS, float(material.dispersion.index(np.array([nm]))[0])
                if material.absorption is not None:
                    absorption[i] = np.interp(nm, VISIBLE_NM, material.absorption.coefficient)
            elif material.is_mirror:
                kind[i] = MIRROR
                rho[i] = np.interp(nm, VISIBLE_NM, rgb_basis() @ np.asarray(material.reflectance_rgb, float))
            else:
                kind[i] = RECEIVER if material.receives else BLACK
        corners = np.concatenate([mesh.corners() for mesh in self.meshes])
        owner = np.concatenate([np.full(len(mesh.triangles), i) for i, mesh in enumerate(self.meshes)])
        return World(corners, owner.astype(np.int64), kind, rank, index, absorption, rho)

    def lamp(self, light: int = 0) -> Lamp:
        """A light as rays: all that may meet glass or a mirror. A round parallel light has the aperture that beams
        have: what else is between the circle and that polygon, tests/unit/test_beam_sources.py bounds."""
        it = self.scene.lights[light]
        right, up, forward = it.axes().T
        special = [i for i, o in enumerate(self.scene.objects) if o.material.is_specular]
        corners = np.concatenate([self.meshes[i].vertices for i in special])
        if it.is_parallel and it.has_place:
            rim = RIM if it.is_disc else 0
            return Lamp(np.array(it.position), forward, right, up, it.half_extent, it.is_disc, corners=rim)
        if it.is_parallel:
            middle = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
            tangent = np.tan(it.angular_radius)
            reach = np.linalg.norm(corners - middle, axis=1).max() * (1.0 + tangent) * 1.01
            back = 3.0 * reach
            half = reach + back * tangent
            return Lamp(middle - back * forward, forward, right, up, (half, half), False, tangent)
        place, half = np.array(it.position), it.half_extent
        if it.has_outline:
            return Lamp(place, forward, right, up, half, it.is_disc, 0.0, True, axis=forward, lambert=True)
        towards = corners.mean(axis=0) - place
        towards /= np.linalg.norm(towards)
        side = np.cross(towards, np.eye(3)[np.argmin(np.abs(towards))])
        side /= np.linalg.norm(side)
        other = np.cross(towards, side)
        depth = (corners - place) @ towards
        window = (0.0, 0.0, 0.0, 0.0)
        if depth.min() > 0.0:
            flat = np.stack([(corners - place) @ side, (corners - place) @ other]) / depth
            low, high = flat.min(axis=1), flat.max(axis=1)
            if np.abs(flat).max() < 3.0:
                window = (low[0], high[0], low[1], high[1])
        return Lamp(place, towards, side, other, (0.0, 0.0), False, 0.0, True, window, forward, it.cone)

    def grid(self, low: tuple[float, float], high: tuple[float, float], cells: int, receiver: int = 0) -> Grid:
        """Square cells, `cells` along u, from `low` to about `high`."""
        side = (high[0] - low[0]) / cells
        origin, axes = self.frames[receiver]
        return Grid(
            self.receivers[receiver], origin, axes, low, side, (cells, max(1, round((high[1] - low[1]) / side)))
        )


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
