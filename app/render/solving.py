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
from ..edit.glass import set_dispersion, set_dispersion_gain
from ..edit.parameters import Stage, value_of
from ..edit.solved import Fit, Match, Ranked
from ..gpu.context import Context
from ..gpu.shader import forget_programs, keep_programs
from ..model.optics import catalogue, glass
from ..model.optics.glass import Dispersion
from ..model.optics.spectrum import illuminant
from ..model.scene import Scene
from ..model.settings import RenderSettings
from ..passes.picture_channels import Channels
from .bake import drawn
from .frames import Picture
from .gradient import ENOUGH, INDEX, Gradient, gradient, nudged
from .light_target import Target, wanted

T = TypeVar("T")
_PARTS, _INDICES, _TRIED = 3, 32, 1 << 15
"""Pictures that show the light of all indices, how many indices each, and photons of them."""
_NEAR, _HARDLY = 0.3, 0.95
"""What the blurred light of the scene's own glass, and of another one, may differ by to begin with it."""
_ALIKE = 0.01
"""The same of a width, which glasses of any n_d may have."""
_BLURS = (0.12, 0.04, 0.0)
"""Standard deviations, of the target's longer side."""
_STEPS = 8
"""With each blur, at most."""
_BLOCKS = 8
"""Along a target's sides, within which what is left over may be alike."""
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
    """Settings of the renderings that are compared."""
    target: Target
    _steps: dict[str, float] = field(default_factory=dict)
    """Found for parameters so far."""

    # ---- numbers of the scene ----------------------------------------------------------------

    def fit(self, paths: Sequence[str]) -> Generator[float, None, Fit]:
        """Gauss and Newton's method from the scene as it is, pausing with the share done."""
        at, taken = np.zeros(len(paths)), 0
        if self.target.width is not None and len(paths) > 1:
            raise UserError("a width fixes one number only: give one parameter")
        if len(set(paths)) < len(paths):
            raise UserError("a parameter is given twice: give each once")
        for number, blur in enumerate(self._blurs):
            for step in range(_STEPS):
                begun = (number + step / _STEPS) / len(self._blurs)
                steps = self._gradient(self._moved(at, paths), paths)
                found = yield from part_of(steps, begun, 1.0 / (len(self._blurs) * _STEPS))
                columns = self._columns(found, blur)
                move, covariance, error = self._solved(columns, blur)
                taken += 1
                for path, column in zip(paths, columns.T[1:], strict=True):
                    if not column.any():
                        raise UserError(f"'{path}' changes no light there: give another parameter, or another place")
                light = max(float(np.linalg.norm(columns[:, 0])), 1e-300)
                size = float(np.linalg.norm(columns[:, 1:] @ move)) / light
                # Those that do nearly the same must not run away against each other.
                most = float((np.linalg.norm(columns[:, 1:], axis=0) * np.abs(move)).max()) / light
                at = at + move * min(1.0, _TRUST / max(most, size, 1e-12))
                if size < 1e-3 or (blur and size < 0.05):
                    break
        self._check_ends(columns)
        if not error < _HARDLY:
            raise UserError("no values were found that cast such light there: begin with values that are nearer")
        covariance = covariance + self._doubt(move, self._columns(found, self._blurs[-2:][0]))
        start = {path: 0.0 if path.endswith(f".{INDEX}") else value_of(self.stage, path) for path in paths}
        values = {path: start[path] + float(change) for path, change in zip(paths, at, strict=True)}
        deviations = dict(zip(paths, np.sqrt(np.diag(covariance)).tolist(), strict=True))
        return Fit(values, deviations, covariance, error, taken)

    def _moved(self, at: np.ndarray, paths: Sequence[str]) -> Stage:
        stage = self.stage
        for path, change in zip(paths, at, strict=True):
            stage = nudged(stage, path, float(change)) if change else stage
        return stage

    def _columns(self, found: Gradient, blur: float) -> np.ndarray:
        """The light (n, 1 + paths) and its derivatives."""
        pictures = [found.base, *(each.picture for each in found.derivatives)]
        return np.stack([self._colours(p, found.placement, blur).ravel() for p in pictures], axis=-1)

    def _doubt(self, move: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """Variances by details that lights have from texels and footprints alone: how another `move` is with blurred
        `columns`, where chance does not say it."""
        softer, covariance, _ = self._solved(columns, self._blurs[-2:][0])
        square = (softer - move) ** 2
        return np.diag(np.where(square > 4.0 * np.diag(covariance), square, 0.0))

    # ---- glasses -----------------------------------------------------------------------------

    def match(self, index: int, count: int = 10) -> Generator[float, None, Match]:
        """The glasses that object `index` may be of, pausing with the share done. Raises `UserError` where the target
        says nothing."""
        entries = [e for e in catalogue.entries() if e.dispersion.is_dispersive and self._may_be(index, e.dispersion)]
        curves = np.stack([_at_bins(entry.dispersion, self._edges) for entry in entries])
        best = yield from self._nearest(index, entries, curves)
        known: dict[int, Gradient] = {}
        names = [entry.qualified_name for entry in entries]

        def derived(number: int) -> Generator[float, None, Gradient]:
            if number not in known:
                its = set_dispersion(self.stage.scene, index, entries[number].dispersion)
                steps = self._gradient(replace(self.stage, scene=its), [f"objects.{its.objects[index].name}.{INDEX}"])
                known[number] = yield from part_of(steps, min(0.42 + 0.05 * len(known), 0.8), 0.05)
            return known[number]

        self._check(self._by_bin((yield from derived(best)), self._blurs[0]), entries[best].dispersion)
        for blur in self._blurs:
            seen: set[int] = set()
            while best not in seen and len(seen) < _STEPS:
                seen.add(best)
                columns = self._by_bin((yield from derived(best)), blur)
                best = int(np.argmin(self._errors(columns, self._wanted(blur), curves - curves[best])))
        columns = self._by_bin((yield from derived(best)), 0.0)
        errors = self._errors(columns, self._wanted(0.0), curves - curves[best])
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
        return Match(ranked, self._around((yield from derived(best)), entries[best].dispersion))

    def _may_be(self, index: int, dispersion: Dispersion) -> bool:
        """Whether its data hold for every light of the scene."""
        try:
            set_dispersion(self.stage.scene, index, dispersion)
        except UserError:
            return False
        return True

    def _nearest(
        self, index: int, entries: Sequence[catalogue.Entry], curves: np.ndarray
    ) -> Generator[float, None, int]:
        """The glass to begin with: the scene's own where its light is near, or else the one whose light is foreseen to
        be nearest. Raises `UserError` where none lights the target."""
        own = _at_bins(self.stage.scene.objects[index].material.dispersion, self._edges)
        nearest, blur = int(np.abs(curves - own).max(axis=1).argmin()), self._blurs[0]
        stage = replace(self.stage, scene=set_dispersion(self.stage.scene, index, entries[nearest].dispersion))
        found = yield from part_of(drawn(self.context, self._few, [stage], self.target.window), 0.0, 0.05)
        shown = self._colours(found.pictures[0], found.placement, blur).reshape(-1, 1)
        (error,) = self._errors(shown, self._wanted(blur), np.zeros((1, 0)))
        if error < (_NEAR if self.target.width is None else _ALIKE):
            return nearest
        errors = yield from part_of(self._foreseen(index, curves), 0.05, 0.35)
        if np.nanmin(errors) < _HARDLY:
            return int(np.nanargmin(errors))
        raise UserError("no glass of the catalogue casts such light there: is the target's place right, and its scene?")

    def _foreseen(self, index: int, curves: np.ndarray) -> Generator[float, None, np.ndarray]:
        """What the blurred light of glasses of such `curves` (m, bins) differs by from the target, by few photons.

        Under lamps of equal energy, through a glass whose index runs through all of theirs while nothing else has
        colours, every bin of a spectrum is the light of one index."""
        from scipy.interpolate import interp1d

        plain, cells = _without_colours(self.stage.scene, index), []
        edges = np.quantile(curves, np.linspace(0.0, 1.0, _PARTS * _INDICES + 1))
        edges += 1e-9 * np.arange(len(edges))  # no two alike
        settings = replace(self._few, bins=_INDICES)
        for part in range(_PARTS):
            rising = edges[part * _INDICES :][: _INDICES + 1]
            swept = glass.table(np.linspace(380.0, 780.0, _INDICES + 1), rising[::-1].tolist(), "swept")
            stage = replace(self.stage, scene=set_dispersion(plain, index, swept))
            steps = drawn(self.context, settings, [stage], self.target.window)
            found = yield from part_of(steps, part / _PARTS, 1.0 / _PARTS)
            assert found.pictures[0].spectral is not None
            cells.append(self.target.seen(found.pictures[0].spectral, found.placement)[..., ::-1])
        blur = self._blurs[0]
        thin = slice(None, None, max(1, int(0.5 * blur * max(self.target.values.shape))))
        light = _blurred(np.concatenate(cells, axis=-1), blur)[thin, thin]
        ends = light[..., 0], light[..., -1]
        of_index = interp1d(0.5 * (edges[1:] + edges[:-1]), light, bounds_error=False, fill_value=ends)
        lamps = self.stage.scene.lights
        power = sum(lamp.spectral_power.binned(self._edges) for lamp in lamps) if lamps else 1.0
        wanted = _blurred(self.target.values.astype(float), blur)[thin, thin].ravel()
        errors = []
        for curve in curves:
            shown = self._in_channels(of_index(curve) * power).reshape(-1, 1)
            errors.append(self._errors(shown, wanted, np.zeros((1, 0)))[0])
        return np.array(errors)

    def _by_bin(self, found: Gradient, blur: float) -> np.ndarray:
        """The light (n, 1 + bins) and its derivatives by the index in each bin."""
        spectral = found.derivatives[0].picture.spectral
        assert spectral is not None
        cells = self.target.seen(spectral, found.placement)
        alone = (_blurred(self._in_channels(cells * one), blur).ravel() for one in np.eye(self.target.bins))
        return np.stack([self._colours(found.base, found.placement, blur).ravel(), *alone], axis=-1)

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
        left = _least_squares(others, moved)[2] * np.linalg.norm(moved) if moved.any() else 0.0
        if not left > _SAYS_NOTHING * np.linalg.norm(columns[:, 0]):
            raise UserError(_NO_COLOURS)

    def _around(self, found: Gradient, dispersion: Dispersion) -> Fit:
        """n_d and V_d near those of a glass; of a width V_d, for it does not say which n_d."""
        shapes = _shapes(dispersion, self._edges)[slice(None) if self.target.width is None else slice(1, None)]

        def both(blur: float) -> np.ndarray:
            columns = self._by_bin(found, blur)
            return np.stack([columns[:, 0], *(columns[:, 1:] @ shape for shape in shapes)], axis=1)

        move, covariance, error = self._solved(both(0.0), 0.0)
        covariance = covariance + self._doubt(move, both(self._blurs[-2:][0]))
        if self.target.width is not None:
            move, covariance = np.append(0.0, move), np.full((2, 2), np.nan)
        values = {"n_d": dispersion.n_d + float(move[0]), "V_d": dispersion.V_d + float(move[1])}
        deviations = dict(zip(values, np.sqrt(np.diag(covariance)).tolist(), strict=True))
        return Fit(values, deviations, covariance, error, 1)

    # ---- light -------------------------------------------------------------------------------

    @property
    def _settings(self) -> RenderSettings:
        return self.target.settings(self.settings)

    @property
    def _few(self) -> RenderSettings:
        """With few photons."""
        return replace(self._settings, photons=min(self._settings.photons or _TRIED, _TRIED))

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
        return _blurred(self._in_channels(self.target.seen(picture.spectral, placement)), blur)

    def _in_channels(self, cells: np.ndarray) -> np.ndarray:
        if self.target.bin_edges_nm is not None:
            return cells
        return Channels(tuple(self._edges.tolist())).to_rgb709(cells).astype(float)

    # ---- what is compared --------------------------------------------------------------------

    @property
    def _blurs(self) -> tuple[float, ...]:
        return _BLURS if self.target.width is None else (0.0,)

    def _errors(self, columns: np.ndarray, wanted: np.ndarray, moves: np.ndarray) -> np.ndarray:
        """Errors of `moves` (m, k), as `_errors` has them; for a width, its relative difference."""
        if self.target.width is None:
            return _errors(columns, wanted, moves)
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
            h, w, channels = self.target.values.shape
            rows, across = (np.arange(n) * _BLOCKS // n for n in (h, w))
            block = np.repeat((rows[:, None] * _BLOCKS + across).ravel(), channels)
            return _least_squares(columns, self._wanted(blur), block)
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
    settings = replace(settings, photons=settings.photons or min(stage.scene.render.photons, ENOUGH))
    its = wanted(context, stage, settings, receiver, values, between, width)
    keep_programs(context.ctx)
    try:
        target = yield from part_of(its, 0.0, 0.05)
        return (yield from part_of(work(Solver(context, stage, settings, target)), 0.05, 0.95))
    finally:
        forget_programs(context.ctx)


def _without_colours(scene: Scene, index: int) -> Scene:
    """`scene` where no glass but object `index` disperses, under lamps of equal energy."""
    even = illuminant("E")
    lights = (
        replace(lamp, spectral_power=even.scaled_to_power(lamp.spectral_power.power_w())) for lamp in scene.lights
    )
    for i, item in enumerate(scene.objects):
        if i != index and item.material.transmits and not item.material.is_crystal:
            scene = set_dispersion_gain(scene, i, 0.0)
    return replace(scene, lights=tuple(lights))


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


def _least_squares(
    columns: np.ndarray, wanted: np.ndarray, block: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray, float]:
    """Moves (k,) with which brightness · (columns[:, 0] + columns[:, 1:] moves) is nearest to `wanted` (n,), their
    covariance and what is left over as a share.

    What is left over may be alike within a `block` (n,), by number; None: it is noise. A. C. Cameron and D. L. Miller,
    A Practitioner's Guide to Cluster-Robust Inference, Journal of Human Resources 50 (2015) 317."""
    solved = np.linalg.lstsq(columns, wanted, rcond=1e-9)[0]
    rest = wanted - columns @ solved
    scale = solved[0] if abs(solved[0]) > 0.0 else 1.0
    inverse = np.linalg.pinv(columns.T @ columns, rcond=1e-18)
    each = np.arange(len(wanted)) if block is None else block
    pulls = np.stack([np.bincount(each, column * rest) for column in columns.T])
    covariance = inverse @ (pulls @ pulls.T) @ inverse
    # Of a quotient: moves are solved[1:] / solved[0].
    turn = np.concatenate([-(solved[1:] / scale)[:, None], np.eye(len(solved) - 1)], axis=1) / scale
    error = float(np.linalg.norm(rest) / np.linalg.norm(wanted))
    return solved[1:] / scale, turn @ covariance @ turn.T, error
