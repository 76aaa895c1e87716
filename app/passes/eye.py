"""The camera's pass: pictures of the scene from the caustic maps and the lights.

One dispatch adds one camera sample to every pixel of a band of rows, so that no dispatch takes
long on a software renderer: between two of them there is time for progress and for a stop.
Samples form a lattice inside the pixel that later launches refine (box filter).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import moderngl
import numpy as np

from app.gpu import bindings, shader
from app.gpu.context import Context
from app.gpu.records import NONE, PLACEMENT, RECEIVER
from app.gpu.scene_buffers import SCENE_STRUCTS, SceneBuffers
from app.gpu.schema import Field, Struct
from app.model.camera_rays import camera_frame
from app.model.colorimetry import xyz_to_rgb709_matrix
from app.model.scene import Camera, Dielectric, Diffuse, Light, Mirror
from app.model.scene_checks import contains
from app.passes.emission_domain import orthonormal_frame
from app.passes.present import Channels

D_LINE_NM = 587.5618
"""The eye's rays have one wavelength."""

MAX_EVENTS = 24
"""Surfaces a camera path may meet in a scene with glass or mirrors."""
REFLECTION_EVENTS = 8
"""Of those, kept back for the reflection at the first glass surface."""

_TARGET_SECONDS = 0.15
"""What one dispatch may take; rows are divided to fit."""
_GROUP = 8

EYE_LIGHT = Struct(
    "EyeLight",
    (
        Field("position", "vec3", "GPU space"),
        Field("kind", "uint", "0 point or spot, 1 directional, 2 collimated, 3 area"),
        Field("axis", "vec3", "unit, propagation"),
        Field("is_disc", "uint"),
        Field("half_u", "vec3", "centre to rim, GPU units; directional: tangent of the angular radius"),
        Field("measure", "float", "area: GPU units²; directional: radiance per irradiance (0: no extent); else 0"),
        Field("half_v", "vec3", "as half_u, across it"),
        Field("reserved", "float", ""),
        Field("cone", "vec2", "inner and outer half angle, rad"),
        Field("reserved2", "vec2", ""),
    ),
)
EYE_PARAMETERS = Struct(
    "EyeParameters",
    (
        Field("position", "vec3", "camera, GPU space"),
        Field("orthographic", "uint"),
        Field("forward", "vec3", "unit"),
        Field("first_row", "uint", "row of this dispatch's first pixels"),
        Field("half_right", "vec3", "picture's middle to its right border"),
        Field("sample_index", "uint", "counts the samples of a pixel"),
        Field("half_up", "vec3", "picture's middle to its upper border"),
        Field("seed", "uint"),
        Field("red_of_xyz", "vec4", "row of the XYZ to linear Rec.709 matrix"),
        Field("green_of_xyz", "vec4"),
        Field("blue_of_xyz", "vec4"),
        Field("size", "uvec2", "picture, pixels"),
        Field("within_pixel", "vec2", "this sample's place in its pixel, 0 to 1"),
        Field("pixel_size", "float", "GPU units a pixel covers at the camera (orthographic)"),
        Field("pixel_angle", "float", "and how that grows with distance (pinhole)"),
        Field("map_scale", "float", "factor on the caustic maps: one over the passes in them"),
        Field("x_eye", "float", "spectral coordinate of the eye's rays"),
        Field("sample_side", "float", "side of a sample's share of its pixel, pixels"),
        Field("unused", "float", "", 3),
        Field("inside_mask", "uint", "solids the camera stands in, bits of the medium stack"),
        Field("inside_object", "uint", "solid outside the stack it stands in, or NONE"),
        Field("reserved", "uvec2", ""),
    ),
)
_LIGHT_KINDS = {"point": 0, "spot": 0, "directional": 1, "collimated": 2, "area": 3}
_BIND_LIGHTS, _BIND_LIGHT_CHANNELS, _BIND_MATERIAL_CHANNELS, _BIND_RECEIVERS, _BIND_PLACEMENTS = range(8, 13)


@dataclass(frozen=True)
class CausticMaps:
    """The light half's result, as the eye reads it."""

    textures: Sequence[moderngl.Texture]
    """RGBA32F, energy per texel: XYZ and W, or four bins each."""
    receivers: moderngl.Buffer
    """RECEIVER records."""
    placements: moderngl.Buffer
    """PLACEMENT records."""
    scale: float = 1.0
    """Factor on every texel: one over the number of passes summed in it."""


