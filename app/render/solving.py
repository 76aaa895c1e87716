"""Which glass, and which numbers of a scene, cast the light that is wanted: least squares by derivatives of its map.

How bright it is is never compared, only how it is spread over places and colours. Far from the answer both pictures are
blurred, so that a colour is still drawn to its place from several widths away.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np

from ..base.errors import UserError
from ..base.generators import part_of
from ..base.tone_map import luminance
from ..edit.glass import set_dispersion
from ..edit.parameters import Stage, value_of
from ..edit.solved import Fit, Match, Ranked
from ..gpu.context import Context
from ..gpu.shader import forget_programs, keep_programs
from ..model.optics import catalogue, glass
from ..model.optics.glass import Dispersion
from ..model.settings import RenderSettings
from ..passes.picture_channels import Channels
from .bake import placement
from .frames import FrameRenderer, Picture
from .gradient import INDEX, Gradient, gradient, nudged
from .light_target import Target, wanted

T = TypeVar("T")
_SCANNED, _LEVELS, _TRIED = 20, 5, 1 << 15
"""Glasses that are tried at first after the scene's own, and next to the nearest; how often more; photons of each."""
_NEAR, _LIT, _HARDLY = 0.3, 0.6, 0.95
"""What their blurred light may differ by, of the scene's own glass, of one of some and of one of many, to begin with
it."""
_ALIKE = 0.01
"""The same of a width, which glasses of any n_d may have."""
_BLURS = (0.12, 0.04, 0.0)
"""Standard deviations, of the target's longer side."""
_STEPS = 8
"""With each blur, at most."""
_TRUST = 0.5
"""Largest change, as a share of the picture's norm, that a linear prediction is believed."""
_NO_COLOURS = (
    "the target says nothing about a glass, for no dispersed light falls there: give a place where colours spread"
)
_AT_ENDS = 0.5
"""Light at a line's end over the brightest on it, from which on its width is not that of the light."""
_SAYS_NOTHING = 1e-3
"""Share of the picture's norm that five Abbe numbers must change."""


