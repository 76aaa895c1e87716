"""Where photons landed: what maps are fitted to. What lands on one side of a receiver does not show on the other."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import moderngl
import numpy as np

from ..gpu import shader
from ..gpu.scene_buffers import SceneBuffers
from ..gpu.schema import Struct
from ..model.scene import Camera
from ..model.scene_camera import camera_frame

CHOSEN = 512
"""Photons that say where all of them land."""
_GROUP = 64
_LANDED = np.dtype([("position", "f4", 3), ("flux_w", "f4"), ("receiver", "u4")])


@dataclass(frozen=True)
class Landings:
    """Pilot photons on one receiver: every place where some wavelength of theirs arrives."""

    positions: np.ndarray
    """float64 (n, 3), GPU space."""
    flux_w: np.ndarray
    """float64 (n,)."""


def by_receiver(photons: np.ndarray) -> dict[int, Landings]:
    """Landings of records that have a position, a flux and a receiver."""
    found = {}
    for receiver in np.unique(photons["receiver"]):
        mine = photons[photons["receiver"] == receiver]
        found[int(receiver)] = Landings(mine["position"].astype(float), mine["flux_w"].astype(float))
    return found


class ChosenLandings:
    """Photons that the device chooses evenly of all, and that are read when it has long done so."""

    def __init__(self, ctx: moderngl.Context, photon: Struct) -> None:
        self._ctx = ctx
        self._program = shader.compute(ctx, "light/landings.comp", {"WORKGROUP": _GROUP}, (photon,))
        self._landed = ctx.buffer(bytes(CHOSEN * _LANDED.itemsize))
        self._count = ctx.buffer(reserve=4)

    def choose(
        self, photons: moderngl.Buffer, count: int, held: tuple[moderngl.Buffer, int] | None, part: int, parts: int
    ) -> None:
        """Choose some of a batch's photons, of `count` or as many as `held` tells (`footprint.Photons`), to stand for
        one of so many equal parts of all."""
        if held is None:
            self._count.write(np.uint32(count).tobytes())
        (buffer, offset), first = held or (self._count, 0), CHOSEN * part // parts
        for binding, bound in enumerate((photons, self._landed, buffer)):
            bound.bind_to_storage_buffer(binding)
        chosen = CHOSEN * (part + 1) // parts - first
        for name, value in (("held_at", offset // 4), ("first", first), ("chosen", chosen)):
            self._program[name].value = value
        self._ctx.memory_barrier()
        self._program.run(-(-chosen // _GROUP))

    def read(self) -> dict[int, Landings]:
        """Where they landed, by receiver."""
        landed = np.frombuffer(self._landed.read(), _LANDED)
        return by_receiver(landed[landed["flux_w"] > 0.0])

    def release(self) -> None:
        """Free everything."""
        shader.release(self._program, self._landed, self._count)


def is_back(receiver: int) -> bool:
    """Whether number `receiver` is a back."""
    return receiver % 2 == 1


def faces_camera(camera: Camera, buffers: SceneBuffers, receiver: int) -> bool:
    """Whether this side of a flat receiver is turned to the camera."""
    mesh = buffers.world_meshes[buffers.receivers[receiver]]
    normal = mesh.face_normals()[int(np.argmax(mesh.areas()))]
    if camera.kind == "orthographic":
        towards = -camera_frame(camera)[2]
    else:
        towards = np.asarray(camera.position, float) - mesh.vertices[0]
    return bool(towards @ normal < 0.0) == is_back(receiver)


def on_both(landings: Mapping[int, Landings]) -> dict[int, Landings]:
    """Each side with what landed on either."""
    found: dict[int, Landings] = {}
    for front in {receiver - is_back(receiver) for receiver in landings}:
        parts = [landings[side] for side in (front, front + 1) if side in landings]
        both = Landings(*(np.concatenate([getattr(one, name) for one in parts]) for name in ("positions", "flux_w")))
        found |= {front: both, front + 1: both}
    return found
