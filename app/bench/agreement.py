"""Whether a method's pictures are the reference's, by standard scores: pixel by pixel, and in blocks of 8×8 pixels.

Independent shifts of the lattices give the method's mean and its variance, photons of the reference give the
reference's. Where both are right, the squared scores of n places have mean 1 with a standard error of √(2/n). What
exceeds it is deviation: its size, with the noise of both taken out, is what matters, since with
enough photons every bias is significant.
"""

from __future__ import annotations

import msgspec
import numpy as np

from ..gpu.context import Context
from ..model.scene import Scene
from ..reference.metrics import ReferencePicture
from .rendering import MethodRig
from .results import AgreementSettings
from .subjects import Progress, make_reference

BLOCK = 8
"""Pixels on a side of a block."""
FEWEST_HITS = 50.0
"""Photons of the reference that a place must have for its score to be nearly normal; a place with fewer is left out."""
SELDOM = 3.0
"""Chance alone brings a score beyond it once in 370 places."""
EXTREME = 5.0
"""Chance alone hardly ever brings a score beyond it."""
SHOWN = 8
"""Places that are named, the worst first."""


class Place(msgspec.Struct, frozen=True):
    """Where the two differ."""

    column: int
    row: int
    """Pixels, upper left corner."""
    score: float
    share: float
    """Method over reference, minus 1."""


class Agreement(msgspec.Struct, frozen=True):
    """Of one kind of place."""

    places: int
    """With enough photons of the reference."""
    chi2: float
    """Mean of the squared scores: 1 where the two differ by chance alone."""
    seldom: int
    """Places beyond ±`SELDOM`."""
    extreme: int
    """Places beyond ±`EXTREME`."""
    deviation: float
    """Root mean square of method minus reference, noise of both taken out, over the reference's root mean square; 0
    where the noise explains all."""
    worst: list[Place]
    """At most `SHOWN`, by the size of their score."""


class SceneAgreement(msgspec.Struct, frozen=True):
    """One scene's."""

    scene: str
    method: str
    photons: int
    seeds: int
    reference_photons: int
    energy: float
    """Luminance of the method's picture over the reference's, all pixels."""
    energy_score: float
    pixels: Agreement
    blocks: Agreement


def measure(
    context: Context, name: str, scene: Scene, settings: AgreementSettings, progress: Progress
) -> SceneAgreement:
    """Compare the caustics of a scene as its camera sees them, by luminance. Raises `NothingToMeasure`."""
    reference_image, info = make_reference(
        scene,
        settings.width,
        settings.height,
        settings.reference_seconds,
        lambda share, text: progress(0.5 * share, text),
    )
    rig = MethodRig(context, scene, settings.method, settings.width, settings.height)
    pictures = []
    try:
        for seed in range(1, settings.seeds + 1):
            progress(0.5 + 0.5 * (seed - 1) / settings.seeds, f"{name}, seed {seed} of {settings.seeds}")
            pictures.append(rig.render(settings.photons, seed).xyz[..., 1])
    finally:
        rig.release()
    luminance = np.array(pictures)
    exact, variance = reference_image.xyz[..., 1], reference_image.variance[..., 1]
    totals = luminance.sum(axis=(1, 2))
    spread = totals.var(ddof=1) / len(totals) + variance.sum()
    return SceneAgreement(
        name,
        settings.method,
        settings.photons,
        settings.seeds,
        info.photons,
        float(totals.mean() / exact.sum()),
        float((totals.mean() - exact.sum()) / np.sqrt(spread)),
        agreement(luminance, reference_image, 1),
        agreement(luminance, reference_image, BLOCK),
    )


def agreement(luminance: np.ndarray, reference_image: ReferencePicture, side: int) -> Agreement:
    """Scores of blocks of `side` × `side` pixels; `luminance`: (seeds, H, W), one picture a seed, at least two.

    Few seeds know a place's variance badly, so it is pooled: a place has the mean variance of its neighbours in
    brightness where that is more than its own."""
    exact, known = _blocks(reference_image.xyz[..., 1], side), _blocks(reference_image.variance[..., 1], side)
    each = np.array([_blocks(picture, side) for picture in luminance])
    mean, own = each.mean(axis=0), each.var(axis=0, ddof=1)
    # Photons of one weight: a place's variance is its mean times that weight.
    enough = exact**2 >= FEWEST_HITS * known
    enough &= known > 0.0
    rows, columns = np.nonzero(enough)
    if not len(rows):
        return Agreement(0, 1.0, 0, 0, 0.0, [])
    exact, known, mean, own = (values[enough] for values in (exact, known, mean, own))
    spread = np.maximum(own, _pooled(exact, own)) / len(each) + known
    score = (mean - exact) / np.sqrt(spread)
    size = np.abs(score)
    excess = float(np.sum((mean - exact) ** 2 - own / len(each) - known))
    return Agreement(
        len(score),
        float(np.mean(score**2)),
        int(np.count_nonzero(size > SELDOM)),
        int(np.count_nonzero(size > EXTREME)),
        float(np.sqrt(max(excess, 0.0) / np.sum(exact**2))),
        [
            Place(int(columns[i]) * side, int(rows[i]) * side, float(score[i]), float(mean[i] / exact[i] - 1.0))
            for i in np.argsort(-size, kind="stable")[:SHOWN]
        ],
    )


def _blocks(values: np.ndarray, side: int) -> np.ndarray:
    """Sums over side × side; what is left over at the right and at the bottom is left out."""
    height, width = (n // side * side for n in values.shape)
    return values[:height, :width].reshape(height // side, side, width // side, side).sum(axis=(1, 3))


def _pooled(exact: np.ndarray, own: np.ndarray, neighbours: int = 32) -> np.ndarray:
    """Mean of `own` over places of about the same brightness."""
    order = np.argsort(exact)
    sums = np.concatenate([[0.0], np.cumsum(own[order])])
    at = np.arange(len(exact))
    low = np.clip(at - neighbours // 2, 0, None)
    high = np.clip(low + neighbours, None, len(exact))
    smooth = np.empty(len(exact))
    smooth[order] = (sums[high] - sums[low]) / (high - low)
    return smooth


HEAD = (
    f"{'scene':16} {'energy':>8} {'score':>6}   {'pixels':>6} {'chi2':>6} {'>3':>6} {'>5':>6} {'deviation':>9}   "
    f"{'blocks':>6} {'chi2':>6} {'>3':>6} {'>5':>6} {'deviation':>9}  worst block"
)


def line(found: SceneAgreement) -> str:
    """A row under `HEAD`."""
    parts = [f"{found.scene:16} {found.energy:8.5f} {found.energy_score:+6.1f}  "]
    parts += [
        f" {one.places:6d} {one.chi2:6.2f} {_share(one.seldom, one)} {_share(one.extreme, one)} {one.deviation:9.5f}  "
        for one in (found.pixels, found.blocks)
    ]
    worst = found.blocks.worst[:1]
    parts += [f"{place.score:+.1f} ({100 * place.share:+.2f} %) at {(place.column, place.row)}" for place in worst]
    return "".join(parts)


def _share(places: int, of: Agreement) -> str:
    return f"{100.0 * places / max(of.places, 1):5.1f}%"
