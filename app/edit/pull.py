"""Pull a colour: a point of the caustic is dragged, and the dispersion that puts it there is solved for.

To first order light of wavelength λ lands at p(λ) = p(d) + Σ_g D_g (n_g(λ) − n_g(d)), where D_g is the stored
derivative of the landing point by the index of glass g. A glass with gain k has n(λ) − n(d) k times as
large, so the place of a colour is linear in k, and one division solves for it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..base.errors import UserError
from ..model.local_dispersion import MAX_LOG2_GAIN, MIN_LOG2_GAIN, gain_at
from ..model.optics.colorimetry import VISIBLE_NM, cmf_xyz, illuminant_table
from ..model.scene import Dab, Scene, SceneObject, Vec3
from ..model.vectors import vec3
from .brush import object_radius
from .glass import set_dispersion_gain
from .objects import with_dabs
from .state import Pull
from .stored_photons import StoredPhotons

MAX_GAIN = 10.0
_GRID_NM = np.arange(380.0, 781.0, 4.0)
_AROUND_NM = 12.0
"""How far from the wanted wavelength light still counts as it."""
_MAX_CANDIDATES = 2000
_PREFERRED_SHARE = 0.05
"""Share of the light at the point above which the preferred glass is taken."""
_MIN_PURITY = 0.12
_SHORTEST = 0.25
"""Least displacement that can be pulled by, in radii of the point taken."""


def dominant_nm(xyz: np.ndarray) -> float | None:
    """Dominant wavelength of a colour against D65; None for purples and for what is nearly white."""
    total = float(np.sum(xyz))
    if not total > 0.0:
        return None
    cmf = cmf_xyz()
    white = illuminant_table()["D65"] @ cmf
    white_xy, locus = white[:2] / white.sum(), (cmf / cmf.sum(axis=1, keepdims=True))[:, :2]
    way = np.asarray(xyz, float)[:2] / total - white_xy
    rays = locus - white_xy
    along = rays @ way / (np.linalg.norm(rays, axis=1) * max(float(np.linalg.norm(way)), 1e-12))
    best = int(along.argmax())
    purity = float(np.linalg.norm(way) / np.linalg.norm(rays[best]))
    return float(VISIBLE_NM[best]) if along[best] > 0.999 and purity > _MIN_PURITY else None


def begin_pull(
    photons: StoredPhotons,
    scene: Scene,
    point: Vec3 | np.ndarray,
    normal: Vec3 | np.ndarray,
    radius: float,
    receiver_index: int,
    wavelength_nm: float | None = None,
    xyz: np.ndarray | None = None,
    prefer: int | None = None,
    local: bool = False,
) -> Pull:
    """Begin to drag the light within `radius` of a world `point` of a receiver.

    The wavelength is the given one, else the dominant one of the colour `xyz` there, else the mean of what lands.
    `prefer` is the selected object: it is taken where a share of the light comes through it. Raises `UserError`
    with the reason where there is nothing to pull.
    """
    point, normal = np.asarray(point, float), np.asarray(normal, float)
    near = _candidates(photons, point, radius, receiver_index)
    if wavelength_nm is None and xyz is not None:
        wavelength_nm = dominant_nm(xyz)
    weights = _weights(near, point, radius, wavelength_nm)
    if not weights.sum() > 0.0:
        raise UserError("no dispersed light lands here; take hold of a coloured part of a caustic")
    source = _source(near, weights.sum(axis=1), prefer)
    group = near.group_of_object[source]
    weights = np.where((_owner(near) == source)[:, None], weights, 0.0)
    if wavelength_nm is None:
        wavelength_nm = float(weights.sum(axis=0) @ _GRID_NM / weights.sum())
    share = weights.sum(axis=1) / weights.sum()
    moved = share @ near.displacement(wavelength_nm, None if local else group)
    moved = moved - (moved @ normal) * normal
    length = float(np.linalg.norm(moved))
    if length < _SHORTEST * radius:
        raise UserError("the colour here hardly moves with the dispersion; take hold of one nearer to red or violet")
    material = scene.objects[source].material
    reference = point - moved
    receiver = scene.objects[receiver_index]
    pull = Pull(
        source,
        receiver_index,
        vec3(point),
        vec3(reference),
        vec3(moved / length),
        wavelength_nm,
        material.dispersion.gain,
        local,
    )
    return replace(pull, gain_at_start=local_gain(receiver, pull)) if local else pull


def _candidates(photons: StoredPhotons, point: np.ndarray, radius: float, receiver: int) -> StoredPhotons:
    """Photons of the receiver whose band passes within three radii of the point, thinned evenly where there are
    many."""
    index = np.flatnonzero((photons.receiver == receiver) & (photons.flux_w > 0.0))
    if not len(index) or not photons.variables:
        return photons.chosen(index[:0])
    some = photons.chosen(index)
    shift = np.stack([variable(some.band_nm) for variable in some.variables], axis=1) - some.n_anchor[:, :, None]
    start, end = np.moveaxis(some.position[:, None] + np.einsum("ngj,ngw->nwj", some.dposition_dn, shift), 1, 0)
    sweep = end - start
    along = np.einsum("nj,nj->n", point - start, sweep) / np.maximum(np.einsum("nj,nj->n", sweep, sweep), 1e-300)
    nearest = start + np.clip(along, 0.0, 1.0)[:, None] * sweep
    # With several glasses the sweep is bent, so the chord is judged generously.
    reach = 3.0 * radius + (0.1 * np.linalg.norm(sweep, axis=1) if len(some.variables) > 1 else 0.0)
    index = np.flatnonzero(np.linalg.norm(nearest - point, axis=1) < reach)
    return some.chosen(index[:: max(1, len(index) // _MAX_CANDIDATES)])


def _weights(photons: StoredPhotons, point: np.ndarray, radius: float, wavelength_nm: float | None) -> np.ndarray:
    """Share of each photon (n,) and wavelength of `_GRID_NM` in the light at the point: (n, w)."""
    if not len(photons.position):
        return np.zeros((0, len(_GRID_NM)))
    low, high = photons.band_nm[:, :1], photons.band_nm[:, 1:]
    step = _GRID_NM[1] - _GRID_NM[0]
    inside = np.clip(np.minimum(_GRID_NM + 0.5 * step, high) - np.maximum(_GRID_NM - 0.5 * step, low), 0.0, step)
    density = photons.flux_w / np.maximum(photons.band_nm[:, 1] - photons.band_nm[:, 0], 1e-9)
    distance2 = np.sum((photons.landing(_GRID_NM) - point) ** 2, axis=2)
    weights = (
        density[:, None]
        * inside
        * np.exp(np.maximum(-2.0 * distance2 / radius**2, -50.0))
        * (distance2 < (3.0 * radius) ** 2)
    )
    if wavelength_nm is None:
        return weights
    around = weights * (np.abs(_GRID_NM - wavelength_nm) <= _AROUND_NM)
    # A mixed colour's dominant wavelength need not be among the light that lands here.
    return around if around.sum() > 0.0 else weights


def _owner(photons: StoredPhotons) -> np.ndarray:
    """The glass that a photon's colours are owed to, (n,): the object met first, else the one that displaces most."""
    owner = photons.source.astype(np.int64)
    dispersive = np.isin(owner, list(photons.group_of_object))
    if dispersive.all() or not photons.group_of_object:
        return owner
    spans = np.array([float(np.ptp(variable(_GRID_NM))) for variable in photons.variables])
    strongest = (np.linalg.norm(photons.dposition_dn, axis=2) * spans).argmax(axis=1)
    first_of_group = {group: item for item, group in sorted(photons.group_of_object.items(), reverse=True)}
    return np.where(dispersive, owner, [first_of_group.get(int(group), -1) for group in strongest])


