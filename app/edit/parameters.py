"""Every number of a scene that can be animated, by a path such as `objects.prism.dispersion_gain`.

A `Stage` is what an animation changes. `apply` sets one parameter, always starting from the stage as it was
drawn up, so a frame depends on its time alone. Angles called `rotation` and `orbit_deg`, and the light's `power`, are
relative to the stage as it is (0 and 1 leave it); all other parameters are the values themselves.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.errors import UserError, suggestion
from ..model.fields import Number
from ..model.optics import glass
from ..model.optics.spectrum import Spectrum
from ..model.placement import rotation_about
from ..model.scene import (
    Camera,
    Dielectric,
    Light,
    Material,
    Scene,
    SceneObject,
    Vec3,
)
from ..model.scene_camera import camera_numbers
from ..model.vectors import vec3

if TYPE_CHECKING:
    from ..model.optics.glass import Dispersion

_AXES: dict[str, Vec3] = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
_FAR = 1e9


@dataclass(frozen=True)
class Stage:
    """What an animation may change."""

    scene: Scene
    camera: Camera
    exposure_ev: float = 0.0
    """Absolute, as `tone_map.to_display` takes it."""
    solo_nm: float | None = None


@dataclass(frozen=True)
class Parameter:
    """One number."""

    meaning: str
    unit: str
    low: float
    high: float
    order: int = 0
    """Lower ones are applied first: turns come after positions, and about x before y before z."""


_ORBIT = {
    "orbit_deg": Parameter("Turn of the camera about its target, seen from above", "°", -1e5, 1e5, 2),
    "elevation_deg": Parameter(
        "Camera's height above the target as an angle, added to what it is", "°", -180.0, 180.0, 1
    ),
    "distance": Parameter("Distance from the camera to its target", "units", 1e-6, _FAR, 1),
}
_PLACE = {f"position.{axis}": Parameter(f"Position along {axis}", "units", -_FAR, _FAR) for axis in _AXES}
_TARGET = {f"target.{axis}": Parameter(f"Point looked at, along {axis}", "units", -_FAR, _FAR) for axis in _AXES}
_TURN = {
    f"rotation.{axis}": Parameter(
        f"Turn about the world's {axis} axis through its own position, added to what it is", "°", -1e5, 1e5, 3 + i
    )
    for i, axis in enumerate(_AXES)
}
_GLASS = {
    "n_d": Parameter("Refractive index at the d line, 587.56 nm", "", 1e-3, 10.0),
    "V_d": Parameter("Abbe number: small is dispersive", "", -1e4, 1e4),
    "dispersion_gain": Parameter("Factor on the glass's dispersion; 1 is the glass itself", "×", 0.0, 100.0, 1),
}
_GLOBAL = {
    "exposure_ev": Parameter("Exposure", "EV", -64.0, 64.0),
    "solo_nm": Parameter("Light of this wavelength only", "nm", 380.0, 780.0),
}
_POWER = Parameter("Power, as a multiple of what it is", "×", 0.0, 1e6)


def paths(scene: Scene, camera: Camera) -> dict[str, Parameter]:
    """All parameters that `scene` seen by `camera` has."""
    found = dict(_GLOBAL)
    own = {**_PLACE, **_TARGET, **_ORBIT} | _of_numbers(camera)
    found |= {f"camera.{name}": parameter for name, parameter in own.items()}
    for item in scene.objects:
        parts = {**_PLACE, **_TURN} | _of_glass(item.material) | _of_numbers(item.material)
        found |= {f"objects.{item.name}.{name}": parameter for name, parameter in parts.items()}
    for light in scene.lights:
        parts = {"power": _POWER} | _of_numbers(light)
        parts |= (_PLACE if light.has_place else {}) | (_TURN if light.has_direction else {})
        found |= {f"lights.{light.name}.{name}": parameter for name, parameter in parts.items()}
    return found


def _of_glass(material: Material) -> dict[str, Parameter]:
    """The parameters of a glass; of a crystal, which has two indices, the gain alone."""
    if not material.transmits:
        return {}
    return {name: each for name, each in _GLASS.items() if name == "dispersion_gain" or not material.is_crystal}


def parameter(stage: Stage, path: str, where: str = "") -> Parameter:
    """The parameter at `path`; raises `UserError` naming the nearest paths there are."""
    known = paths(stage.scene, stage.camera)
    if path not in known:
        # A name that is right and a parameter that is not deserves the parameters of that name.
        beginning = max(
            (p.rpartition(".")[0] for p in known if path.startswith(p.rpartition(".")[0] + ".")), key=len, default=""
        )
        near = [p for p in known if beginning and p.startswith(beginning + ".")]
        hint = suggestion(path, near or known) or suggestion(path, known)
        raise UserError(
            f"{where}'{path}' is no parameter of scene "
            f"'{stage.scene.name}'{hint or '; known are ' + ', '.join(near or sorted(_GLOBAL)) + ' and others'}"
        )
    return known[path]


def check_value(stage: Stage, path: str, value: float, where: str = "") -> float:
    """`value` where `path` can take it; raises `UserError` otherwise."""
    known = parameter(stage, path, where)
    if not (math.isfinite(value) and known.low <= value <= known.high):
        bounds = f"{known.low:g} and {known.high:g} {known.unit}".rstrip()
        raise UserError(f"{where}{path} = {value:g} is out of range: give between {bounds}")
    return value


def value_of(stage: Stage, path: str) -> float:
    """The parameter's present value: relative ones are 0 (turns) or 1 (power)."""
    parameter(stage, path)
    head, name, field = parts(stage.scene, path)
    if head == "camera":
        return _camera_value(stage.camera, field)
    if name:
        item = next(x for x in getattr(stage.scene, head) if x.name == name)
        return _object_value(item, field) if isinstance(item, SceneObject) else _light_value(item, field)
    if path == "exposure_ev":
        return stage.exposure_ev
    return glass.LINE_D_NM if stage.solo_nm is None else stage.solo_nm


