"""Edits of objects: pure functions from a scene to the scene that results.

They check what a scene file's reader checks, so that whatever was edited can be saved and opened
again; a refusal is a UserError with one sentence. Objects are named by index. Meshes are passed
on, never copied, so instances keep sharing theirs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..base.errors import UserError
from ..model.local_dispersion import check_dab
from ..model.naming import checked_name, free_name
from ..model.optics import catalogue
from ..model.scene import Dab, Dielectric, Diffuse, Material, Mirror, Scene, SceneObject, Vec3
from ..model.scene_checks import check_outside, check_scene
from ..model.vectors import frozen
from . import matrices
from .adding import add_object, beside

MAX_LENGTH = 1e30
"""As in a scene file: float32 ends at 3e38."""


def changed(scene: Scene, index: int, **changes: Any) -> Scene:
    """`scene` with other fields of object `index`, unchecked."""
    item = replace(scene.objects[index], **changes)
    return replace(scene, objects=(*scene.objects[:index], item, *scene.objects[index + 1 :]))


# -- name, number, material -----------------------------------------------------------------


def rename(scene: Scene, index: int, name: str) -> Scene:
    """Give object `index` another name. Raises UserError for one that is empty or taken."""
    others = [o.name for i, o in enumerate(scene.objects) if i != index]
    return changed(scene, index, name=checked_name(name, others, "object"))


def duplicate(scene: Scene, index: int) -> Scene:
    """With a copy of object `index` at the end, beside the original and sharing its mesh."""
    item = scene.objects[index]
    copy = replace(item, name=free_name(item.name, [o.name for o in scene.objects]))
    after = replace(scene, objects=(*scene.objects, *beside(scene, [copy])))
    check_scene(after, scene.name)
    return after


def delete(scene: Scene, index: int) -> Scene:
    """Without object `index`. Raises UserError for the last one, and for the last that receives light where no
    environment is seen instead."""
    rest = scene.objects[:index] + scene.objects[index + 1 :]
    name = scene.objects[index].name
    if not rest:
        raise UserError(f"'{name}' is the only object; add another before deleting it")
    without = replace(scene, objects=rest)
    if _shows_nothing(without):
        raise UserError(
            f"'{name}' is the only surface that receives light; add another diffuse object or an environment before "
            "deleting it"
        )
    return without


def set_material(scene: Scene, index: int, material: Material) -> Scene:
    """Give object `index` another material; without a diffuse one, what the dispersion brush painted is lost."""
    item = scene.objects[index]
    dabs = item.local_dispersion if material.receives else ()
    after = changed(scene, index, material=material, local_dispersion=dabs)
    if _shows_nothing(after):
        raise UserError(
            f"'{item.name}' is the only surface that receives light; make another object diffuse or add an "
            "environment before changing it"
        )
    check_scene(after, scene.name)
    return after


def make_glass(scene: Scene, index: int, glass: str) -> Scene:
    """Object `index` of a catalogue glass, with a plane below where nothing else would receive the light. Raises
    UserError for a glass that is not known."""
    material = Dielectric(catalogue.find(glass))
    others = [o for i, o in enumerate(scene.objects) if i != index]
    if scene.environment is None and not any(o.material.receives for o in others):
        scene = add_object(scene, "plane")
    return set_material(scene, index, material)


def set_diffuse_colour(scene: Scene, index: int, rgb: Vec3) -> Scene:
    """Linear Rec.709 reflectance, 0 to 1, of a diffuse object or a mirror; a spectral reflectance gives way to it, a
    texture is tinted by it."""
    item = scene.objects[index]
    if not all(math.isfinite(c) and 0.0 <= c <= 1.0 for c in rgb):
        raise UserError(f"'{item.name}': every channel of a reflectance must be between 0 and 1")
    colour = (float(rgb[0]), float(rgb[1]), float(rgb[2]))
    match item.material:
        case Diffuse():
            material: Material = item.material.changed(reflectance_rgb=colour, reflectance=None)
        case Mirror():
            material = item.material.changed(reflectance_rgb=colour)
        case _:
            raise UserError(f"'{item.name}' is neither diffuse nor a mirror and has no colour")
    return changed(scene, index, material=material)


# -- place ----------------------------------------------------------------------------------


def set_transform(scene: Scene, index: int, matrix: np.ndarray) -> Scene:
    """Place object `index` by its object-to-world matrix (4, 4).

    Raises UserError for one that is not finite or flattens the object, and where a light would end up inside its glass.
    """
    placed = frozen(np.array(matrix, dtype=np.float64))
    after = changed(scene, index, object_to_world=placed)
    _check_matrix(after.objects[index])
    _check_lights(after, after.objects[index])
    before = scene.objects[index].object_to_world
    if not np.allclose(np.linalg.norm(before[:3, :3]), np.linalg.norm(placed[:3, :3]), rtol=1e-9):
        check_scene(after, scene.name)  # another size may be too different from the others
    return after


def set_position(scene: Scene, index: int, position: Vec3) -> Scene:
    """World position of the object's origin, scene units."""
    return set_transform(scene, index, matrices.with_position(scene.objects[index].object_to_world, position))


