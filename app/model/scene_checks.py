"""What must hold for a whole scene, whichever file it came from: something to land on, light outside glass, data in
range."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..base.errors import UserError
from .geometry.mesh import Mesh
from .geometry.mesh_health import forms_of
from .naming import listed
from .scene import Light, Scene, SceneObject

MAX_LIGHTS, MAX_OBJECTS = 256, 0xFFFF
"""A photon remembers the light that it comes from in 8 bits, and the object it met first in 16, all of them set for
none."""
MAX_SIZE_RATIO = 1e12
"""Largest to smallest object; also to the side of an area light."""
MAX_FAR_RATIO = 1e9
"""Distance from the origin to the largest object's size: float64 then tells a millionth of it."""
ON_SURFACE = 1e-9
"""Share of a mesh's longest side: a point so near to a facet is on it."""
_CONTACT, _MOST_TRIED = 1e-3, 64
"""Share of a crystal's size that a sheet on it may be away, and how many of its facets are tried."""
MIN_THICKNESS = 5e-6
"""Of a solid, as a share of half the diagonal of all glass and mirrors: of a thinner one rays in float32 meet one side
only, and none may get through."""
MIN_SIZE = 1e-12
"""Least size of the largest object, and one over its greatest: inverse squares of areas are then numbers in float32."""


def check_scene(scene: Scene, file_name: str) -> list[str]:
    """Notes about `scene`; raises UserError for one that cannot give a picture.

    Errors: no objects, or more of them or of lights than a photon can tell apart, no light and no receiver unless there
    is an environment to see by, a texture without texture coordinates, objects of absurdly different size, a light
    inside glass, a laser line outside a glass's data. Notes: glasses whose data are clamped, or unusual.
    """
    if not scene.objects:
        raise UserError(f"{file_name}: the scene holds no objects; add one with [[objects]]")
    for kind, count, most in (("lights", len(scene.lights), MAX_LIGHTS), ("objects", len(scene.objects), MAX_OBJECTS)):
        if count > most:
            raise UserError(f"{file_name}: {count} {kind}, and at most {most} may be: take some away, or join them")
    if not scene.lights and scene.environment is None:
        raise UserError(f"{file_name}: the scene holds no light; add one with [[lights]]")
    if scene.environment is None and not any(o.material.receives for o in scene.objects):
        raise UserError(
            f"{file_name}: nothing receives the light; add a diffuse object, "
            'such as [[objects]] shape = "plane", material = "diffuse"'
        )
    for item in scene.objects:
        check_texture(item, file_name)
        item.material.check_on(item.mesh, item.name, file_name)
    _check_sizes(scene, file_name)
    _check_crystals(scene, file_name)
    glasses = [o for o in scene.objects if o.material.transmits]
    for light in scene.lights:
        if light.has_place:
            check_outside(light, glasses, file_name)
        check_lines(light, glasses, file_name)
    return (
        _glass_notes(glasses)
        + _sheet_notes(glasses)
        + _thin_notes(scene)
        + [
            f"light '{light.name}' has no power: it gives no light"
            for light in scene.lights
            if not light.spectral_power.power_w() > 0.0
        ]
    )


def _check_crystals(scene: Scene, file_name: str) -> None:
    """Raise UserError for a sheet, or metal, within a crystal or on it: they would have to know its two waves."""
    crystals = [o for o in scene.objects if o.material.is_crystal]
    sheets = [o for o in scene.objects if o.material.is_specular and not o.material.is_solid] if crystals else []
    for item in (o for o in sheets if not o.material.is_mirror or o.material.film is not None):
        corners = item.world_vertices[item.mesh.triangles[:_MOST_TRIED]]
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-300)
        for crystal in crystals:
            off = _CONTACT * _size(crystal) * across
            tried = np.concatenate([corners.mean(axis=1) + off, corners.mean(axis=1) - off])
            if any(contains(crystal, point) for point in tried):
                raise UserError(
                    f"{file_name}: '{item.name}' lies in the crystal of '{crystal.name}' or on it, where light is not "
                    "followed through it; move it away"
                )


def contains(item: SceneObject, point: np.ndarray) -> bool:
    """Whether `point` (3,), in the world, lies inside the object's closed surface, and not on it, whichever way it
    faces there; slightly open meshes are judged too."""
    local = np.linalg.solve(item.object_to_world[:3, :3], np.asarray(point) - item.object_to_world[:3, 3])
    low, high = item.mesh.bounds()
    if np.any(local < low) or np.any(local > high):
        return False
    winds = _crossings(item.mesh, local) != 0 if item.mesh.is_closed else abs(_winding(item.mesh, local)) > 0.5
    return winds and not _touches(item.mesh, local)