def _source(photons: StoredPhotons, weight: np.ndarray, prefer: int | None) -> int:
    owner = _owner(photons)
    sums = {
        int(item): float(weight[owner == item].sum()) for item in np.unique(owner) if item in photons.group_of_object
    }
    if not sums:
        raise UserError("the light here has passed no dispersive glass; choose a glass with dispersion first")
    if prefer is not None and sums.get(prefer, 0.0) > _PREFERRED_SHARE * sum(sums.values()):
        return prefer
    return max(sums, key=sums.__getitem__)


def nearest_on_line(pull: Pull, origin: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """The point of the line that the held colour moves along, nearest to a camera ray (unit `direction`)."""
    start, along = np.asarray(pull.start), np.asarray(pull.direction)
    # Across the ray only: where the line runs towards the camera the cursor says nothing, and the colour stays.
    across = along - (along @ direction) * direction
    square = float(across @ across)
    return start if square < 1e-6 else start + float((origin - start) @ across) / square * along


def solve(pull: Pull, point: Vec3 | np.ndarray) -> float:
    """The gain, 0 to 10, with which the held colour lands where `point` (world) is along the pull's direction."""
    direction, reference = np.asarray(pull.direction), np.asarray(pull.reference)
    held = float((np.asarray(pull.start) - reference) @ direction)
    return float(
        np.clip(pull.gain_at_start * ((np.asarray(point, float) - reference) @ direction) / held, 0.0, MAX_GAIN)
    )


def apply(scene: Scene, pull: Pull, point: Vec3 | np.ndarray, radius: float, falloff: float) -> tuple[Scene, str]:
    """The scene with the colour pulled to `point`, and the edit's name.

    A local pull paints one dab of `radius` (world) where the held light's d line lands, or changes the one it painted
    before.
    """
    gain = solve(pull, point)
    if not pull.local:
        label = f"Pull colour of {scene.objects[pull.object_index].name}"
        return set_dispersion_gain(scene, pull.object_index, gain), label
    receiver = scene.objects[pull.receiver_index]
    dabs = local_dabs(receiver, pull, gain, radius, falloff)
    return with_dabs(scene, pull.receiver_index, dabs), "Pull colour locally"


def local_dabs(receiver: SceneObject, pull: Pull, gain: float, radius: float, falloff: float) -> tuple[Dab, ...]:
    """A receiver's dabs with one at the pull's reference that makes the gain there `gain`."""
    reference = np.asarray(pull.reference)
    place = _to_object(receiver, reference)
    rest = receiver.local_dispersion
    # The dab that this pull laid in the frame before: on the very same place, on top.
    if (
        rest
        and np.allclose(rest[-1].position, place, rtol=0.0, atol=1e-12 * (1.0 + np.abs(place).max()))
        and not rest[-1].erase
    ):
        rest = rest[:-1]
    before = float(np.log2(gain_at(rest, place[None])[0]))
    wanted = float(np.clip(np.log2(max(gain, 1e-9)), MIN_LOG2_GAIN, MAX_LOG2_GAIN))
    return (*rest, Dab(vec3(place), object_radius(receiver, radius), wanted - before, falloff))


def local_gain(receiver: SceneObject, pull: Pull) -> float:
    """The local gain where the held light's d line lands."""
    return float(gain_at(receiver.local_dispersion, _to_object(receiver, np.asarray(pull.reference))[None])[0])


def _to_object(item: SceneObject, point: np.ndarray) -> np.ndarray:
    return np.linalg.solve(item.object_to_world, np.append(point, 1.0))[:3]
