"""What a live view shows of an engine: its picture as a small file, and the light under the cursor as numbers.

Everything here runs in the device's thread.
"""

from __future__ import annotations

import io
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.not_yet import NotYet
from ..edit.picking import PickHit, pick
from ..edit.projection import View
from ..edit.state import Display as Look
from ..passes.display import Display
from ..passes.sample_picture import SamplePicture
from ..ui.auto_exposure import AutoExposure
from ..ui.cursor_info import DirectLightQuery

if TYPE_CHECKING:
    from ..gpu.context import Context
    from ..render.viewer.engine import LiveEngine
    from ..render.viewer.photon_queries import CausticSpectrum

_MOVING_QUALITY, _STILL_QUALITY = 80, 94
"""Qualities of JPEG: a coarse picture is gone in a moment."""
_LOOK = Look()


@dataclass(frozen=True)
class Frame:
    """A picture for the screen."""

    data: bytes
    """A JPEG file."""
    facts: dict[str, Any]
    """Its size, and what it is made of."""


class Frames:
    """Develops pictures of one engine; owns what that takes."""

    def __init__(self, context: Context) -> None:
        self._display = Display(context)
        self._sampler = SamplePicture(context)
        self._exposure = AutoExposure()
        self._last_s = time.monotonic()
        self._direct = DirectLightQuery()
        self._last: tuple[object, ...] = ()
        self._found: CausticSpectrum | NotYet | None = None

    @property
    def is_settling(self) -> bool:
        """The exposure is on its way: one more picture is due."""
        return self._exposure.is_moving

    def develop(self, engine: LiveEngine, exposure_ev: float, is_moving: bool) -> Frame | None:
        """The engine's picture as the viewer shows it, `exposure_ev` stops beyond the automatic exposure; None before
        there is one."""
        from PIL import Image

        radiance = engine.picture
        if radiance is None:
            return None
        now = time.monotonic()
        exposure = self._exposure.follow(lambda: self._sampler.run(radiance), now, now - self._last_s)
        self._last_s = now
        antialias = engine.inputs is None or engine.inputs.scene.render.antialias_highlights
        shown = self._display.run(radiance, _LOOK, exposure + exposure_ev, radiance.size, antialias=antialias)
        codes = np.frombuffer(shown.read(), np.uint8).reshape(shown.height, shown.width, 4)[..., :3]
        file = io.BytesIO()
        quality = _MOVING_QUALITY if is_moving else _STILL_QUALITY
        Image.fromarray(codes).save(file, format="JPEG", quality=quality, subsampling=0)
        stats = engine.stats
        facts = {
            "width": shown.width,
            "height": shown.height,
            "photons": stats.photons,
            "rays_traced": stats.rays_traced,
            "samples": int(stats.camera_samples),
            "first_order": stats.first_order,
            "done": engine.is_idle,
            "moving": is_moving,
        }
        return Frame(file.getvalue(), facts)

    def light_at(self, engine: LiveEngine, x: float, y: float) -> tuple[dict[str, Any], bool]:
        """What is under a place of the picture, 0 to 1 from its top left, as numbers; and whether that is all (direct
        light is found meanwhile, by float64 rays: call again)."""
        inputs = engine.inputs
        if inputs is None:
            return {"object": None}, False
        hit = pick(inputs.scene, View.of(inputs.camera, inputs.width / inputs.height), x, y)
        if hit is None:
            return {"object": None}, True
        facts: dict[str, Any] = {
            "object": inputs.scene.objects[hit.object_index].name,
            "position": [round(float(v), 6) for v in hit.position],
        }
        return self._spectrum(engine, hit, facts) if hit.is_receiver else (facts, True)

    def _spectrum(self, engine: LiveEngine, hit: PickHit, facts: dict[str, Any]) -> tuple[dict[str, Any], bool]:
        place, normal = np.asarray(hit.position, float), np.asarray(hit.normal, float)
        question = (hit.object_index, hit.position, engine.stats.photons, engine.inputs)
        if question != self._last or isinstance(self._found, NotYet):
            self._last, self._found = question, engine.caustic_spectrum(hit.object_index, place)
        found = self._found
        if found is None or isinstance(found, NotYet) or engine.inputs is None:
            return facts, False
        width = found.resolution_nm
        facts |= {"wavelength_nm": found.wavelength_nm.tolist(), "error": found.error}
        facts["caustic"] = None if found.irradiance is None else found.irradiance.tolist()
        scene = engine.inputs.scene
        gains = self._direct.gains(scene, place, normal)
        if gains is None:
            return facts | {"direct": None}, self._direct.is_hopeless
        edges = np.append(found.wavelength_nm - 0.5 * width, found.wavelength_nm[-1] + 0.5 * width)
        direct = sum(g * light.spectral_power.binned(edges) for g, light in zip(gains, scene.lights, strict=True))
        return facts | {"direct": np.broadcast_to(direct, found.wavelength_nm.shape).tolist()}, True

    def release(self) -> None:
        """Free everything."""
        self._display.release()
        self._sampler.release()
        self._direct.release()