def apply(stage: Stage, path: str, value: float) -> Stage:
    """`stage` with one parameter set; all objects (or lights) of that name follow. Raises `UserError`."""
    check_value(stage, path, value)
    head, name, field = parts(stage.scene, path)
    if head == "camera":
        return replace(stage, camera=_with_camera(stage.camera, field, value))
    if name:
        change: Callable = _with_object if head == "objects" else _with_light
        items = tuple(change(x, field, value) if x.name == name else x for x in getattr(stage.scene, head))
        return replace(stage, scene=_changed(stage.scene, head, items))
    return _changed(stage, path, value)


def apply_all(stage: Stage, values: Mapping[str, float]) -> Stage:
    """`stage` with several parameters set, in the order that makes them independent of each other."""
    for path in sorted(values, key=lambda p: parameter(stage, p).order):
        stage = apply(stage, path, values[path])
    return stage


def parts(scene: Scene, path: str) -> tuple[str, str, str]:
    """Group ("camera", "objects", "lights" or ""), name ("" outside of the last two) and field of a path that `paths`
    knows."""
    head, _, rest = path.partition(".")
    if head not in ("objects", "lights"):
        return (head, "", rest) if rest else ("", "", head)
    # Names may hold dots themselves.
    name = max((x.name for x in getattr(scene, head) if rest.startswith(x.name + ".")), key=len)
    return head, name, rest[len(name) + 1 :]


# ---- camera --------------------------------------------------------------------------------


def _camera_value(camera: Camera, name: str) -> float:
    field, _, axis = name.partition(".")
    if axis:
        return getattr(camera, field)["xyz".index(axis)]
    if name == "distance":
        return math.dist(camera.position, camera.target)
    if name == "focus_distance":
        return camera.plane_of_focus
    numbers = _animated_numbers(camera)
    return getattr(camera, numbers[name].attribute) if name in numbers else 0.0


def _with_camera(camera: Camera, name: str, value: float) -> Camera:
    field, _, axis = name.partition(".")
    if axis:
        return _changed(camera, field, _with_axis(getattr(camera, field), axis, value))
    numbers = _animated_numbers(camera)
    if name in numbers:
        return _changed(camera, numbers[name].attribute, value)
    target, arm = np.asarray(camera.target), np.subtract(camera.position, camera.target)
    up = np.asarray(camera.up, float) / np.linalg.norm(camera.up)
    if name == "distance":
        arm = arm * (value / max(float(np.linalg.norm(arm)), 1e-12))
    elif name == "orbit_deg":
        arm = rotation_about(vec3(up), math.radians(value)) @ arm
    else:
        arm = _raised(arm, up, value)
    return replace(camera, position=vec3(target + arm))


