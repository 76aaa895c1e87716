"""What camera rays look up in a scene, for `inspect`: environment, pictures, caustic maps, and how the spectrum is
sampled."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from ..features.features import Features
from ..features.receivers import picture_bytes
from ..features.row import size_words
from ..gpu.map_channels import tents
from ..gpu.mip_chain import level_count
from ..model.scene import Scene
from ..model.texture import Environment, Texture
from ..render.device_scene import spectral_axis

_FILTER = "interpolated, the level by the footprint, more lookups along a long one"


class Lookup(NamedTuple):
    """One thing that camera rays look up, in words."""

    what: str
    content: str
    how: str
    memory: str
    """On the device; "" for nothing worth a line."""


def lookups(scene: Scene, features: Features) -> list[Lookup]:
    """Everything that camera rays look up, and what they do without."""
    return [_beyond(scene), *_pictures(scene), _maps(scene, features), _spectrum(features)]


def _beyond(scene: Scene) -> Lookup:
    if scene.environment is None:
        colour = ", ".join(f"{c:.3g}" for c in scene.background_rgb)
        content = f"one colour ({colour}) lm/(sr unit²)" if any(scene.background_rgb) else "black"
        return Lookup("background", content, "no picture: the lookup is left out", "")
    kind, source = scene.environment.kind, scene.environment.source
    content = f"{kind}{f' {Path(source).name}' if source else ''}, {_size(scene.environment)}"
    return Lookup("environment", content, f"on the sphere, {_FILTER}", picture_words(scene.environment))


def _pictures(scene: Scene) -> list[Lookup]:
    worn: dict[int, tuple[Texture, list[str]]] = {}
    for item in scene.objects:
        texture = item.material.texture
        if texture is not None:
            worn.setdefault(id(texture.rgb), (texture, []))[1].append(item.name)
    if not worn:
        return [Lookup("textures", "none", "no surface wears a picture: the lookup is left out", "")]
    return [
        Lookup(
            "texture",
            f"{Path(texture.source).name if texture.source else '(no file)'}, {_size(texture)}, on {', '.join(names)}",
            f"{'repeats' if texture.wrap == 'repeat' else 'its border goes on'}; {_FILTER}",
            picture_words(texture),
        )
        for texture, names in worn.values()
    ]


def _maps(scene: Scene, features: Features) -> Lookup:
    if not scene.lights or not any(o.material.receives for o in scene.objects):
        why = "there is no light" if not scene.lights else "nothing diffuse receives light"
        return Lookup("caustic maps", "none", why, "")
    if not features.map_tents:
        why = "all wavelengths of a ray meet at one place" if features.camera_specular else "caustics are seen directly"
        return Lookup("caustic maps", "XYZ and W", f"no spectra: {why}", "16 B a texel")
    peaks = tents(spectral_axis(scene, features), features.map_tents).tents_nm
    content = f"XYZ and W, tents at {', '.join(f'{nm:.0f}' for nm in peaks)} nm"
    return Lookup(
        "caustic maps",
        content,
        "each wavelength meets another place behind dispersive glass; straight views take XYZ",
        f"{16 * features.targets} B a texel",
    )


def _spectrum(features: Features) -> Lookup:
    if not features.camera_disperses:
        return Lookup("spectrum", "one interval", "no dispersive glass is in view: one lookup a place", "")
    if features.random_wavelength:
        return Lookup(
            "spectrum", "one wavelength a sample behind glass", f"drawn anew for each ({features.method})", ""
        )
    if features.point_spectrum:
        return Lookup(
            "spectrum",
            f"{features.method.removeprefix('regular-')} wavelengths in turn",
            f"evenly spaced ({features.method})",
            "",
        )
    if features.merged_groups:
        return Lookup("spectrum", "one band", f"swept along its columns ({features.method})", "")
    return Lookup(
        "spectrum",
        "bands",
        f"as many as a small picture of the view asks for, each swept along its columns ({features.method})",
        "",
    )


def picture_words(picture: Texture | Environment) -> str:
    """Memory of a picture and its smaller copies."""
    return f"about {size_words(picture_bytes(picture))}"


def _size(picture: Texture | Environment) -> str:
    height, width = picture.rgb.shape[:2]
    return f"{width} × {height}, {level_count(width, height)} level(s)"
