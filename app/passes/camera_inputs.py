"""What the programs of the camera's pass read besides a dispatch's parameters, and where it is bound: the scene's
tables, lights and pictures, caustic maps, counters."""

from __future__ import annotations

from collections.abc import Sequence

import moderngl
import numpy as np

from ..features.program_switches import Defines, switched
from ..gpu import bindings, shader
from ..gpu.map_channels import MapChannels
from ..gpu.records import PLACEMENT, RECEIVER
from ..gpu.scene_buffers import SceneBuffers
from ..gpu.scene_records import SCENE_STRUCTS
from ..gpu.schema import Struct
from ..gpu.texture_store import PICTURE, TextureStore
from .camera_programs import (
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
)
from .camera_records import CAMERA_LIGHT, CAMERA_PARAMETERS, light_record
from .camera_tables import CameraTables
from .caustic_maps import CausticMaps
from .environment_light import without_light
from .picture_channels import Channels

FALLBACKS = ("columns_dropped", "depth_reached", "stack_full", "band_uncut", "loops_ended")
"""What the shader counts, in its order."""


class CameraInputs:
    """Owns tables, lights, counters and parameters of one scene as it is shown."""

    def __init__(
        self,
        ctx: moderngl.Context,
        scene: SceneBuffers,
        channels: Channels,
        reflectances: Sequence[np.ndarray | None],
        maps: MapChannels,
        pictures: TextureStore | None,
        receiver_light: bool,
    ) -> None:
        """As of `CameraPass`; `receiver_light`: programs look up what the environment and other receivers send."""
        self._ctx = ctx
        self.scene = scene
        self._tables = CameraTables(ctx, scene, channels, reflectances, maps)
        self._owns_pictures = pictures is None
        self.pictures = pictures or TextureStore(ctx, scene.scene, scene.first_triangle, scene.corner_turn)
        lights = self._light_records()
        self._lights = ctx.buffer(lights.tobytes())
        self._lights_in_storage = lights.nbytes > ctx.info["GL_MAX_UNIFORM_BLOCK_SIZE"]
        self._counters = ctx.buffer(bytes(4 * len(FALLBACKS)))
        self._parameters = ctx.buffer(reserve=CAMERA_PARAMETERS.stride)
        self._dark = without_light(ctx, len(scene.receivers)) if receiver_light else None
        """Light of an environment, or of other receivers, of which nothing is known."""
        self._empty: CausticMaps | None = None
        self._map_targets = maps.targets
        self._picture_defines = dict(self.pictures.defines)

    @property
    def structs(self) -> tuple[Struct, ...]:
        """Structs of the records that programs read."""
        pictures = (PICTURE,) if self.pictures.structs else ()
        return *SCENE_STRUCTS, CAMERA_LIGHT, CAMERA_PARAMETERS, RECEIVER, PLACEMENT, *pictures

    @property
    def defines(self) -> Defines:
        """What programs must know of them."""
        places = switched(LIGHTS_IN_STORAGE=self._lights_in_storage, HAS_IMAGES=self.pictures.structs)
        return self._tables.defines | self.pictures.defines | places

    def _light_records(self) -> np.ndarray:
        lights = CAMERA_LIGHT.zeros(len(self.scene.scene.lights) + 1)
        for i, light in enumerate(self.scene.scene.lights):
            lights[i] = light_record(light, self.scene)
        return lights

    def take(self, scene: SceneBuffers) -> bool:
        """Show other colours, glass and spectra of the same geometry; False where other programs are needed."""
        same = self.pictures.defines == self._picture_defines
        if not same or len(scene.scene.lights) != len(self.scene.scene.lights):
            return False
        if not self._tables.take(scene):
            return False
        self._counters.write(bytes(4 * len(FALLBACKS)))
        before, self.scene = self.scene.scene.lights, scene
        if any(a is not b for a, b in zip(before, scene.scene.lights, strict=True)):
            self.move(scene)
        return True

    def move(self, scene: SceneBuffers) -> None:
        """Objects or lights have moved."""
        self.scene = scene
        self._lights.write(self._light_records().tobytes())

    def bind(self, maps: CausticMaps, parameters: np.ndarray) -> None:
        """Everything to the places that the programs read; `parameters`: CAMERA_PARAMETERS (1,)."""
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
        self._parameters.bind_to_uniform_block(bindings.PARAMETERS)
        self._parameters.write(parameters.tobytes())
        for unit, texture in enumerate(maps.textures):
            texture.use(location=unit)
        if self._dark is not None:
            (maps.environment or self._dark).use(location=UNIT_RECEIVER_LIGHT)

    @property
    def fallbacks(self) -> dict[str, int]:
        """How often each of `FALLBACKS` was counted."""
        return dict(zip(FALLBACKS, np.frombuffer(self._counters.read(), "u4").tolist(), strict=True))

    @property
    def brightness(self) -> np.ndarray:
        """How much of what looks bright is below each of equally spaced x."""
        return np.frombuffer(self._tables.cell_cdf.read(), "f4").astype(float)

    @property
    def no_maps(self) -> CausticMaps:
        """Maps without light."""
        if self._empty is None:
            self._empty = CausticMaps.without_light(self._ctx, len(self.scene.receivers), self._map_targets)
        return self._empty

    def release(self) -> None:
        """Free everything, pictures only where they were made here."""
        shader.release(self._tables, self._lights, self._counters, self._parameters)
        if self._owns_pictures:
            self.pictures.release()
        shader.release(self._dark, self._empty)
        self._empty = None
