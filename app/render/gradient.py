"""Derivatives of a caustic map, or of a picture, by the numbers of a scene.

Each is the difference of two pictures of the same photons on the same texels, over twice a small step. Where one glass
is nudged and its index says all about a path, photons are traced once and drawn through glass of two other indices:
their spectral columns move them, and the slope of their weight along their band weighs them. For everything else, and
where beams carry light, it is traced twice by the same random numbers.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..base.errors import UserError
from ..edit.parameters import Stage, apply, parameter, parts, value_of
from ..features.features import Features
from ..gpu import shader
from ..gpu.context import Context
from ..gpu.records import MAX_BANDS
from ..model.optics import glass
from ..model.optics.glass import Dispersion
from ..model.settings import RenderSettings
from .bake import placement
from .device_scene import scene_buffers
from .frames import FrameRenderer, Picture
from .light_pass import LightPass
from .light_plan import Division
from .map_fit import MapFit
from .map_picture import map_picture
from .pass_sizes import pass_sizes
from .sampling import LightSampling
from .traced_light import traced_light
from .viewer.stored_passes import StoredPasses

Report = Callable[[float, str], None]
Stop = Callable[[], bool]
INDEX = "index"
"""Parameter of an object of glass: n(λ), raised alike at all wavelengths."""
_CURVE_NM = np.arange(380.0, 781.0, 4.0)
_CHANGE, _LEAST_CHANGE, _MOST_CHANGE = 0.03, 0.01, 0.08
"""Change of the picture, as a share of its norm, that a step is to make: much less is lost in rounding, and more is no
derivative."""
_FINER_BANDS = 4
_RECORD_BYTES = 1024
"""What one photon leaves at most, nearly: several landings."""


@dataclass(frozen=True)
class Derivative:
    """Of every number of a picture by one parameter, per unit of it."""

    path: str
    picture: Picture
    step: float
    """The parameter's change to either side."""
    traced: int
    """How often photons were traced for it."""


@dataclass(frozen=True)
class Gradient:
    """A picture and its derivatives."""

    base: Picture
    derivatives: tuple[Derivative, ...]
    placement: Mapping[str, object] | None
    """Of a map, as `bake` writes it."""


def gradient(
    context: Context,
    stage: Stage,
    settings: RenderSettings,
    paths: Sequence[str],
    step: float | None = None,
    report: Report = lambda share, text: None,
    stopped: Stop = lambda: False,
) -> Gradient | None:
    """Of what `settings.layer` shows, by each of `paths` (`edit.parameters`, and `INDEX`); None once `stopped()`.

    `step`: of all parameters; None finds one for each. Raises `UserError`."""
    for path in paths:
        check_path(stage, path)
    glasses = [path for path in paths if _is_glass(stage, path)]
    kept = None
    if KeptMap.follows(stage, settings, glasses):
        kept = KeptMap(context, stage, settings)
    found: list[Derivative] = []
    base, where = None, None
    try:
        if kept is not None:
            for share in kept.tracing(stopped):
                report(0.5 * share, "tracing photons")
        for number, path in enumerate(paths):

            def reported(share: float, text: str, number: int = number) -> None:
                report((number + share) / len(paths), text)

            if kept is not None and path in glasses:
                base, where = kept.base, kept.placement
                found.append(_derivative(kept.picture, stage, path, step, 1))
                continue
            h = step or first_step(stage, path)
            twice = FrameRenderer(context, settings, [nudged(stage, path, -h), nudged(stage, path, h)])
            try:

                def traced(nudge: Stage, twice: FrameRenderer = twice, say: Report = reported) -> Picture:
                    for share in twice.steps(nudge, stopped):
                        say(share, twice.phase)
                    return twice.picture

                found.append(_derivative(traced, stage, path, step, 2, stopped))
                if base is None:
                    base = traced(stage)
                    where = placement(twice.light) if settings.layer.startswith("map:") else None
            finally:
                twice.release()
            if stopped():
                return None
    finally:
        shader.release(kept)
    assert base is not None
    return None if stopped() else Gradient(base, tuple(found), where)


def check_path(stage: Stage, path: str) -> None:
    """Raise `UserError` where the scene has no such parameter."""
    parameter(stage, _known(path))
    if path.startswith("camera.") or path in ("exposure_ev", "solo_nm"):
        raise UserError(f"'{path}' changes no light: give a parameter of an object or of a light")


def _known(path: str) -> str:
    return path.removesuffix(f".{INDEX}") + ".n_d" if path.endswith(f".{INDEX}") else path


def _is_glass(stage: Stage, path: str) -> bool:
    return parts(stage.scene, _known(path))[2] in ("n_d", "V_d", "dispersion_gain")


def first_step(stage: Stage, path: str) -> float:
    """A small change of a parameter: of an index, of turns in degrees, of anything else as a share of it."""
    field = path.rpartition(".")[0].rpartition(".")[2], path.rpartition(".")[2]
    if field[1] in ("n_d", INDEX):
        return 2e-3
    if field[0] == "rotation":
        return 0.1
    if field[0] == "position":
        points = np.concatenate([item.world_vertices for item in stage.scene.objects if item.material.is_specular])
        return 2e-3 * float(np.ptp(points, axis=0).max())
    return 0.01 * (abs(value_of(stage, path)) or 1.0)


def nudged(stage: Stage, path: str, change: float) -> Stage:
    """`stage` with one parameter changed; a glass keeps the rest of its curve."""
    head, name, field = parts(stage.scene, _known(path))
    if head != "objects" or not _is_glass(stage, path) or field == "dispersion_gain":
        return apply(stage, path, value_of(stage, path) + change)
    items = tuple(
        replace(item, material=item.material.changed(dispersion=_bent(item.material.dispersion, path, change)))
        if item.name == name
        else item
        for item in stage.scene.objects
    )
    return replace(stage, scene=replace(stage.scene, objects=items))


