"""The camera as a source of beams: what it sees by way of flat glass and mirrors, as polygons of its picture."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..model.camera_rays import camera_frame
from ..model.geometry.mesh import Mesh
from ..model.optics.colorimetry import daylight_per_lumen
from ..model.optics.spectral_tables import SpectralAxis, cumulative
from ..model.optics.spectrum import Spectrum
from ..model.scene import Camera, Scene
from .convert import hulls_around, objects_of, of_kind
from .facets import BLACK, SAMPLES, BeamScene, beam_scene, in_gpu_space
from .find import Emission, GoOn, Search, search
from .leaves import Leaves
from .polarised_arrays import from_one_axis
from .rays import PARALLEL, PINHOLE, SOURCE
from .screen_polygons import ScreenPolygons
from .search import LEAF_OPEN, LEAF_PIECE, LEAF_TAIL, SUM_BEAMS, SUM_ENTERED, SUM_LEAVES, SUMS
from .sources import colour_edges, distance_to, mask_at

TOLERANCE_PX = 0.1
"""How far, in pixels at the objects' distance, places and edges may be from linear."""
MAX_DEPTH = 48
"""Specular events that a beam is followed for: as many as a camera path (`passes.variants.MAX_DEPTH`)."""
_MOST_LEAVES = 50_000
"""Of one facet, 2 kB each."""


class CameraView:
    """The facets of one scene as its cameras see them."""

    def __init__(
        self,
        scene: Scene,
        world_meshes: list[Mesh],
        axis: SpectralAxis,
        to_gpu: Callable[[np.ndarray], np.ndarray],
        unit: float,
    ) -> None:
        """`to_gpu`, `unit`: scene to GPU space, GPU units a scene unit; `axis`: that of the camera's tables."""
        self._meshes = in_gpu_space(world_meshes, to_gpu, unit)
        self.scene: BeamScene = beam_scene(scene, self._meshes, {}, axis, unit)
        self._objects, self._axis, self._to_gpu, self._unit = len(scene.objects), axis, to_gpu, unit
        self.beams = 0
        """Followed by the last search, with what they ended as."""
        self.covered = 0.0
        """Pixels that it saw facets in, about."""
        self.gave_up = False
        """It found too much to go on; what it returned is a part."""

    def sees_all_angles(self, camera: Camera) -> bool:
        """Whether it sees a facet both from straight ahead and from more than 60° beside that: what the facet reflects
        and transmits has no slope where the search would take it, and is another farther out."""
        place = self._to_gpu(np.array(camera.position, float))
        facets = self.scene.facets[self.scene.facets["kind"] < BLACK]
        heights = np.abs(facets["plane"][:, :3] @ place - facets["plane"][:, 3])
        is_wide = 2.0 * heights < np.linalg.norm(facets["centre"] - place, axis=1) + facets["radius"]
        near = (distance_to(place, f["corner"][: f["corners"]]) for f in facets[is_wide])
        return camera.kind != "orthographic" and any(
            d < 1.0001 * h for d, h in zip(near, heights[is_wide], strict=True)
        )

    def find_screen_polygons(
        self,
        camera: Camera,
        size: tuple[int, int],
        threshold: float,
        seed: int = 1,
        faint: float = 0.0,
        threads: int | None = None,
        go_on: GoOn = lambda steps: True,
    ) -> tuple[ScreenPolygons, np.ndarray]:
        """Polygons of a picture of `size` pixels, and bool (O,): which objects they show. Camera rays that meet another
        object first are not among them.

        `threshold`: pixels times throughput and share of the spectrum below which a beam is handed to paths; `faint`:
        below which it plays roulette first. 0: nothing is handed, and roulette is played below the threshold."""
        shown = np.zeros(self._objects, bool)
        emission, footprint = self._emission(camera, size)
        if emission is None:
            return _screen_polygons([], self.scene, np.zeros(2), 1.0), shown
        # `search` takes a share of what enters: of as many pixels, about, as the objects cover.
        how = Search(threshold, seed, MAX_DEPTH, TOLERANCE_PX * footprint, sees=True, faint=faint, most=_MOST_LEAVES)
        leaves, sums, blocked = self._search(emission, how, threads, go_on, footprint)
        self.beams = int(sums[SUM_BEAMS] + sums[SUM_LEAVES])
        self.gave_up = any(len(part.head) >= _MOST_LEAVES for part in leaves)
        self.covered = float(sums[SUM_ENTERED]) / footprint**2
        shown[[o for o in self.scene.beam_objects if o not in blocked]] = True
        polygons = _screen_polygons(leaves, self.scene, 0.5 * np.array(size, float), footprint)
        return polygons.where(shown[polygons.source]), shown

    def _search(
        self, emission: Emission, how: Search, threads: int | None, go_on: GoOn, footprint: float
    ) -> tuple[list[Leaves], np.ndarray, set[int]]:
        entered = self._entered(emission)
        if entered <= 0.0:
            return [], np.zeros(SUMS), set()
        of_entered = footprint**2 / entered
        how = replace(how, threshold=how.threshold * of_entered, faint=how.faint * of_entered)
        return search(self.scene, emission, how, threads, go_on)

    def _entered(self, emission: Emission) -> float:
        """What enters (`search.SUM_ENTERED`), by a search that ends at once."""
        _, sums, _ = search(self.scene, emission, Search(1.0, 1, 1, 1e9, sees=True), 1, lambda steps: False)
        return float(sums[SUM_ENTERED])

    def _emission(self, camera: Camera, size: tuple[int, int]) -> tuple[Emission | None, float]:
        """The camera as a source whose q is the place in the picture about its middle, y downwards, in units in which
        a pixel is as large as what it sees at the nearest specular object; and that size, GPU units."""
        facets = self.scene.facets[self.scene.facets["kind"] < BLACK]
        if not len(facets):
            return None, 1.0
        right, up, forward = camera_frame(camera)
        place = self._to_gpu(np.array(camera.position, float))
        width, height = size
        limits = np.array([[width, 2.0, 0.0], [width, -2.0, 0.0], [height, 0.0, 2.0], [height, 0.0, -2.0]]) * 0.5
        if camera.kind == "orthographic":
            pixel = camera.vertical_extent * self._unit / height
            footprint, kind, scale = pixel, PARALLEL, 1.0
        else:
            pixel = 2.0 * np.tan(np.radians(0.5 * camera.vertical_fov_deg)) / height
            # A wide facet may be far nearer than its corners: only those are measured that may be nearest.
            within = np.linalg.norm(facets["centre"] - place, axis=1) - facets["radius"]
            farthest = np.linalg.norm(facets["corner"][:, 0] - place, axis=1).min()
            distance = min(distance_to(place, f["corner"][: f["corners"]]) for f in facets[within <= farthest])
            footprint, kind = pixel * max(float(distance), 0.02), PINHOLE
            scale = pixel / footprint
        limits[:, 0] *= footprint
        source = np.zeros(1, SOURCE)
        source["kind"], source["origin"], source["forward"] = kind, place, forward
        source["right"], source["up"], source["axis"], source["cone"] = scale * right, -scale * up, forward, 4.0
        room = np.array([0.0, 0.0, 0.5 * footprint * max(size) + footprint])
        daylight = Spectrum(daylight_per_lumen())
        bright = cumulative(self._axis, daylight).at(np.linspace(0.0, 1.0, SAMPLES))
        power = 0.5 * bright[:, 1] / bright[-1, 1] + 0.5 * bright[:, 3] / bright[-1, 3]
        mask = mask_at(place, self.scene, self._meshes)
        edges = colour_edges(self.scene, daylight, self._axis)
        return Emission(source, limits, room, power, power, (), (), True, edges, 1.0, mask), footprint


