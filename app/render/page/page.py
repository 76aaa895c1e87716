"""A caustic as one page: what is traced for it, step by step, and what it says."""

from __future__ import annotations

import html
import itertools
import os
from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ...base import files
from ...base.atomic import atomic_output, check_writable
from ...base.errors import UserError
from ...base.image_io import shown_bytes
from ...base.tone_map import auto_exposure
from ...base.version import __version__
from ...edit.parameters import Stage
from ...features.facts import dispersive_glasses
from ...gpu.context import Context
from ...model.optics.colorimetry import K_M, VISIBLE_NM, cmf_xyz, xyz_to_rgb709
from ...model.optics.glass import LINE_D_NM
from ...model.optics.spectrum import Spectrum
from ...model.scene import Scene, SceneObject
from ...model.settings import RenderSettings
from ...passes.landings import faces_camera
from ..bake import check_receiver
from ..frames import FrameRenderer
from ..lit_receiver import up_of
from .document import document, packed_bytes
from .light import PageLight, TracedLight, page_light
from .picture import first_look, page_picture, pixels_to_plane, weight_of
from .spectra import GAIN_MAX, Glasses, offered_spectra

DEFAULT_PHOTONS = 100_000
DEFAULT_WIDTH = 720
"""Pixels."""
MOST_GROUPS = 3
"""Glasses by whose indices a page's photons move, each by its own."""
MOST_TRIANGLES = 6000
"""Triangles of all objects that a page draws, at most."""
_STAYS = (
    "What is seen of the caustic in mirrors and through glass stays as it was rendered, and so does all other light: "
    "only what falls on the receiver follows the controls."
)
_FIRST_ORDER = (
    "Another dispersion moves light along straight lines, with the weights that it had: first order. For nine tenths "
    "of the light that was found to hold from × {:.2f} to × {:.2f}."
)
_MADE = (
    "Made with SpectraSplat {} from {}, receiver {}. The photons are stored with their dispersion still open: nothing "
    "is traced here, and nothing is loaded from anywhere."
)
_FEWER = (
    "This page holds the light of {:,} photons, not of the {:,} that were asked for, as its file would be too large: "
    "it has {:.1f} times as much noise."
)
_ROOM = 7_000_000
"""Bytes that the light of a page of up to `DEFAULT_PHOTONS` may have in its file; of more photons, as many more."""
_LIGHT_SHARE = 0.5
"""Share of the time for photons that the page keeps."""


@dataclass(frozen=True)
class PageWords:
    """What a page says besides what its scene does."""

    title: str
    description: str = ""
    steps: Sequence[Mapping[str, Any]] = field(default=())
    """`title`, `text` and what a step sets."""


def words_of(scene: Scene, path: Path | None = None) -> PageWords:
    """The scene's name, and what its file begins by saying."""
    said = ""
    if path is not None and path.suffix.lower() == ".toml" and files.is_file(path):
        lines = files.read_text(path, files.SETTINGS_BYTES).splitlines()
        said = " ".join(line.lstrip("# ") for line in itertools.takewhile(lambda line: line.startswith("#"), lines))
    title = scene.name.replace("_", " ")
    return PageWords(title[:1].upper() + title[1:], said)


def page_size(scene: Scene) -> tuple[int, int]:
    """Pixels of a page's picture, in the scene's own shape."""
    return DEFAULT_WIDTH, max(round(DEFAULT_WIDTH * scene.render.height / scene.render.width), 1)


@dataclass(frozen=True)
class Page:
    """A caustic for a browser; a notebook shows it where it is a cell's last value."""

    arrays: Mapping[str, np.ndarray]
    """By the names of docs/pages.md."""
    head: Mapping[str, Any]

    @cached_property
    def html(self) -> str:
        """The file's text."""
        return document(self.arrays, self.head)

    def to_html(self, path: str | os.PathLike[str]) -> Path:
        """Write it. Raises `UserError` where it cannot be written."""
        target = check_page_path(Path(path))
        with atomic_output(target) as temporary:
            temporary.write_text(self.html, encoding="utf-8")
        return target

    def _repr_html_(self) -> str:
        return framed(self.html)

    def __repr__(self) -> str:
        return f"Page of '{self.head['title']}': the light on '{self.head['receiver']}'"