def _bent(dispersion: Dispersion, path: str, change: float) -> Dispersion:
    """The glass with n_d, V_d or the whole curve changed, by the differences of glasses that have no more than n_d and
    V_d."""
    field, n_d, v_d = path.rpartition(".")[2], dispersion.n_d, dispersion.natural.V_d
    n = dispersion.index(_CURVE_NM)
    if field == INDEX or not np.isfinite(v_d):
        n = n + change
    else:
        other = (n_d + change, v_d) if field == "n_d" else (n_d, v_d + change)
        shift = glass.from_abbe(*other).index(_CURVE_NM) - glass.from_abbe(n_d, v_d).index(_CURVE_NM)
        n = n + dispersion.gain * shift + (1.0 - dispersion.gain) * (other[0] - n_d)
    return glass.table(_CURVE_NM, n, dispersion.name)


def _derivative(
    picture: Callable[[Stage], Picture],
    stage: Stage,
    path: str,
    step: float | None,
    traced: int,
    stopped: Stop = lambda: False,
) -> Derivative:
    h = step or first_step(stage, path)
    for _ in range(3):
        low, high = picture(nudged(stage, path, -h)), picture(nudged(stage, path, h))
        norm = float(np.linalg.norm(high.rgb + low.rgb))
        change = float(np.linalg.norm(high.rgb - low.rgb)) / norm if norm > 0.0 else 0.0
        if step is not None or change == 0.0 or _LEAST_CHANGE <= change <= _MOST_CHANGE or stopped():
            break
        h = float(np.clip(h * _CHANGE / change, first_step(stage, path) / 64.0, 8.0 * first_step(stage, path)))
    else:
        low, high = picture(nudged(stage, path, -h)), picture(nudged(stage, path, h))
    spectral = None
    if high.spectral is not None and low.spectral is not None:
        spectral = (high.spectral - low.spectral) / (2.0 * h)
    return Derivative(path, Picture((high.rgb - low.rgb) / (2.0 * h), spectral, high.bin_edges_nm), h, traced)


class KeptMap:
    """A receiver's map by photons that are kept, to be drawn again through other glass."""

    def __init__(self, context: Context, stage: Stage, settings: RenderSettings) -> None:
        """For stages that it `follows`."""
        self._stage = stage
        self._sampling = LightSampling.of(stage.scene, settings)
        settings = replace(settings, nudged=True)
        self._buffers = scene_buffers(context, stage.scene, settings)
        self._stored = StoredPasses(context.ctx, self._sampling.photons * _RECORD_BYTES)
        fit, features = MapFit(stage.camera, settings.width, settings.height), self._buffers.features
        self.light = LightPass(
            context, stage.scene, settings, features, self._buffers, fit=fit, photon_records=self._stored
        )
        self.base: Picture
        """Once they are traced."""

    @staticmethod
    def follows(stage: Stage, settings: RenderSettings, paths: Sequence[str]) -> bool:
        """Whether photons of the map of `settings.layer` serve changes of `paths`, all of glass."""
        features = Features.of(stage.scene, replace(settings, nudged=True))
        one_pass = settings.seconds is None and len(pass_sizes(settings.method, 1 << 20)) == 1
        is_map = settings.layer.startswith("map:")
        if not (paths and is_map and one_pass and features.weighed_by_index) or features.beams:
            return False
        return all(_changed(stage, nudged(stage, path, 1e-6)) is not None for path in paths)

    def tracing(self, stopped: Stop) -> Iterator[float]:
        """Trace, pausing with the share done. Bands are narrower than the picture needs: a column is exact at its
        band's anchor only, and where light lands is one order better than how that changes."""
        light, sampling = self.light, self._sampling
        light.prepare()
        light.begin(sampling.photons, sampling.seed)
        counts = {p.index: (min(_FINER_BANDS * len(p.bands), MAX_BANDS), p.light_points) for p in light.plans}
        light.division = Division(counts)
        yield from traced_light(light, sampling, stopped)
        self.base = self._read()

    @property
    def placement(self) -> Mapping[str, object]:
        """Of the map, as `bake` writes it."""
        return placement(self.light)

    def picture(self, stage: Stage) -> Picture:
        """The map as `stage` has it."""
        glasses, light, kept = _changed(self._stage, stage), self.light, self._stored.fullest
        assert glasses is not None and kept is not None
        if light.shown.show_glass(glasses):
            self._stored.forget_tables()
        light.maps.clear()
        share = kept.store.rounds / kept.store.rounds_of_pass
        for slab in kept.store.first_slabs(kept.store.rounds):
            for _ in light.splat_steps(slab.buffer, slab.count, share**-0.5, kept.tables.full):
                pass
        light.maps.photon_weight = kept.pass_photons * share
        return self._read()

    def _read(self) -> Picture:
        self.light.batches.settled()
        return Picture(*map_picture(self.light), self.light.bin_edges_nm)

    def release(self) -> None:
        """Free everything."""
        shader.release(self.light, self._buffers)


def _changed(traced: Stage, shown: Stage) -> Mapping[Dispersion, Dispersion] | None:
    """The glasses that differ; None where objects of one glass are no longer of one."""
    found: dict[Dispersion, Dispersion] = {}
    for a, b in zip(traced.scene.objects, shown.scene.objects, strict=True):
        for before, after in zip(a.material.dispersions, b.material.dispersions, strict=True):
            if found.setdefault(before, after) != after:
                return None
    return {before: after for before, after in found.items() if before != after}
