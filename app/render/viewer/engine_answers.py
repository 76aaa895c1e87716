"""What a live rendering reports: what is shown and how good it is, what the stored photons say.

Nothing here works or changes anything: `LiveEngine` does, which keeps the fields.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import moderngl
import numpy as np

from ...base.not_yet import NOT_YET, NotYet
from ...edit.live_inputs import LiveInputs
from ...edit.stored_photons import StoredPhotons
from ...gpu.context import Context
from ..notices import shares
from .building import Building, Shown
from .dirty_level import DirtyLevel
from .invalidation import dirty_level
from .live_camera import LiveCamera
from .live_light import LiveLight
from .photon_queries import QUERIED_PHOTONS, CausticSpectrum, spectrum_at, world_photons
from .refit import is_judged
from .schedule import CameraState, Schedule
from .stats import LiveStats, WorkTally


class EngineAnswers:
    """What is wanted, what is shown and how far it is."""

    def __init__(self, context: Context) -> None:
        self.context = context
        self.schedule = Schedule()
        """What is under way and what is due; only `LiveEngine._tell` changes it."""
        self.problem: str | None = None
        """Why the last change could not be shown (bad shader, maps too large); the picture before it stays."""
        self._camera_pass = LiveCamera(context)
        self._wanted: LiveInputs | None = None
        self._inputs: LiveInputs | None = None
        """What the picture shows."""
        self._shown: Shown | None = None
        self._building = Building(context)
        self._awaits_picture = False
        """There are maps of other light than that of the picture, which stays for now."""
        self._tally = WorkTally()
        self._rays_before = 0
        """Rays of the light passes that are gone."""
        self._published_photons = 0.0

    # ---- the picture -------------------------------------------------------------------------

    @property
    def picture(self) -> moderngl.Texture | None:
        """RGBA32F, linear Rec.709 radiance (lm/(sr unit²) for white), top row first; None before the first."""
        return self._camera_pass.picture

    @property
    def picture_version(self) -> int:
        """Changes whenever the picture does."""
        return self._camera_pass.version

    @property
    def camera_samples(self) -> int:
        """A still picture is finished after so many a pixel."""
        return self._camera_pass.target_samples

    @camera_samples.setter
    def camera_samples(self, samples: int) -> None:
        self._camera_pass.target_samples = samples

    @property
    def inputs(self) -> LiveInputs | None:
        """What the picture shows, or is about to."""
        return self._inputs

    # ---- how far it is -----------------------------------------------------------------------

    @property
    def building_at(self) -> str:
        """What building is at now; empty where nothing is built."""
        return self._building.at if self.schedule.building else ""

    @property
    def differs(self) -> Literal["", "light", "scene", "moved"]:
        """What of the wanted scene the picture does not show yet, as in `LiveStats`."""
        if self.schedule.moved and not self.schedule.building:
            return "moved"
        if self._shows_former:
            return "light"
        if self._wanted is None or not self.schedule.building:
            return ""
        return "scene" if self._level == DirtyLevel.BUILD else "light"

    @property
    def _shows_former(self) -> bool:
        """The light of before an edit is seen until all stored photons are in the maps, and the picture by these is
        as smooth as the former."""
        awaits_maps = self.schedule.splatting and not self.schedule.shows_preview
        stays = awaits_maps and self._shown is not None and not self._shown.light.shows_outdated
        return stays or self._awaits_picture

    @property
    def is_busy(self) -> bool:
        """Never: all work is done when a call returns (otherwise with `ThreadedEngine`)."""
        return False

    @property
    def is_idle(self) -> bool:
        """Nothing is left to do until an input changes."""
        if self._wanted is None:
            return True
        judged = self._shown is None or is_judged(self._shown.light, self._wanted)
        knows = self._shown is None or self._shown.light.knows_gathered
        return judged and knows and self.schedule.is_idle(self._camera)

    @property
    def stats(self) -> LiveStats:
        """This moment's."""
        context, camera_pass, seconds = self.context, self._camera_pass, self._tally.seconds
        shows_other = self.differs == "scene" or self._camera.owes_first
        common = LiveStats(
            renderer=context.renderer,
            is_software=context.is_software,
            device_advice=context.advice,
            camera_samples=float(camera_pass.shown_samples),
            resolution_scale=camera_pass.scale,
            direct_scale=camera_pass.direct_scale,
            shows_other=shows_other,
            differs=self.differs,
            preparing=self._building.at if shows_other else "",
            preparing_s=self._building.seconds,
            camera_bands=camera_pass.shown_bands,
            camera_fallbacks=camera_pass.fallbacks,
        )
        if self._shown is None:
            return common
        light = self._shown.light
        light_pass = light.light_pass
        beams, polygons = (0, 0) if light_pass.survey.beams is None else light_pass.survey.beams.counts
        return replace(
            common,
            rays_traced=self._rays_before + light_pass.trace.rays_traced,
            photons=int(self._published_photons),
            photons_stored=light.photons_stored,
            passes=self._shown.accumulation.number,
            frame_photons=self._tally.photons,
            resolve_s=seconds.get("resolve", 0.0),
            trace_s=seconds["trace"],
            splat_s=seconds["splat"] + seconds.get("beams", 0.0),  # apart only by the device's own timers
            camera_s=seconds["camera"],
            photons_per_second=self._tally.photons_per_second,
            first_order=light.first_order and not self._shows_former,
            converged=self.is_idle,
            bytes=light.bytes,
            fallbacks=dict(light_pass.stats.tally.fallbacks),
            lost=shares(light_pass.stats),
            bands=dict(light_pass.stats.bands),
            beams=beams,
            polygons=polygons,
            only_beams=light.only_beams,
        )

    @property
    def _level(self) -> DirtyLevel:
        """What has to be redone for what is wanted."""
        assert self._wanted is not None
        if self._shown is None or self._inputs is None:
            return DirtyLevel.BUILD
        level = dirty_level(self._shown.traced, self._inputs, self._wanted, self._shown.light.may_have_beams)
        return max(level, DirtyLevel.TRACE) if self.schedule.moved else level

    @property
    def _camera(self) -> CameraState:
        return self._camera_pass.state

    # ---- the scene and its light -------------------------------------------------------------

    def stored_photons(self, limit: int = QUERIED_PHOTONS) -> StoredPhotons | NotYet:
        """About `limit` stored photons in world space, as they are shown."""
        if self._shown is None or self._inputs is None or self._lacks_photons(self._shown.light):
            return NOT_YET
        return world_photons(self._shown.light, self._inputs, limit)

    def caustic_spectrum(self, receiver: int, position: np.ndarray) -> CausticSpectrum | NotYet:
        """The caustic's spectral irradiance at a world position on object `receiver`."""
        if self._shown is None or self._inputs is None or self._lacks_photons(self._shown.light):
            return NOT_YET
        if receiver not in self._shown.light.buffers.receivers:  # which it is to become
            return NOT_YET
        return spectrum_at(self._shown.light, self._inputs, receiver, position)

    def _lacks_photons(self, light: LiveLight) -> bool:
        """Photons that can say where light lands are still to be traced."""
        return self.schedule.moved or (self.schedule.has_photon_work and not light.has_records)
