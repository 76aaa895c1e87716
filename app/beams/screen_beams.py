"""Beams that set out from the camera: its picture's polygons."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..model.camera_rays import camera_frame
from ..model.optics.colorimetry import VISIBLE_NM, cmf_xyz
from ..model.optics.spectral_tables import SpectralAxis
from ..model.scene import Camera
from .convert import Chosen, hulls_around, objects_of
from .facets import SAMPLES, BeamScene
from .find import Emission, Search, search
from .leaves import Leaves
from .rays import PARALLEL, PINHOLE, SOURCE
from .screen_polygons import ScreenPolygons
from .search import LEAF_OPEN, LEAF_PIECE

_TOLERANCE = 0.25
"""Pixels."""


def camera_emission(
    camera: Camera,
    size: tuple[int, int],
    to_gpu: Callable[[np.ndarray], np.ndarray],
    unit: float,
    axis: SpectralAxis,
    inside: int = 0,
) -> Emission:
    """A camera as a source; q is the place in its picture, pixels, y downwards. `inside`: mask of the solids that it
    stands in."""
    width, height = size
    right, up, forward = camera_frame(camera)
    record = np.zeros(1, SOURCE)
    position = to_gpu(np.array(camera.position))
    if camera.kind == "orthographic":
        pixel = camera.vertical_extent * unit / height
        record["kind"], record["forward"] = PARALLEL, forward
        record["origin"] = position - 0.5 * pixel * (width * right - height * up)
    else:
        pixel = 2.0 * np.tan(np.radians(0.5 * camera.vertical_fov_deg)) / height
        record["kind"], record["origin"] = PINHOLE, position
        record["forward"] = forward - 0.5 * pixel * (width * right - height * up)
    record["right"], record["up"], record["axis"], record["cone"] = pixel * right, -pixel * up, forward, 4.0
    # Half by brightness, half evenly along the axis, on which dispersion is even.
    x = np.linspace(0.0, 1.0, SAMPLES)
    bright = np.interp(axis.nm_of_samples(SAMPLES), VISIBLE_NM, np.cumsum(cmf_xyz()[:, 1]))
    bright -= bright[0]
    power = 0.5 * bright / bright[-1] + 0.5 * x
    limits = np.array([[0.0, 1.0, 0.0], [width, -1.0, 0.0], [0.0, 0.0, 1.0], [height, 0.0, -1.0]])
    room = np.array([0.5 * width, 0.5 * height, 0.5 * max(width, height) + 1.0])
    return Emission(record, limits, room, power, (), (), True, 1.0, inside)


def find_screen_polygons(
    scene: BeamScene,
    camera: Camera,
    size: tuple[int, int],
    to_gpu: Callable[[np.ndarray], np.ndarray],
    unit: float,
    axis: SpectralAxis,
    threshold: float,
    depth: int,
    seed: int,
    inside: int = 0,
    threads: int | None = None,
    go_on: Callable[[], bool] = lambda: True,
) -> tuple[ScreenPolygons, tuple[int, ...]]:
    """What a picture of `size` pixels shows by way of flat facets, and the objects for which that is so: other paths
    must follow those that something not flat may stand before.

    `threshold`: share of the picture's specular part below which a beam plays roulette; `depth`: most specular events.
    """
    emission = camera_emission(camera, size, to_gpu, unit, axis, inside)
    how = Search(threshold, seed, depth, _TOLERANCE, sees=True)
    leaves, _, blocked = search(scene, emission, how, threads, go_on)
    carried = tuple(o for o in scene.beam_objects if o not in blocked)
    return _screen_polygons(leaves, scene), carried


def _screen_polygons(leaves: list[Leaves], scene: BeamScene) -> ScreenPolygons:
    chosen = Chosen(leaves, (LEAF_OPEN, LEAF_PIECE))
    head = chosen.head
    last = np.maximum(head[:, 2], 0)
    hull_start, hulls = hulls_around(chosen, np.zeros(len(head)))
    towards = np.einsum("mk,mk->m", chosen.ray[:, 1, 1, 0], scene.facets["plane"][last, :3])
    return ScreenPolygons(
        is_handed=head[:, 0] == LEAF_PIECE,
        source=head[:, 3].astype(np.int32),
        depth=head[:, 4].astype(np.int32),
        key=head[:, 8].astype(np.uint32),
        x_lo=chosen.x[:, 0],
        x_hi=chosen.x[:, 2],
        centre=chosen.centre,
        position=chosen.ray[:, 0],
        direction=chosen.ray[:, 1],
        throughput=chosen.density,
        last_triangle=scene.facets["triangle"][last].astype(np.int32),
        last_object=scene.facets["owner"][last].astype(np.int32),
        is_inside=towards < 0.0,
        inside=objects_of(head[:, 5], scene),
        edge_start=np.concatenate([[0], np.cumsum(head[:, 6])]).astype(np.int32),
        edges=np.concatenate([chosen.edges[:, 0], chosen.edges[:, 2]], axis=1),
        hull_start=hull_start,
        hulls=hulls,
    )

