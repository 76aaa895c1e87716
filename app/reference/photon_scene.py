"""The scene as the reference renderer sees it: flat float64 arrays that compiled code can walk through.

Made straight from `spectrasplat.model`, in world lengths about the middle of the specular objects, so that
nothing of the GPU's packing, float32 rounding or half-space solids enters the reference. Media follow
the rule of nested dielectrics (Schmidt and Budge, "Simple Nested Dielectrics in Ray Traced
Images", 2002): of all solids a point lies in, the one of highest rank is its medium.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..base.errors import UserError
from ..model.contacts import overlapping_solids
from ..model.geometry.bvh import Bvh, build_bvh
from ..model.geometry.mesh import Mesh
from ..model.optics.colorimetry import K_M, VISIBLE_NM, cmf_xyz, rgb_basis, xyz_to_rgb709_matrix
from ..model.optics.spectrum import Spectrum, cmf_at
from ..model.scene import Polariser, Scene
from .gratings import gratings
from .rough_albedo import albedo_tables
from .scene_surfaces import Surfaces
from .thin_films import Films, films_of

BLACK, DIFFUSE, MIRROR, DIELECTRIC, GRATING, SHEET, POLARISER = range(7)
OUTSIDE = -1
"""In place of an object: air."""

TABLE_NM = np.linspace(380.0, 780.0, 8001)
"""Grid of index and weight tables; linear between them n errs below 1e-8 for every catalogue glass."""
_NEAR = 1e-9
"""Share of the scene's size below which two surfaces count as one place."""
_CONTACT = 3e-5
"""What counts as contact, where the radius of the specular objects is one or rounded down or up to a power of two. The
renderer's own limit: how thick a film of air may be before it is one is a matter of definition."""
_MAX_STACK = 60


class PhotonScene(NamedTuple):
    """Everything a photon meets. T surfaces in tree order, triangles or curved ones; O objects, N tree nodes."""

    node_bounds: np.ndarray
    """float64 (N, 6): low and high corner; children of a node are neighbours."""
    node_first: np.ndarray
    """int32 (N,): left child, or first surface of a leaf."""
    node_count: np.ndarray
    """int32 (N,): surfaces of a leaf, 0 for an inner node."""
    corners: np.ndarray
    """float64 (T, 9): first corner, then both edges from it; of a curved surface, the diagonal of its box."""
    normals: np.ndarray
    """float64 (T, 3): unit geometric normal, outward; 0 of a curved surface."""
    owner: np.ndarray
    """int32 (T,): object."""
    facet: np.ndarray
    """int32 (T,): triangle of the object's mesh, or −1."""
    curved: np.ndarray
    """int32 (T,): row of `forms`, or −1 for a triangle."""
    forms: np.ndarray
    """float64 (Q, `curved_surfaces.FORM_SIZE`)."""
    smooth: np.ndarray
    """int32 (T,): row of `corner_normals`, or −1 for a flat facet."""
    corner_normals: np.ndarray
    """float64 (S, 9)."""
    kind: np.ndarray
    """int32 (O,)."""
    medium: np.ndarray
    """int32 (O,): row of `refractive_index`, or −1."""
    extraordinary: np.ndarray
    """int32 (O,): row of `refractive_index` of a crystal's second index, or −1."""
    axis: np.ndarray
    """float64 (O, 3): unit optic axis, or that of a polariser."""
    sheet: np.ndarray
    """float64 (O, 3): amplitudes that a polariser lets through along its axis and across, and its retardance, nm."""
    birefringent: bool
    """There are crystals."""
    weight: np.ndarray
    """int32 (O,): row of `weights` (absorption per unit, or a mirror's reflectance), or −1."""
    filter: np.ndarray
    """int32 (O,): row of `weights` (what a surface of glass lets through of what enters), or −1."""
    bit: np.ndarray
    """int32 (O,): rank of a solid among those that nest or touch, or −1."""
    stack: np.ndarray
    """int32 (B,): object of each rank."""
    reflectance: np.ndarray
    """float64 (O, 3): linear Rec.709 factor of a receiver (1 where its reflectance is a spectrum)."""
    reflectance_class: np.ndarray
    """int32 (O,): row of the colour tables."""
    refractive_index: np.ndarray
    """float64 (M, 8001): n on `TABLE_NM`."""
    weights: np.ndarray
    """float64 (W, 8001)."""
    lines: np.ndarray
    """float64 (O, 3): along a grating's lines."""
    first_order: np.ndarray
    """int32 (O + 1,): where the orders of each object's grating begin, and the last's end."""
    orders: np.ndarray
    """float64 (R, `gratings.COLUMNS`)."""
    microfacet_width: np.ndarray
    """float64 (O,): GGX's α of an object's surface; 0: it is polished."""
    albedo: np.ndarray
    """float64 (O or 1, ratios, nodes): share that leaves after one microfacet (`rough_albedo`)."""
    near: float
    """Distances below this are the same place."""
    contact: float
    """Nearer than this, what is no glass is silver, black or paint on what it touches."""
    polarised: bool
    """Paths carry their light's polarisation."""
    films: Films
    backwards: bool = False
    """Paths go from the camera, against the light."""