def _screen_polygons(leaves: list[Leaves], scene: BeamScene, middle: np.ndarray, footprint: float) -> ScreenPolygons:
    parts = [(of_kind(leaves, kind), kind) for kind in (LEAF_OPEN, LEAF_PIECE, LEAF_TAIL)]
    head = np.concatenate([part.head for part, _ in parts])
    count = [len(part.head) for part, _ in parts]
    x = np.concatenate([part.x for part, _ in parts])
    ray = np.concatenate([part.ray for part, _ in parts]) * np.array([1.0, footprint, footprint])[:, None]
    length = np.linalg.norm(ray[:, 1, :, :1], axis=-1, keepdims=True)
    ray[:, 1] /= length
    edges = np.concatenate([part.edge for part, _ in parts])
    edges = np.concatenate([edges[:, 0], edges[:, 2]], axis=1)
    for k in (0, 3):
        edges[:, k + 2] = edges[:, k + 2] / footprint - edges[:, k : k + 2] @ middle
    hulls = [hulls_around(part.corner, part.head[:, 7], np.zeros(len(part.head))) for part, _ in parts]
    counts = np.concatenate([np.diff(starts) for starts, _ in hulls])
    hull_start = np.concatenate([[0], np.cumsum(counts)])
    last = np.maximum(head[:, 2], 0)
    towards = np.einsum("mk,mk->m", ray[:, 1, 1, 0], scene.facets["plane"][last, :3])
    key = head[:, 8] & 0xFFFFFFFF
    return ScreenPolygons(
        np.repeat([False, True, True], count),
        head[:, 3].astype(np.int32),
        head[:, 4].astype(np.int32),
        key.astype(np.uint32),
        x[:, 0],
        x[:, 2],
        np.concatenate([part.centre for part, _ in parts]) / footprint + middle,
        ray[:, 0],
        ray[:, 1],
        np.concatenate([part.density for part, _ in parts]),
        np.concatenate([part.slope for part, _ in parts]) * footprint,
        from_one_axis(np.concatenate([part.state for part, _ in parts]), ray[:, 1, 1, 0]),
        scene.facets["triangle"][last].astype(np.int32),
        scene.facets["owner"][last].astype(np.int32),
        towards < 0.0,
        objects_of(head[:, 5], scene),
        np.concatenate([[0], np.cumsum(head[:, 6])]).astype(np.int32),
        edges,
        hull_start.astype(np.int32),
        np.concatenate([hull[1] for hull in hulls]) / footprint + middle,
    )