class EyePass:
    """Owns the program, the sums and the light tables; `run` adds samples, `read_*` divide by their number."""

    def __init__(
        self,
        context: Context,
        scene: SceneBuffers,
        layer: str = "beauty",
        reflectances: Sequence[np.ndarray | None] = (None,),
        bin_edges_nm: Sequence[float] | None = None,
    ) -> None:
        """`layer`: "beauty", or "caustic" (the maps on what is seen directly, no other light).

        `reflectances`: reflectance classes as the splat tables were built with; the first is
        None, the others (401,) are folded into the maps. `bin_edges_nm`: None for XYZ maps.
        """
        if reflectances[0] is not None:
            raise ValueError("reflectance class 0 must be None: it stands for receivers whose maps hold plain irradiance")
        self.context = context
        self.scene = scene
        self.channels = Channels(None if bin_edges_nm is None else tuple(float(e) for e in bin_edges_nm))
        self._ctx = context.ctx
        self._buffers = self._fixed_buffers(reflectances)
        self._parameters_buffer = self._ctx.buffer(reserve=EYE_PARAMETERS.stride)
        self._empty: CausticMaps | None = None
        self._pictures: list[moderngl.Texture] = []
        self._samples_of_row = np.zeros(0, int)
        self._rows_a_dispatch = 0
        self.dispatch_seconds = _TARGET_SECONDS
        """What one dispatch should take; rows are divided to fit."""
        self._program = shader.compute(self._ctx, "eye.comp", self._defines(layer, len(reflectances)), (*SCENE_STRUCTS, EYE_LIGHT, EYE_PARAMETERS, RECEIVER, PLACEMENT))

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
        """Add `samples` camera samples to every pixel; False when `cancelled` stopped it.

        `sample_offset` is the number of samples already there; 0 starts anew. `maps` None shows
        direct light only. `progress` gets the share done, 0 to 1.
        """
        for share in self.samples(camera, width, height, samples, sample_offset, maps, seed):
            if progress is not None:
                progress(share)
            if cancelled is not None and cancelled():
                return False
        return True

    def samples(
        self, camera: Camera, width: int, height: int, samples: int, sample_offset: int = 0, maps: CausticMaps | None = None, seed: int = 1
    ) -> Iterator[float]:
        """`run`, pausing after every band of rows with the share done: whoever draws meanwhile may bind what it likes."""
        if sample_offset == 0 or self._size != (width, height):
            self._clear(width, height)
        maps = maps or self._no_maps()
        parameters = self._parameters(camera, width, height, maps.scale, seed)
        parameters["sample_side"] = 1.0 / np.sqrt(samples + sample_offset)
        for index, place in enumerate(_pixel_lattice(samples, sample_offset)):
            parameters["sample_index"] = sample_offset + index
            parameters["within_pixel"] = place
            for share in self._add_sample(parameters, width, height, maps):
                yield (index + share) / samples
        self.context.check("the eye pass")

    def _bind(self, maps: CausticMaps) -> None:
        self.scene.bind()
        for binding, buffer in self._buffers.items():
            buffer.bind_to_storage_buffer(binding)
        maps.receivers.bind_to_storage_buffer(_BIND_RECEIVERS)
        maps.placements.bind_to_storage_buffer(_BIND_PLACEMENTS)
        self._parameters_buffer.bind_to_storage_buffer(bindings.PARAMETERS)
        for unit, (texture, picture) in enumerate(zip(maps.textures, self._pictures, strict=True)):
            texture.use(location=unit)
            picture.bind_to_image(unit, read=True, write=True)

    @property
    def sums(self) -> Sequence[moderngl.Texture]:
        """RGBA32F sums over the samples taken, four channels each."""
        return self._pictures

    @property
    def samples_taken(self) -> int:
        """Samples that every pixel has."""
        return int(self._samples_of_row.min(initial=0))

    def read_rgb(self) -> np.ndarray:
        """Linear Rec.709 radiance, float32 (H, W, 3), lm/(sr unit²) per channel of white; row 0 on top."""
        return self.channels.to_rgb709(self._read())

    def read_spectral(self) -> np.ndarray:
        """Radiance of each bin, float32 (H, W, bins), W/(sr unit²)."""
        return self.channels.to_spectral(self._read())

    def release(self) -> None:
        """Free every buffer, texture and program."""
        for owned in (*self._buffers.values(), *self._pictures, self._parameters_buffer, self._program):
            shader.release(owned)
        if self._empty is not None:
            for owned in (*self._empty.textures, self._empty.receivers, self._empty.placements):
                owned.release()
        self._pictures, self._empty = [], None

    # ---- private ---------------------------------------------------------------------------

    @property
    def _size(self) -> tuple[int, int]:
        return self._pictures[0].size if self._pictures else (0, 0)

    def _defines(self, layer: str, classes: int) -> dict[str, int | float | str]:
        scene = self.scene.scene
        beauty = layer != "caustic"
        specular = beauty and any(isinstance(o.material, Dielectric | Mirror) for o in scene.objects)
        defines = self.scene.features.defines() | bindings.SCENE_DEFINES | self.scene.defines
        defines |= {
            "TARGETS": self.channels.targets,
            "BIND_LIGHTS": _BIND_LIGHTS,
            "BIND_LIGHT_CHANNELS": _BIND_LIGHT_CHANNELS,
            "BIND_MATERIAL_CHANNELS": _BIND_MATERIAL_CHANNELS,
            "BIND_RECEIVERS": _BIND_RECEIVERS,
            "BIND_PLACEMENTS": _BIND_PLACEMENTS,
            "CLASSES": classes,
            "LIGHT_COUNT": len(scene.lights),
            "OBJECT_COUNT": len(scene.objects),
            "MAX_EVENTS": MAX_EVENTS if specular else 1,
            "REFLECTION_EVENTS": REFLECTION_EVENTS,
        }
        switches = {
            "LAYER_BEAUTY": beauty,
            "RGB_CHANNELS": self.channels.edges_nm is None,
            "VISIBLE_LIGHTS": beauty and any(_has_extent(light) for light in scene.lights),
        }
        return defines | {name: 1 for name, on in switches.items() if on}

    def _fixed_buffers(self, reflectances: Sequence[np.ndarray | None]) -> dict[int, moderngl.Buffer]:
        scene, channels, space = self.scene.scene, self.channels, self.scene.space
        lights = EYE_LIGHT.zeros(max(1, len(scene.lights)))
        light_channels = np.zeros((len(lights), len(reflectances), 4 * channels.targets), np.float32)
        for i, light in enumerate(scene.lights):
            lights[i] = _light_record(light, self.scene)
            # Intensity over distance² in GPU units needs the square of the scale; the other kinds are free of lengths.
            unit = space.scale**2 if light.kind in ("point", "spot") else 1.0
            for c, reflectance in enumerate(reflectances):
                light_channels[i, c] = unit * channels.of_light(light.spectral_power, reflectance)
        materials = np.zeros((len(scene.objects) + 1, 4 * channels.targets), np.float32)
        for row, item in zip(materials, scene.objects, strict=False):
            match item.material:
                case Diffuse() | Mirror():
                    row[:] = channels.of_reflectance(item.material.reflectance_rgb)
                case Dielectric(absorption=absorption) if absorption is not None:
                    row[:] = channels.of_absorption(absorption.coefficient) / space.scale
        materials[-1] = channels.of_background(scene.background_rgb)
        tables = {_BIND_LIGHTS: lights, _BIND_LIGHT_CHANNELS: light_channels, _BIND_MATERIAL_CHANNELS: materials}
        return {binding: self._ctx.buffer(np.ascontiguousarray(data).tobytes()) for binding, data in tables.items()}

    def _parameters(self, camera: Camera, width: int, height: int, map_scale: float, seed: int) -> np.ndarray:
        space = self.scene.space
        right, up, forward = camera_frame(camera)
        orthographic = camera.kind == "orthographic"
        half_height = 0.5 * camera.vertical_extent * space.scale if orthographic else np.tan(np.radians(0.5 * camera.vertical_fov_deg))
        parameters = EYE_PARAMETERS.zeros(1)
        parameters["position"] = space.to_gpu(np.array(camera.position))
        parameters["orthographic"] = orthographic
        parameters["forward"] = forward
        parameters["half_right"] = right * half_height * width / height
        parameters["half_up"] = up * half_height
        parameters["seed"] = seed & 0xFFFFFFFF
        for name, row in zip(("red_of_xyz", "green_of_xyz", "blue_of_xyz"), xyz_to_rgb709_matrix(), strict=True):
            parameters[name][0, :3] = row
        parameters["size"] = width, height
        parameters["pixel_size" if orthographic else "pixel_angle"] = 2.0 * half_height / height
        parameters["map_scale"] = map_scale
        parameters["x_eye"] = self.scene.axis.x_of_nm(D_LINE_NM)
        parameters["inside_object"] = NONE
        for index, item in enumerate(self.scene.scene.objects):
            if isinstance(item.material, Dielectric) and contains(item, np.array(camera.position)):
                if index in self.scene.stack_objects:
                    parameters["inside_mask"] |= np.uint32(1 << self.scene.stack_objects.index(index))
                else:
                    parameters["inside_object"] = index
        return parameters

    def _clear(self, width: int, height: int) -> None:
        if self._size != (width, height):
            for picture in self._pictures:
                picture.release()
            self._pictures = [self._ctx.texture((width, height), 4, dtype="f4") for _ in range(self.channels.targets)]
            self._rows_a_dispatch = min(height, 64)
        zeros = bytes(width * height * 16)
        for picture in self._pictures:
            picture.write(zeros)
        self._samples_of_row = np.zeros(height, int)

    def _add_sample(self, parameters: np.ndarray, width: int, height: int, maps: CausticMaps) -> Iterator[float]:
        """Dispatch one sample, yielding the share of rows done after each band of rows."""
        row = 0
        while row < height:
            rows = min(self._rows_a_dispatch, height - row)
            parameters["first_row"] = row
            self._bind(maps)
            self._parameters_buffer.write(parameters.tobytes())
            start = time.perf_counter()
            # Groups that overlap the next band would add its rows twice, so bands are whole groups.
            self._program.run(-(-width // _GROUP), -(-rows // _GROUP))
            self._ctx.memory_barrier()
            self._ctx.finish()
            elapsed = time.perf_counter() - start
            self._samples_of_row[row : row + rows] += 1
            row += rows
            fitting = rows * self.dispatch_seconds / max(elapsed, 1e-4)
            most = min(4 * self._rows_a_dispatch, -(-height // _GROUP) * _GROUP)
            self._rows_a_dispatch = int(np.clip(fitting // _GROUP * _GROUP, _GROUP, max(_GROUP, most)))
            yield row / height

    def _read(self) -> np.ndarray:
        if not self._pictures:
            raise RuntimeError("the eye pass has not run yet")
        width, height = self._size
        sums = np.empty((height, width, 4 * len(self._pictures)), np.float32)
        layer = np.empty((height, width, 4), np.float32)
        for t, picture in enumerate(self._pictures):
            picture.read_into(layer)
            sums[:, :, 4 * t : 4 * t + 4] = layer
        sums /= np.maximum(self._samples_of_row, 1).astype(np.float32)[:, None, None]
        return sums

    def _no_maps(self) -> CausticMaps:
        if self._empty is None:
            receivers = RECEIVER.zeros(max(1, len(self.scene.receivers)))
            receivers["placement"] = NONE
            textures = [self._ctx.texture((1, 1), 4, bytes(16), dtype="f4") for _ in range(self.channels.targets)]
            self._empty = CausticMaps(textures, self._ctx.buffer(receivers.tobytes()), self._ctx.buffer(reserve=PLACEMENT.stride))
        return self._empty


def _pixel_lattice(samples: int, offset: int) -> np.ndarray:
    """(samples, 2) places in a pixel: a golden-ratio lattice, shifted from launch to launch.

    Every row and every column of the pixel cut into `samples` holds one sample, so that edges of
    any slant are filtered well.
    """
    golden = 0.6180339887498949
    shift = (0.5 + offset * np.array([0.7548776662466927, 0.5698402909980532])) % 1.0
    index = np.arange(samples)
    return np.column_stack([(index + shift[0]) / samples, (index * golden + shift[1]) % 1.0])


def _has_extent(light: Light) -> bool:
    return light.kind == "area" or (light.kind == "directional" and light.angular_diameter_deg > 0)


def _light_record(light: Light, scene: SceneBuffers) -> np.void:
    record = EYE_LIGHT.zeros(1)[0]
    axis = np.asarray(light.direction, float) / np.linalg.norm(light.direction)
    tangent, bitangent = orthonormal_frame(axis, None if light.tangent is None else np.asarray(light.tangent))
    record["position"] = scene.space.to_gpu(np.array(light.position))
    record["kind"] = _LIGHT_KINDS[light.kind]
    record["axis"] = axis
    record["is_disc"] = light.shape == "disc" or light.kind == "directional"
    half = np.array([light.radius, light.radius] if light.shape == "disc" else [0.5 * light.width, 0.5 * light.height]) * scene.space.scale
    if light.kind == "directional":
        radius = np.radians(0.5 * light.angular_diameter_deg)
        half = np.full(2, np.tan(radius))
        record["measure"] = 1.0 / (np.pi * np.sin(radius) ** 2) if radius > 0 else 0.0
    elif light.kind == "area":
        record["measure"] = half[0] * half[1] * (np.pi if light.shape == "disc" else 4.0)
    record["half_u"], record["half_v"] = tangent * half[0], bitangent * half[1]
    angles = (light.inner_half_angle_deg, light.outer_half_angle_deg)
    record["cone"] = np.radians(angles) if light.kind == "spot" else (4.0, 4.0)
    return record
