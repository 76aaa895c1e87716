"""The environment's light on every receiver: a small program that finds how much of it reaches each texel, and the
texture that the camera looks up.

E(x) = ∫ L(ω) V(x, ω) cos θ dω is shared out by what a direction meets first. Nothing: it counts straight, in directions
drawn by brightness (`model.environment_light`), as the ratio of what arrives to what was asked for, times the integral
without anything in the way, which is known: where nothing hides anything, and where all is hidden, it is exact. Glass
or a mirror: that path is followed backwards to the environment, with Fresnel's reflectance by chance and Beer's law,
and finds there the mean of as wide a patch as it stands for. So what glass transmits of the environment's light, its
focus included, is here, and photons carry none of it. Anything else: nothing; what receivers give to each other
`bounce_light` finds.

Every directions' number is a counter: the picture depends neither on how many are asked at once nor on timing.
"""

from __future__ import annotations

import time
from collections.abc import Iterator

import moderngl
import numpy as np

from ..base.random_words import random_word
from ..gpu import shader
from ..gpu.context import Context
from ..gpu.dispatch_budget import DispatchBudget
from ..gpu.scene_buffers import SceneBuffers
from ..model.environment_light import EnvironmentLight, even_points, lighting_environment
from ..model.scene import Scene
from .covered_places import covered_places
from .environment_places import environment_places
from .gathered_light import DIRECTION, FIRST_DIRECTIONS, PARAMETERS, PER_FOLLOWED, GatheredLight

DIRECTIONS = 512
"""Straight directions in all."""
LEAST_DIRECTIONS = 64
"""Directions of a still, however little time it has."""
MOST_ASKED = 24
"""Directions of one dispatch at most: Mesa's software renderer ends loops that run long."""
_NEIGHBOURS = 25.0
"""Texels whose directions, each its own, are averaged (`gathered_light.SMOOTHING`)."""
_KEY = 70
"""First of the words that decide at surfaces of glass; those after it place directions towards glass."""


