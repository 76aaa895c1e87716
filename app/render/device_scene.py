"""A scene on the device, with the features that it needs."""

from __future__ import annotations

from ..features.features import Features
from ..gpu.context import Context
from ..gpu.scene_buffers import SceneBuffers
from ..model.optics.spectral_tables import SpectralAxis
from ..model.scene import Scene
from ..model.settings import RenderSettings


def spectral_axis(scene: Scene, features: Features) -> SpectralAxis:
    """The axis of a rendering: by the scene's glasses, or plain wavelength for methods linear in λ."""
    if not features.spectral_groups or (features.merged_groups and features.spectral_groups == 1):
        return SpectralAxis.build([])
    return SpectralAxis.build([o.material.dispersion for o in scene.objects if o.material.dispersion is not None])


def scene_buffers(context: Context, scene: Scene, settings: RenderSettings) -> SceneBuffers:
    """`scene` on the device, with the features that it and `settings` decide; the caller's."""
    features = Features.of(scene, settings)
    return SceneBuffers(context.ctx, scene, features, spectral_axis(scene, features))
