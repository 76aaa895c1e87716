"""What changed between two `LiveInputs`, and how little has to be done again for it.

Photons belong to the glass they were traced through. A glass with another dispersion but the same n_d keeps
their paths, to first order in the change of n at each photon's own anchor wavelength: its spectral columns
say where the light lands instead, and nothing is traced.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace

import numpy as np

from ...edit.live_inputs import LiveInputs
from ...features.facts import is_painted
from ...model.environment_light import lighting_environment
from ...model.optics.glass import Dispersion
from ...model.scene import (
    Light,
    Material,
    RenderDefaults,
    Scene,
    SceneObject,
)
from .dirty_level import DirtyLevel

SAME_INDEX = 1e-6
"""Difference in n_d up to which a glass keeps the paths."""


def dirty_level(traced: LiveInputs, shown: LiveInputs, new: LiveInputs, beams: bool = False) -> DirtyLevel:
    """What has to be redone for `new` where photons were traced for `traced` and the picture shows `shown`. `beams`:
    beams, which the brush cannot move, carry light while nothing is painted."""
    if beams and is_painted(traced.scene, traced.local_gain) != is_painted(new.scene, new.local_gain):
        return DirtyLevel.BUILD
    paths = max(_inputs(traced, new), _scene(traced.scene, new.scene))
    if paths >= DirtyLevel.TRACE:
        return paths
    # Whatever is shown, the photons that there are serve: a glass that is shown without dispersion was traced with it.
    return min(max(_inputs(shown, new), _scene(shown.scene, new.scene)), DirtyLevel.SPLAT)


def only_moves(traced: LiveInputs, new: LiveInputs) -> bool:
    """Objects, lights or the camera may have moved; everything else is as it was traced."""
    if replace(new, scene=traced.scene, camera=traced.camera, width=traced.width, height=traced.height) != traced:
        return False
    a, b = traced.scene, new.scene
    kept = replace(b, name=a.name, notes=a.notes, camera=a.camera, objects=a.objects, lights=a.lights)
    return (
        len(a.objects) == len(b.objects)
        and len(a.lights) == len(b.lights)
        and all(
            x is y or (x.mesh is y.mesh and replace(y, name=x.name, object_to_world=x.object_to_world) == x)
            for x, y in zip(a.objects, b.objects, strict=True)
        )
        and all(
            x.spectral_power == y.spectral_power and _light(x, y) <= DirtyLevel.TRACE
            for x, y in zip(a.lights, b.lights, strict=True)
        )
        and all(
            getattr(kept, f.name) is getattr(a, f.name) or getattr(kept, f.name) == getattr(a, f.name)
            for f in fields(Scene)
        )
    )


def moves_view(before: LiveInputs | None, after: LiveInputs | None) -> bool:
    """Camera or picture size are others."""
    if before is None or after is None:
        return False
    return (before.camera, before.width, before.height) != (after.camera, after.width, after.height)


def _inputs(old: LiveInputs, new: LiveInputs) -> DirtyLevel:
    cost = DirtyLevel.NOTHING
    for item in fields(LiveInputs):
        a, b = getattr(old, item.name), getattr(new, item.name)
        if item.name == "scene" or a is b or a == b:
            continue
        cost = max(cost, _INPUTS.get(item.name, DirtyLevel.BUILD))
    return cost


_INPUTS = {
    "camera": DirtyLevel.CAMERA,
    "width": DirtyLevel.CAMERA,
    "height": DirtyLevel.CAMERA,
    "smoothing": DirtyLevel.SPLAT,
    "solo_nm": DirtyLevel.SPLAT,
    "local_gain": DirtyLevel.SPLAT,
    "seed": DirtyLevel.TRACE,
}
"""For fields that are not here (the method) everything is redone."""


def _scene(old: Scene, new: Scene) -> DirtyLevel:
    if old is new:
        return DirtyLevel.NOTHING
    cost = DirtyLevel.NOTHING
    for item in fields(Scene):
        a, b = getattr(old, item.name), getattr(new, item.name)
        if a is b or item.name in ("name", "camera", "notes", "units"):
            continue
        if item.name == "objects":
            cost = max(cost, _objects(a, b))
        elif item.name == "lights":
            cost = max(cost, _lights(a, b))
        elif item.name in ("background_rgb", "environment"):
            # No photon comes from them. Environments are compared by identity: a new one is another one.
            cost = max(cost, DirtyLevel.CAMERA if a != b else DirtyLevel.NOTHING)
            if (lighting_environment(old) is None) != (lighting_environment(new) is None):
                cost = DirtyLevel.BUILD
        elif item.name == "render":
            cost = max(cost, DirtyLevel.BUILD if _path_rules(a) != _path_rules(b) else DirtyLevel.NOTHING)
            cost = max(cost, DirtyLevel.CAMERA if _haze(a) != _haze(b) else DirtyLevel.NOTHING)
        else:
            cost = DirtyLevel.BUILD
    return max(cost, DirtyLevel.NOTHING if cost >= DirtyLevel.TRACE else _glasses(old, new))


def _path_rules(render: RenderDefaults) -> tuple[int, bool, int, bool]:
    """What programs and queues are made for."""
    return render.max_depth, render.polarisation, render.bounces, render.haze > 0.0


def _haze(render: RenderDefaults) -> tuple[float, float]:
    return render.haze, render.haze_anisotropy


def _objects(old: tuple[SceneObject, ...], new: tuple[SceneObject, ...]) -> DirtyLevel:
    if len(old) != len(new):
        return DirtyLevel.BUILD
    return max((_object(a, b) for a, b in zip(old, new, strict=True)), default=DirtyLevel.NOTHING)


def _object(old: SceneObject, new: SceneObject) -> DirtyLevel:
    """All but the change of a glass's dispersion, which `_glasses` judges over all objects."""
    if old is new:
        return DirtyLevel.NOTHING
    if old.mesh is not new.mesh:
        return DirtyLevel.BUILD
    cost = DirtyLevel.NOTHING
    if not np.array_equal(old.object_to_world, new.object_to_world):
        cost = DirtyLevel.TRACE
    if old.local_dispersion != new.local_dispersion:
        cost = max(cost, DirtyLevel.SPLAT)
    a, b = old.material, new.material
    if a is b:
        return cost
    if type(a) is not type(b):
        return DirtyLevel.BUILD
    if a.receives and b.receives:
        # What there is at all, the programs know: a coat, a rough base.
        if a.has_coat != b.has_coat or (a.diffuse_roughness > 0.0) != (b.diffuse_roughness > 0.0):
            return DirtyLevel.BUILD
        if a.reflectance is None and b.reflectance is None and (a.texture is None) == (b.texture is None):
            # Another picture is only seen; whether there is one, the objects' records on the device know.
            same = a.changed(texture=None) == b.changed(texture=None) and a.texture is b.texture
            return max(cost, DirtyLevel.NOTHING if same else DirtyLevel.CAMERA)
        return DirtyLevel.BUILD
    if a.transmits and b.transmits:
        same_absorption = a.absorption is b.absorption or (
            a.absorption is not None
            and b.absorption is not None
            and np.array_equal(a.absorption.coefficient, b.absorption.coefficient)
        )
        if not same_absorption:
            return DirtyLevel.BUILD if (a.absorption is None) != (b.absorption is None) else max(cost, DirtyLevel.TRACE)
        kinds = [(m.is_rough, m.thin, m.transmittance_rgb, m.is_crystal, m.film) for m in (a, b)]
        if kinds[0] != kinds[1]:
            return DirtyLevel.BUILD
        same = a.priority == b.priority and a.microfacet_width == b.microfacet_width and a.axis == b.axis
        return cost if same else max(cost, DirtyLevel.TRACE)
    if a == b:
        return cost
    return max(cost, DirtyLevel.TRACE if a.is_like(b) else DirtyLevel.BUILD)


