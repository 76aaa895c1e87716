"""Edits of lights: place, shape, spectrum and power in its own unit. Pure functions from a scene to a new one."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ..base.errors import UserError
from ..model.lights import LIGHT_KINDS, IesLight
from ..model.lights.ies_file import read_ies
from ..model.lights.light import DEFAULT_ILLUMINANCE, PowerKey, made
from ..model.naming import checked_name, free_name
from ..model.optics import spectrum as spectra
from ..model.optics.spectrum import Spectrum
from ..model.placement import default_direction, rotation_about
from ..model.scene import Light, Scene, Vec3
from ..model.scene_checks import check_lines, check_outside
from ..model.scene_defaults import environment_of
from ..model.spectrum_file import describe_spectrum
from ..model.vectors import vec3
from .adding import up_frame
from .objects import MAX_LENGTH
from .projection import View

SpectrumKind = Literal["illuminant", "blackbody", "laser", "lines", "csv", "table"]

LIGHT_SUFFIXES = (".ies", ".ldt")
"""Photometric files."""
_VIEW_MARGIN = 0.08
"""Share of the picture's sides that a new light keeps away from its borders."""
_DARK = 1e-9
"""Least power, in any unit: at none at all a light would forget its colour."""


def set_light(scene: Scene, index: int, light: Light) -> Scene:
    """`scene` with light `index` replaced; directions are normalised.

    Raises UserError for a size or angle no scene file could hold, a name that is taken, and a place inside glass.
    """
    others = [other.name for i, other in enumerate(scene.lights) if i != index]
    name = checked_name(light.name, others, "light")
    light = replace(light, name=name)
    if light.has_direction:
        light = light.changed(direction=_unit(light, "direction", light.direction))
    if light.tangent is not None:
        light = light.changed(tangent=_unit(light, "tangent", light.tangent))
    light.check()
    _check_against_glass(scene, light, scene.lights[index] if index < len(scene.lights) else None)
    return replace(scene, lights=(*scene.lights[:index], light, *scene.lights[index + 1 :]))


def add_light(scene: Scene, kind: str = "directional", view: View | None = None) -> Scene:
    """With a white light at the end, aimed at the objects and as bright there as a scene file's default; where it has
    a place, that is in the picture of `view`."""
    cls = _class_of(kind)
    name = free_name(f"{kind} light", [light.name for light in scene.lights])
    direction = vec3(up_frame(scene) @ default_direction())
    given = {"name": name, "spectral_power": spectra.illuminant("D65"), "direction": direction}
    light = made(cls, _usual(scene, np.array(direction)) | given)
    if light.has_place and view is not None:
        light = _in_view(scene, light, view)
    return set_light(scene, len(scene.lights), _lighting(scene, light, DEFAULT_ILLUMINANCE))


def _class_of(kind: str) -> type[Light]:
    if kind not in LIGHT_KINDS:
        raise UserError(f"there is no light of kind '{kind}'; known are {', '.join(LIGHT_KINDS)}")
    return LIGHT_KINDS[kind]


def _usual(scene: Scene, direction: np.ndarray) -> dict[str, Any]:
    """Place and size that suit the scene's objects, for a light that shines along `direction`."""
    around = environment_of(scene.objects)
    position = vec3(around.centre - 6.0 * around.radius * direction)
    return {"position": position, "radius": 0.5 * around.radius, "width": around.radius, "height": around.radius}


def _in_view(scene: Scene, light: Light, view: View) -> Light:
    """The light nearer to its target, as far as the picture shows that place; or in the picture's upper left, as far
    away as the objects."""
    around = environment_of(scene.objects)
    places = [around.centre + share * (light.position - around.centre) for share in np.linspace(1.0, 0.25, 16)]
    seen = view.project(np.array(places))[0]
    inside = ((seen > _VIEW_MARGIN) & (seen < 1.0 - _VIEW_MARGIN)).all(axis=1)
    if inside.any():
        place = places[int(inside.argmax())]
    else:
        origin, way = view.ray(0.25, 0.2)
        depth = max(float(view.depth(around.centre)), 2.0 * around.radius)
        place = origin + way * (depth / float(way @ view.forward))
    aimed = light.changed(position=vec3(place))
    toward = around.centre - place
    if aimed.has_direction and np.linalg.norm(toward) > 1e-9 * around.radius:
        aimed = aimed.changed(direction=_unit(light, "direction", vec3(toward)))
    return aimed


