"""What the frames of an animation share, so that what does not move in the scene does not move in the pictures: the
view and the landings that maps are fitted to, one spectral axis, the finest division that any frame needs."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..edit.live_inputs import LiveInputs
from ..edit.parameters import Stage
from ..gpu.gpu_space import GpuSpace
from ..model.optics.glass import Dispersion
from ..model.scene import Camera
from ..model.settings import RenderSettings
from ..passes.pilot import Pilot
from .light_pass import LightPass
from .light_plan import Division
from .map_fit import MapFit
from .viewer.dirty_level import DirtyLevel
from .viewer.invalidation import dirty_level

_SURVEYED = 5
"""Frames whose pilots say where maps are needed."""
_WIDE_DEG = 150.0


@dataclass(frozen=True)
class Survey:
    """What one frame needs: where its light lands and into how many sub-lattices it is divided."""

    space: GpuSpace
    pilots: tuple[Pilot, ...]
    glasses: tuple[Dispersion, ...]
    counts: dict[int, tuple[int, int]]
    """Spectral bands and points of each light."""

    @staticmethod
    def of(light: LightPass) -> Survey:
        """Survey of a light pass that has begun."""
        counts = {plan.index: (len(plan.bands), plan.light_points) for plan in light.plans}
        return Survey(light.buffers.space, tuple(light.survey.pilots.values()), light.buffers.axis.glasses, counts)


@dataclass(frozen=True)
class FrameFit:
    """What all frames are fitted to."""

    view: Camera | None
    """What maps are seen by; None: each frame's own camera."""
    settings: RenderSettings
    """Those of the frames; the size is of the picture that `view` sees."""
    surveys: tuple[Survey, ...] = ()

    @staticmethod
    def of(stages: Sequence[Stage], settings: RenderSettings) -> FrameFit:
        """Not surveyed yet. A camera that moves gets a view that sees everything, with pixels as small as those of the
        nearest."""
        cameras = [stage.camera for stage in stages]
        first = cameras[0]
        if settings.layer.startswith("map:") or all(camera == first for camera in cameras):
            return FrameFit(None, settings)
        nearest = min(
            cameras,
            key=lambda c: (
                np.linalg.norm(np.subtract(c.position, c.target))
                * (c.vertical_extent if c.kind == "orthographic" else math.tan(math.radians(0.5 * c.vertical_fov_deg)))
            ),
        )
        if nearest.kind == "orthographic":
            factor, view = 8.0, replace(nearest, vertical_extent=8.0 * nearest.vertical_extent)
        else:
            factor = math.tan(math.radians(0.5 * _WIDE_DEG)) / math.tan(math.radians(0.5 * nearest.vertical_fov_deg))
            view = replace(nearest, vertical_fov_deg=max(_WIDE_DEG, nearest.vertical_fov_deg))
            factor = max(factor, 1.0)
        width, height = round(factor * settings.width), round(factor * settings.height)
        return FrameFit(view, replace(settings, width=width, height=height))

    @property
    def glasses(self) -> list[Dispersion]:
        """Glasses of all surveyed frames."""
        return [glass for survey in self.surveys for glass in survey.glasses]

    @property
    def division(self) -> Division:
        """The finest that a surveyed frame needs."""
        return Division.finest(survey.counts for survey in self.surveys)

    def maps(self, camera: Camera) -> MapFit:
        """For the frame that `camera` sees."""
        others = tuple((survey.space, pilot) for survey in self.surveys for pilot in survey.pilots)
        shared = self.view is not None
        return MapFit(self.view or camera, self.settings.width, self.settings.height, others=others, is_shared=shared)


def inputs_of(stage: Stage, settings: RenderSettings) -> LiveInputs:
    """All that decides the picture of `stage`."""
    s = settings
    return LiveInputs(
        stage.scene, stage.camera, s.width, s.height, s.method, s.smoothing, stage.solo_nm, s.local_gain, s.seed
    )


def share_light(shown: LiveInputs, wanted: LiveInputs) -> bool:
    """Whether the photons of `shown` serve `wanted`: a change of what is merely seen may still concern the maps'
    records, so only a moved camera keeps the light."""
    return dirty_level(shown, shown, replace(wanted, camera=shown.camera)) == DirtyLevel.NOTHING


def stages_to_survey(stages: Sequence[Stage], settings: RenderSettings) -> Iterator[Stage]:
    """Stages, evenly spread, whose light differs; none where all share it, for then a frame's own pilot says
    everything."""
    found: list[Stage] = []
    for index in np.unique(np.linspace(0, len(stages) - 1, _SURVEYED).astype(int)):
        new = inputs_of(stages[index], settings)
        if not any(share_light(inputs_of(stage, settings), new) for stage in found):
            found.append(stages[index])
    return iter(found if len(found) > 1 else [])
