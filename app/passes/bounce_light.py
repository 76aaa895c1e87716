"""Light that is reflected from one diffuse surface to another, up to three times: found for texels of all receivers,
once for all views, and added to the environment's light in the texture that the camera looks up.

With K the operator that takes what surfaces send out to what arrives at others, straight or by way of glass and
mirrors, ρ their reflectances and M what they send back of all other light, the irradiance after n bounces is
F_n = K (M + ρ F_(n-1)), F_0 = 0. Each is an average over directions of its own. They are asked for in rounds, a few
directions of each in turn: the estimate of F_(n-1) that there is stands for it, since K is linear.

What is met straight is found in two ways that are weighed against each other (balance heuristic: Veach and Guibas
1995): in directions drawn by the cosine, and at places drawn by the light that they send out, without which a caustic,
small and bright, would be hit by few directions. What comes by way of glass and mirrors is followed as
`environment_light` does. Colours are linear Rec.709, multiplied channel by channel from bounce to bounce.
"""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np

from ..base.random_words import random_word
from ..gpu.context import Context
from ..gpu.dispatch_budget import DispatchBudget
from ..gpu.map_channels import MapChannels
from ..gpu.scene_buffers import SceneBuffers
from ..model.environment_light import even_points
from ..model.scene import Scene
from .bounce_sources import BounceSources
from .caustic_maps import CausticMaps
from .covered_places import covered_places
from .environment_light import EnvironmentLightPass
from .environment_places import environment_places
from .gathered_light import DIRECTION, FIRST_DIRECTIONS, PARAMETERS, PER_FOLLOWED, GatheredLight

