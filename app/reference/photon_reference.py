"""The converged picture that `bench` and the tests measure errors against.

It shares no code with the shaders, the emission lattice, the splats, the maps or the camera pass:
exact float64 intersections, a random wavelength, one photon one pixel, no footprint. The caustic
layer alone: light that reached a diffuse surface by glass or mirrors, on what the camera sees
directly.

PARTS independent scramblings of one quasi-random sequence run side by side, a thread each, so the
picture converges faster than random and still knows its own error. References are kept by the content of their scene,
and grow: where less error is wanted, more photons are added. One `.npz` a scene, size and depth in the user's cache
folder holds the sums of all independent parts and how far each got, so that a later call goes on with fresh points of
the same sequences.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..base.errors import UserError
from ..model.optics.colorimetry import rgb709_to_xyz, rgb709_to_xyz_matrix
from ..model.scene import Scene
from ..model.scene_key import scene_key
from .code_key import code_key
from .rounds import PARTS, Cancelled, Limits, Pace, PartsRun, Progress, continue_kept, continue_run, kept_path
from .scene_surfaces import description

if TYPE_CHECKING:
    from .photon_emission import Domain


TALLY = ("emitted", "deposited", "direct", "absorbed", "escaped", "lost_depth", "lost_numeric")
"""What the first numbers of a tally are, W."""
TALLY_SIZE = 9
"""Then the photons that left their light, and those that came to the picture."""
RELMSE_EPSILON = 1e-2
"""ε of relMSE = mean[(I − R)²/(R² + ε)] as a share of mean(R)², on XYZ over all pixels and channels."""

_PILOT_PHOTONS = 1 << 16
_PILOT_BLOCK = 8
"""Pixels a side over which the pilot's brightness is averaged."""
_MAX_A_UNIT = 16
"""Points of the most important domain in a unit; every domain has at least one."""
_LAST_POINT = 2**31
_BLACK_PHOTONS = 1 << 20


def relative_variance(values: np.ndarray, variance: np.ndarray) -> float:
    """mean[variance / (values² + ε)], as relMSE weighs errors; 0 where all is black."""
    epsilon = RELMSE_EPSILON * float(values.mean()) ** 2 if values.size else 0.0
    return float(np.mean(variance / (values**2 + epsilon))) if epsilon > 0.0 else 0.0


@dataclass(frozen=True)
class ReferencePicture:
    """A converged picture and what is known of its error; row 0 on top."""

    rgb: np.ndarray
    """float64 (H, W, 3): linear Rec.709, lm/(sr unit²) for white, as `render(… layer="caustic").rgb`: the mean over
    each pixel."""
    covariance: np.ndarray
    """float64 (H, W, 3, 3): of a pixel's channels as estimates, from PARTS independent pictures."""
    photons: int
    seconds: float
    """Time spent tracing."""
    balance: dict[str, float]
    """Flux by fate, W: emitted = deposited + direct + absorbed + escaped + lost_depth + lost_numeric."""

    @property
    def amount(self) -> int:
        """Photons."""
        return self.photons

    @property
    def variance(self) -> np.ndarray:
        """Variance of `rgb` as an estimate, float64 (H, W, 3)."""
        return np.einsum("...ii->...i", self.covariance).copy()

    def xyz(self) -> np.ndarray:
        """The picture in CIE XYZ (Y: lm/(sr unit²)), float64 (H, W, 3)."""
        return rgb709_to_xyz(self.rgb)

    def xyz_variance(self) -> np.ndarray:
        """Variance of `xyz()`, float64 (H, W, 3)."""
        return self._xyz_variance

    @cached_property
    def _xyz_variance(self) -> np.ndarray:
        matrix = rgb709_to_xyz_matrix()
        # One product of (H · W, 9) and (9, 3): a fourth of the time of one with matrices in it.
        products = np.einsum("ij,ik->jki", matrix, matrix).reshape(9, 3)
        return (self.covariance.reshape(-1, 9) @ products).reshape(*self.covariance.shape[:-2], 3)

    @cached_property
    def relmse(self) -> float:
        """The picture's own error: mean[var/(R² + ε)] on XYZ; 0 for a black picture without photons in it."""
        return relative_variance(self.xyz(), self.xyz_variance())

    def is_within(self, target_relmse: float) -> bool:
        """Whether the error is known to be no larger; blackness is believed after many photons only."""
        return self.relmse <= target_relmse and (bool(self.rgb.any()) or self.photons >= _BLACK_PHOTONS)