def duplicate_light(scene: Scene, index: int) -> Scene:
    """With a copy of light `index` at the end, a little to the side so that the two can be distinguished."""
    light = scene.lights[index]
    frame = up_frame(scene)
    copy = replace(light, name=free_name(light.name, [other.name for other in scene.lights]))
    if not light.has_place:
        turn = rotation_about(vec3(frame[:, 2]), math.radians(15.0))
        copy = copy.changed(direction=vec3(turn @ light.direction))
    else:
        copy = copy.changed(position=vec3(light.position + 0.5 * environment_of(scene.objects).radius * frame[:, 0]))
    return set_light(scene, len(scene.lights), copy)


def delete_light(scene: Scene, index: int) -> Scene:
    """Without light `index`. Raises UserError for the last one where there is no environment to see by."""
    if len(scene.lights) == 1 and scene.environment is None:
        raise UserError(
            f"'{scene.lights[index].name}' is the only light; add another or an environment before deleting it"
        )
    return replace(scene, lights=scene.lights[:index] + scene.lights[index + 1 :])


def rename_light(scene: Scene, index: int, name: str) -> Scene:
    """Give light `index` another name. Raises UserError for one that is empty or taken."""
    return set_light(scene, index, replace(scene.lights[index], name=name))


def set_light_kind(scene: Scene, index: int, kind: str) -> Scene:
    """Make light `index` of another kind that aims at the same place and lights it as brightly."""
    light = scene.lights[index]
    cls = _class_of(kind)
    around = environment_of(scene.objects)
    direction = light.direction
    if not light.has_direction:
        toward = around.centre - light.position
        if np.linalg.norm(toward) > 1e-9 * around.radius:
            direction = _unit(light, "direction", vec3(toward))
    changed = made(cls, _usual(scene, np.array(direction)) | {"direction": direction} | light.given())
    return set_light(scene, index, _lighting(scene, changed, light.spectral_power.luminous() / _reach(scene, light)))


def set_light_file(scene: Scene, index: int | None, path: Path) -> Scene:
    """Let light `index`, or a new one (None), shine as the photometric file `path` has it, as bright as that says.

    A light of another kind becomes one that keeps its place and aim. Raises UserError for a file that cannot be used.
    """
    profile = read_ies(path)
    if index is None:
        scene, index = add_light(scene, IesLight.kind), len(scene.lights)
    elif scene.lights[index].profile is None:
        scene = set_light_kind(scene, index, IesLight.kind)
    light = scene.lights[index].changed(profile=profile)
    power = light.spectral_power.scaled_to_luminous(profile.peak_cd)
    return set_light(scene, index, replace(light, spectral_power=power))


# -- power ----------------------------------------------------------------------------------


def photometric_key(light: Light) -> str:
    """The power key that a light of this kind is usually given in: cd, lm/unit² or cd/unit²."""
    return light.power_keys[0].key


def light_power(light: Light, key: str | None = None) -> float:
    """Power of a light as the scene-file key `key` states it (its own photometric one if None)"""
    return light.power(_power_key(light, key))


def set_light_power(scene: Scene, index: int, value: float, key: str | None = None) -> Scene:
    """Give light `index` a power, in the unit of `key` (None: its photometric one). 0 is kept as a spark of 1e-9."""
    light = scene.lights[index]
    found = _power_key(light, key)
    if not (math.isfinite(value) and 0.0 <= value <= MAX_LENGTH):
        raise UserError(f"light '{light.name}': its power is {value:g}; give a number of 0 or more")
    return _with_power(scene, index, light.with_power(found, max(value, _DARK)).spectral_power)


def _power_key(light: Light, key: str | None) -> PowerKey:
    """The quantity called `key` (None: the light's usual one). Raises UserError where the light has none such."""
    keys = {each.key: each for each in light.power_keys}
    if key is not None and key not in keys:
        raise UserError(f"light '{light.name}' is {light.kind} and has no {key}; its power is one of {', '.join(keys)}")
    return keys[key or photometric_key(light)]