class EnvironmentLightPass(GatheredLight):
    """Owns the environment's levels besides what `GatheredLight` does; `asked` counts straight directions."""

    def __init__(
        self,
        context: Context,
        buffers: SceneBuffers,
        seed: int = 1,
        directions: int = DIRECTIONS,
        finer: float = 1.0,
    ) -> None:
        """For a scene that an environment lights (`Features.environment_lights`); `finer`: factor on the number of
        texels."""
        environment = lighting_environment(buffers.scene)
        assert environment is not None
        places = covered_places(buffers, environment_places(buffers, finer))
        budget = DispatchBudget(PER_FOLLOWED, PER_FOLLOWED, MOST_ASKED * PER_FOLLOWED // (PER_FOLLOWED + 1))
        super().__init__(context, buffers, places, seed, directions, MOST_ASKED, budget)
        self._light: EnvironmentLight | None = None
        self._write(np.zeros((len(self.places.places), 3)))
        self.take(buffers.scene)

    def take(self, scene: Scene) -> None:
        """Another environment or other colours of the same things: what was found is forgotten where it must be. A
        scene that nothing lights keeps what there is: its camera does not look it up."""
        environment = lighting_environment(scene)
        if environment is None or (self._light is not None and self._light.environment is environment):
            return
        self._light = EnvironmentLight(environment, self._seed)
        self._unshadowed = self._light.unshadowed(self.places.normals) if len(self.places.places) else np.zeros((0, 3))
        packed, self._level_places = self._light.levels()
        shader.release(*self._read)
        texels = np.zeros((*packed.shape[:2], 4), np.float32)
        texels[..., :3] = packed
        levels = self._ctx.texture(packed.shape[1::-1], 4, texels, dtype="f4")
        levels.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._read = [levels]
        # What is shown stays until something is known of the new one.
        self.asked = self.shown = 0
        self._sums[0].clear()

    @property
    def is_done(self) -> bool:
        """All directions were followed."""
        return self.asked >= self.total or not len(self.places.places)

    @property
    def is_worth_showing(self) -> bool:
        """Much more is known than the texture holds."""
        wanted = max(FIRST_DIRECTIONS, 4 * self.shown)
        return self.asked > self.shown and (self.asked >= min(wanted, self.total) or self.is_done)

    def steps(self, seconds: float | None = None) -> Iterator[float]:
        """Ask all that is left, pausing after every dispatch of about so many seconds with the share done; None: as
        many as suit the device."""
        seconds = seconds or self._context.traits.dispatch_s
        while not self.is_done:
            self._ask(min(self._budget.units, self.total - self.asked), seconds)
            yield self.asked / self.total

    def _ask(self, count: int, seconds: float) -> None:
        assert self._light is not None
        started = time.perf_counter()
        follows = self._sphere is not None
        first_followed, end_followed = (
            (self.asked // PER_FOLLOWED, (self.asked + count) // PER_FOLLOWED) if follows else (0, 0)
        )
        asked = DIRECTION.zeros(MOST_ASKED)
        drawn = self._light.directions(self.asked, count)
        asked["target"][:count], asked["weight"][:count] = drawn.toward, drawn.weight
        asked["within"][:count] = drawn.within
        followed = end_followed - first_followed
        if followed:
            numbers = np.arange(first_followed, end_followed)
            places = even_points(numbers, self._seed, _KEY + 1)
            asked["target"][count : count + followed, :2] = places[:, :2]
            asked["within"][count : count + followed] = places[:, 2:]
            asked["key"][count : count + followed] = [random_word(self._seed, 1, int(n), _KEY) for n in numbers]
        parameters = PARAMETERS.zeros(1)
        columns = np.asarray(self._light.environment.world_to_local, float).T
        for name, column in zip(("sky_x", "sky_y", "sky_z"), columns, strict=True):
            parameters[name][0, :3] = column
        wide = 2.0 * np.pi * PER_FOLLOWED / self.total
        if self._buffers.features.environment_spectrum:  # colours are finer than what each path stands for
            wide /= _NEIGHBOURS
        parameters["level_wide"][0, :3] = self._level(wide)
        parameters["level_narrow"][0, :3] = self._level(0.25 * wide)
        parameters["straight"], parameters["followed"] = count, followed
        self._dispatch(parameters, asked, self._read[0], "environment")
        self.asked += count
        took = time.perf_counter() - started
        self.seconds += took
        self._budget.learn(count, took, seconds)

    def _level(self, solid_angle: float) -> tuple[int, int, int]:
        """The level whose texels are about as large as a patch of so many steradians."""
        height = self._level_places[0][2]
        level = int(np.floor(max(0.0, np.log2(np.sqrt(solid_angle) * height / np.pi))))
        return self._level_places[min(level, len(self._level_places) - 1)]

    # ---- what was found ----------------------------------------------------------------------

    def irradiance(self) -> np.ndarray:
        """Light at every place, float64 (n, 3), linear Rec.709, lm/unit²: as far as it is known."""
        sums = self._found()
        asked_for, straight = sums["all"].astype(float), sums["straight"].astype(float)
        share = np.divide(straight, asked_for, out=np.zeros_like(straight), where=asked_for > 0.0)
        return share * self._unshadowed + self._specular(sums, self.asked)

    def show(self) -> None:
        """What was found becomes what the camera looks up."""
        if self.shown == self.asked:
            return
        self._write(self.irradiance())
        self.shown = self.asked

    def _write(self, irradiance: np.ndarray) -> None:
        self.texture.write(self.places.image(irradiance).tobytes())


def without_light(ctx: moderngl.Context, receivers: int) -> moderngl.Texture:
    """The texture of a scene whose so many receivers are lit by nothing."""
    return ctx.texture((max(1, receivers), 1), 4, bytes(16 * max(1, receivers)), dtype="f4")
