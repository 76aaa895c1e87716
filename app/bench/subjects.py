"""What a bench measures of each pass of the renderer: its rigs, and the independent reference of its errors."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..gpu.context import Context
from ..model.scene import Scene
from ..reference.metrics import ReferencePicture
from .camera_rendering import camera_rigs
from .rendering import Rig, light_rigs
from .results import ReferenceInfo

if TYPE_CHECKING:
    from ..reference.rounds import Picture
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
    """The light pass's reference: up to `seconds` are added to what the cache holds of this scene, camera and size."""
    from ..reference.photon_reference import cached_reference

    picture = cached_reference(
        scene,
        width,
        height,
        max_depth=scene.render.max_depth,
        target_relmse=TARGET_RELMSE,
        seconds=seconds,
        progress=progress,
    )
    return _described(picture, METHOD, reference_key(scene, width, height))


def reference_key(scene: Scene, width: int, height: int) -> str:
    """Hash of everything that the light pass's reference depends on."""
    from ..reference import photon_reference

    return photon_reference.reference_key(scene, width, height, scene.render.max_depth)


def make_camera_reference(
    scene: Scene, width: int, height: int, seconds: float, progress: Progress
) -> tuple[ReferencePicture, ReferenceInfo]:
    """The same for all that the camera sees. Raises UserError where the caustic falls on a curved receiver."""
    from ..reference.camera_reference import cached_camera_reference

    picture = cached_camera_reference(
        scene,
        width,
        height,
        caustic=caustic_plan(scene),
        target_relmse=TARGET_RELMSE,
        seconds=seconds,
        progress=progress,
    )
    return _described(picture, CAMERA_METHOD, camera_reference_key(scene, width, height))


def camera_reference_key(scene: Scene, width: int, height: int) -> str:
    """Hash of everything that the camera's reference depends on."""
    from ..reference import camera_reference

    return camera_reference.camera_reference_key(scene, width, height, camera_reference.MAX_DEPTH, caustic_plan(scene))


def _described(picture: Picture, method: str, key: str) -> tuple[ReferencePicture, ReferenceInfo]:
    measured = ReferencePicture(picture.xyz, picture.variance)
    caustic = picture.caustic_photons, picture.caustic_relmse
    return measured, ReferenceInfo(method, picture.amount, picture.seconds, measured.own_relmse, key, *caustic)


def caustic_plan(scene: Scene) -> CausticPlan | None:
    """How the caustic of the camera's reference is made; None where there is no light or nothing that it could fall
    on."""
    from ..reference.spectral_caustic import CausticPlan

    if not scene.lights or not any(o.material.receives for o in scene.objects):
        return None
    return CausticPlan(CAUSTIC_PHOTONS, CAUSTIC_RELMSE, max_depth=scene.render.max_depth)


@dataclass(frozen=True)
class Subject:
    """One pass's rigs and reference."""

    rigs: Callable[
        [Context, Scene, Sequence[str], int, int, Callable[[str], None]], AbstractContextManager[Mapping[str, Rig]]
    ]
    """(context, scene, methods, width, height, progress) → every method's rig, as long as the context lasts."""
    reference_image: Callable[[Scene, int, int, float, Progress], tuple[ReferencePicture, ReferenceInfo]]
    """(scene, width, height, seconds, progress) → the reference, with so many seconds added to what is kept of it."""
    key: Callable[[Scene, int, int], str]
    """(scene, width, height) → hash of everything that the reference depends on."""


SUBJECTS = {
    "light": Subject(light_rigs, make_reference, reference_key),
    "camera": Subject(camera_rigs, make_camera_reference, camera_reference_key),
}