# -- spectrum -------------------------------------------------------------------------------


def set_light_spectrum(
    scene: Scene, index: int, kind: SpectrumKind, value: str | float | Path | tuple[tuple[float, float], ...]
) -> Scene:
    """Give light `index` another spectrum of the same photometric power.

    `value` by kind: "illuminant" a CIE name, "blackbody" kelvin, "laser" nm, "lines" rows of (nm, relative power),
    "csv" a file of wavelength_nm and power. Raises UserError for what is unknown, invisible or outside a glass's data.
    """
    light = scene.lights[index]
    notes = list(scene.notes)
    shape = _spectrum(light, kind, value, notes)
    scene = replace(scene, notes=tuple(notes))
    changed = _with_power(scene, index, shape.scaled_to_luminous(light.spectral_power.luminous()))
    _check_against_glass(scene, changed.lights[index], light)
    return changed


@lru_cache(maxsize=64)
def spectrum_words(spectrum: Spectrum) -> tuple[SpectrumKind, str | float | tuple[tuple[float, float], ...] | None]:
    """Kind and value of a spectrum, as `set_light_spectrum` takes them; ("table", None) for a measured one."""
    described = describe_spectrum(spectrum)
    if isinstance(described, str):
        return "illuminant", described
    if "blackbody" in described:
        return "blackbody", float(described["blackbody"])
    if "laser" in described:
        return "laser", float(described["laser"])
    if set(described) == {"lines"}:
        return "lines", tuple((w, p) for w, p in described["lines"])
    return "table", None


def _spectrum(light: Light, kind: str, value: object, notes: list[str]) -> Spectrum:
    match kind, value:
        case "illuminant", str(name):
            return spectra.illuminant(name)
        case "blackbody", float() | int():
            return spectra.blackbody(float(value))
        case "laser", float() | int():
            return _lines(light, ((float(value), 1.0),))
        case "lines", tuple(rows) if rows:
            return _lines(light, rows)
        case "csv", (str() | Path()) as path:
            return spectra.from_csv(path, notes)
    raise UserError(
        f"light '{light.name}': '{kind}' with {value!r} is no spectrum; use illuminant, blackbody, laser, lines or csv"
    )


def _lines(light: Light, rows: tuple[tuple[float, float], ...]) -> Spectrum:
    for wavelength, _ in rows:
        if not 380.0 <= wavelength <= 780.0:
            raise UserError(
                f"light '{light.name}': a line at {wavelength:g} nm is not visible; choose one from 380 to 780 nm"
            )
    return Spectrum(lines=rows)


def _with_power(scene: Scene, index: int, spectrum: Spectrum) -> Scene:
    light = replace(scene.lights[index], spectral_power=spectrum)
    return replace(scene, lights=(*scene.lights[:index], light, *scene.lights[index + 1 :]))


# -- brightness on the objects, checks ------------------------------------------------------


def _reach(scene: Scene, light: Light) -> float:
    """Luminous quantity of the light over the illuminance it gives the objects' middle, on a plane across it."""
    around = environment_of(scene.objects)
    return light.reach(max(float(np.linalg.norm(around.centre - light.position)), 1e-3 * around.radius))


def _lighting(scene: Scene, light: Light, illuminance: float) -> Light:
    power = light.spectral_power.scaled_to_luminous(max(illuminance * _reach(scene, light), _DARK))
    return replace(light, spectral_power=power)


def _check_against_glass(scene: Scene, light: Light, before: Light | None) -> None:
    glasses = [o for o in scene.objects if o.material.transmits]
    if light.has_place:
        check_outside(light, glasses, scene.name)
    if before is None or before.spectral_power is not light.spectral_power:
        check_lines(light, glasses, scene.name)


def _unit(light: Light, what: str, vector: Vec3) -> Vec3:
    length = math.hypot(*vector)
    if not (math.isfinite(length) and length > 1e-150):
        raise UserError(f"light '{light.name}': its {what} is zero or not finite; give a direction")
    return vec3(np.array(vector) / length)
