"""The camera's pass: pictures of the scene from the caustic maps and the lights.

A dispatch adds one camera sample to the pixels of a band of rows; another follows those that see glass or mirrors
there. On a GPU a band is the whole picture, unless earlier ones took long. On a software renderer bands are small, and
lists are followed a portion at a time: between two dispatches there is time for progress and for a stop. There a sample
that takes long halts and is taken up again by a later dispatch, for the driver would cut it short
(shaders/camera/waiting.glsl). Samples form a lattice inside the pixel that later launches refine (box filter).
"""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence
from contextlib import contextmanager

import moderngl
import numpy as np

from ..features.program_switches import switched
from ..gpu import shader
from ..gpu.context import Context
from ..gpu.dispatch_budget import DispatchBudget
from ..gpu.map_channels import MapChannels
from ..gpu.scene_buffers import SceneBuffers
from ..gpu.schema import Struct
from ..gpu.texture_store import TextureStore
from ..model.scene import Camera
from .camera_inputs import CameraInputs
from .camera_programs import CameraPrograms, camera_defines, waiting_bytes
from .camera_records import camera_parameters
from .caustic_maps import CausticMaps
from .haze import Haze
from .listed_pixels import ListedPixels
from .picture_channels import Channels
from .picture_sums import PictureSums
from .sample_spread import (
    LOOKS,
    PRIMARY_SAMPLES,
    SURVEY_KEPT,
    cells_of,
    is_in_strips,
    looks_lattice,
    looks_of,
    pixel_lattice,
    spread_alone,
    spread_pilot,
    spread_samples,
    spread_survey,
)
from .spectrum_choice import PilotRender, Spectrum, bands_of_plates, choosing_spectrum, grid_of

SPLIT_THRESHOLD = 0.0008
"""Share of a sample's power above which both parts of a split path are followed: small enough for the third reflection
in a ball, whose choice by chance would show as grain."""
MAX_TAPS = 24
"""Lookups along one sweep."""
SURVEY_FROM = 4
"""A still of as many samples or more surveys its pixels first: fewer would cost no more than the survey itself."""

_GROUP = 8
_FIRST_ROWS = 16


