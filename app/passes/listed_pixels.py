"""The pixels that see glass or mirrors first, and how one dispatch after the other follows them.

The program for what is seen directly lists them; another follows the list: all at once by a dispatch whose size the
list holds. Where a driver ends long loops, it is followed a portion at a time, and samples halt and are taken up again
(shaders/camera/waiting.glsl).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import moderngl
import numpy as np

from ..gpu import shader
from ..gpu.device_traits import DeviceTraits
from ..gpu.dispatch_budget import DispatchBudget
from ..gpu.records import NONE
from .camera_programs import BIND_LISTED, BIND_WAITING

_WHOLE = 64
"""Multiples in which a dispatch is given pixels."""
_FIRST = 1024
_GROUPS_AT, _LISTED_AT, _UNEVEN_GROUPS_AT, _HALTED_AT = 0, 12, 16, 32
_NOTHING = np.array((0, 1, 1, 0, 64, 0, 1, 0, 0, 0), "u4")
"""The list's first words where nothing is listed (shaders/camera/listed.glsl)."""
SURVEYED = np.dtype([("key", "u4"), ("mean", "u4", 3)])
"""Bytes that a survey keeps of a pixel (shaders/camera/survey.glsl)."""
_UNEVEN_BYTES = 4
"""Bytes of the number of a pixel that is not even."""

Dispatch = Callable[[DispatchBudget, int], None]
"""Follows so many pixels, as `first_listed` and its neighbours in the parameters say; the budget learns from it."""


class ListedPixels:
    """Owns the list and the room that the paths of samples wait in."""

    def __init__(self, ctx: moderngl.Context, traits: DeviceTraits, bytes_of_waiting: int) -> None:
        """`bytes_of_waiting`: room of one sample's paths; 0 where none are followed."""
        self._ctx = ctx
        self.may_halt = bytes_of_waiting > 0 and traits.is_software
        """It is followed a portion at a time (`follow`)."""
        self._places, self._bytes_of_waiting = traits.camera_paths, bytes_of_waiting
        self._waiting: moderngl.Buffer | None = None
        self._list: moderngl.Buffer | None = None
        self.room = 0
        """What the list holds."""
        self._surveyed = 0
        """Pixels of a survey, which follow the list."""
        self.budget = self.resumed = DispatchBudget(1, 1, 1)
        """How many pixels, and how many halted samples, a dispatch is given."""

    def resize(self, pixels: int, room: int) -> None:
        """Make room for pictures of so many pixels, up to `room` of them on the list at a time."""
        self.room, self._surveyed = room, 0
        self._reserve()
        self.budget = DispatchBudget(_FIRST, _WHOLE, max(pixels, _WHOLE))
        self.resumed = DispatchBudget(_FIRST, _WHOLE, self._places)
        wanted = min(self._places, -(-pixels // _WHOLE) * _WHOLE) * self._bytes_of_waiting
        if wanted > (0 if self._waiting is None else self._waiting.size):
            shader.release(self._waiting)
            self._waiting = self._ctx.buffer(reserve=wanted)

    def survey_at(self, pixels: int) -> int:
        """Make room for a survey of so many pixels behind the list; where it begins, in words behind the counts."""
        if self._surveyed != pixels:
            self._surveyed = pixels
            self._reserve()
        return self.room

    @property
    def count(self) -> int:
        """Pixels that are listed; waits for the device."""
        return self._count(_LISTED_AT)

    def run(self, program: moderngl.ComputeShader, *, uneven: bool = False) -> None:
        """Run `program` over all that is listed, or over the pixels that a survey found uneven."""
        assert self._list is not None
        program.run_indirect(self._list, _UNEVEN_GROUPS_AT if uneven else _GROUPS_AT)
        self._ctx.memory_barrier()

    def clear(self) -> None:
        """Nothing is listed and nothing has halted."""
        assert self._list is not None
        self._list.write(_NOTHING)

    def bind(self) -> None:
        """To the places that the programs read."""
        if self._list is not None:
            self._list.bind_to_storage_buffer(BIND_LISTED)
        if self._waiting is not None:
            self._waiting.bind_to_storage_buffer(BIND_WAITING)

    def follow(self, parameters: np.ndarray, dispatch: Dispatch) -> Iterator[float]:
        """Follow all that is listed by portions, yielding the share done after each dispatch but the last."""
        count, done, place = self._count(_LISTED_AT), 0, 0
        while done < count:
            pixels = min(self.budget.units, count - done, self._places - place)
            parameters["first_place"], parameters["queue"] = place, 0
            _follow(self.budget, done, pixels, parameters, dispatch)
            done, place = done + pixels, place + pixels
            # Those of many dispatches together, so that few are left without neighbours.
            if done == count or place == self._places:
                for _ in self._resume_halted(parameters, dispatch):
                    yield done / count
                place = 0
            if done < count:
                yield done / count

    def _resume_halted(self, parameters: np.ndarray, dispatch: Dispatch) -> Iterator[None]:
        """Take up the samples that have halted until none is left, pausing before every dispatch."""
        assert self._list is not None
        parameters["first_place"] = NONE
        while count := self._count(_HALTED_AT):
            self._list.write(bytes(4), offset=_HALTED_AT)
            parameters["queue"] = 1 - parameters["queue"]
            done = 0
            while done < count:
                yield
                samples = min(self.resumed.units, count - done)
                _follow(self.resumed, done, samples, parameters, dispatch)
                done += samples

    def _count(self, at: int) -> int:
        assert self._list is not None
        return int(np.frombuffer(self._list.read(4, offset=at), "u4")[0])

    def _reserve(self) -> None:
        shader.release(self._list)
        bytes_of_surveyed = SURVEYED.itemsize + _UNEVEN_BYTES
        self._list = self._ctx.buffer(reserve=_NOTHING.nbytes + 4 * self.room + bytes_of_surveyed * self._surveyed)

    def release(self) -> None:
        """Free both."""
        shader.release(self._list, self._waiting)


def _follow(budget: DispatchBudget, first: int, count: int, parameters: np.ndarray, dispatch: Dispatch) -> None:
    """Dispatch a portion of the listed pixels, or of the halted samples."""
    parameters["first_listed"], parameters["end_listed"] = first, first + count
    dispatch(budget, count)
