"""What is measured of a scene: for each pass of the renderer where its rigs and its reference come from."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass

from ..gpu.context import Context
from ..model.scene import Scene
from ..reference.metrics import ReferencePicture
from .camera_rendering import camera_rigs
from .reference_picture import camera_reference_key, make_camera_reference, make_reference, reference_key
from .rendering import Rig, light_rigs
from .results import ReferenceInfo

Progress = Callable[[float, str], None]
RigMaker = Callable[
    [Context, Scene, Sequence[str], int, int, Callable[[str], None]], AbstractContextManager[Mapping[str, Rig]]
]
ReferenceMaker = Callable[[Scene, int, int, float, Progress], tuple[ReferencePicture, ReferenceInfo]]
KeyMaker = Callable[[Scene, int, int], str]


@dataclass(frozen=True)
class Subject:
    """One pass's rigs and reference."""

    rigs: RigMaker
    """(context, scene, methods, width, height, progress) → every method's rig, as long as the context lasts."""
    reference_image: ReferenceMaker
    """(scene, width, height, seconds, progress) → the reference, with so many seconds added to what is kept of it."""
    key: KeyMaker
    """(scene, width, height) → hash of everything that the reference depends on."""


SUBJECTS = {
    "light": Subject(light_rigs, make_reference, reference_key),
    "camera": Subject(camera_rigs, make_camera_reference, camera_reference_key),
}
