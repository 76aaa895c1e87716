"""The reference of a scene, from the independent renderer of `app.truth`, as the bench measures against it."""

from __future__ import annotations

from collections.abc import Callable

from app.bench.metrics import Truth
from app.bench.results import ReferenceInfo
from app.model.scene import Scene

Progress = Callable[[float, str], None]
TARGET_RELMSE = 1e-5
"""Good enough for any method's error; time usually ends sooner."""
METHOD = "photon tracing in float64: random wavelength, one photon one pixel, no footprint, no splat or map code shared"


def make_truth(scene: Scene, width: int, height: int, seconds: float, progress: Progress) -> tuple[Truth, ReferenceInfo]:
    """Add up to `seconds` to what the cache holds of this scene, camera and size."""
    from app.truth import photon_reference

    picture = photon_reference.cached_reference(
        scene, width, height, max_depth=scene.render.max_depth, target_relmse=TARGET_RELMSE, seconds=seconds, progress=progress, cancelled=lambda: False
    )
    truth = Truth(picture.xyz(), picture.xyz_variance())
    return truth, ReferenceInfo(METHOD, picture.photons, picture.seconds, truth.own_relmse, truth_key(scene, width, height))


def truth_key(scene: Scene, width: int, height: int) -> str:
    """Hash of everything that the reference depends on."""
    from app.truth import photon_reference

    return photon_reference.scene_key(scene, width, height, scene.render.max_depth)
