"""Puts a scene on the GPU for a rendering, with the features and the spectral coordinate that it needs."""

from __future__ import annotations

from ..features.features import Features
from ..gpu.context import Context
from ..gpu.scene_buffers import SceneBuffers
from ..model.optics.spectral_tables import SpectralAxis
from ..model.scene import Scene
from ..model.settings import RenderSettings


def spectral_axis(scene: Scene, features: Features) -> SpectralAxis:
    """The spectral coordinate: from the scene's glasses, or λ without spectral columns or with a single shared one."""
    if not features.spectral_groups or (features.merged_groups and features.spectral_groups == 1):
        return SpectralAxis.build([])
    return SpectralAxis.build([glass for item in scene.objects for glass in item.material.dispersions])


def scene_buffers(context: Context, scene: Scene, settings: RenderSettings) -> SceneBuffers:
    """GPU buffers of `scene` with the features that it and `settings` require. The caller releases them."""
    features = Features.of(scene, settings)
    return SceneBuffers(context.ctx, scene, features, spectral_axis(scene, features))