def set_rotation(scene: Scene, index: int, rotation_deg: Vec3) -> Scene:
    """Angles about the fixed axes x, then y, then z, degrees."""
    return set_transform(scene, index, matrices.with_rotation(scene.objects[index].object_to_world, rotation_deg))


def set_scale(scene: Scene, index: int, scale: Vec3) -> Scene:
    """Scale along the object's own axes; negative mirrors, zero is refused."""
    if not all(math.isfinite(s) and s != 0.0 for s in scale):
        raise UserError(f"'{scene.objects[index].name}': a scale of 0 would flatten the object; give another number")
    return set_transform(scene, index, matrices.with_scale(scene.objects[index].object_to_world, scale))


# -- the dispersion brush -------------------------------------------------------------------


def with_dabs(scene: Scene, index: int, dabs: tuple[Dab, ...]) -> Scene:
    """With these dabs of the dispersion brush on receiver `index`. Raises UserError where it receives no light, and for
    dabs that no scene file could hold."""
    item, shared = scene.objects[index], 0
    # A growing stroke is not checked from its start each time.
    while shared < min(len(dabs), len(item.local_dispersion)) and dabs[shared] is item.local_dispersion[shared]:
        shared += 1
    if not item.material.receives:
        raise UserError(f"'{item.name}' is not diffuse: the dispersion brush paints on what receives the caustic")
    for dab in dabs[shared:]:
        check_dab(dab, item.name)
    return changed(scene, index, local_dispersion=dabs)


def add_dabs(scene: Scene, index: int, dabs: Sequence[Dab]) -> Scene:
    """Put dabs of the dispersion brush on receiver `index`, on top of what is there."""
    return with_dabs(scene, index, (*scene.objects[index].local_dispersion, *dabs))


def clear_dabs(scene: Scene, index: int | None = None) -> Scene:
    """Without what was painted on object `index`, or on any (None)."""
    chosen = range(len(scene.objects)) if index is None else (index,)
    objects = [
        replace(o, local_dispersion=()) if i in chosen and o.local_dispersion else o
        for i, o in enumerate(scene.objects)
    ]
    return replace(scene, objects=tuple(objects))


# -- checks ---------------------------------------------------------------------------------


def _shows_nothing(scene: Scene) -> bool:
    """Nothing receives light, and there is no environment to be seen (as `check_scene` has it)."""
    return scene.environment is None and not any(o.material.receives for o in scene.objects)


def _check_matrix(item: SceneObject) -> None:
    matrix = item.object_to_world
    if matrix.shape != (4, 4) or not np.isfinite(matrix).all() or np.abs(matrix).max() > MAX_LENGTH:
        raise UserError(f"'{item.name}': its place holds a number that is not finite or too large; choose another")
    if not np.array_equal(matrix[3], (0.0, 0.0, 0.0, 1.0)):
        raise UserError(f"'{item.name}': its matrix must end in 0, 0, 0, 1")
    linear = matrix[:3, :3]
    if abs(np.linalg.det(linear)) <= 1e-12 * np.linalg.norm(linear) ** 3:
        raise UserError(f"'{item.name}': this place flattens the object; use a scale other than zero on every axis")


def _check_lights(scene: Scene, item: SceneObject) -> None:
    if item.material.transmits:
        for light in scene.lights:
            if light.has_place:
                check_outside(light, [item], scene.name)