def framed(page: str) -> str:
    """An element that shows a page within another one."""
    return f'<iframe srcdoc="{html.escape(page)}" title="A caustic" style="width:100%;height:640px;border:0"></iframe>'


def check_page_path(path: Path) -> Path:
    """`path`; raises `UserError` where it cannot be a page's."""
    if path.suffix.lower() != ".html":
        raise UserError(f"cannot write {path}: the name of a page must end in .html")
    check_writable(path)
    return path


def check_page(scene: Scene, receiver: str) -> None:
    """Raise `UserError` where no page can show the light on `receiver`."""
    check_receiver(scene, receiver)
    item = next(o for o in scene.objects if o.name == receiver and o.material.receives)
    if (why := _why_not(item)) is not None:
        raise UserError(f"{why}: choose another receiver, or export a .glb")


def _why_not(item: SceneObject) -> str | None:
    """Why no page can show the light on a receiver; None: one can."""
    if not item.mesh.is_flat:
        return f"'{item.name}' is not one flat face, and a page shows light on flat receivers only"
    if item.material.texture is not None:
        return f"'{item.name}' wears a picture, and a page shows light on receivers of one colour only"
    return None


def page_steps(
    context: Context, stage: Stage, settings: RenderSettings, receiver: str | None, words: PageWords
) -> Generator[float, None, Page]:
    """Make a page of the light on `receiver` (None: the one with most of it), pausing with the share done.
    `settings.photons`: those that it holds; its picture has the settings' size. Raises `UserError`."""
    scene = stage.scene
    if receiver is not None:
        check_page(scene, receiver)
    glasses = Glasses.of(scene)
    settings = replace(settings, photons=settings.photons or DEFAULT_PHOTONS)
    if glasses.own is None:  # beams have no columns by which another glass moves them
        alone = len(dispersive_glasses(scene)) <= MOST_GROUPS
        settings = replace(settings, method="srd-photons" if alone else "srd-lambda")
    widened = replace(glasses.widened(scene), camera=stage.camera)
    traced, light = yield from _tracing(context, widened, settings, receiver, glasses)
    try:
        groups = _groups(traced, glasses)
        size = settings.width, settings.height
        item = light.item
        to_plane = pixels_to_plane(stage.camera, *size, light.frame, traced.buffers)
        around = first_look(stage.camera, up_of(scene), light.frame, light.head["lit"], traced.buffers)
        weight = weight_of(context, traced.buffers, stage.camera, size, item)
    finally:
        traced.release()
    rgb, caustic = yield from _still(context, stage, settings)
    exposure = auto_exposure(rgb) + (settings.exposure_ev or 0.0)
    still = shown_bytes(rgb, settings.exposure_ev or 0.0, settings.glare, scene.render.antialias_highlights, ".jpg")
    material = scene.objects[item].material
    picture = page_picture(rgb, caustic, weight, exposure, still)
    camera = picture.head | {"pixel_to_uv": to_plane.tolist()}
    meshes, shapes = _meshes(scene, item)
    tables, spectra = _spectra(scene, material.reflectance)
    arrays = {**light.arrays, **picture.arrays, **shapes, **tables, **groups.arrays}
    notes = [_STAYS, _MADE.format(__version__, scene.name, scene.objects[item].name)]
    if traced.photons < (settings.photons or 1):
        notes.insert(
            0, _FEWER.format(traced.photons, settings.photons, ((settings.photons or 1) / traced.photons) ** 0.5)
        )
    if glasses.own is None and groups.head["groups"]:
        notes.insert(0, _FIRST_ORDER.format(*straight_gains(light.arrays, groups.arrays["glass_n"])))
    head = light.head | groups.head | spectra | _said(scene, item, words) | {"notes": notes}
    head |= {
        "camera": camera,
        "around": around,
        "meshes": meshes,
        "exposure_ev": exposure,
    }
    head["reflectance_rgb"] = [1.0] * 3 if material.reflectance is not None else list(material.reflectance_rgb)
    yield 1.0
    return Page(arrays, head)