def _touches(mesh: Mesh, point: np.ndarray) -> bool:
    """Whether `point` lies on a facet, up to what rounding does to a place (`ON_SURFACE`)."""
    near = ON_SURFACE * float(np.ptp(mesh.vertices, axis=0).max())
    corners = mesh.corners() - point
    away = (corners.min(axis=1) > near).any(axis=1) | (corners.max(axis=1) < -near).any(axis=1)
    for first, second, third in corners[~away]:
        normal = np.cross(second - first, third - first)
        length = float(np.linalg.norm(normal))
        if length == 0.0 or abs(float(first @ normal)) > near * length:
            continue
        # What lies on the inner side of all three edges is on the facet.
        ends = ((first, second), (second, third), (third, first))
        if all(np.cross(a, b) @ normal >= -near * length * float(np.linalg.norm(b - a)) for a, b in ends):
            return True
    return False


def _crossings(mesh: Mesh, point: np.ndarray) -> int:
    """How often a closed mesh winds round `point`: signed crossings of the ray from it along +z.

    Cut by the plane x = 0, then by the line y = 0, each half-open and each edge computed from its lower end, so that
    neighbours agree to the last bit and no ray slips through an edge. A few milliseconds for 250,000 triangles.
    """
    x, y, z = (mesh.vertices - point).T
    beyond = x >= 0.0
    a, b, c = mesh.triangles.T
    cut = mesh.triangles[(beyond[a] != beyond[b]) | (beyond[a] != beyond[c])]
    if len(cut) == 0:
        return 0
    side = beyond[cut]
    ends = []
    for following in (1, 0):  # the edge that goes to beyond, then the one that comes back
        corner = np.argmax((side != np.roll(side, -1, axis=1)) & (np.roll(side, -1, axis=1) == following), axis=1)
        rows = np.arange(len(cut))
        edge = cut[rows, corner], cut[rows, (corner + 1) % 3]
        low, high = edge if following else edge[::-1]
        share = x[low] / (x[low] - x[high])
        ends.append((y[low] + share * (y[high] - y[low]), z[low] + share * (z[high] - z[low])))
    (y1, z1), (y2, z2) = ends
    crossing = (y1 >= 0.0) != (y2 >= 0.0)
    y1, z1, y2, z2 = (v[crossing] for v in (y1, z1, y2, z2))
    above = z1 + y1 / (y1 - y2) * (z2 - z1) > 0.0
    return int(np.where(y1 < y2, 1, -1)[above].sum())


def _winding(mesh: Mesh, point: np.ndarray) -> float:
    """Winding number of any mesh round `point`: the sum of signed solid angles over 4π (van Oosterom and
    Strackee, IEEE Trans. Biomed. Eng. 30, 1983, eq. 8)."""
    corners = mesh.vertices - point
    if np.any(corners.min(axis=0) > 0.0) or np.any(corners.max(axis=0) < 0.0):
        return 0.0
    a, b, c = np.moveaxis(corners[mesh.triangles], 1, 0)
    la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    triple = np.einsum("ij,ij->i", a, np.cross(b, c))
    dot = np.einsum
    denominator = la * lb * lc + dot("ij,ij->i", a, b) * lc + dot("ij,ij->i", b, c) * la + dot("ij,ij->i", c, a) * lb
    return float(np.arctan2(triple, denominator).sum() / (2.0 * np.pi))


def _check_sizes(scene: Scene, file_name: str) -> None:
    """Refuse an object that float32 cannot tell from a point, next to the others (a slip of units)."""
    sizes = {o.name: _size(o) for o in scene.objects}
    largest = max(sizes.values())
    if not MIN_SIZE <= largest <= 1.0 / MIN_SIZE:
        raise UserError(
            f"{file_name}: the largest object is {largest:.2g} units large; choose units in which it is between "
            f"{MIN_SIZE:g} and {1.0 / MIN_SIZE:g}"
        )
    for light in scene.lights:
        if light.has_outline and light.area < (largest / MAX_SIZE_RATIO) ** 2:
            raise UserError(
                f"{file_name}: light '{light.name}' is {light.area:.2g} square units large, next to objects of "
                f"{largest:.2g} units; make it larger, or a point light"
            )
    places = [np.asarray(item.object_to_world[:3, 3]) for item in scene.objects]
    far = float(max(np.abs(place).max() for place in places))
    if far > MAX_FAR_RATIO * largest:
        raise UserError(
            f"{file_name}: objects of {largest:.2g} units stand {far:.2g} units off the origin, where their own form "
            "is rounded away; move the scene nearer to the origin"
        )
    small, large = min(sizes, key=sizes.__getitem__), max(sizes, key=sizes.__getitem__)
    if sizes[small] * MAX_SIZE_RATIO < sizes[large]:
        raise UserError(
            f"{file_name}: object '{small}' is {sizes[small]:.2g} units large and '{large}' {sizes[large]:.2g}, "
            "too different to be computed together; check the units of their sizes and scales"
        )