@dataclass
class Solver:
    """Light of one scene compared with a target."""

    context: Context
    stage: Stage
    settings: RenderSettings
    """Of the rendering."""
    target: Target
    _steps: dict[str, float] = field(default_factory=dict)
    """Found for parameters so far."""

    # ---- numbers of the scene ----------------------------------------------------------------

    def fit(self, paths: Sequence[str]) -> Generator[float, None, Fit]:
        """Gauss and Newton's method from the scene as it is, pausing with the share done."""
        at, taken = np.zeros(len(paths)), 0
        if self.target.width is not None and len(paths) > 1:
            raise UserError("a width fixes one number only: give one parameter")
        for number, blur in enumerate(self._blurs):
            for step in range(_STEPS):
                begun = (number + step / _STEPS) / len(self._blurs)
                columns = yield from part_of(self._columns(at, paths, blur), begun, 1.0 / (len(self._blurs) * _STEPS))
                move, covariance, error = self._solved(columns, blur)
                taken += 1
                light = max(float(np.linalg.norm(columns[:, 0])), 1e-300)
                size = float(np.linalg.norm(columns[:, 1:] @ move)) / light
                # Those that do nearly the same must not run away against each other.
                most = float((np.linalg.norm(columns[:, 1:], axis=0) * np.abs(move)).max()) / light
                at = at + move * min(1.0, _TRUST / max(most, size, 1e-12))
                if size < 1e-3 or (blur and size < 0.05):
                    break
        self._check_ends(columns)
        start = {path: 0.0 if path.endswith(f".{INDEX}") else value_of(self.stage, path) for path in paths}
        values = {path: start[path] + float(change) for path, change in zip(paths, at, strict=True)}
        deviations = dict(zip(paths, np.sqrt(np.diag(covariance)).tolist(), strict=True))
        return Fit(values, deviations, covariance, error, taken)

    def _columns(self, at: np.ndarray, paths: Sequence[str], blur: float) -> Generator[float, None, np.ndarray]:
        """The light (n, 1 + paths) of the scene moved by `at`, and its derivatives."""
        stage = self.stage
        for path, change in zip(paths, at, strict=True):
            stage = nudged(stage, path, float(change)) if change else stage
        found = yield from self._gradient(stage, paths)
        pictures = [found.base, *(each.picture for each in found.derivatives)]
        return np.stack([self._colours(p, found.placement, blur).ravel() for p in pictures], axis=-1)

    # ---- glasses -----------------------------------------------------------------------------

    def match(self, index: int, count: int = 10) -> Generator[float, None, Match]:
        """The glasses that object `index` may be of, pausing with the share done. Raises `UserError` where the target
        says nothing."""
        entries = [e for e in catalogue.entries() if e.dispersion.is_dispersive and self._may_be(index, e.dispersion)]
        curves = np.stack([_at_bins(entry.dispersion, self._edges) for entry in entries])
        start = yield from self._scanned(index, entries, curves)
        known: dict[int, Gradient] = {}
        names = [entry.qualified_name for entry in entries]
        best, errors, columns = start, np.zeros(0), np.zeros((0, 0))

        def derived(number: int) -> Generator[float, None, Gradient]:
            if number not in known:
                its = set_dispersion(self.stage.scene, index, entries[number].dispersion)
                steps = self._gradient(replace(self.stage, scene=its), [f"objects.{its.objects[index].name}.{INDEX}"])
                known[number] = yield from part_of(steps, min(0.42 + 0.05 * len(known), 0.8), 0.05)
            return known[number]

        for blur in self._blurs:
            seen: set[int] = set()
            while best not in seen and len(seen) < _STEPS:
                seen.add(best)
                columns = self._by_bin((yield from derived(best)), blur)
                if not errors.size:
                    self._check(columns, entries[best].dispersion)
                errors = self._errors(columns, curves - curves[best], blur)
                last, best = best, int(np.argmin(errors))
            best = last if len(seen) == _STEPS else best
        tried = _neighbours(known[best], curves - curves[best])
        errors[tried] = yield from part_of(self._lit(index, [entries[i] for i in tried], 0.0), 0.85, 0.1)
        if (best := int(np.argmin(errors))) not in known:
            columns = self._by_bin((yield from derived(best)), 0.0)
        self._check_ends(columns)
        if not errors.min() < _HARDLY:
            raise UserError(
                f"no glass was found that casts such light there; the last that was tried is {names[best]}: give the "
                "scene's object a glass whose light falls nearer to it"
            )
        order = np.argsort(errors, kind="stable")[: min(count, int(np.isfinite(errors).sum()))]
        ranked = tuple(
            Ranked(names[i], entries[i].dispersion.n_d, entries[i].dispersion.V_d, float(errors[i])) for i in order
        )
        return Match(ranked, self._around(columns, entries[best].dispersion))

    def _may_be(self, index: int, dispersion: Dispersion) -> bool:
        """Whether its data hold for every light of the scene."""
        try:
            set_dispersion(self.stage.scene, index, dispersion)
        except UserError:
            return False
        return True

    def _scanned(
        self, index: int, entries: Sequence[catalogue.Entry], curves: np.ndarray
    ) -> Generator[float, None, int]:
        """The glass whose blurred light is nearest: the scene's own; or one of some spread over n_d, of more as long as
        none lights the target, and from there on over those next to it. Raises `UserError` where none does."""
        errors: dict[int, float] = {}
        near = _NEAR if self.target.width is None else _ALIKE

        def nearest(chosen: Sequence[int] | np.ndarray) -> Generator[float, None, int]:
            fresh = [int(i) for i in chosen if int(i) not in errors]
            steps = self._lit(index, [entries[i] for i in fresh], _BLURS[0])
            found = yield from part_of(steps, 0.4 * len(errors) / 700, 0.02)
            errors.update(zip(fresh, found, strict=True))
            return min(errors, key=errors.__getitem__)

        own = _at_bins(self.stage.scene.objects[index].material.dispersion, self._edges)
        best = yield from nearest([int(np.abs(curves - own).max(axis=1).argmin())])
        if errors[best] < near:
            return best
        by_index = np.argsort([entry.dispersion.n_d for entry in entries])
        for level in range(_LEVELS):
            ranks = np.linspace(0.01, 0.99, _SCANNED << level) * (len(entries) - 1)
            best = yield from nearest(by_index[ranks.astype(int)])
            if errors[best] < _LIT:
                break
        last = -1
        while last != best and _NEAR <= errors[best] < _HARDLY:
            last = best
            best = yield from nearest(np.argsort(np.abs(curves - curves[best]).max(axis=1))[:_SCANNED])
        if errors[best] < _HARDLY:
            return best
        raise UserError("no glass of the catalogue casts such light there: is the target's place right, and its scene?")

    def _lit(self, index: int, entries: Sequence[catalogue.Entry], blur: float) -> Generator[float, None, list[float]]:
        """What the light of each glass, blurred of few photons, differs by from the target."""
        settings, errors = self._settings, []
        if blur:
            settings = replace(settings, photons=min(settings.photons or _TRIED, _TRIED))
        blur = blur if self.target.width is None else 0.0
        for number, entry in enumerate(entries):
            stage = replace(self.stage, scene=set_dispersion(self.stage.scene, index, entry.dispersion))
            # A renderer each: the spectral axis of several is coarse where some do not disperse.
            renderer = FrameRenderer(self.context, settings, [stage], window=self.target.window)
            try:
                for share in renderer.steps(stage):
                    yield (number + share) / len(entries)
                shown = self._colours(renderer.picture, placement(renderer.light), blur).ravel()
            finally:
                renderer.release()
            errors.append(float(self._errors(shown[:, None], np.zeros((1, 0)), blur)[0]))
        return errors

    def _by_bin(self, found: Gradient, blur: float) -> np.ndarray:
        """The light (n, 1 + bins) and its derivatives by the index in each bin."""
        derivative = found.derivatives[0].picture
        assert derivative.spectral is not None
        alone = derivative.spectral[..., None, :] * np.eye(self.target.bins, dtype=np.float32)
        columns = [self._colours(found.base, found.placement, blur).ravel()]
        for b in range(self.target.bins):
            its = Picture(derivative.rgb, np.ascontiguousarray(alone[..., b, :]), derivative.bin_edges_nm)
            columns.append(self._colours(its, found.placement, blur).ravel())
        return np.stack(columns, axis=-1)

    def _check(self, columns: np.ndarray, dispersion: Dispersion) -> None:
        """Raise `UserError` where another dispersion would look the same."""
        shapes = _shapes(dispersion, self._edges)
        if self.target.width is not None:
            found, turned = self._widths(columns, np.stack([np.zeros_like(shapes[1]), 5.0 * shapes[1]]))
            if not abs(turned - found) > _SAYS_NOTHING * found:
                raise UserError(_NO_COLOURS)
            return
        others = np.stack([columns[:, 0], columns[:, 1:] @ shapes[0]], axis=1)
        moved = 5.0 * columns[:, 1:] @ shapes[1]
        rest = moved - others @ np.linalg.lstsq(others, moved, rcond=None)[0]
        if not np.linalg.norm(rest) > _SAYS_NOTHING * np.linalg.norm(columns[:, 0]):
            raise UserError(_NO_COLOURS)

    def _around(self, columns: np.ndarray, dispersion: Dispersion) -> Fit:
        """n_d and V_d near those of a glass."""
        shapes = _shapes(dispersion, self._edges)
        both = np.stack([columns[:, 0], *(columns[:, 1:] @ shape for shape in shapes)], axis=1)
        if self.target.width is not None:  # which n_d, it does not say
            move, covariance, error = self._solved(both[:, ::2], 0.0)
            move, covariance = np.append(0.0, move), np.full((2, 2), np.nan)
        else:
            move, covariance, error = self._solved(both, 0.0)
        values = {"n_d": dispersion.n_d + float(move[0]), "V_d": dispersion.V_d + float(move[1])}
        deviations = dict(zip(values, np.sqrt(np.diag(covariance)).tolist(), strict=True))
        return Fit(values, deviations, covariance, error, 1)

    # ---- light -------------------------------------------------------------------------------

    @property
    def _settings(self) -> RenderSettings:
        return self.target.settings(self.settings)

    @property
    def _edges(self) -> np.ndarray:
        return np.linspace(380.0, 780.0, self.target.bins + 1)

    def _gradient(self, stage: Stage, paths: Sequence[str]) -> Generator[float, None, Gradient]:
        found = yield from gradient(self.context, stage, self._settings, paths, self._steps, self.target.window)
        self._steps |= {each.path: each.step for each in found.derivatives}
        return found

    def _colours(self, picture: Picture, placement: object, blur: float) -> np.ndarray:
        """A picture in the target's cells and channels."""
        assert picture.spectral is not None
        cells = self.target.seen(picture.spectral, placement)
        if self.target.bin_edges_nm is None:
            cells = Channels(tuple(self._edges.tolist())).to_rgb709(cells).astype(float)
        return _blurred(cells, blur)

    # ---- what is compared --------------------------------------------------------------------

    @property
    def _blurs(self) -> tuple[float, ...]:
        return _BLURS if self.target.width is None else (0.0,)

    def _errors(self, columns: np.ndarray, moves: np.ndarray, blur: float) -> np.ndarray:
        """Of `moves` (m, k): see `_errors`; of a width what it differs by, relative."""
        if self.target.width is None:
            return _errors(columns, self._wanted(blur), moves)
        found = self._widths(columns, moves)
        size = np.linalg.norm(columns[:, 1:] @ moves.T, axis=0)
        believed = np.isfinite(found) & (size <= _TRUST * np.linalg.norm(columns[:, 0]))
        return np.where(believed, np.abs(found / self.target.width - 1.0), np.inf)

    def _widths(self, columns: np.ndarray, moves: np.ndarray) -> np.ndarray:
        """Widths of the light moved by `moves` (m, k), as shares of the line."""
        light = columns[:, :1] + columns[:, 1:] @ moves.T
        return width_of(luminance(light.T.reshape(len(moves), -1, 3)))

    def _check_ends(self, columns: np.ndarray) -> None:
        """Raise `UserError` where a width is that of the line, not of the light."""
        if self.target.width is None:
            return
        light = luminance(columns[:, 0].reshape(-1, 3))
        if light[[0, -1]].max() > _AT_ENDS * light.max():
            raise UserError("light reaches an end of that line, which cuts its width: give a line that holds it all")

    def _solved(self, columns: np.ndarray, blur: float) -> tuple[np.ndarray, np.ndarray, float]:
        """See `_least_squares`; of a width the one move that makes it, whose variance is not known."""
        if self.target.width is None:
            return _least_squares(columns, self._wanted(blur))
        h = 1e-2 * np.linalg.norm(columns[:, 0]) / max(float(np.linalg.norm(columns[:, 1])), 1e-300)
        low, found, high = self._widths(columns, np.array([[-h], [0.0], [h]]))
        if not abs(high - low) > 1e-9:
            length = float(np.linalg.norm(self.target.corners[1] - self.target.corners[0]))
            stays = f"stays {length * found:.4g}" if np.isfinite(found) else "is not known, for no light falls there"
            raise UserError(f"no such width was found: on that line it {stays}, whatever changes")
        move = np.array([(self.target.width - found) * 2.0 * h / (high - low)])
        return move, np.full((1, 1), np.nan), abs(float(found) / self.target.width - 1.0)

    def _wanted(self, blur: float) -> np.ndarray:
        return _blurred(self.target.values.astype(float), blur).ravel()


