"""The pictures of a sweep in a folder, with a file that says which values each belongs to; can be gone on from."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path

from ..base import files
from ..base.atomic import atomic_output
from ..base.errors import UserError
from ..base.image_io import SHOWN_SUFFIXES, write_image
from ..base.tone_map import auto_exposure
from .point_tasks import Drawn
from .sweep import Point

INDEX = "sweep.json"
_DIGITS = 4


class SweepFolder:
    """Pictures of `points`; those to look at share the exposure of the first point."""

    def __init__(
        self, folder: Path, points: tuple[Point, ...], description: Mapping[str, object], suffix: str, overwrite: bool
    ) -> None:
        """`description`: what decides the pictures besides their values. The folder is there and held. Raises
        `UserError` where it holds another sweep."""
        self._folder, self._points, self._suffix = folder, points, suffix
        self._description = json.loads(json.dumps(dict(description) | {"suffix": suffix}))
        self._base_ev: float | None = None
        before = self._stored()
        told = {"sweep": self._description, "pictures": self._pictures()}
        if before is not None and {key: before.get(key) for key in told} != told:
            if not overwrite:
                raise UserError(f"{folder} holds another sweep: choose another folder, or replace it with --overwrite")
            self._empty(before)
            before = None
        elif before is not None and overwrite:
            self._empty(before)
            before = None
        if before is not None:
            found = before.get("base_ev")
            self._base_ev = float(found) if isinstance(found, int | float) else None
        self._save()

    def path(self, number: int) -> Path:
        """Of a point's picture."""
        return self._folder / f"{number:0{_DIGITS}}{self._suffix}"

    def has(self, number: int) -> bool:
        """Whether it is there: files appear whole or not at all."""
        is_settled = self._base_ev is not None or not self.shares_exposure
        return is_settled and os.path.isfile(self.path(number)) and self.path(number).stat().st_size > 0

    @property
    def shares_exposure(self) -> bool:
        """Whether pictures are for looking at."""
        return self._suffix in SHOWN_SUFFIXES

    @property
    def first(self) -> int | None:
        """The point that must be drawn before the others can be written; None where that is settled."""
        return 0 if self.shares_exposure and self._base_ev is None else None

    def put(self, drawn: Drawn) -> None:
        """Write a point's picture. Raises `UserError`."""
        exposure = None
        if self.shares_exposure:
            if self._base_ev is None:
                self._base_ev = auto_exposure(drawn.rgb)
                self._save()
            exposure = self._base_ev - auto_exposure(drawn.rgb) + self._points[drawn.number].stage.exposure_ev
        stage = self._points[drawn.number].stage
        write_image(
            self.path(drawn.number),
            drawn.rgb,
            exposure_ev=exposure,
            glare=stage.scene.render.glare,
            antialias=stage.scene.render.antialias_highlights,
            spectral=drawn.spectral if self._suffix == ".exr" else None,
            bin_edges_nm=drawn.bin_edges_nm if self._suffix == ".exr" else None,
        )

    def _pictures(self) -> list[dict[str, object]]:
        return [{"file": self.path(point.number).name, **point.values} for point in self._points]

    def _stored(self) -> dict | None:
        try:
            stored = json.loads(files.read_text(self._folder / INDEX, files.TABLE_BYTES))
        except FileNotFoundError:
            return None
        except (OSError, ValueError, RecursionError) as error:
            raise UserError(f"{self._folder / INDEX} cannot be read: remove it, or choose another folder") from error
        return stored if isinstance(stored, dict) else {}

    def _save(self) -> None:
        told = {"sweep": self._description, "pictures": self._pictures(), "base_ev": self._base_ev}
        with atomic_output(self._folder / INDEX) as temporary:
            temporary.write_text(json.dumps(told, indent=1) + "\n", encoding="utf-8")

    def _empty(self, before: dict) -> None:
        """Remove the pictures of the sweep that was here, and nothing else."""
        for picture in before.get("pictures", ()):
            name = picture.get("file", "") if isinstance(picture, dict) else ""
            path = self._folder / str(name)
            if path.parent == self._folder and path.stem.isdigit():
                path.unlink(missing_ok=True)
