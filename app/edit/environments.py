"""Edits of the environment, and of the pictures on surfaces: pure functions from a scene to the scene that results.

An environment is one picture whatever it was made of (`model.environment`), so an edit makes it anew from its
parameters. Where only its rotation changes, the picture itself stays: the renderer then keeps it on the device.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ..base.errors import UserError
from ..base.tone_map import LUMINANCE_709
from ..model.environment import constant, from_map, gradient, sky, up_and_rotation, world_to_local
from ..model.lights.directional import DirectionalLight
from ..model.scene import Diffuse, Light, Scene, Vec3
from ..model.scene_defaults import environment_of
from ..model.texture import Environment, Texture, TextureReader
from ..model.vectors import frozen, vec3
from . import objects
from .adding import up_frame

ENVIRONMENT_SUFFIXES = (".hdr", ".exr", ".pic", ".npy", ".png", ".jpg", ".jpeg")
TEXTURE_SUFFIXES = (".png", ".jpg", ".jpeg", ".exr", ".hdr", ".npy")
_SKY_SHARE = 0.3
"""Share of the radiance of a white surface in the scene's light: a first sky is seen and outshines nothing."""
_ABSOLUTE = 10.0
"""A panorama within this factor of what suits the lights is taken to be in absolute units."""
_SUN_DEG = 10.0
"""Apparent size beyond which a directional light is no sun."""
_MADE_OF_NUMBERS: dict[str, Callable[..., Environment]] = {"gradient": gradient, "sky": sky, "constant": constant}
_ZENITH, _HORIZON, _NADIR = (0.25, 0.45, 0.9), (0.9, 0.95, 1.0), (0.2, 0.18, 0.16)


def environment_kind(scene: Scene) -> str:
    """ "constant", "gradient", "sky" or "map"."""
    return "constant" if scene.environment is None else scene.environment.kind


def set_environment_kind(scene: Scene, kind: str) -> Scene:
    """A plain background, a first gradient or a first sky as bright as suits the scene's lights. A map wants a file:
    `set_environment_map`.

    Raises UserError where the environment is all that there is to be seen.
    """
    if kind == environment_kind(scene):
        return scene
    if kind == "constant":
        return _without_environment(scene)
    if kind not in ("gradient", "sky"):
        raise UserError(
            f"'{kind}' is no kind of environment that can be made without a file; choose constant, gradient or sky"
        )
    level = _usual_radiance(scene)
    up = vec3(up_frame(scene)[:, 2])
    made = (
        gradient(_ZENITH, _HORIZON, _NADIR, up, level)
        if kind == "gradient"
        else sky(**_sun_of(scene, up), luminance=level, up=up)
    )
    return replace(scene, environment=made)


def set_environment(scene: Scene, **changes: Any) -> Scene:
    """A gradient, a sky or a constant environment with other parameters, named as in a scene file. Raises UserError for
    what is out of range."""
    now = scene.environment
    if now is None or now.kind not in _MADE_OF_NUMBERS:
        raise UserError("the environment of the scene is not made of numbers; choose a gradient or a sky first")
    values = {key: tuple(value) if isinstance(value, list) else value for key, value in now.parameters.items()}
    values |= changes
    if "type" in values:
        values["sky_type"] = values.pop("type")
    made = _MADE_OF_NUMBERS[now.kind](**values)
    return replace(scene, environment=made, background_rgb=values.get("radiance", scene.background_rgb))