def solution(
    context: Context,
    stage: Stage,
    settings: RenderSettings,
    receiver: str,
    values: np.ndarray | None,
    between: Sequence[Sequence[float]] | None,
    width: float | None,
    work: Callable[[Solver], Generator[float, None, T]],
) -> Generator[float, None, T]:
    """What `work` finds for the target that `wanted` makes of the rest, pausing with the share done."""
    its = wanted(context, stage, settings, receiver, values, between, width)
    keep_programs(context.ctx)
    try:
        target = yield from part_of(its, 0.0, 0.05)
        return (yield from part_of(work(Solver(context, stage, settings, target)), 0.05, 0.95))
    finally:
        forget_programs(context.ctx)


def _neighbours(found: Gradient, moves: np.ndarray) -> np.ndarray:
    """Numbers of the `moves` (m, bins) of the index that change the light least. In no bin it changes by more than all
    of it: glasses may be far apart in the violet alone, beyond some makers' data."""
    derivative, base = found.derivatives[0].picture.spectral, found.base.spectral
    assert derivative is not None and base is not None
    moved = np.abs(moves) * np.linalg.norm(derivative, axis=(0, 1))
    changes = np.minimum(moved, np.linalg.norm(base, axis=(0, 1)))
    return np.argsort((changes**2).sum(axis=1), kind="stable")[:_SCANNED]