def _tracing(
    context: Context, scene: Scene, settings: RenderSettings, receiver: str | None, glasses: Glasses
) -> Generator[float, None, tuple[TracedLight, PageLight]]:
    """The light of as many photons as a page has room for, the caller's to release, and what it is on the receiver;
    pausing with the share of the page that is done."""
    photons, done = settings.photons or 1, 0.0
    room = _ROOM * max(photons / DEFAULT_PHOTONS, 1.0)
    settings = replace(settings, editable=True, any_view=True)
    while True:
        traced = TracedLight(context, scene, replace(settings, photons=photons))
        try:
            for share in traced.steps():
                done = max(done, _LIGHT_SHARE * share)
                yield done
            light = page_light(traced, _receiver(traced, receiver), glasses)
        except BaseException:  # also when the page is given up
            traced.release()
            raise
        if (size := packed_bytes(light.arrays)) <= room or photons == 1:
            return traced, light
        traced.release()
        photons = max(int(0.95 * photons * room / size), 1)


def _receiver(light: TracedLight, name: str | None) -> int:
    """Number of the receiver called so, or of that on which most light lands: of the side that the camera looks at."""
    objects = light.scene.objects
    numbers = [
        r
        for r, i in enumerate(light.buffers.receivers)
        if name == objects[i].name or (name is None and _why_not(objects[i]) is None)
    ]
    if not numbers:
        whys = "; ".join(filter(None, (_why_not(objects[i]) for i in light.buffers.receivers[::2])))
        raise UserError(f"no caustic of this scene can be on a page: {whys or 'nothing in it is diffuse'}")
    landed = {r: light.landed(r) for r in numbers}
    shown = [r for r in numbers if landed[r] > 0.0 and faces_camera(light.scene.camera, light.buffers, r)]
    return max(shown or numbers, key=lambda r: landed[r])


def _still(
    context: Context, stage: Stage, settings: RenderSettings
) -> Generator[float, None, tuple[np.ndarray, np.ndarray]]:
    """The picture, and the caustics in it alone."""
    frames = FrameRenderer(context, settings, [stage])
    try:
        for share in frames.steps(stage):
            yield _LIGHT_SHARE + 0.45 * share
        rgb = frames.picture.rgb
        for share in frames.steps_of_layer("caustic", stage, lambda: False):
            yield 0.95 + 0.05 * share
        return rgb, frames.picture.rgb
    finally:
        frames.release()


@dataclass(frozen=True)
class _Part:
    """Entries of a page."""

    arrays: dict[str, np.ndarray]
    head: dict[str, Any]


def _groups(light: TracedLight, glasses: Glasses) -> _Part:
    """Glasses whose dispersion may be edited, and what may be shown instead of each. None beside crystals, whose two
    indices go together, and gratings, which have none."""
    groups, traced = light.buffers.groups, light.scene
    rows: list[np.ndarray] = []
    listed: list[dict[str, Any]] = []
    edited: list[dict[str, Any]] = []
    alone = groups.count == len(groups.glasses) and not groups.by_wavelength
    alone &= not any(m.is_grating or m.extraordinary is not None for m in (item.material for item in traced.objects))
    for g in range(groups.count if alone else 0):
        own = glasses.own or groups.glasses[g]
        choices = [own, *glasses.others]
        first = len(rows)
        rows += [glass.index(VISIBLE_NM) for glass in choices]
        listed += [
            {"name": glass.name or "its own glass", "n_d": glass.n_d, "V_d": glass.V_d, "choice": glass is not own}
            for glass in choices
        ]
        objects = [item.name for item in traced.objects if item.material.dispersion == groups.glasses[g]]
        names = list(dict.fromkeys(objects))
        edited.append(
            {"name": own.name or names[0], "objects": names, "row": first, "choices": [*range(first, len(rows))]}
        )
    array = np.array(rows, "f4").reshape(-1, len(VISIBLE_NM))
    head: dict[str, Any] = {"glasses": listed, "groups": edited, "limits": {"gain_max": GAIN_MAX}}
    return _Part({"glass_n": array}, head)


