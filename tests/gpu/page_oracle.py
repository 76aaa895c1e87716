"""What a page's data say (docs/pages.md), evaluated by numpy: independent of the page's own scripts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from spectrasplat.model.optics.spectrum import Spectrum

Arrays = Mapping[str, np.ndarray]
Head = Mapping[str, Any]
SAMPLES = 4097
EDGES = np.concatenate([[380.0], np.arange(380.0, 780.0) + 0.5, [780.0]])
NM = np.arange(380.0, 781.0)
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
SUB, PARTS, CUT = 4, 48, 3.5
"""Sub-places of a texel along its side for polygons; most parts of a photon; deviations up to which it is drawn."""
AT_ONCE = 1 << 21
"""Values held at a time."""


def energies(arrays: Arrays, head: Head, observer: np.ndarray, light: Spectrum, index: np.ndarray | None) -> np.ndarray:
    """(SAMPLES, 6) below x, where glass of `index` (401,) is shown: light, linear Rec.709; its luminance, and that
    times x and x²."""
    if head["mode"] == "index":
        assert index is not None
        x = (np.interp(EDGES, NM, index) - head["n_at_0"]) / (head["n_at_1"] - head["n_at_0"])
    else:
        x = np.interp(EDGES, arrays["nm"], np.linspace(0.0, 1.0, len(arrays["nm"])))
    colours = (light.density * arrays.get("reflectance", 1.0) * np.diff(EDGES))[:, None] * observer
    places = np.linspace(0.0, 1.0, SAMPLES)
    middle = 0.5 * (x[:-1] + x[1:])
    below = np.concatenate([np.zeros((1, 6)), np.cumsum(_with_moments(colours, middle), axis=0)])
    found = np.stack([np.interp(places, x, column) for column in below.T], axis=1)
    for nm, watts in light.lines:
        colour = np.array([np.interp(nm, NM, column) for column in observer.T])
        at = np.atleast_1d(np.interp(nm, EDGES, x))
        found += (places >= at)[:, None] * _with_moments(watts * colour[None], at)
    return found


def _with_moments(colours: np.ndarray, x: np.ndarray) -> np.ndarray:
    brightness = colours @ LUMINANCE
    return np.concatenate([colours, np.stack([brightness, brightness * x, brightness * x**2], axis=1)], axis=1)


def irradiance(
    arrays: Arrays,
    head: Head,
    observer: np.ndarray,
    lights: Sequence[Spectrum],
    index: Sequence[np.ndarray],
    window: tuple[np.ndarray, np.ndarray],
    shape: tuple[int, int],
) -> np.ndarray:
    """(H, W, 3) lm/unit² on the rectangle from `window[0]` to `window[1]` of the plane, v upwards along rows; `index`:
    (401,) of the glass shown for each spectral group."""
    own = index[0] if head["mode"] == "index" else None
    tables = [energies(arrays, head, observer, light, own) for light in lights]
    low, texel = window[0], (window[1] - window[0]) / (shape[1], shape[0])
    found = np.zeros((*shape, 3))
    _add_photons(found, arrays, head, tables, index, low, texel)
    if "beams.x" in arrays:
        _add_beams(found, arrays, tables, low, texel)
    return found


def _at(table: np.ndarray, x: np.ndarray) -> np.ndarray:
    places = np.linspace(0.0, 1.0, len(table))
    return np.stack([np.interp(x, places, column) for column in table.T], axis=-1)


def _add_photons(
    found: np.ndarray,
    arrays: Arrays,
    head: Head,
    tables: Sequence[np.ndarray],
    index: Sequence[np.ndarray],
    low: np.ndarray,
    texel: np.ndarray,
) -> None:
    x = arrays["photons.x"] / 65535.0
    if not len(x):
        return
    if head["mode"] == "index":
        traced = shown = np.array([[head["n_at_0"], head["n_at_1"]]])
    else:
        traced = arrays["variable"].astype(float)
        shown = np.array([np.interp(arrays["nm"], NM, n) for n in index])
    change = arrays["photons.dposition_dn"].astype(float)
    anchors = _at(traced.T, x[:, 1])
    ends = [
        arrays["photons.position"] + ((_at(shown.T, x[:, k]) - anchors)[..., None] * change).sum(axis=1) for k in (0, 2)
    ]
    smoothing = head["photons"]["smoothing"]
    axes = smoothing * np.stack([arrays["photons.axis_s"], arrays["photons.axis_t"]], axis=1).astype(float)
    weights = arrays["photons.throughput"].astype(float) * head["photons"]["unit"]
    sweep = np.linalg.norm((ends[1] - ends[0]) / texel, axis=1)
    parts = np.clip(np.ceil(sweep), 1, PARTS).astype(int)
    for count in np.unique(parts):
        mine = np.flatnonzero(parts == count)
        for k in range(count):
            a, b = (x[mine, 0] + share * (x[mine, 2] - x[mine, 0]) for share in (k / count, (k + 1) / count))
            light = np.zeros((len(mine), 6))
            for i, table in enumerate(tables):
                of = arrays["photons.light"][mine] == i
                light[of] = _at(table, b[of]) - _at(table, a[of])
            # Where in its part the light is, and how far it spreads.
            power = np.maximum(light[:, 3], 1e-30)
            middle = np.clip(np.where(light[:, 3] > 1e-30, light[:, 4] / power, 0.5 * (a + b)), a, b)
            spread = np.clip(light[:, 5] / power - middle**2, 0.0, (b - a) ** 2 / 4.0)
            first, anchor, last = x[mine].T
            below = np.clip((middle - first) / np.maximum(anchor - first, 1e-12), 0.0, 1.0)
            above = np.clip((middle - anchor) / np.maximum(last - anchor, 1e-12), 0.0, 1.0)
            w = weights[mine]
            weight = w[:, 0] + below * (w[:, 1] - w[:, 0]) + above * (w[:, 2] - w[:, 1])
            along = (ends[1] - ends[0])[mine] / np.maximum(last - first, 1e-12)[:, None]
            place = ends[0][mine] + (middle - first)[:, None] * along
            step = along * np.sqrt(spread)[:, None]
            wide = np.einsum("nki,nkj->nij", axes[mine], axes[mine]) + step[:, :, None] * step[:, None]
            _splat(
                found,
                (place - low) / texel,
                wide / np.outer(texel, texel),
                weight[:, None] * light[:, :3] / texel.prod(),
            )


def _splat(found: np.ndarray, place: np.ndarray, wide: np.ndarray, light: np.ndarray) -> None:
    """Gaussians about `place` (n, 2), texels, of covariance `wide`, averaged over texels."""
    lit = np.abs(light).sum(axis=1) > 0.0
    place, wide, light = place[lit], wide[lit] + np.eye(2) / 12.0, light[lit]
    reach = np.ceil(CUT * np.sqrt(np.trace(wide, axis1=1, axis2=2)))
    reach = np.minimum(2.0 ** np.ceil(np.log2(reach)), max(found.shape)).astype(int)
    for side in np.unique(reach):
        _splat_within(found, *(values[reach == side] for values in (place, wide, light)), int(side))


def _splat_within(found: np.ndarray, place: np.ndarray, wide: np.ndarray, light: np.ndarray, reach: int) -> None:
    inverse, determinant = np.linalg.inv(wide), np.linalg.det(wide)
    height, width = found.shape[:2]
    steps = np.arange(-reach, reach + 1)
    for first in range(0, len(place), max(AT_ONCE // len(steps) ** 2, 1)):
        some = slice(first, first + max(AT_ONCE // len(steps) ** 2, 1))
        nearest = np.floor(place[some])
        x, y = (nearest[:, k, None] + steps for k in (0, 1))
        u, v = (x + 0.5 - place[some, 0, None])[:, None], (y + 0.5 - place[some, 1, None])[:, :, None]
        a, b, c = inverse[some, 0, 0], inverse[some, 0, 1], inverse[some, 1, 1]
        power = a[:, None, None] * u * u + 2.0 * b[:, None, None] * u * v + c[:, None, None] * v * v
        share = np.exp(-0.5 * power) / (2.0 * np.pi * np.sqrt(determinant[some]))[:, None, None]
        if reach <= 4:
            share /= share.sum(axis=(1, 2), keepdims=True)
        inside = ((x >= 0) & (x < width))[:, None] & ((y >= 0) & (y < height))[:, :, None]
        at = (np.clip(y, 0, height - 1)[:, :, None] * width + np.clip(x, 0, width - 1)[:, None]).astype(int)
        for k in range(3):
            summed = np.bincount(at[inside], (share * light[some, k, None, None])[inside], height * width)
            found[..., k] += summed.reshape(height, width)


def _add_beams(
    found: np.ndarray, arrays: Arrays, tables: Sequence[np.ndarray], low: np.ndarray, texel: np.ndarray
) -> None:
    height, width = found.shape[:2]
    edges = arrays["beams.edge"].astype(float).reshape(-1, 2, 4)
    for m, (first, last) in enumerate(arrays["beams.x"].astype(float)):
        hull = arrays["beams.hull"][arrays["beams.hull_first"][m] : arrays["beams.hull_first"][m + 1]]
        box = (np.stack([hull.min(axis=0), hull.max(axis=0)]) - low) / texel
        i0, j0 = np.maximum(np.floor(box[0]), 0).astype(int)
        i1, j1 = np.minimum(np.ceil(box[1]), (width, height)).astype(int)
        if i1 <= i0 or j1 <= j0:
            continue
        u = low[0] + (i0 + (np.arange(SUB * (i1 - i0)) + 0.5) / SUB) * texel[0]
        v = low[1] + (j0 + (np.arange(SUB * (j1 - j0)) + 0.5) / SUB) * texel[1]
        places = np.stack([*np.meshgrid(u, v), np.ones((len(v), len(u)))], axis=-1)
        begins, ends = np.zeros(places.shape[:2]), np.ones(places.shape[:2])
        for at_first, at_last in edges[arrays["beams.first"][m] : arrays["beams.first"][m + 1]]:
            a, b = places @ at_first[:3], places @ at_last[:3]
            crossing = a / np.where(a == b, 1.0, a - b)
            begins = np.where(a < 0.0, np.where(b < 0.0, 2.0, np.maximum(begins, crossing)), begins)
            ends = np.where((b < 0.0) & (a >= 0.0), np.minimum(ends, crossing), ends)
        ends = np.maximum(ends, begins)
        t, (at_0, at_half, at_1) = 0.5 * (begins + ends), arrays["beams.density"][m].astype(float)
        density = at_0 + t * (4.0 * at_half - 3.0 * at_0 - at_1 + t * 2.0 * (at_0 + at_1 - 2.0 * at_half))
        tilt = 1.0 + (places[..., :2] - arrays["beams.centre"][m]) @ arrays["beams.slope"][m]
        table = tables[arrays["beams.light"][m]]
        lit = _at(table, first + np.minimum(ends, 1.0) * (last - first))
        lit -= _at(table, first + np.minimum(begins, 1.0) * (last - first))
        lit = lit[..., :3] * (density * np.maximum(tilt, 0.0))[..., None]
        found[j0:j1, i0:i1] += lit.reshape(j1 - j0, SUB, i1 - i0, SUB, 3).mean(axis=(1, 3))
