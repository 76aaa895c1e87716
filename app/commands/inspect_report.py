"""What `spectrasplat inspect` says of a scene: objects, glasses, lights, camera, and what its programs hold.

For people's eyes only; nothing else of the program reads it.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ..model.scene import Camera, Light, Scene, SceneObject
from ..model.scene_defaults import bounds_of
from .printing import show, table
from .scenes import find_scene
from .table import Inspect

if TYPE_CHECKING:
    from rich.console import RenderableType
    from rich.table import Table

    from ..model.optics.glass import Dispersion


def inspect(options: Inspect) -> int:
    """Show a scene, or its programs. Raises `UserError`."""
    from ..model.flat_faces import with_flat_faces
    from ..model.io.scene_file import load_scene
    from ..model.panorama_lights import with_panorama_lights

    scene = with_panorama_lights(load_scene(find_scene(options.scene)))
    if options.programs:
        from .inspect_programs import programs_text

        show(programs_text(with_flat_faces(scene)))
    else:
        show(inspect_text(scene))
    return 0


def inspect_text(scene: Scene) -> RenderableType:
    """Everything `scene` holds, as one printable group of tables."""
    from rich.console import Group

    parts: list[RenderableType] = [
        f"Scene '{scene.name}', bounds {_box(*bounds_of(scene.objects))}",
        _objects_table(scene.objects),
        _lights_table(scene.lights),
        camera_line(scene),
    ]
    glasses = list(dict.fromkeys(o.material.dispersion for o in scene.objects if o.material.transmits))
    if glasses:
        parts.insert(2, _glasses_table(glasses))
    parts += _compiled(scene)
    parts += [f"Note: {note}" for note in scene.notes]
    return Group(*parts)


def camera_line(scene: Scene) -> str:
    """The camera and the picture it makes, one line."""
    camera: Camera = scene.camera
    if camera.kind == "orthographic":
        lens = f"orthographic, {camera.vertical_extent:.4g} units high"
    else:
        lens = f"pinhole, {camera.vertical_fov_deg:.4g}° vertical field of view"
    if camera.lens_radius > 0.0:
        lens += f", lens of radius {camera.lens_radius:.4g} focused at {camera.plane_of_focus:.4g}"
    render = scene.render
    return (
        f"Camera: {lens}, at {_point(camera.position)} towards {_point(camera.target)}; "
        f"{render.width}×{render.height} pixels, {render.photons:,} photons, depth {render.max_depth}"
    )


def light_flux(light: Light) -> tuple[float, float] | None:
    """(lumen, watt) a light sends out in all; None for a directional one, which has no end."""
    factor = light.flux_factor
    if math.isinf(factor):
        return None
    return light.spectral_power.luminous() * factor, light.spectral_power.power_w() * factor


# -- tables -------------------------------------------------------------------------------


def _objects_table(objects: tuple[SceneObject, ...]) -> Table:
    from ..model.geometry.mesh_health import examine

    meshes = {id(item.mesh): item.mesh for item in objects}
    health = {key: examine(mesh).summary() for key, mesh in meshes.items()}
    rows = [
        (
            item.name,
            f"{len(item.mesh.triangles):,}",
            _box(*bounds_of((item,))),
            item.material.words(),
            "flat" if item.mesh.corner_normals is None else "smooth",
            health[id(item.mesh)],
        )
        for item in objects
    ]
    return table("Objects", ("name", ">triangles", "bounds", "material", "shading", "mesh"), rows)


def _glasses_table(glasses: list[Dispersion]) -> Table:
    rows = []
    for glass in glasses:
        low, high = glass.range_nm
        gain = "" if glass.gain == 1.0 else f", {glass.gain:g} times as dispersive"
        rows.append(
            (
                (glass.name or "(unnamed)") + gain,
                f"{glass.n_d:.6f}",
                "∞ (no dispersion)" if math.isinf(glass.natural.V_d) else f"{glass.natural.V_d:.2f}",
                f"{float(glass.index(400.0)):.6f}",
                f"{float(glass.index(700.0)):.6f}",
                "any wavelength" if math.isinf(high) else f"{low:g}–{high:g} nm",
            )
        )
    return table("Glasses", ("name", ">n_d", ">V_d", ">n at 400 nm", ">n at 700 nm", "data"), rows)


def _lights_table(lights: tuple[Light, ...]) -> Table:
    rows = []
    for light in lights:
        lumen, watt = (key.unit for key in light.own_keys)
        flux, power = light_flux(light), light.spectral_power
        rows.append(
            (
                light.name,
                light.words(),
                spectrum_words(light),
                f"{power.luminous():.5g} {lumen}",
                f"{power.power_w():.5g} {watt}",
                "per unit² only" if flux is None else f"{flux[0]:.5g} lm, {flux[1]:.5g} W",
            )
        )
    return table("Lights", ("name", "kind", "spectrum", ">photometric", ">radiometric", "in all"), rows)


def _compiled(scene: Scene) -> list[RenderableType]:
    from ..features.facts import Facts
    from ..features.features import Features
    from ..model.flat_faces import with_flat_faces
    from ..model.settings import RenderSettings
    from .inspect_features import record_words, static_costs

    wishes = scene.render
    settings = RenderSettings(width=wishes.width, height=wishes.height, max_depth=wishes.max_depth)
    rendered = with_flat_faces(scene)
    features, facts = Features.of(rendered, settings), Facts(rendered, settings)
    costs = static_costs(facts, features)
    rows = [
        (name, "in" if included else "out", reason, costs.get(name, ""))
        for name, included, reason in features.explain(facts)
    ]
    return [
        table("Compiled into the programs", ("part", " ", "why", "costs"), rows),
        record_words(features),
    ]


# -- words --------------------------------------------------------------------------------


def spectrum_words(light: Light) -> str:
    """A light's spectrum in a few words."""
    from ..model.spectrum_file import describe_spectrum

    said = describe_spectrum(light.spectral_power)
    if isinstance(said, str):
        return said
    if "laser" in said:
        return f"laser {said['laser']:g} nm"
    if "blackbody" in said:
        return f"black body {said['blackbody']:g} K"
    lines = said.get("lines", [])
    if "nm" not in said:
        return "lines at " + ", ".join(f"{wavelength:g}" for wavelength, _ in lines) + " nm"
    low, high = light.spectral_power.support_nm()
    return f"table {math.ceil(low)}–{math.floor(high)} nm" + (f" and {len(lines)} line(s)" if lines else "")


def _box(low: np.ndarray, high: np.ndarray) -> str:
    size = high - low
    return f"{' × '.join(f'{s:.4g}' for s in size)} about {_point(0.5 * (low + high))}"


def _point(point: tuple[float, float, float] | np.ndarray) -> str:
    return "(" + ", ".join(f"{v + 0.0:.4g}" for v in point) + ")"
