"""The reference's photons, round by round, and the picture they have made so far.

PARTS independent scramblings of one quasi-random sequence run side by side, a thread each, so the
picture converges faster than random and still knows its own error. `photon_reference` is the way in.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ..base.errors import UserError
from ..model.optics.colorimetry import rgb709_to_xyz, rgb709_to_xyz_matrix
from ..model.scene import Scene
from .rounds import PARTS, Pace, PartsRun
from .scene_surfaces import specular_corners

if TYPE_CHECKING:
    from .photon_emission import Domain
    from .photon_scene import Colours

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
        """Of `rgb`, float64 (H, W, 3)."""
        return np.einsum("...ii->...i", self.covariance).copy()

    def xyz(self) -> np.ndarray:
        """The picture in CIE XYZ (Y: lm/(sr unit²)), float64 (H, W, 3)."""
        return rgb709_to_xyz(self.rgb)

    def xyz_variance(self) -> np.ndarray:
        """Of `xyz()`, float64 (H, W, 3)."""
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
            from . import photon_emission, photon_kernel, photon_scene, sampling, worn_textures
        except ImportError as error:
            raise UserError(
                f"the reference renderer needs numba ({error}); install it with: pip install numba"
            ) from error
        self._kernel, self._sampling = photon_kernel, sampling
        self._scene, centre = photon_scene.photon_scene(scene)
        self._camera_pass = photon_scene.viewpoint(scene.camera, width, height, centre)
        self._worn = worn_textures.worn_textures(scene, self._scene)
        self._max_depth, self._seed = max_depth, seed
        classes, _ = photon_scene.reflectance_classes(scene)
        corners = specular_corners(scene, centre)
        points = self._scene.corners[:, :3]
        reach = float(
            np.linalg.norm(points, axis=1).max()
            + np.linalg.norm(self._scene.corners[:, 3:].reshape(-1, 3), axis=1).max()
        )
        domains: list[Domain] = []
        self._colours: list[Colours] = []
        for light in scene.lights:
            if light.spectral_power.power_w() <= 0.0:
                continue
            found = photon_emission.domains(light, corners, centre, reach)
            domains += found
            self._colours += [photon_scene.colours(light.spectral_power, classes)] * len(found)
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