def width_of(light: np.ndarray) -> np.ndarray:
    """Full width at half maximum (m,) of the light (m, cells) along lines, as a share of the line: between the
    outermost places that are half as bright as the brightest; NaN where no light is."""
    found = np.full(len(light), np.nan)
    for row, its in enumerate(np.pad(light, ((0, 0), (1, 1)))):
        half = 0.5 * its.max()
        if half > 0.0:
            lit = np.flatnonzero(its >= half)
            first, last = lit[0], lit[-1]
            before = (its[first] - half) / (its[first] - its[first - 1])
            after = (its[last] - half) / (its[last] - its[last + 1])
            found[row] = (last - first + before + after) / light.shape[1]
    return found


def _blurred(cells: np.ndarray, share: float) -> np.ndarray:
    from scipy.ndimage import gaussian_filter

    sigma = share * max(cells.shape[:2])
    return gaussian_filter(cells, (sigma, sigma, 0.0), mode="nearest") if sigma > 0.0 else cells


def _at_bins(dispersion: Dispersion, edges: np.ndarray) -> np.ndarray:
    """Mean index in every bin."""
    within = (np.arange(4) + 0.5) / 4.0
    return dispersion.index(edges[:-1, None] + within * np.diff(edges)[:, None]).mean(axis=1)


