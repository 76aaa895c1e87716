"""What a bench run has done so far, on disk: results.json, pictures, and the sums that a resumed run goes on from.

After every method and seed the sums are written under a name that says how many seeds they hold, then results.json,
then the older sums go. Whatever moment a run is stopped at, results.json and the sums it needs fit together.
"""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import msgspec
import numpy as np

from ..base import files
from ..base.atomic import atomic_output, make_output_folder
from ..base.errors import UserError
from ..reference.metrics import ReferencePicture
from .results import BenchResult, BenchSettings, SceneResult

RESULTS = "results.json"
PICTURES = "pictures"
PARTIAL = "partial"
"""Folder of what only a resumed run needs; a finished scene leaves nothing in it."""
_OF_ONE_MACHINE = ("processor", "renderer", "program")
"""Results that differ in these must not be compared."""


class Store:
    """A bench folder. `result` is what results.json holds, or will after `save`."""

    def __init__(self, directory: Path, fresh_result: BenchResult, fresh: bool = False) -> None:
        """Open or make `directory`. Earlier results in it are gone on from, or forgotten if `fresh`.

        Raises `UserError` where it cannot be written or holds results that cannot be gone on from.
        """
        self.directory = directory
        make_output_folder(directory, RESULTS)
        self.result = fresh_result
        if not os.path.exists(self.path):
            return
        if fresh:
            self._forget()
            return
        earlier = self._read()
        self._refuse_mixture(earlier, fresh_result)
        self.result.scenes = earlier.scenes

    @property
    def path(self) -> Path:
        """results.json."""
        return self.directory / RESULTS

    def save(self) -> None:
        """Write results.json."""
        with atomic_output(self.path) as path:
            path.write_bytes(msgspec.json.format(msgspec.json.encode(self.result), indent=1))

    def scene(self, name: str) -> SceneResult | None:
        """What is known of a scene."""
        return next((scene for scene in self.result.scenes if scene.scene == name), None)

    def put_scene(self, scene: SceneResult) -> None:
        """Add a scene, or put it in the place of what was known of it."""
        self.result.scenes = [s for s in self.result.scenes if s.scene != scene.scene] + [scene]

    def save_picture(self, scene: str, name: str, xyz: np.ndarray) -> str:
        """Write an XYZ picture as float32 .npy; returns its name relative to the folder."""
        relative = f"{PICTURES}/{scene}_{name.replace(' ', '_')}.npy"
        self._save_array(self.directory / relative, xyz.astype(np.float32))
        return relative

    def save_reference(self, scene: str, reference_image: ReferencePicture) -> None:
        """Keep the very reference that the samples are measured against."""
        self._save_array(self._reference_path(scene), np.stack([reference_image.xyz, reference_image.variance]))

    def load_reference(self, scene: str) -> ReferencePicture | None:
        """The reference of a scene under way."""
        stored = _load_array(self._reference_path(scene))
        return None if stored is None else ReferencePicture(stored[0], stored[1])

    def save_sums(self, scene: str, method: str, seeds: int, sums: np.ndarray) -> None:
        """Keep Σ (I − R̂) over the first `seeds` seeds, float32 (budgets, H, W, 3). Earlier sums stay until
        `drop_sums`."""
        self._save_array(self._sums_path(scene, method, seeds), sums)

    def load_sums(self, scene: str, method: str, seeds: int) -> np.ndarray | None:
        """What `save_sums` kept."""
        return _load_array(self._sums_path(scene, method, seeds))

    def drop_sums(self, scene: str, method: str, seeds: int) -> None:
        """Forget sums that results.json no longer needs."""
        self._sums_path(scene, method, seeds).unlink(missing_ok=True)

    def drop_partial(self, scene: SceneResult) -> None:
        """Forget all that only going on with `scene` needs."""
        self._reference_path(scene.scene).unlink(missing_ok=True)
        for curve in scene.curves:
            for seeds in range(scene.seeds + 1):
                self.drop_sums(scene.scene, curve.method, seeds)
        if self._partial.is_dir() and not any(self._partial.iterdir()):
            self._partial.rmdir()

    @property
    def _partial(self) -> Path:
        return self.directory / PARTIAL

    def _reference_path(self, scene: str) -> Path:
        return self._partial / f"{scene}.reference.npy"

    def _sums_path(self, scene: str, method: str, seeds: int) -> Path:
        return self._partial / f"{scene}.{method}.{seeds}.npy"

    def _save_array(self, path: Path, array: np.ndarray) -> None:
        path.parent.mkdir(exist_ok=True)
        with atomic_output(path) as temporary, temporary.open("wb") as file:
            np.save(file, array)

    def _read(self) -> BenchResult:
        try:
            return msgspec.json.decode(self.path.read_bytes(), type=BenchResult)
        except (OSError, msgspec.DecodeError) as error:
            raise UserError(
                f"{self.path} cannot be read as earlier results ({error}): give --fresh to replace it, or another -o"
            ) from error

    def _refuse_mixture(self, earlier: BenchResult, wanted: BenchResult) -> None:
        difference = _settings_difference(earlier.settings, wanted.settings)
        if difference:
            raise UserError(
                f"{self.path} was made with {difference}: give the same to go on, --fresh to begin anew, or another -o"
            )
        for key in _OF_ONE_MACHINE:
            before, now = earlier.machine.get(key, ""), wanted.machine.get(key, "")
            if before != now:
                what = (
                    "another version of the program" if key == "program" else f"another {key} ('{before}', not '{now}')"
                )
                raise UserError(
                    f"{self.path} was made with {what}, which cannot be mixed: give --fresh to begin anew, or another "
                    "-o"
                )

    def _forget(self) -> None:
        self.path.unlink(missing_ok=True)
        shutil.rmtree(self._partial, ignore_errors=True)


def _settings_difference(earlier: BenchSettings, wanted: BenchSettings) -> str:
    """ "--seconds 3 instead of 1", or "" when they agree."""

    def size(settings: BenchSettings) -> str:
        return "by the scene" if settings.size is None else f"{settings.size[0]}x{settings.size[1]}"

    if earlier.measured_pass != wanted.measured_pass:
        return f"the {earlier.measured_pass} pass measured instead of the {wanted.measured_pass} pass"
    pairs = {
        "--seconds": (f"{earlier.seconds:g}", f"{wanted.seconds:g}"),
        "--horizon": (f"{earlier.horizon_seconds:g}", f"{wanted.horizon_seconds:g}"),
        "--seeds": (f"{earlier.seeds}", f"{wanted.seeds}"),
        "--methods": (",".join(earlier.methods), ",".join(wanted.methods)),
        "--size": (size(earlier), size(wanted)),
    }
    return ", ".join(f"{option} {before} instead of {now}" for option, (before, now) in pairs.items() if before != now)


def _load_array(path: Path) -> np.ndarray | None:
    try:
        return np.array(files.read_npy(path))
    except (OSError, ValueError):
        return None