def _size(item: SceneObject) -> float:
    """Diagonal of a world box round the object's own box: exact enough for a ratio, and quick for large meshes."""
    vertices = item.mesh.vertices
    extent = vertices.max(axis=0) - vertices.min(axis=0)
    return float(np.linalg.norm(np.abs(item.object_to_world[:3, :3]) @ extent))


def check_texture(item: SceneObject, file_name: str) -> None:
    """Raise UserError for a texture on a mesh that does not say where it goes."""
    if item.material.texture is None:
        return
    if item.mesh.uv is None:
        raise UserError(
            f"{file_name}: object '{item.name}' has a texture, but its mesh no texture coordinates; export it with "
            "UVs, use a shape that has them (plane, disc, box, slab, sphere), or leave the texture out"
        )
    if not np.isfinite(item.mesh.uv).all():
        raise UserError(
            f"{file_name}: object '{item.name}' has texture coordinates that are not finite; export its mesh again"
        )


def check_outside(light: Light, glasses: Sequence[SceneObject], file_name: str) -> None:
    """Raise UserError for a light that stands inside one of `glasses`."""
    for item in glasses:
        if item.material.is_solid and contains(item, np.array(light.position)):
            raise UserError(
                f"{file_name}: light '{light.name}' stands inside the glass of '{item.name}'; move its position "
                "out of it"
            )


def check_lines(light: Light, glasses: Sequence[SceneObject], file_name: str) -> None:
    """Raise UserError for an emission line outside the data of one of `glasses`."""
    for wavelength_nm, power in light.spectral_power.lines:
        for item in glasses:
            ranges = [dispersion.range_nm for dispersion in item.material.dispersions]
            low, high = max(low for low, _ in ranges), min(high for _, high in ranges)
            if power > 0.0 and not low <= wavelength_nm <= high:
                raise UserError(
                    f"{file_name}: the line at {wavelength_nm:g} nm of light '{light.name}' lies outside the data of "
                    f"'{item.name}' ({low:g} to {high:g} nm); choose another wavelength or glass"
                )


def _sheet_notes(glasses: list[SceneObject]) -> list[str]:
    """What of thin sheets and of films has no effect; sheets that are to be solid."""
    sheets = [o for o in glasses if o.material.thin]
    # Meshes from files got a note about open edges when they were read.
    open_ones = [o for o in glasses if o.material.is_solid and not o.mesh.source and not o.mesh.is_closed]
    opens = forms_of([o.mesh.transformed(o.object_to_world) for o in open_ones])
    notes = {
        "absorption has no effect in a thin sheet": [o for o in sheets if o.material.absorption is not None],
        "roughness has no effect in a thin sheet": [o for o in sheets if o.material.roughness],
        "coating and film_nm have no effect on rough glass": [
            o for o in glasses if o.material.is_rough and (o.material.coating or o.material.film_nm)
        ],
        "an open sheet is taken as the face of a solid; thin = true makes it a pane": [
            o for o, form in zip(open_ones, opens, strict=True) if form == "sheet"
        ],
    }
    return [f"{listed([o.name for o in of])}: {what}" for what, of in notes.items() if of]


def _thin_notes(scene: Scene) -> list[str]:
    """Solids of glass so thin that they may let no light through."""
    solids = [o for o in scene.objects if o.material.is_solid and o.mesh.is_closed]
    if not solids:
        return []
    bounds = np.stack([o.world_bounds for o in scene.objects if o.material.is_specular])
    least = MIN_THICKNESS * 0.5 * float(np.linalg.norm(bounds[:, 1].max(axis=0) - bounds[:, 0].min(axis=0)))
    thin = [o.name for o in solids if _thickness(replace(o.mesh, vertices=o.world_vertices)) < least]
    what = f"thinner than {least:.2g}, light may not pass it next to all other glass; make a pane a thin plane"
    return [f"{listed(thin)}: {what}"] if thin else []


def _thickness(mesh: Mesh) -> float:
    """Of a closed mesh that is a plate; of a ball a third of its diameter."""
    return 2.0 * abs(mesh.volume()) / float(mesh.areas().sum())


def _glass_notes(glasses: list[SceneObject]) -> list[str]:
    dispersions = dict.fromkeys(dispersion for o in glasses for dispersion in o.material.dispersions)
    return [note for dispersion in dispersions for note in dispersion.notes()]