def set_environment_map(scene: Scene, path: Path) -> Scene:
    """The panorama in `path`, turned as the present one is; a first one as bright as suits the scene's lights. Raises
    UserError where it cannot be used."""
    now, notes = scene.environment, list(scene.notes)
    if now is not None and now.kind == "map":
        up, rotation_deg = up_and_rotation(now)
        made = from_map(path, map_intensity(now) or 1.0, rotation_deg, up, notes, now.lights)
        return replace(scene, environment=made, notes=tuple(notes))
    made = from_map(path, up=vec3(up_frame(scene)[:, 2]), notes=notes)
    changed = replace(scene, environment=made, notes=tuple(notes))
    # Few panoramas are in absolute units; those that seem to be are left alone.
    factor = _usual_radiance(scene) / max(_mean_luminance(made), 1e-30)
    return (
        changed
        if 1.0 / _ABSOLUTE < factor < _ABSOLUTE or factor > 1e20
        else set_map_intensity(changed, float(f"{factor:.2g}"))
    )


def set_map_rotation(scene: Scene, rotation_deg: float) -> Scene:
    """Turn the map about its up direction, degrees; the picture itself stays."""
    now = _map_of(scene)
    if not math.isfinite(rotation_deg):
        raise UserError("the rotation of the environment must be a finite angle")
    up, _ = up_and_rotation(now)
    kept = dict(now.parameters) | {"rotation_deg": float(rotation_deg)}
    return replace(scene, environment=replace(now, world_to_local=world_to_local(up, rotation_deg), parameters=kept))


def set_map_intensity(scene: Scene, intensity: float) -> Scene:
    """Factor on the map's own values, 0 or more."""
    now = _map_of(scene)
    if not (math.isfinite(intensity) and intensity >= 0.0):
        raise UserError("the intensity of the environment must be a number of 0 or more")
    before = map_intensity(now)
    up, rotation_deg = up_and_rotation(now)
    if before == 0.0:
        if now.source is None:
            raise UserError("the environment was dimmed to nothing and has no file to be read again; choose its file")
        return replace(scene, environment=from_map(now.source, intensity, rotation_deg, up, lights=now.lights))
    with np.errstate(over="ignore"):
        rgb = now.rgb * np.float32(intensity / before)
    if not np.isfinite(rgb).all():
        raise UserError(
            f"an intensity of {intensity:g} takes the environment's brightest value out of range; choose a smaller one"
        )
    kept = {"rotation_deg": rotation_deg, "up": list(up)} | dict(now.parameters) | {"intensity": float(intensity)}
    return replace(scene, environment=replace(now, rgb=frozen(rgb), parameters=kept))


def set_environment_lights(scene: Scene, lights: bool) -> Scene:
    """Whether the environment lights what is diffuse. Raises UserError where there is only a background."""
    now = scene.environment
    if now is None:
        raise UserError("a plain background lights nothing; choose a gradient, a sky or a picture")
    kept = {key: value for key, value in now.parameters.items() if key != "lights"}
    kept |= {} if lights else {"lights": False}
    return replace(scene, environment=replace(now, lights=lights, parameters=kept))


def map_intensity(environment: Environment) -> float:
    """Factor that the map's values carry already."""
    return float(environment.parameters.get("intensity", 1.0))


# -- pictures on surfaces -------------------------------------------------------------------


def set_texture(scene: Scene, index: int, path: Path, wrap: Literal["repeat", "clamp"] = "repeat") -> Scene:
    """Put the picture in `path` on diffuse object `index`; a first picture is shown in its own colours, not tinted by
    the object's.

    Raises UserError for an object that is not diffuse or has no texture coordinates, and for a picture that cannot be
    used."""
    item = scene.objects[index]
    material = _diffuse(scene, index)
    if item.mesh.uv is None:
        raise UserError(f"'{item.name}': its mesh has no texture coordinates for a picture; export it with them")
    reader = TextureReader()
    texture = _worn_already(scene, path, wrap) or reader.load(path, wrap)
    colour: Vec3 = material.reflectance_rgb if material.texture is not None else (1.0, 1.0, 1.0)
    worn = material.changed(reflectance_rgb=colour, reflectance=None, texture=texture)
    return objects.changed(replace(scene, notes=(*scene.notes, *reader.notes)), index, material=worn)