class ReferenceRun(PartsRun[ReferencePicture]):
    """Photons of one picture, added round by round; `picture()` at any time."""

    def __init__(self, scene: Scene, width: int, height: int, max_depth: int = 64, seed: int = 1) -> None:
        """Reads the scene and sends a pilot, which sets where photons start and how many each light has.

        Raises UserError where numba is missing, solids nest beyond reach or the camera has a lens.
        """
        if scene.camera.lens_radius > 0.0:
            raise UserError(
                f"the reference of the caustic layer has no lens: set lens_radius of '{scene.name}' to 0, or compare "
                "the beauty layer"
            )
        try:
            from . import photon_emission, photon_kernel, photon_scene, sampling, viewpoint, worn_textures
        except ImportError as error:
            raise UserError(
                f"the reference renderer needs numba ({error}); install it with: pip install numba"
            ) from error
        self._kernel, self._sampling = photon_kernel, sampling
        self._scene, centre = photon_scene.photon_scene(scene)
        self._camera_pass = viewpoint.viewpoint(scene.camera, width, height, centre)
        self._worn = worn_textures.worn_textures(scene, self._scene)
        self._max_depth, self._seed = max_depth, seed
        domains, self._colours = photon_emission.scene_domains(scene, self._scene, centre)
        super().__init__((height, width, 3), TALLY_SIZE)
        self._domains, self._points = self._aimed(domains)
        self._sequences = [[sampling.scrambled(seed, part, d) for d in range(len(domains))] for part in range(PARTS)]
        self._pace = Pace(max(1, 1024 // max(self.unit, 1)))

    @property
    def unit(self) -> int:
        """Photons of a unit, over all domains; 0 where no light meets glass or a mirror."""
        return sum(self._points)

    @property
    def photons(self) -> int:
        """Photons so far."""
        return self.amount

    @property
    def amount_words(self) -> str:
        """Photons for people."""
        return f"{self.amount / 1e6:.1f} M photons"

    @property
    def exhausted(self) -> bool:
        """Whether the sequence has no fresh points left, or there is nothing to trace."""
        return not self._points or int(self.units.max()) * max(self._points) >= _LAST_POINT

    def _most_units(self) -> int:
        return _LAST_POINT // max(self._points)

    def kept(self) -> dict[str, object]:
        """With the size of a unit, which a pilot has found."""
        return super().kept() | {"unit": self.unit}

    def picture(self) -> ReferencePicture:
        """What has been gathered; black without variance before the first round."""
        return summed(self.sums, self.units, self.tallies, self.unit, self.seconds)

    def _trace_part(self, part: int, units: int) -> None:
        none = np.zeros((0, 0))
        for domain, colour, points, sequence in zip(
            self._domains, self._colours, self._points, self._sequences[part], strict=True
        ):
            self._kernel.trace(
                self._scene,
                self._camera_pass,
                self._worn,
                domain,
                colour,
                sequence,
                int(self.units[part]) * points,
                units * points,
                1.0 / points,
                self._max_depth,
                self.sums[part],
                self.tallies[part],
                none,
                none,
                self._sampling.scratch(),
            )
        self.units[part] += units

    def _aimed(self, domains: list[Domain]) -> tuple[list[Domain], list[int]]:
        """Densities and points a unit by a pilot that is not part of the picture.

        First where the picture is bright, then what photons of each cell add to it in units of its error's weight.
        """
        from .photon_emission import density, refined

        weight = np.ones(self.sums.shape[1:3])
        if domains:
            picture, _ = self._pilot(domains, weight, 0)
            weight = _error_weight(picture @ np.array([0.2126, 0.7152, 0.0722]))
            _, importance = self._pilot(domains, weight, 1)
        aimed, moments = [], []
        for d, domain in enumerate(domains):
            aimed.append(refined(domain, importance[d]))
            old, new = density(domain), density(aimed[-1])
            moments.append(float(np.sum(importance[d] * np.divide(old, new, out=np.zeros_like(old), where=new > 0.0))))
        deviation = np.sqrt(np.array(moments))
        largest = deviation.max(initial=0.0)
        steps = np.log2(np.maximum(_MAX_A_UNIT * deviation / largest, 1.0)) if largest > 0.0 else np.zeros(len(domains))
        return aimed, [int(2**step) for step in np.rint(steps).astype(int)]

    def _pilot(self, domains: list[Domain], weight: np.ndarray, number: int) -> tuple[np.ndarray, list[np.ndarray]]:
        from .photon_emit import GRID

        picture, importance = np.zeros(self.sums.shape[1:]), [np.zeros((GRID, GRID)) for _ in domains]
        for d, (domain, colour) in enumerate(zip(domains, self._colours, strict=True)):
            sequence = self._sampling.scrambled(self._seed, PARTS + number, d)
            self._kernel.trace(
                self._scene,
                self._camera_pass,
                self._worn,
                domain,
                colour,
                sequence,
                0,
                _PILOT_PHOTONS,
                1.0 / _PILOT_PHOTONS,
                self._max_depth,
                picture,
                np.zeros(TALLY_SIZE),
                weight,
                importance[d],
                self._sampling.scratch(),
            )
        return picture, importance


def summed(sums: np.ndarray, units: np.ndarray, tallies: np.ndarray, unit: int, seconds: float) -> ReferencePicture:
    """The picture from the sums (PARTS, H, W, 3) and tallies (PARTS, TALLY_SIZE) of parts that traced `units` (PARTS,)
    of `unit` photons."""
    total = max(int(units.sum()), 1)
    flux = tallies.sum(axis=0) / total
    balance = {name: float(value) for name, value in zip(TALLY, flux, strict=False)}
    mean = sums.sum(axis=0) / total
    covariance = np.zeros((*mean.shape, 3))
    used = np.flatnonzero(units)
    if len(used) > 1:
        for part in used:
            apart = sums[part] / units[part] - mean
            covariance += units[part] / total * apart[..., :, None] * apart[..., None, :]
        covariance /= len(used) - 1
    return ReferencePicture(mean, covariance, int(units.sum()) * unit, seconds, balance)


def _error_weight(luminance: np.ndarray) -> np.ndarray:
    """1/(R² + ε) of a noisy picture (H, W), R averaged over blocks: what a squared error counts in relMSE, up to a
    factor."""
    height, width = luminance.shape
    rows, columns = np.arange(height) // _PILOT_BLOCK, np.arange(width) // _PILOT_BLOCK
    index = rows[:, None] * (columns[-1] + 1) + columns
    count = np.bincount(index.ravel())
    block = np.bincount(index.ravel(), luminance.ravel()) / count
    smooth = np.maximum(block, 0.0)[index]
    epsilon = RELMSE_EPSILON * float(luminance.mean()) ** 2
    return 1.0 / (smooth**2 + epsilon) if epsilon > 0.0 else np.ones_like(smooth)


_SEED = 1


def reference_key(scene: Scene, width: int, height: int, max_depth: int) -> str:
    """SHA-256 over everything the picture depends on, the code that makes it included."""
    return scene_key(scene, code_key("photon_reference"), description(scene), width, height, max_depth)


def render_reference(
    scene: Scene,
    width: int,
    height: int,
    *,
    max_depth: int = 64,
    photons: int | None = None,
    seconds: float | None = None,
    target_relmse: float | None = None,
    seed: int = 1,
    progress: Progress = lambda fraction, text: None,
    cancelled: Cancelled = lambda: False,
) -> ReferencePicture:
    """The caustic layer of `scene`, until `photons`, `seconds` or `target_relmse` is reached, whichever comes first.

    What was done when `cancelled()` turned true is kept. Raises ValueError without any limit, UserError
    without numba or where too many solids nest.
    """
    progress(0.0, "preparing")
    limits = Limits(photons, seconds, target_relmse)
    return continue_run(ReferenceRun(scene, width, height, max_depth, seed), limits, progress, cancelled)


def cached_reference(
    scene: Scene,
    width: int,
    height: int,
    *,
    max_depth: int = 64,
    photons: int | None = None,
    seconds: float | None = None,
    target_relmse: float | None = None,
    progress: Progress = lambda fraction, text: None,
    cancelled: Cancelled = lambda: False,
    folder: Path | None = None,
) -> ReferencePicture:
    """The stored picture where it is good enough, otherwise what is stored and more photons, stored again.

    Limits as in `render_reference`; `photons` counts those that are stored, `seconds` only the time spent
    now: with `seconds` alone every call adds. A damaged file is ignored; a folder that cannot be written
    costs only the saving. An interrupt (KeyboardInterrupt) stores what is done and goes on upwards.
    """

    def picture_of(stored: Mapping[str, np.ndarray]) -> ReferencePicture:
        values = stored["sums"], stored["units"], stored["tallies"]
        return summed(*values, int(stored["unit"]), float(stored["seconds"]))

    def begin(stored: Mapping[str, np.ndarray] | None) -> ReferenceRun:
        progress(0.0, "preparing")
        run = ReferenceRun(scene, width, height, max_depth, _SEED)
        if stored is not None and int(stored["unit"]) == run.unit:
            run.restore(stored)
        return run

    path = kept_path(reference_key(scene, width, height, max_depth), folder)
    shapes = {"sums": (PARTS, height, width, 3), "units": (PARTS,), "tallies": (PARTS, TALLY_SIZE)}
    shapes |= {"seconds": (), "unit": ()}
    limits = Limits(photons, seconds, target_relmse)
    return continue_kept(path, shapes, picture_of, begin, limits, progress, cancelled)
