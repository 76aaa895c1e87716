"""The references of a scene's two passes, from the independent renderers of `spectrasplat.reference`, as the bench
measures against them."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from ..model.scene import Scene
from ..reference.metrics import ReferencePicture
from .results import ReferenceInfo

if TYPE_CHECKING:
    from ..reference.spectral_caustic import CausticPlan

Progress = Callable[[float, str], None]
TARGET_RELMSE = 1e-5
"""Good enough for any method's error; time usually ends sooner."""
METHOD = "photon tracing in float64: random wavelength, one photon one pixel, no footprint, no splat or map code shared"
CAMERA_METHOD = (
    "camera paths in float64: one random wavelength each, Fresnel by chance, textures looked up at points, "
    "no column, no map and no shader code shared"
)
CAUSTIC_RELMSE = 3e-5
"""What the caustic's noise may add to the picture's error …"""
CAUSTIC_PHOTONS = 1 << 27
"""… unless it takes more than these: ten minutes on two cores, once a scene and size. What noise is left is known pixel
by pixel, and subtracted as the camera paths' is."""


def make_reference(
    scene: Scene, width: int, height: int, seconds: float, progress: Progress
) -> tuple[ReferencePicture, ReferenceInfo]:
    """Add up to `seconds` to what the cache holds of this scene, camera and size."""
    from ..reference import photon_reference

    picture = photon_reference.cached_reference(
        scene,
        width,
        height,
        max_depth=scene.render.max_depth,
        target_relmse=TARGET_RELMSE,
        seconds=seconds,
        progress=progress,
        cancelled=lambda: False,
    )
    reference_image = ReferencePicture(picture.xyz(), picture.xyz_variance())
    return reference_image, ReferenceInfo(
        METHOD, picture.photons, picture.seconds, reference_image.own_relmse, reference_key(scene, width, height)
    )


def reference_key(scene: Scene, width: int, height: int) -> str:
    """Hash of everything that the reference depends on."""
    from ..reference import photon_reference

    return photon_reference.reference_key(scene, width, height, scene.render.max_depth)


def make_camera_reference(
    scene: Scene, width: int, height: int, seconds: float, progress: Progress
) -> tuple[ReferencePicture, ReferenceInfo]:
    """The same for all that the camera sees. Raises UserError where the caustic falls on a curved receiver."""
    from ..reference import camera_reference

    plan = caustic_plan(scene)
    picture = camera_reference.cached_camera_reference(
        scene,
        width,
        height,
        target_relmse=TARGET_RELMSE,
        seconds=seconds,
        caustic=plan,
        progress=progress,
        cancelled=lambda: False,
    )
    reference_image = ReferencePicture(picture.xyz, picture.variance)
    key = camera_reference_key(scene, width, height)
    return reference_image, ReferenceInfo(
        CAMERA_METHOD,
        picture.samples,
        picture.seconds,
        reference_image.own_relmse,
        key,
        picture.caustic_photons,
        picture.caustic_relmse,
    )


def camera_reference_key(scene: Scene, width: int, height: int) -> str:
    """Hash of everything that the camera's reference depends on."""
    from ..reference import camera_reference

    return camera_reference.camera_reference_key(scene, width, height, camera_reference.MAX_DEPTH, caustic_plan(scene))


def caustic_plan(scene: Scene) -> CausticPlan | None:
    """How the caustic of the camera's reference is made; None where there is no light or nothing that it could fall
    on."""
    from ..reference.spectral_caustic import CausticPlan

    if not scene.lights or not any(o.material.receives for o in scene.objects):
        return None
    return CausticPlan(CAUSTIC_PHOTONS, CAUSTIC_RELMSE, max_depth=scene.render.max_depth)