def set_texture_wrap(scene: Scene, index: int, wrap: Literal["repeat", "clamp"]) -> Scene:
    """Whether the picture of object `index` repeats beyond its border."""
    material = _diffuse(scene, index)
    if material.texture is None:
        raise UserError(f"'{scene.objects[index].name}' has no picture; choose one first")
    return objects.changed(scene, index, material=replace(material, texture=replace(material.texture, wrap=wrap)))


def clear_texture(scene: Scene, index: int) -> Scene:
    """Object `index` in its plain colour."""
    return objects.changed(scene, index, material=replace(_diffuse(scene, index), texture=None))


# -- parts ----------------------------------------------------------------------------------


def _without_environment(scene: Scene) -> Scene:
    if not scene.lights:
        raise UserError("the environment is the scene's only light; add a light before taking it away")
    if not any(o.material.receives for o in scene.objects):
        raise UserError(
            "nothing in the scene receives light, so the environment is all there is to see; add a diffuse object "
            "before taking it away"
        )
    return replace(scene, environment=None)


def _map_of(scene: Scene) -> Environment:
    if scene.environment is None or scene.environment.kind != "map":
        raise UserError("the environment of the scene is no map; choose that kind first")
    return scene.environment


def _diffuse(scene: Scene, index: int) -> Diffuse:
    material = scene.objects[index].material
    if not isinstance(material, Diffuse):
        raise UserError(f"'{scene.objects[index].name}' is not diffuse and can have no picture; make it diffuse first")
    return material


def _worn_already(scene: Scene, path: Path, wrap: str) -> Texture | None:
    """The same picture on another object: one on the device serves both."""
    source = str(path.resolve())
    for item in scene.objects:
        texture = item.material.texture
        if texture is not None and texture.source == source:
            return texture if texture.wrap == wrap else replace(texture, wrap=wrap)
    return None


def _usual_radiance(scene: Scene) -> float:
    """Radiance, lm/(sr unit²), of a background that suits the scene's lights; the present one's where there is one."""
    if max(scene.background_rgb) > 0.0:
        return float(np.dot(scene.background_rgb, LUMINANCE_709))
    # The faintest: a beam may be thousands of times as bright as what is round it.
    lit = min((_illuminance(light, scene) for light in scene.lights), default=0.0)
    level = _SKY_SHARE * lit / math.pi
    return float(f"{level:.2g}") if math.isfinite(level) and level > 0.0 else 1.0


def _mean_luminance(environment: Environment) -> float:
    """Over all directions."""
    height = len(environment.rgb)
    weight = np.sin(np.pi * (np.arange(height) + 0.5) / height)
    return float(weight @ (environment.rgb.mean(axis=1, dtype=np.float64) @ LUMINANCE_709) / weight.sum())


def _illuminance(light: Light, scene: Scene) -> float:
    """About what the light gives to a surface turned to it in the scene's middle, lm/unit²."""
    around = environment_of(scene.objects)
    distance2 = float(np.sum((around.centre - np.array(light.position)) ** 2)) + around.radius**2
    return light.spectral_power.luminous() / light.reach(math.sqrt(distance2))


def _sun_of(scene: Scene, up: Vec3) -> dict[str, Any]:
    """Where the sun, or else the strongest light that has a direction, comes from, for a sky that fits it."""
    directed = [light for light in scene.lights if light.has_direction]
    suns = [
        light for light in directed if isinstance(light, DirectionalLight) and light.angular_diameter_deg < _SUN_DEG
    ]
    if not directed:
        return {}
    sun = max(suns or directed, key=lambda light: _illuminance(light, scene))
    x, y, z = world_to_local(up) @ (-np.asarray(sun.direction, float) / np.linalg.norm(sun.direction))
    if z < 0.0:
        return {}
    return {
        "sun_elevation_deg": math.degrees(math.asin(min(z, 1.0))),
        "sun_azimuth_deg": math.degrees(math.atan2(y, x)) if math.hypot(x, y) > 1e-9 else 0.0,
    }