def _shapes(dispersion: Dispersion, edges: np.ndarray) -> np.ndarray:
    """How the index in every bin changes with n_d and with V_d (2, bins)."""
    n_d, v_d = dispersion.n_d, dispersion.V_d
    h = 1e-4, 1e-3 * v_d
    either = [(glass.from_abbe(n_d + s * h[0], v_d), glass.from_abbe(n_d, v_d + s * h[1])) for s in (-1.0, 1.0)]
    return np.stack([(_at_bins(either[1][i], edges) - _at_bins(either[0][i], edges)) / (2.0 * h[i]) for i in range(2)])


def _errors(columns: np.ndarray, wanted: np.ndarray, moves: np.ndarray) -> np.ndarray:
    """What remains of `wanted` (n,), as a share of its norm, beside columns[:, 0] + columns[:, 1:] moves, for each of
    `moves` (m, k), at the brightness that leaves least; infinite where a prediction is not believed."""
    gram, along = columns.T @ columns, columns.T @ wanted
    at = np.concatenate([np.ones((len(moves), 1)), moves], axis=1)
    square = np.einsum("mi,ij,mj->m", at, gram, at)
    size = np.einsum("mi,ij,mj->m", at[:, 1:], gram[1:, 1:], at[:, 1:])
    total = float(wanted @ wanted)
    rest = total - np.maximum(at @ along, 0.0) ** 2 / np.maximum(square, 1e-300)
    errors = np.sqrt(np.maximum(rest, 0.0) / total)
    return np.where(size <= _TRUST**2 * gram[0, 0], errors, np.inf)


def _least_squares(columns: np.ndarray, wanted: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Moves (k,) with which brightness · (columns[:, 0] + columns[:, 1:] moves) is nearest to `wanted`, their
    covariance and what is left over as a share."""
    solved = np.linalg.lstsq(columns, wanted, rcond=1e-9)[0]
    rest = wanted - columns @ solved
    spread = float(rest @ rest) / max(len(wanted) - columns.shape[1], 1)
    scale = solved[0] if abs(solved[0]) > 0.0 else 1.0
    covariance = spread * np.linalg.pinv(columns.T @ columns, rcond=1e-18)
    # Of a quotient: moves are solved[1:] / solved[0].
    turn = np.concatenate([-(solved[1:] / scale)[:, None], np.eye(len(solved) - 1)], axis=1) / scale
    error = float(np.linalg.norm(rest) / np.linalg.norm(wanted))
    return solved[1:] / scale, turn @ covariance @ turn.T, error
