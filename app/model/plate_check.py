"""Whether a caustic plate draws its picture: where it is sharp, how like, how bright, how coloured, how sensitive."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np

from ..base.errors import UserError
from ..base.tone_map import luminance
from .geometry.mesh import Mesh
from .optics.caustic_plate import Plate, landing, plate_of
from .optics.glass import LINE_C_NM, LINE_D_NM, LINE_F_NM, Dispersion

PIXELS = 96
"""Pixels of the longer side at which pictures are compared."""
_ALIGNED = 40_000
"""Samples by which pictures are brought into line."""
_BLUR_PX = 0.7
_BLANK = 1e-2
"""Relative spread of a target that says nothing."""
_GROWTH = 0.1
"""By which the error may grow within the tolerances."""
_SCAN = np.geomspace(0.5, 32.0, 13)
"""Distances that are tried where none is given, widths of the plate."""
_TOLD = 0.9
"""Correlation below which other turns may be as like."""
_MOST_TILT_DEG = 40.0
_EITHER_WAY = 0.005
"""Correlation by which the picture must be better with the shaped side to the light."""
Report = Callable[[float, str], object]
Cancelled = Callable[[], bool]


@dataclass(frozen=True)
class Fit:
    """Where on the screen the target lies."""

    correlation: float
    turn: int
    """Quarter turns counter-clockwise, plus 4 where it is mirrored first."""
    pixel: float
    """Side of a pixel of the compared target, mesh units."""
    centre: tuple[float, float]


@dataclass(frozen=True)
class PlateReport:
    """How a plate draws its target; lengths in the mesh's unit."""

    plate: Plate
    flat_first: bool
    """Whether its picture is that with the flat side to the light."""
    distance: float
    """From the plate's far side to the screen."""
    focal_distance: float
    """Where the picture is most like the target."""
    fit: Fit
    error: float
    """Root mean square difference to the target, of its mean."""
    efficiency: float
    """Share of the light on the plate that lands in the picture."""
    transmitted: float
    width: float
    """Width of the picture on the screen."""
    blur: float
    """Root mean square distance between where F and C light of a place of the plate land."""
    nearer: float
    """How much nearer, and farther, the screen may be before the error grows by a tenth; NaN: cancelled."""
    farther: float
    tilt_deg: float
    """Likewise how far the plate may be tilted, about its more sensitive axis."""
    picture: np.ndarray
    """float64 (h, w), the light in the picture, turned as the target is, of mean 1."""
    target: np.ndarray
    """float64 (h, w), likewise."""

    def rows(self) -> tuple[tuple[str, str], ...]:
        """What it found, in words."""
        quarter, mirrored = self.fit.turn % 4, "mirrored, " if self.fit.turn >= 4 else ""
        sides = ("flat", "shaped") if self.flat_first else ("shaped", "flat")
        turned = mirrored + (f"turned by {90 * quarter}° counter-clockwise" if quarter else "upright")
        if self.fit.correlation < _TOLD:
            turned = "too unlike the target there to tell how it is turned"
        known = [each for each in (self.nearer, self.farther, self.tilt_deg) if math.isfinite(each)]
        held = f"{self.nearer:.4g} nearer to {self.farther:.4g} farther, {self.tilt_deg:.3g}° of tilt"
        return (
            ("plate", f"{self.plate.size[0]:.5g} × {self.plate.size[1]:.5g}, {self.plate.thickness:.4g} thick"),
            ("shaped side", f"{self.plate.side}; picture with the {sides[0]} side to the light"),
            ("picture", f"{turned}, {self.width:.5g} wide, seen from the plate"),
            ("distance", f"{self.distance:.5g}; most like the target at {self.focal_distance:.5g}"),
            (
                "error",
                f"{100.0 * self.error:.1f} % root mean square of the mean; correlation {self.fit.correlation:.4f}",
            ),
            (
                "efficiency",
                f"{100.0 * self.efficiency:.1f} % of the light; {100.0 * self.transmitted:.1f} % is transmitted",
            ),
            ("colour blur", f"{self.blur:.4g} between F and C, {100.0 * self.blur / self.width:.2f} % of the width"),
            ("tolerance", held if len(known) == 3 else "not measured: it was stopped"),
        )

    def pictures(self) -> np.ndarray:
        """The target and, on its right, what the plate draws: float32 (h, 2 w + 2, 3), white is 1.25 times the target's
        brightest."""
        gap = np.zeros((len(self.target), 2))
        grey = np.hstack([self.target, gap, self.picture]) / (1.25 * self.target.max())
        return np.repeat(grey[..., None], 3, axis=2).astype(np.float32)