def straight_gains(arrays: Mapping[str, np.ndarray], index: np.ndarray) -> tuple[float, float]:
    """Gains between which nine tenths of a page's photons keep within the change of index over which their own
    intervals of the spectrum were found straight. `index`: n(λ) of each glass, by nm."""
    x = arrays["photons.x"] / 65535.0
    nm = np.interp(x, np.linspace(0.0, 1.0, len(arrays["nm"])), arrays["nm"])
    reach = np.full(len(x), np.inf)
    for glass in index:
        n = np.interp(nm, VISIBLE_NM, glass)
        off = np.abs(n - np.interp(LINE_D_NM, VISIBLE_NM, glass)).max(axis=1)
        reach = np.minimum(reach, np.abs(n[:, 2] - n[:, 0]) / np.maximum(off, 1e-9))
    order = np.argsort(reach)
    light = np.cumsum((arrays["photons.throughput"][:, 1].astype(float) * (x[:, 2] - x[:, 0]))[order])
    within = float(reach[order][np.searchsorted(light, 0.1 * light[-1])])
    return max(1.0 - within, 0.0), min(1.0 + within, GAIN_MAX)


def _spectra(scene: Scene, reflectance: np.ndarray | None) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """Spectra of the lights, and those of 1 lm to choose from; what the eye sees of a nanometre's light, and
    that after a receiver's `reflectance` (by nm), linear Rec.709 by rows."""
    observer = xyz_to_rgb709(K_M * cmf_xyz()).T
    spectra: list[tuple[str, Spectrum, bool]] = [(light.name, light.spectral_power, False) for light in scene.lights]
    spectra += [(name, spectrum.scaled_to_luminous(1.0), True) for name, spectrum in offered_spectra().items()]
    arrays = {
        "spectra.density": np.array([spectrum.density for _, spectrum, _ in spectra], "f4"),
        "observer": observer.astype("f4"),
        "response": (observer if reflectance is None else observer * reflectance).astype("f4"),
    }
    listed = [{"name": n, "lines": [list(line) for line in s.lines], "choice": choice} for n, s, choice in spectra]
    lights = [{"spectrum": i, "luminous": light.spectral_power.luminous()} for i, light in enumerate(scene.lights)]
    return arrays, {"spectra": listed, "lights": lights}


def _meshes(scene: Scene, receiver: int) -> tuple[list[dict[str, Any]], dict[str, np.ndarray]]:
    """All objects but the receiver, glass first, with few triangles."""
    listed: list[dict[str, Any]] = []
    arrays: dict[str, np.ndarray] = {}
    others = [i for i in range(len(scene.objects)) if i != receiver]
    others.sort(key=lambda i: not scene.objects[i].material.transmits)
    total = sum(len(scene.objects[i].mesh.triangles) for i in others)
    for number, i in enumerate(others):
        item = scene.objects[i]
        mesh = item.mesh.transformed(item.object_to_world)
        share = MOST_TRIANGLES * len(mesh.triangles) / max(total, 1)
        vertices, triangles = decimated(mesh.vertices, mesh.triangles, max(int(share), 64))
        names = {part: f"mesh.{number}.{part}" for part in ("vertices", "triangles")}
        arrays |= {names["vertices"]: vertices.astype("f4"), names["triangles"]: triangles.astype("u4")}
        kind = "glass" if item.material.transmits else "opaque"
        listed.append({"name": item.name, "kind": kind, "colour": list(item.material.reflectance_rgb), **names})
    return listed, arrays


def decimated(vertices: np.ndarray, triangles: np.ndarray, most: int) -> tuple[np.ndarray, np.ndarray]:
    """About `most` triangles of the same shape: corners that share a cell of a grid become one."""
    low, size = vertices.min(axis=0), float(np.ptp(vertices, axis=0).max()) or 1.0
    cells = 256
    while len(triangles) > most and cells > 4:
        _, first, owner = np.unique(
            np.rint((vertices - low) / size * cells), axis=0, return_index=True, return_inverse=True
        )
        joined = owner.reshape(-1)[triangles]
        kept = joined[(joined[:, 0] != joined[:, 1]) & (joined[:, 1] != joined[:, 2]) & (joined[:, 2] != joined[:, 0])]
        if len(kept) <= most or cells <= 6:
            return vertices[first], kept
        cells = int(cells / 1.4)
    return vertices, triangles


def _said(scene: Scene, receiver: int, words: PageWords) -> dict[str, Any]:
    return {
        "title": words.title,
        "description": words.description,
        "steps": [dict(step) for step in words.steps],
        "scene": scene.name,
        "receiver": scene.objects[receiver].name,
    }