class Colours(NamedTuple):
    """One light's spectrum as A atoms: nanometre cells and lines, drawn by `cdf`."""

    cdf: np.ndarray
    """float64 (A + 1,): 0 to 1."""
    start_nm: np.ndarray
    width_nm: np.ndarray
    """float64 (A,) each; a line has no width."""
    watt: np.ndarray
    """float64 (A,): power over probability."""
    rgb: np.ndarray
    """float64 (classes, A, 3): linear Rec.709 per watt, lm/W, the class's reflectance included."""


def photon_scene(scene: Scene) -> tuple[PhotonScene, np.ndarray]:
    """The arrays, and the world position float64 (3,) of their origin.

    Raises UserError where more solids nest or touch than a photon can remember.
    """
    meshes = [item.mesh.transformed(item.object_to_world) for item in scene.objects]
    centre, size = _middle(scene, meshes)
    surfaces = Surfaces()
    for index, (mesh, item) in enumerate(zip(meshes, scene.objects, strict=True)):
        surfaces.add(index, item, mesh, centre)
    corners, owner, facet, curved = surfaces.arrays()
    tree = build_bvh(corners.astype(np.float32))
    order = tree.order
    corners, owner, facet, curved = corners[order], owner[order], facet[order], curved[order]
    normals, smooth, corner_normals = surfaces.normals(order)
    rank = _ranks(scene)
    media, weights = _Rows(), _Rows()
    kinds, medium, other, weight, filters = [], [], [], [], []
    for item in scene.objects:
        material = item.material
        kinds.append(material.met_as)
        medium.append(media.add(material.dispersion.index(TABLE_NM)) if material.transmits else -1)
        other.append(media.add(material.extraordinary.index(TABLE_NM)) if material.is_crystal else -1)
        weight.append(-1)
        filters.append(-1)
        if material.filters:
            filters[-1] = weights.add(np.interp(TABLE_NM, VISIBLE_NM, material.surface_filter))
        if material.absorption is not None and material.is_solid:
            weight[-1] = weights.add(np.interp(TABLE_NM, VISIBLE_NM, material.absorption.coefficient))
        elif material.is_mirror:
            reflectance = rgb_basis() @ np.asarray(material.reflectance_rgb, float)
            weight[-1] = weights.add(np.interp(TABLE_NM, VISIBLE_NM, reflectance))
    _, reflectance_class = reflectance_classes(scene)
    factor = [
        np.asarray(o.material.reflectance_rgb, float)
        if o.material.receives and o.material.reflectance is None
        else np.ones(3)
        for o in scene.objects
    ]
    bounds, first, count = _exact_nodes(tree, corners)
    widths = np.array([item.material.microfacet_width for item in scene.objects], float)
    return PhotonScene(
        bounds,
        first,
        count,
        np.concatenate([corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], axis=1),
        np.ascontiguousarray(normals),
        owner,
        facet,
        curved,
        surfaces.forms(),
        smooth,
        corner_normals,
        np.array(kinds, np.int32),
        np.array(medium, np.int32),
        np.array(other, np.int32),
        *_axes(scene),
        any(row >= 0 for row in other),
        np.array(weight, np.int32),
        np.array(filters, np.int32),
        np.array([rank.get(i, -1) for i in range(len(meshes))], np.int32),
        np.array(sorted(rank, key=lambda i: rank[i]) or [OUTSIDE], np.int32),
        np.array(factor),
        reflectance_class,
        media.array(),
        weights.array(),
        *gratings(scene),
        widths,
        albedo_tables(widths, np.array([item.material.is_mirror for item in scene.objects])),
        _NEAR * size,
        _CONTACT * 2.0 ** round(float(np.log2(size))),
        scene.polarised,
        films_of(scene, TABLE_NM, centre),
    ), centre