class CameraPass:
    """Owns the program, the sums and the light tables; `run` adds samples, `read_*` divide by their number."""

    def __init__(
        self,
        context: Context,
        scene: SceneBuffers,
        layer: str = "beauty",
        reflectances: Sequence[np.ndarray | None] = (None,),
        maps: MapChannels = MapChannels(),
        pictures: TextureStore | None = None,
    ) -> None:
        """`layer`: "beauty", or "caustic" (the maps on what is seen directly, no other light).

        `reflectances`: reflectance classes as the splat tables were built with; the first is
        None, the others (401,) are folded into the maps. `maps`: what their channels are; those of a picture in bins
        are its own.
        `pictures`: textures and environment of `scene.scene`, the caller's; None makes them. The camera's method is
        that of `scene.features`.
        """
        if reflectances[0] is not None:
            raise ValueError(
                "reflectance class 0 must be None: it stands for receivers whose maps hold plain irradiance"
            )
        self.context = context
        self.scene = scene
        self.channels = Channels(maps.edges_nm)
        self._ctx = context.ctx
        self._sums = PictureSums(self._ctx, self.channels.targets)
        self._rows = DispatchBudget(1, 1, 1)
        self._within_rows = False
        """Some listed pixels of a band of rows have this sample, others are still to get it."""
        self.dispatch_seconds = context.traits.camera_s
        """What one dispatch should take; rows are divided to fit."""
        features = scene.features
        self.disperses = layer != "caustic" and features.camera_disperses
        """Samples differ in the stretch of the spectrum they see."""
        self.fixed_bands = {"regular-7": 7, "regular-16": 16, "srd-lambda": 1}.get(features.method)
        """What the method prescribes."""
        self.least_bands = bands_of_plates(scene.scene.objects)
        self.spectrum = Spectrum(self.fixed_bands or self.least_bands)
        """How samples see the spectrum; one of `single` wavelengths needs `may_be_single`."""
        self.may_be_single = False
        """Where bands serve a scene badly, wavelengths may be taken one by one. That takes a program of its own, which
        is compiled when it is needed."""
        self.max_taps = MAX_TAPS
        self.primary_samples = PRIMARY_SAMPLES if self.chooses or not self.disperses else 1
        """Lookups of a sample at what is seen directly, while a pixel has few samples."""
        self.only_directly = False
        """Leave what is seen in glass and mirrors black where a program of its own follows it."""
        self.split_threshold = SPLIT_THRESHOLD
        shown = camera_defines(scene, self.channels, layer, maps)
        self._made_for = layer, tuple(reflectances), maps, dict(shown)
        self._inputs = CameraInputs(
            self._ctx, scene, self.channels, reflectances, maps, pictures, "RECEIVER_LIGHT" in shown
        )
        shown |= self._inputs.defines
        shown |= {"PATHS_GROUP": context.traits.paths_group, "PATHS_AT_ONCE": context.traits.camera_paths}
        self.follows = "CAMERA_SPECULAR" in shown
        """Some paths go on beyond glass or mirrors."""
        if self.follows and context.traits.is_software:
            shown |= switched(HALTS=True)
        self.listed = ListedPixels(self._ctx, context.traits, waiting_bytes(shown) if self.follows else 0)
        self._programs = CameraPrograms(self._ctx, shown, self._inputs.structs, features.lens)
        self._haze = Haze(context, scene, self.channels) if features.haze and layer == "beauty" else None
        self._is_hazy = False
        """The samples that are being taken are of the picture that haze was drawn for."""
        for variant in ("all", "direct") if self.follows else ("direct",):
            self._programs.of(variant)

    def take(self, scene: SceneBuffers, reflectances: Sequence[np.ndarray | None], maps: MapChannels) -> bool:
        """Show `scene`, the same geometry with other colours, glass, lights or pictures, from now on, in the buffers
        that there are. False, and nothing done, where a new pass is needed."""
        layer, classes, channels, defines = self._made_for
        if maps != channels or len(classes) != len(reflectances) or scene.texels is not self.scene.texels:
            return False
        if any(a is not b for a, b in zip(classes, reflectances, strict=True)):
            return False
        if camera_defines(scene, self.channels, layer, maps) != defines or not self._inputs.take(scene):
            return False
        self.scene = scene
        if self._haze is not None:
            self._haze.take(scene)
        return True

    def move(self, scene: SceneBuffers) -> None:
        """Objects or lights have moved (`SceneBuffers.move`)."""
        self.scene = scene
        self._inputs.move(scene)
        if self._haze is not None:
            self._haze.move(scene)

    @property
    def has_haze(self) -> bool:
        """Light is seen on its way."""
        return self._haze is not None

    def draw_haze(self, camera: Camera, width: int, height: int) -> None:
        """What `samples` does before the first one of a view, where there is haze: a clock of samples leaves it out."""
        if self._haze is not None:
            self._haze.draw(camera, width, height)
            self._is_hazy = True

    def add_haze(self, picture: moderngl.Texture, camera: Camera, *, coarse: bool) -> None:
        """Add what haze shows to a picture of radiance; `coarse`: by fewer beams."""
        assert self._haze is not None
        self._haze.draw(camera, *picture.size, coarse=coarse)
        self._haze.add([picture], 0, picture.height)

    @property
    def brightness(self) -> np.ndarray | None:
        """How much of what looks bright is below each of equally spaced x; None where nothing disperses."""
        return self._inputs.brightness if self.disperses else None

    def run(
        self,
        camera: Camera,
        width: int,
        height: int,
        samples: int,
        sample_offset: int = 0,
        maps: CausticMaps | None = None,
        seed: int = 1,
    ) -> None:
        """`samples`, without a pause."""
        for _ in self.samples(camera, width, height, samples, sample_offset, maps, seed):
            pass

    def samples(
        self,
        camera: Camera,
        width: int,
        height: int,
        samples: int,
        sample_offset: int = 0,
        maps: CausticMaps | None = None,
        seed: int = 1,
    ) -> Iterator[float]:
        """Add `samples` camera samples to every pixel, pausing after every dispatch with the share done; a caller that
        draws meanwhile may bind what it likes, and one that leaves does so where `is_even`.

        `sample_offset` is the number of samples already there; 0 starts anew. `maps` None shows direct light only."""
        if sample_offset == 0 or self._sums.size != (width, height):
            self._clear(width, height)
        maps = maps or self._inputs.no_maps
        self.draw_haze(camera, width, height)
        parameters = self._parameters(camera, width, height, maps.scale, seed)
        spread_samples(parameters, samples, sample_offset, self.spectrum.bands)
        directly = looks_of(samples + sample_offset, self.primary_samples, self.spectrum.single)
        parameters["primary_samples"] = directly
        if not is_in_strips(samples, sample_offset) and not self._programs.has_lens:
            parameters["cells"] = cells_of(samples * directly)
        looks = np.zeros((samples, LOOKS, 2))
        if directly > 1:
            looks = looks_lattice(samples, sample_offset)
            if (
                not self._programs.has_lens  # few lookups do not show what hides a blurred place
                and sample_offset == 0
                and samples >= SURVEY_FROM
                and self._sums.is_single
            ):
                for _ in self._survey(parameters, width, height, maps):
                    yield 0.0
        for index, place in enumerate(pixel_lattice(samples, sample_offset)):
            parameters["sample_index"] = sample_offset + index
            parameters["within_pixel"] = place
            parameters["looks"] = looks[index].reshape(-1, 4)
            for share in self._add_sample(parameters, width, height, maps):
                yield (index + share) / samples
        self.context.check("the camera pass")

    @property
    def chooses(self) -> bool:
        """`choosing_spectrum` has something to choose: the method leaves it open, and some paths are followed."""
        return self.disperses and self.fixed_bands is None and not self.scene.features.random_wavelength

    def choosing_spectrum(
        self, camera: Camera, width: int, height: int, samples: int, maps: CausticMaps | None = None
    ) -> Iterator[float]:
        """Sample the spectrum in the way that leaves the least error after so many samples, as far as a coarse grid of
        the picture's own pixels shows; pauses after every dispatch.

        Sets `spectrum`; what was summed up is forgotten. A method that prescribes its way keeps it."""
        if not self.chooses:
            return
        maps = maps or self._inputs.no_maps
        looks = choosing_spectrum(samples, self.may_be_single, self.least_bands)
        picture: np.ndarray | None = None
        while True:
            try:
                look = next(looks) if picture is None else looks.send(picture)
            except StopIteration as stop:
                self.spectrum = stop.value
                break
            picture = yield from self._coarse_picture(look, camera, width, height, samples, maps)
        self._clear(*self._sums.size)

    def _coarse_picture(
        self, look: PilotRender, camera: Camera, width: int, height: int, samples: int, maps: CausticMaps
    ) -> Generator[float, None, np.ndarray]:
        """Few pixels of the picture, each as large as the picture's own."""
        columns, rows = grid_of(width, height)
        self._clear(columns, rows)
        self.spectrum, self._is_hazy = look.spectrum, False
        parameters = self._parameters(camera, columns, rows, maps.scale, look.seed)
        spread_pilot(parameters, look, samples, columns / width)
        for number in range(look.spectrum.bands):
            parameters["sample_index"] = number
            yield from self._add_sample(parameters, columns, rows, maps)
        picture = self._sums.mean().astype(np.float64)
        # Beside a picture in colour, turns are counted.
        return picture[..., :3] if self.channels.edges_nm is None else picture

    def bind(self, maps: CausticMaps, parameters: np.ndarray) -> None:
        """Bind everything that the camera's programs read."""
        self._inputs.bind(maps, parameters)
        self.listed.bind()
        self._sums.bind()

    @property
    def fallbacks(self) -> dict[str, int]:
        """How often, since the pass was made, a path lost its columns, was left at its greatest depth, could not wait,
        kept a band that should have been cut, or was cut short by the driver."""
        return self._inputs.fallbacks

    @property
    def sums(self) -> Sequence[moderngl.Texture]:
        """RGBA32F sums over the samples taken, four channels each."""
        return self._sums.textures

    @property
    def is_even(self) -> bool:
        """All pixels of a row have as many samples: `samples` may be left here."""
        return not self._within_rows

    @property
    def samples_taken(self) -> int:
        """Samples that every pixel has."""
        rows = self._sums.samples_of_row
        return int(rows.min()) if len(rows) else 0

    def read_rgb(self) -> np.ndarray:
        """Linear Rec.709 radiance, float32 (H, W, 3), lm/(sr unit²) per channel of white; row 0 on top."""
        return self.channels.to_rgb709(self._sums.mean())

    def read_spectral(self) -> np.ndarray:
        """Radiance of each bin, float32 (H, W, bins), W/(sr unit²)."""
        return self.channels.to_spectral(self._sums.mean())

    def release(self) -> None:
        """Free every buffer, texture and program."""
        shader.release(self._inputs, self._programs, self._sums, self.listed, self._haze)

    # ---- for pictures in motion ------------------------------------------------------------

    @property
    def source(self) -> tuple[dict[str, int | float | str], tuple[Struct, ...]]:
        """Defines and structs of the program that follows listed pixels; those of the others are made from them."""
        return self._programs.defines, self._programs.structs

    def moving_parameters(
        self, camera: Camera, width: int, height: int, maps: CausticMaps, max_taps: int
    ) -> np.ndarray:
        """CAMERA_PARAMETERS (1,) of one sample of the whole spectrum in every pixel's middle; sums have that size
        then, whatever is in them."""
        if self._sums.size != (width, height):
            self._clear(width, height)
        self.spectrum, self.max_taps = Spectrum(1), max_taps
        parameters = self._parameters(camera, width, height, maps.scale, seed=1)
        spread_alone(parameters)
        return parameters

    def follow(self, parameters: np.ndarray, maps: CausticMaps) -> Iterator[float]:
        """Follow what is listed, into the sums; pauses with the share done."""
        if not self.follows:
            return
        yield from self._portions(parameters, maps)
        if not self.listed.may_halt:
            self.bind(maps, parameters)
            self.listed.run(self._program_beyond())

    # ---- private ---------------------------------------------------------------------------

    def _parameters(self, camera: Camera, width: int, height: int, map_scale: float, seed: int) -> np.ndarray:
        self._programs.has_lens = camera.lens_radius > 0.0
        parameters = camera_parameters(self.scene, camera, width, height)
        parameters["seed"] = seed & 0xFFFFFFFF
        bands = self.spectrum.bands
        parameters["bands"], parameters["dithered"], parameters["counts_turns"] = bands, bands > 1, 1
        parameters["max_taps"], parameters["split_threshold"] = self.max_taps, self.split_threshold
        parameters["map_scale"] = map_scale
        return parameters

    def _clear(self, width: int, height: int) -> None:
        if self._sums.clear(width, height):
            self._rows = DispatchBudget(_FIRST_ROWS, _GROUP, -(-height // _GROUP) * _GROUP)
            self.listed.resize(width * height, width * (-(-height // _GROUP) * _GROUP))
        self._within_rows = False

    def _add_sample(self, parameters: np.ndarray, width: int, height: int, maps: CausticMaps) -> Iterator[float]:
        """Dispatch one sample, yielding the share done after each dispatch: a band of rows, or some of its listed
        pixels."""
        follows = self.follows and not self.only_directly
        for row, rows in self._bands(parameters, width, height, maps, follows=follows):
            for share in self._portions(parameters, maps) if follows else ():
                self._within_rows = True
                yield (row + share * rows) / height
            if self._haze is not None and self._is_hazy:
                self._haze.add(self._sums.textures, row, rows)
            self._within_rows = False
            self._sums.samples_of_row[row : row + rows] += 1
            yield (row + rows) / height

    def _bands(
        self, parameters: np.ndarray, width: int, height: int, maps: CausticMaps, *, follows: bool
    ) -> Iterator[tuple[int, int]]:
        """A sample of what is seen directly, a band of rows after the other, and, where `follows`, of what its listed
        pixels see, unless these are for `_portions`; pauses with the band's first row and their number."""
        row = 0
        while row < height:
            # Groups that overlap the next band would add its rows twice, so bands are whole groups.
            rows = min(self._rows.units, height - row)
            parameters["first_row"] = row
            self.listed.clear()
            self.bind(maps, parameters)
            with self._timing(self._rows, rows):
                groups = -(-width // _GROUP), -(-rows // _GROUP)
                if parameters["survey"] != SURVEY_KEPT:
                    self._run(self._programs.of("direct"), *groups)
                else:
                    self._run(self._programs.of("kept"), *groups)
                    self.listed.run(self._programs.of("direct"), uneven=True)
                if follows and not self.listed.may_halt:
                    self.listed.run(self._program_beyond())
            yield row, rows
            row += rows

    def _survey(self, parameters: np.ndarray, width: int, height: int, maps: CausticMaps) -> Iterator[float]:
        """Find the pixels in which, and round which, nothing but one surface in the same light is seen directly, and
        what that looks like: the samples then take lookups in the others only. Pauses after every dispatch with 0.0."""
        parameters["survey_at"] = self.listed.survey_at(width * height)
        taken = parameters.copy()
        for _ in spread_survey(taken):
            for _ in self._bands(taken, width, height, maps, follows=False):
                yield 0.0
        self.bind(maps, taken)
        self._run(self._programs.of("even"), -(-width // _GROUP), -(-height // _GROUP))
        parameters["survey"] = SURVEY_KEPT

    def _portions(self, parameters: np.ndarray, maps: CausticMaps) -> Iterator[float]:
        """Follow what listed pixels see where that is done by portions, yielding the share done."""
        if not self.listed.may_halt:
            return
        group = self.context.traits.paths_group

        def follow(budget: DispatchBudget, count: int) -> None:
            self.bind(maps, parameters)
            with self._timing(budget, count):
                self._run(self._program_beyond(), -(-count // group))

        yield from self.listed.follow(parameters, follow)

    @contextmanager
    def _timing(self, budget: DispatchBudget, units: int) -> Iterator[None]:
        """`budget` learns, sooner or later, what so many units took within the block."""
        with self.context.timers.timing("camera", lambda took: budget.learn(units, took, self.dispatch_seconds)):
            yield

    def _run(self, program: moderngl.ComputeShader, groups_x: int, groups_y: int = 1) -> None:
        program.run(groups_x, groups_y)
        self._ctx.memory_barrier()

    def _program_beyond(self) -> moderngl.ComputeShader:
        """What follows rays beyond glass and mirrors."""
        return self._programs.of("single" if self.spectrum.single else "all")