def check_plate(
    mesh: Mesh,
    glass: Dispersion,
    rgb: np.ndarray,
    distance: float | None = None,
    progress: Report | None = None,
    cancelled: Cancelled | None = None,
) -> PlateReport:
    """Compare the caustic of `mesh` in parallel light with the linear picture `rgb` (h, w, 3), row 0 the top.

    None for `distance`: where it is most like. Raises `UserError` where the mesh is no plate or the picture blank.
    """
    report, stopped = progress or (lambda share, text: None), cancelled or (lambda: False)
    target, plate = _target(rgb), plate_of(mesh, glass)
    coarse = plate.thinned(_ALIGNED)
    given = [distance] if distance is not None else [share * max(plate.size) for share in _SCAN]
    best: tuple[Fit, bool, float] | None = None
    for i, at in enumerate(given):
        report(0.4 * i / len(given), "looking for the picture")
        for flat_first in (True, False):
            fit = _search(*landing(coarse, at, LINE_D_NM, flat_first), target, range(8))
            # Most plates draw alike either way: then the flat side is to the light.
            if best is None or fit.correlation > best[0].correlation + (0.0 if flat_first else _EITHER_WAY):
                best = fit, flat_first, at
        if stopped():
            break
    assert best is not None
    fit, flat_first, at = best

    fits = {at: fit}

    def aligned(place: float, tilt_deg: tuple[float, float] = (0.0, 0.0)) -> Fit:
        near = fits[min(fits, key=lambda known: abs(math.log(known / place)))]
        found = _refined(*landing(coarse, place, LINE_D_NM, flat_first, tilt_deg), target, near)
        return found if any(tilt_deg) else fits.setdefault(place, found)

    report(0.4, "looking for the focus")
    ratio = 2.0 if distance is not None else float(_SCAN[1] / _SCAN[0])
    focus = _peak(lambda place: aligned(place).correlation, at / ratio, at * ratio, stopped)
    at = focus if distance is None else distance
    xy, flux = landing(plate, at, LINE_D_NM, flat_first)
    fit = _refined(xy, flux, target, fits.get(at, fit))
    picture, inside = _shown(xy, flux, target, fit)
    error = _error(picture, target)

    def grown(place: float, tilt_deg: tuple[float, float] = (0.0, 0.0)) -> bool:
        lands = landing(plate, place, LINE_D_NM, flat_first, tilt_deg)
        return _error(_shown(*lands, target, aligned(place, tilt_deg))[0], target) > error + _GROWTH

    tolerances = []
    wanted: tuple[tuple[float, Callable[[float], bool]], ...] = (
        (at, lambda by: grown(at - by)),
        (4.0 * at, lambda by: grown(at + by)),
        (_MOST_TILT_DEG, lambda by: grown(at, (by, 0.0)) or grown(at, (0.0, by))),
    )
    for i, (most, fails) in enumerate(wanted):
        report(0.6 + 0.13 * i, "tilting and moving it")
        tolerances.append(_largest(fails, 0.999 * most, stopped))
    ends = [landing(plate, at, nm, flat_first)[0] for nm in (LINE_F_NM, LINE_C_NM)]
    apart = ((ends[0] - ends[1]) ** 2).sum(axis=1)
    lit = float(plate.facets[:, 2].sum())
    report(1.0, "")
    width = fit.pixel * target.shape[1]
    passed, blur = float(flux.sum()) / lit, math.sqrt(float((flux * apart).sum() / flux.sum()))
    shares, (nearer, farther, tilt) = (error, inside / lit, passed), tolerances
    return PlateReport(plate, flat_first, at, focus, fit, *shares, width, blur, nearer, farther, tilt, picture, target)


