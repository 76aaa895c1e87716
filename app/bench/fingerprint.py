"""Fingerprints of programs and of small pictures: what a change of the shaders changes, and what it does not.

A case is one scene under one choice of settings. Its fingerprint holds hashes of the text of every program that it
compiles (white space aside) and of its photon records, caustic maps and camera samples. On one driver two runs of the
same version agree to the bit.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from ..base.paths import assets_dir, shipped_scenes
from ..edit.glass import set_dispersion_gain
from ..edit.live_inputs import LiveInputs
from ..gpu.context import Context, create_context
from ..gpu.device_traits import DeviceTraits, assumed
from ..gpu.shader import Built, forget_programs, keep_programs, recorded
from ..model.io.scene_file import load_scene
from ..model.scene import Scene
from ..model.settings import CAMERA_METHODS, METHODS, RenderSettings
from ..render.still import render
from ..render.traced_light import traced_light
from ..render.viewer.still_engine import finish, still_engine

if TYPE_CHECKING:
    from pathlib import Path

    import moderngl

    from ..passes.trace import Batch
    from ..render.frames import Stop
    from ..render.light_pass import LightPass
    from ..render.photon_records import PhotonRecords, RoundOf
    from ..render.sampling import LightSampling

_TOKEN = re.compile(r"^[ \t]*#.*$|\w+|\S", re.MULTILINE)
"""Of GLSL: a directive, a word, or one character."""
_SMALL = RenderSettings(width=64, height=36, photons=2048, spp=8)
"""Eight samples a pixel are the fewest for which the camera chooses how it samples the spectrum."""
_TEXTS_PHOTONS = 256

Fingerprint = dict[str, list[str]]
"""What was hashed (a program's shaders, "photon records", "caustic maps", "camera samples") → its hashes, sorted."""


@dataclass(frozen=True)
class Case:
    """One choice of settings, for every scene."""

    settings: Mapping[str, object] | None = None
    """Of `RenderSettings`."""
    scene: Callable[[Scene], Scene] = lambda scene: scene
    """What it changes in a scene."""
    traits: DeviceTraits | None = None
    """Programs as on a device of these traits; such a case has texts alone."""
    in_viewer: bool = False
    """The viewer's programs, whose pictures depend on the clock: texts alone."""


def _rendered(scene: Scene, **wishes: object) -> Scene:
    return replace(scene, render=replace(scene.render, **wishes))  # type: ignore[arg-type]


def _with_lens(scene: Scene) -> Scene:
    away = np.linalg.norm(np.subtract(scene.camera.position, scene.camera.target))
    return replace(scene, camera=replace(scene.camera, lens_radius=0.02 * float(away)))


CASES: dict[str, Case] = {
    **{method: Case({"method": method}) for method in METHODS},
    **{f"camera {method}": Case({"camera_method": method}) for method in CAMERA_METHODS if method != "srd"},
    "caustic": Case({"layer": "caustic"}),
    "bins": Case({"bins": 8}),
    "any view": Case({"any_view": True, "editable": True}),
    "polarised": Case(scene=partial(_rendered, polarisation=True)),
    "bounces": Case(scene=partial(_rendered, bounces=1)),
    "haze": Case(scene=partial(_rendered, haze=0.02)),
    "lens": Case(scene=_with_lens),
    "viewer": Case(in_viewer=True),
    "as on a GPU": Case(traits=DeviceTraits()),
    "as on a GPU without a rasteriser": Case(traits=DeviceTraits(splats_by_compute=True)),
}


def scene_files() -> dict[str, Path]:
    """Name → file of every scene and lesson that comes with the program."""
    lessons = sorted((assets_dir() / "lessons").glob("*.toml"))
    return shipped_scenes() | {f"lessons/{file.stem}": file for file in lessons if file.stem != "lessons"}


def measure(
    scenes: Mapping[str, Path], cases: Sequence[str], *, texts_only: bool
) -> Iterator[tuple[str, str, Fingerprint]]:
    """Scene, case and fingerprint, as they are measured. What a scene has by itself ("srd" with haze) is not measured
    again as another case."""
    by_traits: dict[DeviceTraits | None, list[str]] = {}
    for name in cases:
        by_traits.setdefault(CASES[name].traits, []).append(name)
    for traits, names in by_traits.items():
        with assumed(traits) if traits else nullcontext(), create_context() as context:
            keep_programs(context.ctx)
            for scene_name, file in scenes.items():
                plain = load_scene(file)
                for name in names:
                    case = CASES[name]
                    scene = case.scene(plain)
                    if scene != plain or case.settings or case.traits or case.in_viewer:
                        yield scene_name, name, _fingerprint(context, scene, case, texts_only)
            forget_programs(context.ctx)


def differences(known: Fingerprint, found: Fingerprint, *, texts_only: bool) -> list[str]:
    """What is in one fingerprint and not, or not the same, in the other; `texts_only`: of programs alone."""
    names = (name for name in {*known, *found} if name.startswith("program ") or not texts_only)
    return sorted(name for name in names if known.get(name) != found.get(name))


# -- one case -------------------------------------------------------------------------------


def _fingerprint(context: Context, scene: Scene, case: Case, texts_only: bool) -> Fingerprint:
    texts_only = texts_only or case.in_viewer or case.traits is not None
    photons = _TEXTS_PHOTONS if texts_only else _SMALL.photons
    wishes = {"photons": photons, "max_depth": scene.render.max_depth, **(case.settings or {})}
    settings = replace(_SMALL, **wishes)  # type: ignore[arg-type]
    found: Fingerprint = {}
    with recorded() as programs:
        if case.in_viewer:
            _view(context, scene, settings)
        else:
            found = _render(context, scene, settings)
    return ({} if texts_only else found) | _texts(programs)


def _texts(programs: Iterable[Built]) -> Fingerprint:
    hashes: dict[str, set[str]] = {}
    for built in programs:
        hashes.setdefault(f"program {built.name}", set()).add(
            _hash(" ".join(_TOKEN.findall(text.replace("\\\n", " "))).encode() for text in built.texts)
        )
    return {name: sorted(found) for name, found in hashes.items()}


def _render(context: Context, scene: Scene, settings: RenderSettings) -> Fingerprint:
    records: list[str] = []
    maps: list[bytes] = []

    def fill(light: LightPass, sampling: LightSampling, stop: Stop) -> Iterator[float]:
        light.batches.records = _HashedRecords(light.batches.records, records)  # type: ignore[assignment]
        yield from traced_light(light, sampling, stop)
        light.maps.atlas.flush()
        context.ctx.memory_barrier()
        maps.extend(texture.read() for texture in light.maps.atlas.total_textures)

    picture = render(scene, settings, context=context, fill=fill)
    samples = [picture.rgb] if picture.spectral is None else [picture.rgb, picture.spectral]
    return {
        "photon records": records,
        "caustic maps": [_hash([texels]) for texels in maps],
        "camera samples": [_hash([values.tobytes()]) for values in samples],
    }


def _view(context: Context, scene: Scene, settings: RenderSettings) -> None:
    """A picture as it is first shown, after the camera moved, and after an edit of the dispersion."""
    engine = still_engine(context, settings, exact=True)
    try:
        wanted = LiveInputs(scene, scene.camera, settings.width, settings.height)
        x, y, z = scene.camera.position
        moved = replace(wanted, camera=replace(scene.camera, position=(x + 0.01 * abs(z) + 1e-3, y, z)))
        stages = [wanted, moved]
        glass = next((i for i, item in enumerate(scene.objects) if item.material.disperses), None)
        if glass is not None:
            gain = 1.1 * scene.objects[glass].material.dispersion.gain
            stages.append(replace(moved, scene=set_dispersion_gain(scene, glass, gain)))
        for stage in stages:
            engine.set(stage)
            finish(engine, settings.photons or 1, lambda share, words: None, lambda: False)
    finally:
        engine.release()


def _hash(parts: Iterable[bytes]) -> str:
    digest = hashlib.blake2b(digest_size=8)
    for part in parts:
        digest.update(part)
    return digest.hexdigest()


class _HashedRecords:
    """`PhotonRecords` that hashes each batch on its way to `records`."""

    keeps = True

    def __init__(self, records: PhotonRecords, hashes: list[str]) -> None:
        self._records, self._hashes = records, hashes

    def keep(self, photons: moderngl.Buffer, batch: Batch, stride: int, of: RoundOf) -> None:
        """See `PhotonRecords`."""
        self._hashes.append(_hash([photons.read(batch.photons * stride)]))
        self._records.keep(photons, batch, stride, of)

    def __getattr__(self, name: str) -> object:
        return getattr(self._records, name)