def _glasses(old: Scene, new: Scene) -> DirtyLevel:
    pairs = [
        pair
        for a, b in zip(old.objects, new.objects, strict=True)
        if a.material.transmits and b.material.transmits
        for pair in zip(a.material.dispersions, b.material.dispersions, strict=False)
    ]
    if all(a == b for a, b in pairs):
        return DirtyLevel.NOTHING
    if shown_glasses(old, new) is None:
        # Whether a glass disperses at all decides what photons carry.
        return (
            DirtyLevel.BUILD
            if any(a.is_dispersive != b.is_dispersive for a, b in pairs) or _partition(pairs, 0) != _partition(pairs, 1)
            else DirtyLevel.TRACE
        )
    return DirtyLevel.SPLAT


def _partition(pairs: list[tuple[Dispersion, Dispersion]], side: int) -> list[int]:
    """Which objects share a glass, as the number of the first one of each."""
    glasses = [pair[side] for pair in pairs]
    return [glasses.index(glass) for glass in glasses]


def shown_glasses(traced: Scene, shown: Scene) -> Mapping[Dispersion, Dispersion] | None:
    """The glass that replaces each one photons were traced through; None where paths do not follow.

    They follow where n_d stays, the glass was dispersive (photons carry its column), and objects of one glass are still
    of one.
    """
    found: dict[Dispersion, Dispersion] = {}
    for a, b in zip(traced.objects, shown.objects, strict=True):
        if not (a.material.transmits and b.material.transmits):
            continue
        if a.material.is_crystal != b.material.is_crystal:
            return None
        for before, after in zip(a.material.dispersions, b.material.dispersions, strict=True):
            if found.setdefault(before, after) != after:
                return None
            if before != after and (abs(before.n_d - after.n_d) > SAME_INDEX or not before.is_dispersive):
                return None
    return found


