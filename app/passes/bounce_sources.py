"""What receivers send back of the light that they get from anything but each other: lights' own, caustics', and the
environment's.

Colours are multiplied as the camera multiplies them. A light's spectrum meets a surface's reflectance wavelength by
wavelength; what came by way of maps, whose spectra are gone, channel by channel in linear Rec.709.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import moderngl
import numpy as np

from ..gpu import bindings, shader
from ..gpu.context import Context
from ..gpu.map_channels import MapChannels
from ..gpu.records import PLACEMENT, RECEIVER
from ..gpu.scene_buffers import SceneBuffers
from ..gpu.scene_records import SCENE_STRUCTS
from ..gpu.schema import Field, Struct
from ..gpu.texture_store import TextureStore, place_defines
from ..model.optics.colorimetry import VISIBLE_NM, rgb_basis, xyz_to_rgb709, xyz_to_rgb709_matrix
from ..model.optics.spectrum import Spectrum
from ..model.scene import Light, Scene
from .camera_records import CAMERA_LIGHT, light_record
from .caustic_maps import CausticMaps
from .environment_places import PLACE, EnvironmentPlaces
from .picture_channels import Channels

SAMPLES, SAMPLES_OF_EXTENT = 16, 64
"""Shadow rays a place and light: over the place; over a light of some extent as well."""
_AT_ONCE = 8
"""Samples of one dispatch."""
_GROUP = 64
_BIND_PLACES, _BIND_LIGHTS, _BIND_GAINS, _BIND_SOURCES, _BIND_RECEIVERS, _BIND_PLACEMENTS, _BIND_PICTURES = range(8, 15)
_UNIT_PICTURES = 10

DIRECT_PARAMETERS = Struct(
    "BounceDirectParameters",
    (
        Field("count", "uint", "places"),
        Field("light", "uint"),
        Field("first_sample", "uint"),
        Field("end_sample", "uint"),
        Field("share", "float", "one over all samples"),
        Field("reserved", "float", ""),
        Field("reserved_too", "vec2", ""),
    ),
)
CAUSTIC_PARAMETERS = Struct(
    "BounceCausticParameters",
    (
        Field("colours", "vec4", "linear Rec.709 of each of a map's four channels", 4),
        Field("count", "uint", "places"),
        Field("scale", "float", "factor on the map"),
        Field("reserved", "vec2", ""),
    ),
)
SOURCE = Struct(
    "BounceSource",
    (
        Field("caustic", "vec3", "irradiance, linear Rec.709; of a measured reflectance what it sends back of that"),
        Field("reserved", "float", ""),
        Field("paint", "vec3", "colour of the picture that is worn, linear Rec.709"),
        Field("reserved_too", "float", ""),
    ),
)


class BounceSources:
    """Owns programs and buffers; light by light in `steps`, maps at once in `take_maps`."""

    def __init__(self, context: Context, buffers: SceneBuffers, places: EnvironmentPlaces, gpu_places: moderngl.Buffer):
        """`gpu_places`: those of `places`, the caller's."""
        self._context, self._ctx, self._buffers, self._places = context, context.ctx, buffers, places
        self._gpu_places = gpu_places
        self._count, lights = len(places.places), buffers.scene.lights
        records = CAMERA_LIGHT.zeros(max(1, len(lights)))
        for number, light in enumerate(lights):
            records[number] = light_record(light, buffers)
        self._lights = self._ctx.buffer(records.tobytes())
        self._gains = self._ctx.buffer(bytes(4 * max(1, self._count * len(lights))))
        self._sources = self._ctx.buffer(reserve=max(1, self._count) * SOURCE.stride)
        self._parameters = self._ctx.buffer(reserve=max(DIRECT_PARAMETERS.stride, CAUSTIC_PARAMETERS.stride))
        self._left = [
            (light, first, count)
            for light, each in enumerate(lights)
            for count in [SAMPLES_OF_EXTENT if each.has_extent else SAMPLES]
            for first in range(0, count, _AT_ONCE)
        ]
        self._all = len(self._left)
        self._worn = TextureStore(self._ctx, *self._place_of(buffers.scene))
        defines = buffers.features.defines() | bindings.SCENE_DEFINES | buffers.defines
        for name in ("NORMAL_DERIVATIVES", "HAS_TEXTURES"):
            defines.pop(name, None)
        defines |= {"BIND_PLACES": _BIND_PLACES}
        self._direct: moderngl.ComputeShader | None = None
        if lights:
            named = defines | {"BIND_LIGHTS": _BIND_LIGHTS, "BIND_GAINS": _BIND_GAINS}
            read = (*SCENE_STRUCTS, PLACE, CAMERA_LIGHT, DIRECT_PARAMETERS)
            self._direct = shader.compute(self._ctx, "light/bounce_direct.comp", named, read)
        named = defines | {"BIND_SOURCES": _BIND_SOURCES, "BIND_RECEIVERS": _BIND_RECEIVERS, "MAP_TARGETS": 1}
        named |= {"BIND_PLACEMENTS": _BIND_PLACEMENTS, **place_defines(_BIND_PICTURES, _UNIT_PICTURES)}
        named |= self._worn.defines
        structs = (*SCENE_STRUCTS, PLACE, RECEIVER, PLACEMENT, CAUSTIC_PARAMETERS, SOURCE, *self._worn.structs)
        self._lookups = shader.compute(self._ctx, "light/bounce_caustic.comp", named, structs)
        self._no_maps = CausticMaps.without_light(self._ctx, len(buffers.receivers), 1)
        self._caustic, self._paint = self._looked_up(self._no_maps, MapChannels())

    def _place_of(self, scene: Scene) -> tuple[Scene, np.ndarray, np.ndarray]:
        """Arguments of a store of the pictures on surfaces alone: the environment is never looked up."""
        return replace(scene, environment=None), self._buffers.first_triangle, self._buffers.corner_turn

    def take_scene(self, scene: Scene) -> None:
        """Surfaces may wear other pictures."""
        place = self._place_of(scene)
        if self._worn.follow(*place):
            return
        self._worn.release()
        self._worn = TextureStore(self._ctx, *place)
        _, self._paint = self._looked_up(self._no_maps, MapChannels())

    def steps(self) -> Iterator[float]:
        """Ask for the lights that are left, pausing after every dispatch with the share done."""
        while self._left:
            light, first, count = self._left.pop(0)
            parameters = DIRECT_PARAMETERS.zeros(1)
            parameters["count"], parameters["light"] = self._count, light
            parameters["first_sample"], parameters["end_sample"] = first, min(first + _AT_ONCE, count)
            parameters["share"] = 1.0 / count
            self._bind(parameters)
            self._lights.bind_to_storage_buffer(_BIND_LIGHTS)
            self._gains.bind_to_storage_buffer(_BIND_GAINS)
            assert self._direct is not None
            self._run(self._direct)
            yield 1.0 - len(self._left) / self._all

    @property
    def is_done(self) -> bool:
        """All lights were sampled."""
        return not self._left

    def take_maps(self, maps: CausticMaps, channels: MapChannels) -> None:
        """Look up what the caustic maps hold now; they are not sampled again."""
        self._caustic, self._paint = self._looked_up(maps, channels)

    def _looked_up(self, maps: CausticMaps, channels: MapChannels) -> tuple[np.ndarray, np.ndarray]:
        """`BounceSource.caustic` and `paint` of every place, float64 (n, 3) each."""
        records = SOURCE.zeros(max(1, self._count))
        records["paint"] = 1.0
        self._sources.write(records.tobytes())
        for target, colours in enumerate(_colours_of(channels)):
            parameters = CAUSTIC_PARAMETERS.zeros(1)
            parameters["colours"][0, :, :3] = colours
            parameters["count"], parameters["scale"] = self._count, maps.scale
            self._bind(parameters)
            self._sources.bind_to_storage_buffer(_BIND_SOURCES)
            maps.receivers.bind_to_storage_buffer(_BIND_RECEIVERS)
            maps.placements.bind_to_storage_buffer(_BIND_PLACEMENTS)
            self._worn.bind(_BIND_PICTURES, _UNIT_PICTURES)
            maps.textures[target].use(location=0)
            self._run(self._lookups)
        found = np.frombuffer(self._sources.read(), SOURCE.dtype)[: self._count]
        return found["caustic"].astype(float), found["paint"].astype(float)

    def reflectance(self, scene: Scene) -> np.ndarray:
        """Light at every place, float64 (n, 3), linear Rec.709."""
        own = np.array([o.material.reflectance_rgb if o.material.receives else (0.0,) * 3 for o in scene.objects])
        return own.reshape(-1, 3)[self._places.places["object"]] * self._paint

    def radiosity(self, scene: Scene, environment: np.ndarray | None) -> np.ndarray:
        """What every place sends back of direct light, caustics and `environment` (n, 3), the environment's irradiance:
        float64 (n, 3), linear Rec.709, lm/unit². Colours and spectra are those of `scene`."""
        objects, reflectance = self._places.places["object"], self.reflectance(scene)
        measured = np.array([o.material.receives and o.material.reflectance is not None for o in scene.objects])
        found = self._caustic * np.where(measured[objects][:, None], 1.0, reflectance)
        if environment is not None:
            found += reflectance * environment
        count = len(scene.lights)
        gains = np.frombuffer(self._gains.read(), "f4")[: count * self._count].reshape(count, self._count)
        for light, gain in zip(scene.lights, gains, strict=True):
            unit = self._buffers.space.scale**2 if light.is_intensity else 1.0
            by_colour = reflectance @ np.stack([_rgb(light, column) for column in rgb_basis().T])
            for index in np.flatnonzero(measured):
                by_colour[objects == index] = _rgb(light, np.asarray(scene.objects[index].material.reflectance))
            found += unit * gain[:, None].astype(float) * by_colour
        return found

    def _bind(self, parameters: np.ndarray) -> None:
        self._buffers.bind()
        self._parameters.write(parameters.tobytes())
        self._parameters.bind_to_uniform_block(bindings.PARAMETERS)
        self._gpu_places.bind_to_storage_buffer(_BIND_PLACES)

    def _run(self, program: moderngl.ComputeShader) -> None:
        with self._context.timers.timing("bounces"):
            program.run(-(-max(1, self._count) // _GROUP))
            self._ctx.memory_barrier()
        self._ctx.finish()

    @property
    def bytes(self) -> int:
        """Device memory held."""
        return self._gains.size + self._sources.size + self._lights.size + self._worn.bytes

    def release(self) -> None:
        """Free everything."""
        shader.release(self._lights, self._gains, self._sources, self._parameters, self._lookups)
        if self._direct is not None:
            shader.release(self._direct)
        self._worn.release()
        self._no_maps.release()


def _rgb(light: Light, reflectance: np.ndarray) -> np.ndarray:
    """Linear Rec.709 (3,) of a light's whole spectrum under a reflectance (401,)."""
    spectrum = light.spectral_power
    lines = tuple((at, power * float(np.interp(at, VISIBLE_NM, reflectance))) for at, power in spectrum.lines)
    return xyz_to_rgb709(Spectrum(spectrum.density * reflectance, lines).xyz())


def _colours_of(channels: MapChannels) -> list[np.ndarray]:
    """Linear Rec.709 of each channel of the targets that hold all light once: float64 (4, 3) each."""
    if channels.edges_nm is None:
        return [np.concatenate([xyz_to_rgb709_matrix().T, np.zeros((1, 3))])]
    rgb = Channels(channels.edges_nm).to_rgb709(np.eye(channels.columns)).astype(float)
    return list(rgb.reshape(-1, 4, 3))