# ---- pictures ---------------------------------------------------------------------------------


def _target(rgb: np.ndarray) -> np.ndarray:
    """Its luminance at `PIXELS`, of mean 1. Raises `UserError` for a blank one."""
    from PIL import Image

    grey = np.maximum(luminance(np.asarray(rgb, np.float64)), 0.0)
    h, w = grey.shape
    scale = PIXELS / max(h, w)
    size = (max(1, round(w * scale)), max(1, round(h * scale)))
    method = Image.Resampling.BOX if scale < 1.0 else Image.Resampling.BILINEAR
    small = np.asarray(Image.fromarray(grey.astype(np.float32)).resize(size, method), np.float64)
    mean = float(small.mean())
    if min(small.shape) < 4 or mean <= 0.0 or small.std() < _BLANK * mean:
        raise UserError(
            "the target picture is blank or a line, which any plate draws; give the picture it was made for"
        )
    return _smooth(small / mean)


def _smooth(picture: np.ndarray) -> np.ndarray:
    from scipy.ndimage import gaussian_filter

    return np.asarray(gaussian_filter(picture, _BLUR_PX, mode="nearest"))


def _turned(picture: np.ndarray, turn: int) -> np.ndarray:
    return np.rot90(picture[:, ::-1] if turn >= 4 else picture, turn % 4)


def _turned_back(picture: np.ndarray, turn: int) -> np.ndarray:
    back = np.rot90(picture, -(turn % 4))
    return back[:, ::-1] if turn >= 4 else back


def _deposited(
    xy: np.ndarray, flux: np.ndarray, shape: tuple[int, int], pixel: float, centre: np.ndarray
) -> np.ndarray:
    """Light on a grid of pixels, shared bilinearly, as seen from the plate: x to the left, y up; float64 `shape`."""
    h, w = shape
    column = 0.5 * w - 0.5 - (xy[:, 0] - centre[0]) / pixel
    row = 0.5 * h - 0.5 - (xy[:, 1] - centre[1]) / pixel
    keep = (column > -1.0) & (column < w) & (row > -1.0) & (row < h)
    column, row, flux = column[keep] + 1.0, row[keep] + 1.0, flux[keep]
    i, j = row.astype(np.int64), column.astype(np.int64)
    fi, fj = row - i, column - j
    grid = np.zeros((h + 2) * (w + 2))
    for di, dj, share in ((0, 0, (1 - fi) * (1 - fj)), (0, 1, (1 - fi) * fj), (1, 0, fi * (1 - fj)), (1, 1, fi * fj)):
        grid += np.bincount((i + di) * (w + 2) + j + dj, flux * share, len(grid))
    return grid.reshape(h + 2, w + 2)[1:-1, 1:-1]


def _shown(xy: np.ndarray, flux: np.ndarray, target: np.ndarray, fit: Fit) -> tuple[np.ndarray, float]:
    """The picture of light that lands, turned as the target is and of mean 1, and how much light is in it."""
    light = _deposited(xy, flux, _turned(target, fit.turn).shape, fit.pixel, np.array(fit.centre))
    grid = _smooth(light)
    return _turned_back(grid / max(float(grid.mean()), 1e-300), fit.turn), float(light.sum())


def _error(picture: np.ndarray, target: np.ndarray) -> float:
    return float(np.sqrt(((picture - target) ** 2).mean()))


# ---- alignment --------------------------------------------------------------------------------


