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

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..base.errors import UserError
from ..model.scene import Scene
from ..model.scene_key import scene_key
from .code_key import code_key
from .rounds import (
    PARTS,
    RELMSE_EPSILON,
    TALLY_SIZE,
    Kind,
    Limits,
    Pace,
    PartsRun,
    Picture,
    Progress,
    continue_kept,
    continue_run,
    kept_path,
)
from .scene_surfaces import description

if TYPE_CHECKING:
    from .photon_emission import Domain
    from .sampling import Sequence


KIND = Kind(
    fates=("emitted", "deposited", "direct", "absorbed", "escaped", "lost_depth", "lost_numeric"),
    per_pixel=False,
    is_rgb=True,
    black_amount=1 << 20,
)
"""Fates are W. A tally ends with the photons that left their light and those that came to the picture."""

_PILOT_PHOTONS = 1 << 16
_PILOT_BLOCK = 8
"""Pixels a side over which the pilot's brightness is averaged."""
_MAX_A_UNIT = 16
"""Points of the most important domain in a unit; every domain has at least one."""
_LAST_POINT = 2**31


class ReferenceRun(PartsRun):
    """Photons of one picture, added round by round; `picture()` at any time."""

    kind = KIND
    unit_words = 1e6, "M photons"

    def __init__(self, scene: Scene, width: int, height: int, max_depth: int = 64, seed: int = 1) -> None:
        """Reads the scene and traces a pilot, which sets where photons start and how many each light has.

        Raises UserError where solids nest beyond reach or the camera has a lens.
        """
        if scene.camera.lens_radius > 0.0:
            raise UserError(
                f"the reference of the caustic layer has no lens: set lens_radius of '{scene.name}' to 0, or compare "
                "the beauty layer"
            )
        from . import photon_emission, photon_kernel, photon_scene, sampling, viewpoint, worn_textures

        self._kernel, self._sampling = photon_kernel, sampling
        self._scene, centre = photon_scene.photon_scene(scene)
        self._camera = viewpoint.viewpoint(scene.camera, width, height, centre)
        self._worn = worn_textures.worn_textures(scene, self._scene)
        self._max_depth, self._seed = max_depth, seed
        domains, self._colours = photon_emission.scene_domains(scene, self._scene, centre)
        super().__init__(width, height)
        self._domains, self._points = self._aimed(domains)
        self._sequences = [[sampling.scrambled(seed, part, d) for d in range(len(domains))] for part in range(PARTS)]
        self._pace = Pace(max(1, 1024 // max(self.unit, 1)))

    @property
    def unit(self) -> int:
        """Photons of a unit, over all domains; 0 where no light meets glass or a mirror."""
        return sum(self._points)

    @property
    def exhausted(self) -> bool:
        """Whether the sequence has no fresh points left, or there is nothing to trace."""
        return not self._points or int(self.units.max()) * max(self._points) >= _LAST_POINT

    def _most_units(self) -> int:
        return _LAST_POINT // max(self._points)

    def _trace_part(self, part: int, units: int) -> None:
        none = np.zeros((0, 0))
        for d, points in enumerate(self._points):
            span = int(self.units[part]) * points, units * points, 1.0 / points
            self._trace(d, self._domains[d], self._sequences[part][d], span, self.sums[part], part, none, none)
        self.units[part] += units

    def _trace(
        self,
        d: int,
        domain: Domain,
        sequence: Sequence,
        span: tuple[int, int, float],
        picture: np.ndarray,
        part: int | None,
        weight: np.ndarray,
        importance: np.ndarray,
    ) -> None:
        """Photons of domain number `d`; `span`: the first, how many, and the share that each has."""
        tally = np.zeros(TALLY_SIZE) if part is None else self.tallies[part]
        limits = *span, self._max_depth
        target = picture, tally, weight, importance, self._sampling.scratch()
        self._kernel.trace(self._scene, self._camera, self._worn, domain, self._colours[d], sequence, *limits, *target)

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
        span = 0, _PILOT_PHOTONS, 1.0 / _PILOT_PHOTONS
        for d, domain in enumerate(domains):
            sequence = self._sampling.scrambled(self._seed, PARTS + number, d)
            self._trace(d, domain, sequence, span, picture, None, weight, importance[d])
        return picture, importance


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


def reference_key(scene: Scene, width: int, height: int, max_depth: int) -> str:
    """SHA-256 over everything the picture depends on, the code that makes it included."""
    return scene_key(scene, code_key("photon_reference"), description(scene), width, height, max_depth)


def render_reference(
    scene: Scene, width: int, height: int, *, photons: int, max_depth: int = 64, seed: int = 1
) -> Picture:
    """The caustic layer of `scene`, of so many photons. Raises UserError where too many solids
    nest."""
    return continue_run(ReferenceRun(scene, width, height, max_depth, seed), Limits(photons))


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
    folder: Path | None = None,
) -> Picture:
    """The stored picture where it is good enough, otherwise what is stored and more photons, stored again.

    It ends where `photons`, `seconds` or `target_relmse` is reached, whichever comes first; `photons` counts those that
    are stored, `seconds` only the time spent now: with `seconds` alone every call adds. A damaged file is ignored; a
    folder that cannot be written costs only the saving. An interrupt (KeyboardInterrupt) stores what is done and is
    raised again. Raises ValueError without any limit.
    """

    def begin() -> ReferenceRun:
        progress(0.0, "preparing")
        return ReferenceRun(scene, width, height, max_depth)

    path = kept_path(reference_key(scene, width, height, max_depth), folder)
    limits = Limits(photons, seconds, target_relmse)
    return continue_kept(path, KIND, (width, height), begin, limits, progress)
