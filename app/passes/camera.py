"""The camera's pass: pictures of the scene from the caustic maps and the lights.

A dispatch adds one camera sample to the pixels of a band of rows, or to some of those that see glass or mirrors there,
so that none takes long on a software renderer: between two of them there is time for progress and for a stop. There a
sample that takes long halts and is taken up by a later dispatch, for the driver would cut it short
(shaders/camera/halts.glsl). Samples form a lattice inside the pixel that later launches refine (box filter).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Iterator, Sequence

import moderngl
import numpy as np

from ..beams.screen_polygons import ScreenPolygons
from ..beams.screen_starts import ScreenStarts
from ..gpu import bindings, shader
from ..gpu.context import Context
from ..gpu.dispatch_budget import DispatchBudget
from ..gpu.map_channels import MapChannels
from ..gpu.records import PLACEMENT, RECEIVER
from ..gpu.scene_buffers import SceneBuffers
from ..gpu.scene_records import SCENE_STRUCTS
from ..gpu.schema import Struct
from ..gpu.texture_store import PICTURE, TextureStore
from ..model.scene import Camera
from .beam_starts import BeamStarts
from .camera_records import CAMERA_LIGHT, CAMERA_PARAMETERS, camera_parameters, light_record
from .camera_tables import CameraTables
from .caustic_maps import CausticMaps
from .environment_light import without_light
from .haze import Haze
from .listed_pixels import GROUP, ListedPixels
from .picture_channels import Channels
from .picture_sums import PictureSums
from .pixel_lattice import LOOKS, cells_of, is_in_strips, looks_lattice, pixel_lattice, shared_places
from .screen_beams import MOST_ENTRIES, ScreenBeams
from .spectrum_choice import PilotRender, Spectrum, choosing_spectrum, grid_of
from .variants import (
    BIND_BEAM_OBJECTS,
    BIND_CELL_CDF,
    BIND_COUNTERS,
    BIND_LIGHTS,
    BIND_OBJECT_COLOURS,
    BIND_PICTURES,
    BIND_PLACEMENTS,
    BIND_RECEIVERS,
    UNIT_EMISSION,
    UNIT_PICTURES,
    UNIT_RECEIVER_LIGHT,
    Defines,
    beside_defines,
    camera_defines,
    direct_defines,
    halted_bytes,
    halting_defines,
    lens_defines,
    screen_beam_defines,
    single_defines,
    start_defines,
)

SPLIT_THRESHOLD = 0.0008
"""Share of a sample's power above which both parts of a split path are followed. Five times as much leaves the third
reflection in a ball to chance, which shows as grain where it meets what is bright: twice the error of `ball`, for an
eighth less time."""
START_SHARE = 0.25
"""Of a sample's power, that a path which carries on a beam stands for."""
MAX_TAPS = 24
"""Looks along one sweep."""
TAPS_PER_PIXEL = 1.2
"""Of one sample; between two looks colours are not told apart, so the more samples there are, the closer they lie."""
PRIMARY_SAMPLES = LOOKS
"""Of one sample at what is seen directly: outlines and textures there cost a tenth of what glass costs …"""
PRIMARY_SAMPLES_UNTIL = 64
"""… and with more samples than these they are smooth as they are."""
SURVEY_SAMPLES = 2
"""Samples of so many looks each that tell, before a still's first sample, which pixels are even …"""
SURVEY_FROM = 4
"""… where as many samples or more follow: fewer would cost no more than the survey itself."""