def _search(xy: np.ndarray, flux: np.ndarray, target: np.ndarray, turns: Iterable[int]) -> Fit:
    """The best of `turns`, of sizes about that which spreads the light as the target does, and of all places."""
    from scipy.signal import fftconvolve

    lit = flux > 0.0
    if not lit.any():
        return Fit(-1.0, 0, 1.0, (0.0, 0.0))
    low, high = np.percentile(xy[lit], (0.5, 99.5), axis=0)
    kept = lit & ((xy >= low) & (xy <= high)).all(axis=1)
    centre = np.average(xy[kept], axis=0, weights=flux[kept])
    spread = math.sqrt(float(np.average(((xy[kept] - centre) ** 2).sum(axis=1), weights=flux[kept])))
    rows, columns = (np.arange(side) - 0.5 * (side - 1) for side in target.shape)
    r2 = (rows[:, None] - np.average(rows, weights=target.sum(axis=1))) ** 2 + (
        columns - np.average(columns, weights=target.sum(axis=0))
    ) ** 2
    usual = max(spread, 1e-12) / math.sqrt(float(np.average(r2, weights=target)))
    side = 2 * max(target.shape)
    best = Fit(-1.0, 0, usual, (float(centre[0]), float(centre[1])))
    for pixel in usual * np.geomspace(0.7, 1.4, 13):
        grid = _smooth(_deposited(xy, flux, (side, side), pixel, centre))
        for turn in turns:
            wanted = _turned(target, turn)
            wanted = wanted - wanted.mean()
            box = np.ones(wanted.shape)
            sums, squares = (fftconvolve(each, box, "valid") for each in (grid, grid**2))
            spread_there = np.sqrt(np.maximum(squares - sums**2 / wanted.size, 1e-6 * squares.max()))
            score = fftconvolve(grid, wanted[::-1, ::-1], "valid") / (spread_there * np.linalg.norm(wanted))
            i, j = np.unravel_index(int(score.argmax()), score.shape)
            if score[i, j] > best.correlation:
                away = np.array([j + 0.5 * wanted.shape[1], i + 0.5 * wanted.shape[0]]) - 0.5 * side
                best = Fit(float(score[i, j]), turn, float(pixel), tuple((centre - pixel * away).tolist()))
    return best


def _refined(xy: np.ndarray, flux: np.ndarray, target: np.ndarray, start: Fit) -> Fit:
    """`start` with size and place improved to parts of a pixel."""
    from scipy.optimize import minimize

    wanted = _turned(target, start.turn)
    wanted = (wanted - wanted.mean()) / np.linalg.norm(wanted - wanted.mean())

    def place(change: np.ndarray) -> Fit:
        x, y = (start.centre[k] + start.pixel * float(change[1 + k]) for k in (0, 1))
        return replace(start, pixel=start.pixel * math.exp(0.02 * float(change[0])), centre=(x, y))

    def loss(change: np.ndarray) -> float:
        fit = place(change)
        grid = _smooth(_deposited(xy, flux, wanted.shape, fit.pixel, np.array(fit.centre)))
        grid = grid - grid.mean()
        norm = float(np.linalg.norm(grid))
        return -float((grid * wanted).sum()) / norm if norm > 0.0 else 1.0

    simplex = np.vstack([np.zeros(3), np.eye(3)])
    found = minimize(loss, np.zeros(3), method="Nelder-Mead", options={"maxfev": 45, "initial_simplex": simplex})
    return replace(place(found.x), correlation=-float(found.fun))


def _peak(of: Callable[[float], float], low: float, high: float, stopped: Cancelled) -> float:
    """Where `of` is largest between two distances: by a few, then between the neighbours of the best of them."""
    for count in (9, 7, 7):
        places = np.geomspace(low, high, count)
        outward = np.argsort(np.abs(np.arange(count) - count // 2))  # each begins with what its neighbour found
        scores = np.empty(count)
        for i in outward:
            scores[i] = of(float(places[i]))
        at = int(np.argmax(scores))
        low, high = places[max(at - 1, 0)], places[min(at + 1, count - 1)]
        if stopped():
            break
    return float(places[at])


def _largest(fails: Callable[[float], bool], most: float, stopped: Cancelled) -> float:
    """The largest value up to `most` that does not fail, to a twentieth; NaN where it was cancelled."""
    low, high = 0.0, most / 64.0
    while not stopped() and not fails(high):
        low = high
        if high >= most:
            return most
        high = min(2.0 * high, most)
    while not stopped() and high - low > 0.05 * high:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if fails(middle) else (middle, high)
    return math.nan if stopped() else low