def _raised(arm: np.ndarray, up: np.ndarray, degrees: float) -> np.ndarray:
    """`arm` turned towards `up`, stopping short of the pole, where a camera would flip over."""
    length = float(np.linalg.norm(arm))
    level = arm - up * (arm @ up)
    if np.linalg.norm(level) < 1e-9 * length:
        return arm
    level /= np.linalg.norm(level)
    angle = np.clip(
        math.asin(np.clip(arm @ up / length, -1.0, 1.0)) + math.radians(degrees),
        -math.radians(89.9),
        math.radians(89.9),
    )
    return length * (math.cos(angle) * level + math.sin(angle) * up)


# ---- objects and lights ---------------------------------------------------------------------


def _object_value(item: SceneObject, name: str) -> float:
    field, _, axis = name.partition(".")
    if field == "position":
        return float(item.object_to_world["xyz".index(axis), 3])
    if field == "rotation":
        return 0.0
    numbers = _animated_numbers(item.material)
    if field in numbers:
        return getattr(item.material, numbers[field].attribute)
    dispersion = item.material.dispersion
    # The gain is a parameter of its own: V_d is the glass's without it.
    return {"dispersion_gain": dispersion.gain, "n_d": dispersion.n_d, "V_d": dispersion.natural.V_d}[name]


def _with_object(item: SceneObject, name: str, value: float) -> SceneObject:
    field, _, axis = name.partition(".")
    if field in ("position", "rotation"):
        matrix = item.object_to_world.copy()
        if field == "position":
            matrix["xyz".index(axis), 3] = value
        else:
            matrix[:3, :3] = rotation_about(_AXES[axis], math.radians(value)) @ matrix[:3, :3]
        return replace(item, object_to_world=matrix)
    numbers = _animated_numbers(item.material)
    if field in numbers:
        return replace(item, material=replace(item.material, **{numbers[field].attribute: value}))
    material = item.material
    assert isinstance(material, Dielectric)
    if name == "dispersion_gain":
        return replace(item, material=material.with_gain(value))
    return replace(item, material=material.changed(dispersion=_with_glass(material.dispersion, name, value)))


def _with_glass(dispersion: Dispersion, name: str, value: float) -> Dispersion:
    plain = dispersion.natural
    n_d, v_d = (value, plain.V_d) if name == "n_d" else (plain.n_d, value)
    return glass.with_gain(glass.from_abbe(n_d, v_d, dispersion.name), dispersion.gain)


def _of_numbers(thing: Camera | Light | Material) -> dict[str, Parameter]:
    found = {}
    for name, number in _animated_numbers(thing).items():
        animated = number.animated
        assert animated is not None
        found[name] = Parameter(animated.meaning, number.unit, *number.span(animated))
    return found


def _animated_numbers(thing: Camera | Light | Material) -> dict[str, Number]:
    """The numbers of a camera, of a light's shape, or of a material, by their names in an animation."""
    numbers = camera_numbers(thing) if isinstance(thing, Camera) else thing.shown_numbers()
    return {n.animated.name or n.attribute: n for n in numbers if n.animated is not None}


def _light_value(light: Light, name: str) -> float:
    field, _, axis = name.partition(".")
    if field == "position":
        return light.position["xyz".index(axis)]
    relative = {"power": 1.0, "rotation": 0.0}
    return relative[field] if field in relative else getattr(light, _animated_numbers(light)[field].attribute)


def _with_light(light: Light, name: str, value: float) -> Light:
    field, _, axis = name.partition(".")
    if field == "position":
        return light.changed(position=_with_axis(light.position, axis, value))
    if field == "rotation":
        turn = rotation_about(_AXES[axis], math.radians(value))
        turned = light.changed(direction=vec3(turn @ np.asarray(light.direction)))
        if light.tangent is None and not light.has_roll:
            return turned
        tangent = light.axes()[:, 0] if light.tangent is None else np.asarray(light.tangent)
        return turned.changed(tangent=vec3(turn @ tangent))
    if field == "power":
        spectrum = light.spectral_power
        lines = tuple((nm, power * value) for nm, power in spectrum.lines)
        return replace(light, spectral_power=Spectrum(spectrum.density * value, lines))
    return light.changed(**{_animated_numbers(light)[field].attribute: value}).fitted()


def _changed(thing: Any, name: str, value: object) -> Any:
    """A copy of a frozen `thing` with one field set."""
    return replace(thing, **{name: value})


def _with_axis(vector: Vec3, axis: str, value: float) -> Vec3:
    index = "xyz".index(axis)
    return (*vector[:index], float(value), *vector[index + 1 :])  # type: ignore[return-value]
