"""Parts of small scenes for the stress sweep, and ways to bend a whole scene: move, scale, other glass."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ...model.geometry.mesh import Mesh
from ...model.geometry.primitives import plane
from ...model.lights import CollimatedLight, DirectionalLight
from ...model.lights.light import made
from ...model.optics.glass import Dispersion, constant, from_abbe, table
from ...model.optics.spectrum import Spectrum, illuminant
from ...model.placement import rotation_about
from ...model.scene import Camera, Dielectric, Diffuse, Light, Scene, SceneObject
from ...model.scene_defaults import bounds_of
from ...model.vectors import vec3

TABLE = SceneObject("table", plane(8.0, 8.0), Diffuse())
"""Receiver in z = 0."""
UNDER_GLASS = Camera((0.0, 0.0, 1e-3), (0.0, 0.0, 0.0), (0.0, -1.0, 0.0), "orthographic", vertical_extent=4.5)
"""Sees the table's caustic from so near that no glass is before it, on the same pixels whatever is on the table."""
BEAM = CollimatedLight(
    "beam", illuminant("D65").scaled_to_luminous(10.0), (0.3, 0.0, 6.0), (0.0, 0.0, -1.0), radius=0.45
)
"""A beam straight down."""
SUN = DirectionalLight("sun", illuminant("D65").scaled_to_luminous(10.0), direction=(0.36, 0.0, -0.9329523))
"""Slanting light over everything."""
FLINT = from_abbe(1.7, 30.0, "flint")
CROWN = from_abbe(1.5, 60.0, "crown")
WATER = from_abbe(1.333, 55.0, "water")
ANOMALOUS, RAINBOW, STEP = "V_d −20, anomalous", "n 2.2 (violet) to 1.2 (red)", "a step from 1.7 to 1.5 within 1 nm"
IMPOSSIBLE = {
    RAINBOW: table((380.0, 780.0), (2.2, 1.2), "rainbow gem"),
    "n 1.2 (violet) to 2.2 (red)": table((380.0, 780.0), (1.2, 2.2), "reversed gem"),
    ANOMALOUS: from_abbe(1.6, -20.0, "anomalous"),
    STEP: table((380.0, 549.5, 550.5, 780.0), (1.7, 1.7, 1.5, 1.5), "step"),
    "n 4 and V_d 10": from_abbe(4.0, 10.0, "heavy"),
    "n 1 + 1e-6": constant(1.0 + 1e-6, "hardly glass"),
}
"""Glasses that no maker sells."""


def at(x: float = 0.0, y: float = 0.0, z: float = 0.0, turned: np.ndarray | None = None) -> np.ndarray:
    """Placement of an object's origin, (4, 4), first turned by a matrix (3, 3)."""
    place = np.eye(4)
    place[:3, :3] = np.eye(3) if turned is None else turned
    place[:3, 3] = x, y, z
    return place


def solid(
    name: str,
    mesh: Mesh,
    glass: Dispersion,
    place: tuple[float, float, float] = (0.0, 0.0, 0.0),
    priority: int = 0,
    turned: np.ndarray | None = None,
) -> SceneObject:
    """A piece of glass with its own origin at `place`, first turned by the matrix `turned` (3, 3)."""
    return SceneObject(name, mesh, Dielectric(glass, priority=priority), at(*place, turned))


def tilted(*items: SceneObject) -> list[SceneObject]:
    """Objects modelled round the origin, turned together and lifted over the table: no face lies along an axis."""
    matrix = at(0.0, 0.0, 1.2, turn((1.0, 0.4, 0.2), 28.0))
    return [replace(item, object_to_world=matrix @ item.object_to_world) for item in items]


def stage(
    *objects: SceneObject, lights: Sequence[Light] = (BEAM,), camera: Camera = UNDER_GLASS, table: SceneObject = TABLE
) -> Scene:
    """Objects over the table."""
    return Scene("stage", camera, tuple(lights), (*objects, table))


def moved(
    scene: Scene,
    scale: float = 1.0,
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0),
    rotation: np.ndarray | None = None,
) -> Scene:
    """The whole scene under a similarity; radiance stays, so the picture does.

    Lengths grow by `scale`, hence intensities by its square and absorption by its inverse.
    """
    turn = np.eye(3) if rotation is None else rotation
    matrix = at(*offset, scale * turn)

    def point(p: Sequence[float]) -> tuple[float, float, float]:
        return vec3(matrix[:3, :3] @ p + matrix[:3, 3])

    def direction(d: Sequence[float]) -> tuple[float, float, float]:
        return vec3(turn @ d)

    camera = replace(
        scene.camera,
        position=point(scene.camera.position),
        target=point(scene.camera.target),
        up=direction(scene.camera.up),
        vertical_extent=scale * scene.camera.vertical_extent,
    )

    def moved(light: Light) -> Light:
        given = light.given()
        given |= {name: scale * given[name] for name in ("radius", "width", "height") if name in given}
        given |= {"position": point(light.position), "direction": direction(light.direction)}
        given["tangent"] = None if light.tangent is None else direction(light.tangent)
        if light.is_intensity:
            given["spectral_power"] = brighter(light.spectral_power, scale**2)
        return made(type(light), given)

    lights = tuple(moved(light) for light in scene.lights)
    objects = tuple(
        replace(_thinner(item, scale), object_to_world=matrix @ item.object_to_world) for item in scene.objects
    )
    seen = scene.environment
    if seen is not None:
        # The whole world turns: what glass mirrors of it too.
        seen = replace(seen, world_to_local=seen.world_to_local @ turn.T)
    return replace(scene, camera=camera, lights=lights, objects=objects, environment=seen)


def turn(axis: Sequence[float], degrees: float) -> np.ndarray:
    """Rotation about `axis` (of any length), float64 (3, 3)."""
    return rotation_about(vec3(np.asarray(axis, float) / np.linalg.norm(axis)), np.radians(degrees))


def brighter(spectrum: Spectrum, factor: float) -> Spectrum:
    """Every power times `factor`."""
    return Spectrum(spectrum.density * factor, tuple((nm, power * factor) for nm, power in spectrum.lines))


def with_glass(scene: Scene, change: Callable[[Dispersion], Dispersion]) -> Scene:
    """The scene with every glass replaced by `change(glass)`."""

    def changed(item: SceneObject) -> SceneObject:
        if not item.material.transmits:
            return item
        return replace(item, material=item.material.changed(dispersion=change(item.material.dispersion)))

    return replace(scene, objects=tuple(changed(item) for item in scene.objects))


def extent(scene: Scene) -> float:
    """Diagonal of what is not a receiver (else of everything), scene units."""
    items = [o for o in scene.objects if not o.material.receives] or list(scene.objects)
    low, high = bounds_of(items)
    return float(np.linalg.norm(np.asarray(high) - np.asarray(low)))


def _thinner(item: SceneObject, scale: float) -> SceneObject:
    """Absorption is per length."""
    material = item.material
    if material.absorption is None:
        return item
    absorption = replace(material.absorption, coefficient=material.absorption.coefficient / scale)
    return replace(item, material=material.changed(absorption=absorption))
