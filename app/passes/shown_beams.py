"""Which objects of a picture are seen by its polygons instead of by paths, what these add to it, and the paths that
carry some of them on."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

import moderngl
import numpy as np

from ..beams.screen_polygons import ScreenPolygons
from ..beams.screen_starts import ScreenStarts
from .beam_starts import BeamStarts
from .listed_pixels import ListedPixels
from .screen_beams import MOST_ENTRIES, ScreenBeams
from .variants import BIND_BEAM_OBJECTS, screen_beam_defines, start_defines

if TYPE_CHECKING:
    from ..gpu.scene_buffers import SceneBuffers
    from .camera_programs import CameraPrograms

START_SHARE = 0.25
"""Of a sample's power, that a path which carries on a beam stands for."""

Dispatch = Callable[[moderngl.ComputeShader, int], float]
"""Runs a program for so many paths; seconds it took."""


class ShownBeams:
    """Owns what draws them, once there are any."""

    def __init__(self, ctx: moderngl.Context, objects: int, targets: int) -> None:
        """`objects` in the scene, `targets` of its sums."""
        self._ctx, self._targets = ctx, targets
        self.objects = np.zeros(objects, bool)
        """(O,) those that are seen by beams."""
        self._objects_buffer: moderngl.Buffer | None = None
        self._beams: ScreenBeams | None = None
        self._starts: BeamStarts | None = None

    @property
    def are_there(self) -> bool:
        """Some objects are seen by them."""
        return bool(self.objects.any())

    def drop(self) -> None:
        """None is."""
        self.objects[:] = False

    def take(
        self,
        programs: CameraPrograms,
        scene: SceneBuffers,
        brightness: np.ndarray | None,
        polygons: ScreenPolygons,
        objects: np.ndarray,
        starts: tuple[ScreenStarts, ScreenPolygons] | None,
        width: int,
    ) -> None:
        """As `CameraPass.take_beams`."""
        shown, structs = programs.defines, programs.structs
        if self._beams is None:
            self._beams = ScreenBeams(self._ctx, screen_beam_defines(shown), structs, self._targets)
            programs.of("beside")
            self._objects_buffer = self._ctx.buffer(reserve=4 * len(self.objects))
        assert self._objects_buffer is not None
        self.objects[:] = objects
        self._objects_buffer.write(self.objects.astype("u4").tobytes())
        self._beams.take(polygons, scene, brightness)
        if starts is not None and self._starts is None:
            self._starts = BeamStarts(self._ctx, start_defines(shown), structs, MOST_ENTRIES)
        if self._starts is not None:
            drawn, handed = starts or (ScreenStarts.none(), polygons)
            self._starts.take(drawn, handed, scene, width)

    def bind_objects(self) -> None:
        """For the program that looks beside them."""
        assert self._objects_buffer is not None
        self._objects_buffer.bind_to_storage_buffer(BIND_BEAM_OBJECTS)

    def draw(
        self,
        size: tuple[int, int],
        places: np.ndarray,
        as_image: bool,
        parameters: np.ndarray,
        listed: ListedPixels,
        bind: Callable[[], None],
        dispatch: Dispatch,
        target_s: float,
    ) -> Iterator[float]:
        """Draw a picture of that `size`, yielding the share done after every portion: looked at in `places` of a pixel;
        `bind` what programs read with `parameters`, which `dispatch` does as well."""
        assert self._beams is not None
        parameters["sample_index"] = parameters["draw_index"] = 0
        drawn = 1.0 if self._starts is None else 0.5
        for share in self._beams.draw(size, places, as_image, bind, target_s):
            yield drawn * share
        if self._starts is not None:
            found, gather = self._beams.found, self._beams.gather
            parameters["start_share"] = START_SHARE

            for share in self._starts.follow(listed, parameters, dispatch, found, gather, target_s):
                yield drawn + (1.0 - drawn) * share

    def add(self, sums: Sequence[moderngl.Texture], row: int, rows: int) -> None:
        """What was drawn, to the sums of a band of rows."""
        assert self._beams is not None
        self._beams.add(sums, row, rows)

    def release(self) -> None:
        """Free everything."""
        for owned in (self._beams, self._starts, self._objects_buffer):
            if owned is not None:
                owned.release()