DIRECTIONS = 256
"""Directions of every bounce, and as many places."""
LEAST_DIRECTIONS = 32
"""Directions of a still, however little time it has."""
FINER = 0.25
"""Factor on the number of texels where no environment needs more: this light has no sharp edges."""
_GUTTER = 2
"""Texels round each chart then: as many as a lookup reads."""
_PAIRS = 8
"""Directions of one dispatch at most: Mesa's software renderer ends loops that run long."""
_MOST_ASKED = 2 * _PAIRS + -(-_PAIRS // PER_FOLLOWED)
_KEY = 80
"""First of the generator words of a bounce's directions, places and choices."""
_KEYS = 16
"""Generator words of each bounce."""


class BounceLightPass(GatheredLight):
    """Owns the sources and each bounce's radiance besides what `GatheredLight` does; its texture holds the
    environment's light too."""

    def __init__(
        self,
        context: Context,
        buffers: SceneBuffers,
        environment: EnvironmentLightPass | None,
        seed: int = 1,
        directions: int = DIRECTIONS,
        finer: float = FINER,
    ) -> None:
        """For a scene whose receivers light each other (`Features.bounces`). `environment`: what else is in the
        texture, and whose texels these are; where there is none, `finer` is a factor on their number."""
        self._environment, self.bounces = environment, buffers.features.bounces
        places = (
            environment.places
            if environment is not None
            else covered_places(buffers, environment_places(buffers, finer, _GUTTER))
        )
        budget = DispatchBudget(PER_FOLLOWED, PER_FOLLOWED, _PAIRS)
        super().__init__(context, buffers, places, seed, directions, _MOST_ASKED, budget, self.bounces)
        self.sources = BounceSources(context, buffers, self.places, self._places)
        self._read = [self._texture() for _ in range(self.bounces)]
        self._areas = self.places.areas
        self._rows = self.places.rows
        self._scene: Scene | None = None
        self._keeps = False
        """Until all is known the texture stays as it is: it holds the same things in nearly the same light."""
        self._light = np.zeros((len(self.places.places), 3))
        self._stages: list[tuple[np.ndarray, np.ndarray]] = []
        self._running: Iterator[bool] | None = None
        self._dispatch_s = context.traits.dispatch_s
        self._write()

    # ---- what is asked -----------------------------------------------------------------------

    def take(self, scene: Scene, maps: CausticMaps | None = None, channels: MapChannels = MapChannels()) -> None:
        """Ask anew: with the colours and spectra of `scene`, of the same things, and where they are given with other
        caustic maps. What is shown stays until as much is known again, or enough of another scene."""
        self.sources.take_scene(scene)
        if maps is not None:
            self.sources.take_maps(maps, channels)
        self._keeps = self._scene is scene and (self._keeps or self.shown == self.total)
        self._scene, self.asked, self.shown, self._stages, self._running = scene, 0, 0, [], None
        for sums in self._sums:
            sums.clear()

    @property
    def is_done(self) -> bool:
        """All directions were followed, or there is no light to follow."""
        return self._scene is None or self.asked >= self.total or not len(self.places.places)

    @property
    def is_worth_showing(self) -> bool:
        """More is known than the texture holds."""
        wanted = self.total if self._keeps else min(max(FIRST_DIRECTIONS, 4 * self.shown), self.total)
        return self.asked > self.shown and self.asked >= wanted

    def steps(self, seconds: float | None = None) -> Iterator[float]:
        """Ask all that is left, pausing after every dispatch of about so many seconds with the share done; None: as
        many as suit the device."""
        self._dispatch_s = seconds or self._context.traits.dispatch_s
        if self.is_done:
            return
        for _ in self.sources.steps():
            yield 0.0
        while not self.is_done:
            # A round that was interrupted is continued: what it has found is in the sums.
            self._running = self._running or self._round()
            if next(self._running, None) is None:
                self._running = None
            yield self.asked / self.total

    def _round(self) -> Iterator[bool]:
        """A few directions of every bounce, pausing after each."""
        assert self._scene is not None
        started = time.perf_counter()
        if not self._stages:
            environment = None if self._environment is None else self._environment.irradiance()
            self._own = self.sources.radiosity(self._scene, environment)
            self._reflectance = self.sources.reflectance(self._scene)
            self._stages = [self._prepared(0, self._own)]
        asked, count = self.asked, min(self._budget.units, self.total - self.asked)
        for bounce in range(self.bounces):
            if bounce:
                arrived = self._arrived(bounce - 1, asked + count)
                self._stages[bounce:] = [self._prepared(bounce, self._own + self._reflectance * arrived)]
            began = time.perf_counter()
            self._ask(bounce, asked, count)
            self._budget.learn(count, time.perf_counter() - began, self._dispatch_s)
            self.seconds += time.perf_counter() - started
            if bounce + 1 == self.bounces:
                self.asked = asked + count
            yield True
            started = time.perf_counter()

    def _prepared(self, bounce: int, radiosity: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Running sums (n + 1,) of the probability with which a place is drawn, and its density (n,), of what sends out
        `radiosity` (n, 3), which the texture of that bounce then holds."""
        radiance = radiosity / np.pi
        # Between texels radiance is interpolated: it reaches over into dark ones.
        power = self.places.spread(np.abs(radiance).mean(axis=1)) * self._areas * self.places.on_top
        total = power.sum()
        chance = power / total if total > 0.0 else power
        density = np.divide(chance, self._areas, out=np.zeros_like(chance), where=self._areas > 0.0)
        texels = np.concatenate([radiance, density[:, None]], axis=1)
        self._read[bounce].write(self.places.image(texels).tobytes())
        return np.concatenate([[0.0], np.cumsum(chance)]), density.astype(np.float32)

    def _ask(self, bounce: int, first: int, count: int) -> None:
        key, seed = _KEY + _KEYS * bounce, self._seed
        running, density = self._stages[bounce]
        numbers, aims = np.arange(first, first + count), bool(running[-1] > 0.0)
        parameters, asked = PARAMETERS.zeros(1), DIRECTION.zeros(_MOST_ASKED)
        points = even_points(numbers, seed, key)
        asked["target"][:count, :2], asked["within"][:count] = points[:, :2], points[:, 2:]
        straight = count
        if aims:
            part = asked[count : 2 * count]
            points = even_points(numbers, seed, key + 4)
            self._draw(part, points, running, density)
            part["within"] = even_points(numbers, seed, key + 8)[:, 2:]
            straight = 2 * count
        end = (first + count) // PER_FOLLOWED if self._sphere is not None else 0
        followed = np.arange(first // PER_FOLLOWED, end)
        part = asked[straight : straight + len(followed)]
        if len(followed):
            points = even_points(followed, seed, key + 12)
            part["target"][:, :2], part["within"] = points[:, :2], points[:, 2:]
            part["key"] = [random_word(seed, 2 + bounce, int(n), _KEY) for n in followed]
        parameters["by_cosine"] = count
        parameters["straight"], parameters["followed"], parameters["aims"] = straight, len(followed), aims
        self._dispatch(parameters, asked, self._read[bounce], "bounces", bounce)

    def _draw(self, asked: np.ndarray, points: np.ndarray, running: np.ndarray, density: np.ndarray) -> None:
        """Aim records (n,) at places drawn by `points` (n, 4): the first number chooses among rows of texels and goes
        on across the row, the second along it, so that what is even in the square is even on the surfaces."""
        low, width = _found(running, self._rows, points[:, 0] * running[-1])
        first, end = running[self._rows[low]], running[self._rows[low + 1]]
        index, along = _found(running, np.arange(len(running)), first + points[:, 1] * (end - first))
        chosen = self.places.places[index]
        u, v = along[:, None] - 0.5, width[:, None] - 0.5
        asked["target"] = chosen["position"] + u * chosen["span_u"] + v * chosen["span_v"]
        asked["normal"], asked["key"], asked["density"] = chosen["normal"], chosen["object"], density[index]

    # ---- what was found ----------------------------------------------------------------------

    def _arrived(self, bounce: int, asked: int) -> np.ndarray:
        """Irradiance of every place after so many bounces and one, float64 (n, 3), by what was asked."""
        sums = self._found(bounce)
        return sums["straight"].astype(float) / max(asked, 1) + self._specular(sums, asked)

    def irradiance(self) -> np.ndarray:
        """What every place gets from other receivers, float64 (n, 3), linear Rec.709, lm/unit²: as far as it is
        known."""
        return self._arrived(self.bounces - 1, self.asked)

    def show(self) -> None:
        """What was found, and what is known of the environment's light, becomes what the camera looks up."""
        if self.asked:
            self._light, self.shown = self.irradiance(), self.asked
        self._write()

    def _write(self) -> None:
        known = self._light if self._environment is None else self._light + self._environment.irradiance()
        self.texture.write(self.places.image(known).tobytes())

    @property
    def bytes(self) -> int:
        """Device memory held."""
        return super().bytes + self.sources.bytes

    def release(self) -> None:
        """Free everything."""
        self.sources.release()
        super().release()


def _found(running: np.ndarray, borders: np.ndarray, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Among intervals between `borders` (k + 1,) of the running sums, which hold values `at` (n,), and where in them, 0
    to 1: those without any probability hold none."""
    sums = running[borders]
    index = np.searchsorted(sums, np.minimum(at, np.nextafter(sums[-1], 0.0)), side="right") - 1
    index = np.clip(index, 0, len(sums) - 2)
    width = sums[index + 1] - sums[index]
    return index, np.clip((at - sums[index]) / np.where(width > 0.0, width, 1.0), 0.0, 1.0)