_BEAMS_PROGRESS = 0.7
"""Of a frame's time, about, that drawing its beams takes."""
_SURVEY_GRID = (4, 2)
"""Columns and rows of a survey's looks in a pixel: SURVEY_SAMPLES · LOOKS together."""
_GROUP = 8
_FIRST_ROWS = 16
_VARIANTS: dict[str, Callable[[Defines], Defines]] = {
    "all": lambda shown: shown,
    "direct": direct_defines,
    "single": single_defines,
    "beside": beside_defines,
}
"""Programs: beyond glass and mirrors, for what is seen directly, beyond glass of one wavelength, and directly where
beams show the rest."""
FALLBACKS = ("columns_dropped", "depth_reached", "stack_full", "band_uncut", "loops_ended")
"""What the shader counts, in its order."""


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
        self._tables = CameraTables.build(self._ctx, scene, self.channels, reflectances, maps)
        self._owns_pictures = pictures is None
        self.pictures = pictures or TextureStore(self._ctx, scene.scene, scene.first_triangle, scene.corner_turn)
        lights = self._light_records()
        self._lights = self._ctx.buffer(lights.tobytes())
        self._lights_in_storage = lights.nbytes > self._ctx.info["GL_MAX_UNIFORM_BLOCK_SIZE"]
        self._counters = self._ctx.buffer(bytes(4 * len(FALLBACKS)))
        self._parameters_buffer = self._ctx.buffer(reserve=CAMERA_PARAMETERS.stride)
        self._empty: CausticMaps | None = None
        self._dark: moderngl.Texture | None = None
        """Light of an environment, or of other receivers, of which nothing is known."""
        self._sums = PictureSums(self._ctx, self.channels.targets)
        self._rows = DispatchBudget(1, 1, 1)
        self._within_rows = False
        """Some listed pixels of a band of rows have this sample, others are still to get it."""
        self._map_targets = maps.targets
        self.dispatch_seconds = context.traits.dispatch_s
        """What one dispatch should take; rows are divided to fit."""
        features = scene.features
        self.disperses = layer != "caustic" and features.camera_disperses
        """Samples differ in the stretch of the spectrum they see."""
        self.fixed_bands = {"regular-7": 7, "regular-16": 16, "srd-lambda": 1}.get(features.method)
        """What the method prescribes."""
        self.spectrum = Spectrum(self.fixed_bands or 1)
        """How samples see the spectrum; one of `single` wavelengths needs `may_be_single`."""
        self.may_be_single = False
        """Where bands serve a scene badly, wavelengths may be taken one by one. That takes a program of its own, which
        is compiled when it is needed."""
        self.max_taps = MAX_TAPS
        self.primary_samples = PRIMARY_SAMPLES if self._may_choose or not self.disperses else 1
        """Of a sample, at what is seen directly, while a pixel has few samples."""
        self.only_directly = False
        """Leave what is seen in glass and mirrors black where a program of its own follows it."""
        self.split_threshold = SPLIT_THRESHOLD
        structs = (
            *SCENE_STRUCTS,
            CAMERA_LIGHT,
            CAMERA_PARAMETERS,
            RECEIVER,
            PLACEMENT,
            *([PICTURE] if self.pictures.structs else []),
        )
        shown = camera_defines(scene, self.channels, layer, maps) | self._tables.defines | self.pictures.defines
        shown |= {
            name: 1
            for name, on in (
                ("LIGHTS_IN_STORAGE", self._lights_in_storage),
                ("HAS_IMAGES", bool(self.pictures.structs)),
            )
            if on
        }
        self.follows = "CAMERA_SPECULAR" in shown
        """Some paths go on beyond glass or mirrors."""
        halts = self.follows and context.traits.loops_may_end
        # A viewer may open the lens later.
        self._listed = ListedPixels(self._ctx, halted_bytes(lens_defines(shown)) if halts else None)
        shown = halting_defines(shown) if halts else shown
        if "RECEIVER_LIGHT" in shown:
            self._dark = without_light(self._ctx, len(scene.receivers))
        self._source = (shown, structs)
        self._beams: ScreenBeams | None = None
        self._starts: BeamStarts | None = None
        self._haze = Haze(context, scene, self.channels) if features.haze and layer == "beauty" else None
        self._is_hazy = False
        """The samples that are being taken are of the picture that haze was drawn for."""
        self._beam_objects = np.zeros(len(scene.scene.objects), bool)
        self._beam_objects_buffer: moderngl.Buffer | None = None
        self._programs: dict[tuple[str, bool], moderngl.ComputeShader] = {}
        """Those of `_VARIANTS` that are compiled, without and with a lens."""
        self._has_lens = features.lens
        if not features.camera_beams:
            # Else beams may do without them, and they are compiled when paths need them.
            for variant in ("all", "direct") if self.follows else ("direct",):
                self._compiled(variant)

    def _light_records(self) -> np.ndarray:
        lights = CAMERA_LIGHT.zeros(len(self.scene.scene.lights) + 1)
        for i, light in enumerate(self.scene.scene.lights):
            lights[i] = light_record(light, self.scene)
        return lights

    def move(self, scene: SceneBuffers) -> None:
        """The same objects and lights stand elsewhere (`SceneBuffers.move`)."""
        self.scene = scene
        self._lights.write(self._light_records().tobytes())
        if self._haze is not None:
            self._haze.move(scene)

    def inherit(self, before: CameraPass) -> None:
        """Take over what stays as it was of `before`, which is about to be released."""
        if self._haze is not None and before._haze is not None:
            self._haze.inherit(before._haze)

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

    def _compiled(self, variant: str) -> moderngl.ComputeShader:
        """One of the camera's programs, compiled when it is first asked for."""
        key = variant, self._has_lens
        if key not in self._programs:
            shown, structs = self._source
            shown = lens_defines(shown) if self._has_lens else shown
            self._programs[key] = shader.compute(self._ctx, "camera/camera.comp", _VARIANTS[variant](shown), structs)
        return self._programs[key]

    def take_beams(
        self,
        polygons: ScreenPolygons | None,
        objects: np.ndarray | None = None,
        starts: tuple[ScreenStarts, ScreenPolygons] | None = None,
        width: int = 0,
    ) -> None:
        """From the next first sample on, show what is seen in these objects (O,) by polygons of the picture, which
        belong to its camera, size and seed; None: by paths, as everything else. `starts`: paths that carry on handed
        polygons, with those, of a picture so wide."""
        if polygons is None or objects is None or not self.follows:
            self._beam_objects[:] = False
            return
        shown, structs = self._source
        if self._beams is None:
            self._beams = ScreenBeams(self._ctx, screen_beam_defines(shown), structs, self.channels.targets)
            self._compiled("beside")
            self._beam_objects_buffer = self._ctx.buffer(reserve=4 * len(self._beam_objects))
        assert self._beam_objects_buffer is not None
        self._beam_objects[:] = objects
        self._beam_objects_buffer.write(self._beam_objects.astype("u4").tobytes())
        self._beams.take(polygons, self.scene, self.brightness)
        if starts is not None and self._starts is None:
            self._starts = BeamStarts(self._ctx, start_defines(shown), structs, MOST_ENTRIES)
        if self._starts is not None:
            drawn, handed = starts or (ScreenStarts.none(), polygons)
            self._starts.take(drawn, handed, self.scene, width)

    @property
    def brightness(self) -> np.ndarray | None:
        """How much of what looks bright lies below each of equally spaced x; None where nothing disperses."""
        return np.frombuffer(self._tables.cell_cdf.read(), "f4").astype(float) if self.disperses else None

    @property
    def shows_beams(self) -> bool:
        """Some objects are seen by polygons of the picture."""
        return bool(self._beam_objects.any())

    def run(
        self,
        camera: Camera,
        width: int,
        height: int,
        samples: int,
        sample_offset: int = 0,
        maps: CausticMaps | None = None,
        seed: int = 1,
        progress: Callable[[float], None] | None = None,
        cancelled: Callable[[], bool] | None = None,
    ) -> bool:
        """Add `samples` camera samples to every pixel; False when `cancelled` stopped it, after one at least.

        `sample_offset` is the number of samples already there; 0 starts anew. `maps` None shows
        direct light only. `progress` gets the share done, 0 to 1.
        """
        stops = False
        for share in self.samples(camera, width, height, samples, sample_offset, maps, seed):
            if progress is not None:
                progress(share)
            stops = stops or (cancelled is not None and cancelled())
            if stops and self.is_even and self.samples_taken:
                return False
        return True

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
        """`run`, pausing after every dispatch with the share done: whoever draws meanwhile may bind what it likes."""
        if sample_offset == 0 or self._sums.size != (width, height):
            self._clear(width, height)
        maps = maps or self._no_maps()
        self.draw_haze(camera, width, height)
        parameters = self._parameters(camera, width, height, maps.scale, seed)
        parameters["sample_side"] = 1.0 / np.sqrt(samples + sample_offset)
        if is_in_strips(samples, sample_offset):
            parameters["pixel_width"], parameters["pixel_height"] = samples**-0.5, samples**0.5
        # Where samples are of one band each, fewer of them share a pixel in that band.
        parameters["band_side"] = min(1.0, np.sqrt(self.spectrum.bands / (samples + sample_offset)))
        parameters["taps_per_pixel"] = TAPS_PER_PIXEL * (samples + sample_offset) ** 0.25
        parameters["primary_samples"] = (
            1
            if samples + sample_offset > PRIMARY_SAMPLES_UNTIL or (self.spectrum.single and not self.shows_beams)
            else max(self.primary_samples, PRIMARY_SAMPLES if self.shows_beams else 1)
        )
        before = _BEAMS_PROGRESS if self.shows_beams and sample_offset == 0 else 0.0
        if before:
            for share in self._draw_beams(parameters, samples, maps):
                yield before * share
        if not is_in_strips(samples, sample_offset) and not self._has_lens:
            parameters["cells"] = cells_of(samples * int(parameters["primary_samples"][0]))
        looks = np.zeros((samples, LOOKS, 2))
        if parameters["primary_samples"][0] > 1:
            looks = looks_lattice(samples, sample_offset)
            if (
                not self._has_lens  # few looks do not tell what lies before a blurred place
                and sample_offset == 0
                and samples >= SURVEY_FROM
                and self._sums.is_single
            ):
                for _ in self._survey(parameters, width, height, maps):
                    yield before
        for index, place in enumerate(pixel_lattice(samples, sample_offset)):
            parameters["sample_index"] = parameters["draw_index"] = sample_offset + index
            parameters["within_pixel"] = place
            parameters["looks"] = looks[index].reshape(-1, 4)
            for share in self._add_sample(parameters, width, height, maps):
                yield before + (1.0 - before) * (index + share) / samples
        self.context.check("the camera pass")

    @property
    def chooses(self) -> bool:
        """`choose_spectrum` has something to choose: the method leaves it open, and some paths are followed."""
        specular = [item.material.is_specular for item in self.scene.scene.objects]
        return self._may_choose and not np.all(self._beam_objects[specular])

    @property
    def _may_choose(self) -> bool:
        return self.disperses and self.fixed_bands is None and not self.scene.features.random_wavelength

    def choose_spectrum(
        self, camera: Camera, width: int, height: int, samples: int, maps: CausticMaps | None = None
    ) -> Spectrum:
        """Sample the spectrum in the way that leaves the least error after so many samples, as far as a coarse grid of
        the picture's own pixels tells.

        Sets and returns `spectrum`; what was summed up is forgotten. A method that prescribes its way keeps it."""
        for _ in self.choosing_spectrum(camera, width, height, samples, maps):
            pass
        return self.spectrum

    def choosing_spectrum(
        self, camera: Camera, width: int, height: int, samples: int, maps: CausticMaps | None = None
    ) -> Iterator[float]:
        """`choose_spectrum`, pausing after every dispatch."""
        if not self.chooses:
            return
        looks = choosing_spectrum(samples, self.may_be_single)
        picture: np.ndarray | None = None
        while True:
            try:
                look = next(looks) if picture is None else looks.send(picture)
            except StopIteration as stop:
                self.spectrum = stop.value
                break
            picture = yield from self._coarse_picture(look, camera, width, height, samples, maps or self._no_maps())
        self._clear(*self._sums.size)

    def _coarse_picture(
        self, look: PilotRender, camera: Camera, width: int, height: int, samples: int, maps: CausticMaps
    ) -> Generator[float, None, np.ndarray]:
        """Few pixels of the picture, each as large as the picture's own."""
        columns, rows = grid_of(width, height)
        self._clear(columns, rows)
        self.spectrum, self._is_hazy = look.spectrum, False
        parameters = self._parameters(camera, columns, rows, maps.scale, look.seed)
        parameters["dithered"], parameters["counts_turns"], parameters["sample_side"], parameters["band_side"] = (
            0,
            0,
            1.0,
            1.0,
        )
        parameters["pixel_width"] = parameters["pixel_height"] = columns / width
        parameters["taps_per_pixel"] = TAPS_PER_PIXEL * samples**0.25
        # Within the picture's pixel, which is a small part of the grid's.
        parameters["within_pixel"] = 0.5 + (look.place - 0.5) * columns / width
        for number in range(look.spectrum.bands):
            parameters["sample_index"] = parameters["draw_index"] = number
            yield from self._add_sample(parameters, columns, rows, maps)
        picture = self._sums.mean().astype(np.float64)
        # Beside a picture in colour, turns are counted.
        return picture[..., :3] if self.channels.edges_nm is None else picture

    def _bind(self, maps: CausticMaps) -> None:
        self.scene.bind()
        tables = self._tables
        self.scene.texels.bind_spectra(tables.spectra)
        if self.scene.texels.as_image:
            tables.emission.bind_to_image(UNIT_EMISSION, read=True, write=False)
        else:
            tables.emission.use(UNIT_EMISSION)
        self.pictures.bind(BIND_PICTURES, UNIT_PICTURES)
        if self._lights_in_storage:
            self._lights.bind_to_storage_buffer(BIND_LIGHTS)
        else:
            self._lights.bind_to_uniform_block(BIND_LIGHTS)
        buffers = (tables.object_colours, tables.cell_cdf, maps.receivers, maps.placements)
        for binding, buffer in zip(
            (BIND_OBJECT_COLOURS, BIND_CELL_CDF, BIND_RECEIVERS, BIND_PLACEMENTS), buffers, strict=True
        ):
            buffer.bind_to_storage_buffer(binding)
        self._counters.bind_to_storage_buffer(BIND_COUNTERS)
        self._listed.bind()
        self._parameters_buffer.bind_to_uniform_block(bindings.PARAMETERS)
        for unit, texture in enumerate(maps.textures):
            texture.use(location=unit)
        if self._dark is not None:
            (maps.environment or self._dark).use(location=UNIT_RECEIVER_LIGHT)
        self._sums.bind()

    @property
    def fallbacks(self) -> dict[str, int]:
        """How often, since the pass was made, a path lost its columns, was left at its greatest depth, could not wait,
        kept a band that should have been cut, or was cut short by the driver."""
        return dict(zip(FALLBACKS, np.frombuffer(self._counters.read(), "u4").tolist(), strict=True))

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
        shader.release(self._tables, self._lights, self._counters, self._sums, self._parameters_buffer)
        for beams in (self._beams, self._starts, self._haze):
            if beams is not None:
                beams.release()
        if self._beam_objects_buffer is not None:
            self._beam_objects_buffer.release()
        shader.release(*self._programs.values())
        self._listed.release()
        if self._owns_pictures:
            self.pictures.release()
        if self._dark is not None:
            self._dark.release()
        if self._empty is not None:
            self._empty.release()
        self._empty = None

    # ---- for pictures in motion ------------------------------------------------------------

    @property
    def source(self) -> tuple[dict[str, int | float | str], tuple[Struct, ...]]:
        """Defines and structs of the program that follows listed pixels; those of the others are made from them."""
        return self._source

    @property
    def listed(self) -> int:
        """Pixels that are listed."""
        return self._listed.count

    def moving_parameters(
        self, camera: Camera, width: int, height: int, maps: CausticMaps, max_taps: int, seed: int
    ) -> np.ndarray:
        """CAMERA_PARAMETERS (1,) of one sample of the whole spectrum in every pixel's middle; sums have that size
        then, whatever is in them."""
        if self._sums.size != (width, height):
            self._clear(width, height)
        self.spectrum, self.max_taps = Spectrum(1), max_taps
        parameters = self._parameters(camera, width, height, maps.scale, seed)
        parameters["sample_side"] = parameters["band_side"] = 1.0
        parameters["taps_per_pixel"] = TAPS_PER_PIXEL
        parameters["within_pixel"] = 0.5
        return parameters

    def bind_for(self, parameters: np.ndarray, maps: CausticMaps) -> None:
        """Bind everything that the camera's programs read."""
        self._bind(maps)
        self._parameters_buffer.write(parameters.tobytes())

    def start_list(self) -> None:
        """Nothing is listed."""
        self._listed.clear()

    def follow(self, parameters: np.ndarray, maps: CausticMaps) -> Iterator[float]:
        """Follow what is listed, into the sums; pauses with the share done."""
        yield from self._follow_listed(parameters, maps)

    # ---- private ---------------------------------------------------------------------------

    def _parameters(self, camera: Camera, width: int, height: int, map_scale: float, seed: int) -> np.ndarray:
        self._has_lens = camera.lens_radius > 0.0
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
            self._listed.resize(width * height, width * (-(-height // _GROUP) * _GROUP))
        self._within_rows = False

    def _add_sample(self, parameters: np.ndarray, width: int, height: int, maps: CausticMaps) -> Iterator[float]:
        """Dispatch one sample, yielding the share done after each dispatch: a band of rows, or some of its listed
        pixels."""
        for row, rows in self._seen_directly(parameters, width, height, maps):
            for share in self._follow_listed(parameters, maps):
                self._within_rows = True
                yield (row + share * rows) / height
            if self.shows_beams:
                assert self._beams is not None
                self._beams.add(self._sums.textures, row, rows)
            if self._haze is not None and self._is_hazy:
                self._haze.add(self._sums.textures, row, rows)
            self._within_rows = False
            self._sums.samples_of_row[row : row + rows] += 1
            yield (row + rows) / height

    def _seen_directly(
        self, parameters: np.ndarray, width: int, height: int, maps: CausticMaps
    ) -> Iterator[tuple[int, int]]:
        """Look at what is seen directly, one dispatch after the other; pauses with the band's first row and their
        number, which glass in it has been listed of."""
        row = 0
        while row < height:
            # Groups that overlap the next band would add its rows twice, so bands are whole groups.
            rows = min(self._rows.units, height - row)
            parameters["first_row"] = row
            self._listed.clear()
            took = self._dispatch(self._program_direct(), parameters, maps, -(-width // _GROUP), -(-rows // _GROUP))
            self._rows.learn(rows, took, self.dispatch_seconds)
            yield row, rows
            row += rows

    def _survey(self, parameters: np.ndarray, width: int, height: int, maps: CausticMaps) -> Iterator[float]:
        """Find the pixels in which, and round which, nothing but one surface in the same light is seen directly, and
        what that looks like: the samples then look at the others only. Pauses after every dispatch with 0.0."""
        taken = parameters.copy()
        taken["survey"], taken["survey_gain"] = 1, 1.0 / SURVEY_SAMPLES
        taken["survey_at"] = self._listed.survey_at(width * height)
        # The looks tile the pixel: what they are averaged over is then all of it, and nothing twice.
        columns, rows = _SURVEY_GRID
        taken["sample_side"], taken["cells"] = SURVEY_SAMPLES**-0.5, 0.0
        taken["pixel_width"], taken["pixel_height"] = np.sqrt(rows / columns), np.sqrt(columns / rows)
        tiles = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1).reshape(-1, 2)
        looks = ((tiles + 0.5) / _SURVEY_GRID).reshape(SURVEY_SAMPLES, -1, 4)
        for index, places in enumerate(looks):
            taken["sample_index"] = taken["draw_index"] = index
            taken["looks"] = places
            for _ in self._seen_directly(taken, width, height, maps):
                yield 0.0
        parameters["survey"], parameters["survey_at"] = 2, taken["survey_at"]

    def _follow_listed(self, parameters: np.ndarray, maps: CausticMaps) -> Iterator[float]:
        """Follow what the listed pixels of a band of rows see, yielding the share done."""
        if self.only_directly or not self.follows:
            return

        def dispatch(count: int) -> float:
            return self._dispatch(self._program_beyond(), parameters, maps, -(-count // GROUP), 1)

        yield from self._listed.follow(parameters, dispatch, self.dispatch_seconds)

    def _dispatch(
        self, program: moderngl.ComputeShader, parameters: np.ndarray, maps: CausticMaps, groups_x: int, groups_y: int
    ) -> float:
        """Run a program to its end; seconds it took."""
        self._bind(maps)
        self._parameters_buffer.write(parameters.tobytes())
        start = time.perf_counter()
        with self.context.timers.timing("camera"):
            program.run(groups_x, groups_y)
            self._ctx.memory_barrier()
        self._ctx.finish()
        return time.perf_counter() - start

    def _program_direct(self) -> moderngl.ComputeShader:
        """What looks at what is seen directly."""
        if not self.shows_beams:
            return self._compiled("direct")
        assert self._beam_objects_buffer is not None
        self._beam_objects_buffer.bind_to_storage_buffer(BIND_BEAM_OBJECTS)
        return self._compiled("beside")

    def _draw_beams(self, parameters: np.ndarray, samples: int, maps: CausticMaps) -> Iterator[float]:
        """Draw what is seen by beams, yielding the share done after every portion."""
        assert self._beams is not None
        parameters["sample_index"] = parameters["draw_index"] = 0

        def bind() -> None:
            self._bind(maps)
            self._parameters_buffer.write(parameters.tobytes())

        places = shared_places(samples, int(parameters["primary_samples"][0]))
        as_image = self.scene.texels.as_image
        drawn = 1.0 if self._starts is None else 0.5
        for share in self._beams.draw(self._sums.size, places, as_image, bind, self.dispatch_seconds):
            yield drawn * share
        if self._starts is not None:
            found, gather = self._beams.found, self._beams.gather
            parameters["start_share"] = START_SHARE

            def dispatch(program: moderngl.ComputeShader, count: int) -> float:
                return self._dispatch(program, parameters, maps, -(-count // GROUP), 1)

            for share in self._starts.follow(self._listed, parameters, dispatch, found, gather, self.dispatch_seconds):
                yield drawn + (1.0 - drawn) * share

    def _program_beyond(self) -> moderngl.ComputeShader:
        """What follows rays beyond glass and mirrors."""
        return self._compiled("single" if self.spectrum.single else "all")

    def _no_maps(self) -> CausticMaps:
        if self._empty is None:
            self._empty = CausticMaps.without_light(self._ctx, len(self.scene.receivers), self._map_targets)
        return self._empty