def _axes(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """`axis` and `sheet` of a `PhotonScene`."""
    axis, sheet = np.zeros((len(scene.objects), 3)), np.zeros((len(scene.objects), 3))
    for index, item in enumerate(scene.objects):
        material = item.material
        if isinstance(material, Polariser):
            along, across = np.sqrt([material.transmittance, material.crossed_transmittance])
            sheet[index] = along, across, material.retardance_nm
        if material.polarises:
            axis[index] = material.axis_in_world(item.object_to_world)
    return axis, sheet


def colours(spectrum: Spectrum, classes: list[np.ndarray | None]) -> Colours:
    """Atoms of a spectrum: drawn mostly by what the eye sees, partly by power.

    A cell has the colour of its nanometre, as everywhere in the program; a line that of its own wavelength.
    """
    lit = np.flatnonzero(spectrum.density > 0.0)
    line_nm = np.array([nm for nm, power in spectrum.lines if power > 0.0])
    line_power = np.array([power for _, power in spectrum.lines if power > 0.0])
    low, high = np.maximum(VISIBLE_NM[lit] - 0.5, VISIBLE_NM[0]), np.minimum(VISIBLE_NM[lit] + 0.5, VISIBLE_NM[-1])
    start = np.concatenate([low, line_nm])
    width = np.concatenate([high - low, np.zeros(len(line_nm))])
    power = np.concatenate([spectrum.density[lit], line_power])
    if not len(power):
        return Colours(
            np.array([0.0, 1.0]), np.array([560.0]), np.zeros(1), np.zeros(1), np.zeros((len(classes), 1, 3))
        )
    seen = np.concatenate([cmf_xyz()[lit], cmf_at(line_nm).reshape(-1, 3)])
    share = 0.2 * power / power.sum()
    bright = power * seen.sum(axis=1)
    share = share + 0.8 * (bright / bright.sum() if bright.sum() > 0.0 else power / power.sum())
    share /= share.sum()
    order = np.argsort(start, kind="stable")
    start, width, power, seen, share = start[order], width[order], power[order], seen[order], share[order]
    rgb = []
    for reflectance in classes:
        factor = np.ones(401) if reflectance is None else reflectance
        at = np.where(width > 0.0, start + 0.5 * width, start)
        cell = np.clip(np.rint(at).astype(int) - 380, 0, 400)
        here = np.where(width > 0.0, factor[cell], np.interp(at, VISIBLE_NM, factor))
        rgb.append(K_M * (here[:, None] * seen) @ xyz_to_rgb709_matrix().T)
    cdf = np.concatenate([[0.0], np.cumsum(share)])
    cdf[-1] = 1.0
    return Colours(cdf, start, width, power / share, np.array(rgb))


def reflectance_classes(scene: Scene) -> tuple[list[np.ndarray | None], np.ndarray]:
    """Distinct spectral reflectances (the first is None: a plain colour), and each object's row, int32 (O,)."""
    classes: list[np.ndarray | None] = [None]
    row = np.zeros(len(scene.objects), np.int32)
    for index, item in enumerate(scene.objects):
        if item.material.reflectance is not None:
            row[index] = len(classes)
            classes.append(np.asarray(item.material.reflectance, float))
    return classes, row


class _Rows:
    """Distinct table rows."""

    def __init__(self) -> None:
        self._rows: list[np.ndarray] = []

    def add(self, row: np.ndarray) -> int:
        for i, known in enumerate(self._rows):
            if np.array_equal(known, row):
                return i
        self._rows.append(row)
        return len(self._rows) - 1

    def array(self) -> np.ndarray:
        return np.array(self._rows).reshape(-1, len(TABLE_NM)) if self._rows else np.ones((1, len(TABLE_NM)))


def _middle(scene: Scene, meshes: list[Mesh]) -> tuple[np.ndarray, float]:
    """Middle and half diagonal of the specular objects, or of everything."""
    chosen = [m for m, o in zip(meshes, scene.objects, strict=True) if o.material.is_specular] or meshes
    low = np.min([m.bounds()[0] for m in chosen], axis=0)
    high = np.max([m.bounds()[1] for m in chosen], axis=0)
    return 0.5 * (low + high), max(0.5 * float(np.linalg.norm(high - low)), 1e-300)


def _ranks(scene: Scene) -> dict[int, int]:
    """Rank of every transparent solid whose bounds meet another surface's: by priority, then by order."""
    meeting = overlapping_solids(scene)
    if len(meeting) > _MAX_STACK:
        raise UserError(
            f"scene '{scene.name}': {len(meeting)} transparent solids nest or touch and at most {_MAX_STACK} may; "
            "move some apart"
        )
    ranked = sorted(meeting, key=lambda i: (scene.objects[i].material.priority, i))
    return {index: rank for rank, index in enumerate(ranked)}


def _exact_nodes(tree: Bvh, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The tree's nodes with bounds of the float64 corners (its own hold float32 ones)."""
    first = tree.nodes["left_or_first"].astype(np.int32)
    count = tree.nodes["count"].astype(np.int32)
    low, high = corners.min(axis=1), corners.max(axis=1)
    bounds = np.empty((len(first), 6))
    for node in range(len(first) - 1, -1, -1):  # children come after their parent
        if count[node]:
            span = slice(first[node], first[node] + count[node])
            bounds[node, :3], bounds[node, 3:] = low[span].min(axis=0), high[span].max(axis=0)
        else:
            left, right = bounds[first[node]], bounds[first[node] + 1]
            bounds[node, :3], bounds[node, 3:] = np.minimum(left[:3], right[:3]), np.maximum(left[3:], right[3:])
    return bounds, first, count