def _lights(old: tuple[Light, ...], new: tuple[Light, ...]) -> DirtyLevel:
    if len(old) != len(new):
        return DirtyLevel.BUILD
    return max((_light(a, b) for a, b in zip(old, new, strict=True)), default=DirtyLevel.NOTHING)


def _light(old: Light, new: Light) -> DirtyLevel:
    if old is new or old == new:
        return DirtyLevel.NOTHING
    if replace(old, name=new.name, spectral_power=new.spectral_power) != new:
        return DirtyLevel.TRACE if old.variant == new.variant else DirtyLevel.BUILD
    if old.spectral_power == new.spectral_power:
        return DirtyLevel.NOTHING
    # Photons carry weights, not watts; bands reach as far as the light they were planned for.
    (a0, a1), (b0, b1) = old.spectral_power.support_nm(), new.spectral_power.support_nm()
    return DirtyLevel.SPLAT if a0 <= b0 and b1 <= a1 and (a0 < a1) else DirtyLevel.TRACE


def appearance_differs(old: LiveInputs, new: LiveInputs) -> bool:
    """Whether what the camera sees without the maps differs: colours, lights, the background, glass that
    bends its own rays otherwise."""
    a, b = old.scene, new.scene
    if _haze(a.render) != _haze(b.render):
        return True
    if lights_differ(old, new) or a.background_rgb != b.background_rgb or a.environment is not b.environment:
        return True
    return any(_material_differs(x.material, y.material) for x, y in zip(a.objects, b.objects, strict=True))


def lights_differ(old: LiveInputs, new: LiveInputs) -> bool:
    """Whether lights shine otherwise, or in another wavelength alone."""
    pairs = zip(old.scene.lights, new.scene.lights, strict=True)
    return old.solo_nm != new.solo_nm or any(x is not y for x, y in pairs)


def _material_differs(old: Material, new: Material) -> bool:
    if old is new:
        return False
    if old.transmits and new.transmits:
        # For all else of a glass light is traced anew before the camera sees it.
        return old.dispersions != new.dispersions
    return True
