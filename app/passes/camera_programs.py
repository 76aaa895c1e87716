"""What each program of the camera's pass is compiled with, and the programs, each made when it is first used.

Every scene has a program for what is seen directly. In a scene that shows glass or mirrors it lists the pixels that
meet something specular first, and another program, which holds all that is expensive, follows those. A third is for
samples of single wavelengths.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import moderngl

from ..features.program_switches import Defines, switched
from ..gpu import bindings, shader
from ..gpu.map_channels import MapChannels
from ..gpu.scene_buffers import SceneBuffers
from ..gpu.schema import Struct
from ..gpu.texture_store import place_defines
from .camera_tables import EMISSION_CELLS
from .picture_channels import Channels

MAX_DEPTH = 48
"""Surfaces that one camera path may meet."""
MAX_EVENTS = 160
"""Surfaces that all paths of a sample may meet together."""
STACK = 6
"""Paths of a sample that may wait while another is followed."""
ENDS_HELD = 8
"""Ends of a sample's paths that are evaluated together."""
CUT_THRESHOLD = 0.004
"""Share of a sample's power above which both parts of a cut band are followed."""
ROULETTE_WEIGHT = 0.05
"""Share of a sample's power below which a path of one wavelength goes on by chance only."""
HALT_ROUNDS = 5000
"""Rounds of its loops after which a sample halts on a software renderer (camera/waiting.glsl). Eight side by side that
have nothing in common then take 40,000 of the driver's 65,535, and what is left is for the surface they are at and the
ends of paths they hold. Those of one wavelength, which vary most in length, find others as long after a third."""
TINT_STEPS = 48
"""Stretches that the whole spectrum is cut into behind coloured glass."""

(
    BIND_LIGHTS,
    BIND_OBJECT_COLOURS,
    BIND_CELL_CDF,
    BIND_RECEIVERS,
    BIND_PLACEMENTS,
    BIND_PICTURES,
    BIND_COUNTERS,
    BIND_LISTED,
    BIND_WAITING,
) = range(8, 17)
UNIT_RECEIVER_LIGHT, UNIT_EMISSION, UNIT_PICTURES = 9, 10, 11
_BEYOND_ONLY = (
    "CAMERA_SPECULAR",
    "HAS_DISPERSION",
    "SPECTRAL_SWEEP",
    "RANDOM_WAVELENGTH",
    "EVEN_WAVELENGTHS",
    "MAP_BINS",
    "ABSORPTION",
    "NORMAL_DERIVATIVES",
    "POLARISED",
    "HAS_CRYSTAL",
)
"""What only rays beyond glass and mirrors need."""


def camera_defines(scene: SceneBuffers, channels: Channels, layer: str, maps: MapChannels) -> Defines:
    """What the scene needs of the shader, for a picture in `channels` and `maps` of these channels; tables and pictures
    add theirs.

    `CAMERA_SPECULAR` is among them where rays go on beyond glass or mirrors: these are then for the listed pixels, and
    `direct_defines` has the others'.
    """
    lights, features = scene.scene.lights, scene.features
    beauty = layer != "caustic"
    specular = beauty and features.camera_specular
    disperses = specular and features.camera_disperses
    # A method that follows single wavelengths has no columns for them; nor has a scene where nothing disperses.
    groups = features.spectral_groups if disperses else 0
    # The same features of the camera's own rays.
    seen = replace(
        features,
        spectral_groups=groups,
        absorption=specular and features.camera_colours,
        normal_derivatives=features.smooth_normals or features.curved_solids or features.rough,
        polarised=specular and features.polarised,
    )
    return (
        seen.defines(of_picture=True)
        | bindings.SCENE_DEFINES
        | scene.defines
        | place_defines(BIND_PICTURES, UNIT_PICTURES)
        | {
            "TARGETS": channels.targets,
            "MAP_TARGETS": maps.targets,
            "BIND_LIGHTS": BIND_LIGHTS,
            "BIND_OBJECT_COLOURS": BIND_OBJECT_COLOURS,
            "BIND_CELL_CDF": BIND_CELL_CDF,
            "BIND_COUNTERS": BIND_COUNTERS,
            "BIND_LISTED": BIND_LISTED,
            "BIND_WAITING": BIND_WAITING,
            "BIND_RECEIVERS": BIND_RECEIVERS,
            "BIND_PLACEMENTS": BIND_PLACEMENTS,
            "UNIT_RECEIVER_LIGHT": UNIT_RECEIVER_LIGHT,
            "UNIT_EMISSION": UNIT_EMISSION,
            "EMISSION_CELLS": EMISSION_CELLS,
            "TINT_STEPS": TINT_STEPS,
            "BIN_TARGET": maps.first_target,
            "BIN_COUNT": maps.count,
            "BIN_OVERLAP": 1 if maps.edges_nm is not None else 0,
            "LIGHT_COUNT": len(lights),
            "LIGHT_ROOM": len(lights) + 1,
            "MAX_DEPTH": MAX_DEPTH,
            "MAX_EVENTS": MAX_EVENTS if specular else 1,
            "STACK": STACK,
            "CUT_THRESHOLD": CUT_THRESHOLD,
            "ROULETTE_WEIGHT": ROULETTE_WEIGHT,
            "HALT_ROUNDS": HALT_ROUNDS,
            "ENDS_HELD": ENDS_HELD,
        }
        | switched(
            LAYER_BEAUTY=beauty,
            CAMERA_SPECULAR=specular,
            RECEIVER_LIGHT=beauty and (features.environment_lights or features.bounces > 0),
            HAS_DISPERSION=disperses,
            SPECTRAL_SWEEP=groups > 0,
            RGB_CHANNELS=channels.edges_nm is None,
            MAP_BINS=disperses and maps.count > 0,
            VISIBLE_LIGHTS=beauty and any(light.has_extent for light in lights),
        )
    )


def direct_defines(beyond: Defines) -> Defines:
    """Defines for what is seen directly, from what the listed pixels are compiled with."""
    return {name: value for name, value in beyond.items() if name not in _BEYOND_ONLY} | {
        **switched(LISTS_SPECULAR=True, FOLLOWED="CAMERA_SPECULAR" in beyond),
        "SPECTRAL_GROUPS": 0,
        "MAX_EVENTS": 1,
    }


def single_defines(beyond: Defines) -> Defines:
    """Defines for listed pixels whose samples are of one wavelength each."""
    return {name: value for name, value in beyond.items() if name != "SPECTRAL_SWEEP"} | {
        "SPECTRAL_GROUPS": 0,
        "RANDOM_WAVELENGTH": 1,
        "EVEN_WAVELENGTHS": 1,
    }


def waiting_bytes(beyond: Defines) -> int:
    """Room that surely holds what a sample lets wait, also with a lens: its paths, their ends, the rest."""
    columns = int(beyond["SPECTRAL_GROUPS"]) + 2
    path = 312 + 40 * columns + 4 * int(beyond.get("ABSORBERS", 0)) + 64 * int("POLARISED" in beyond)
    path += 16 * int("COATS" in beyond) + 48 * int("HAS_FILM" in beyond)
    ends = 0 if "HALTS" in beyond else ENDS_HELD * (path + 64)
    return (STACK + 1) * path + ends + 16 * int(beyond["TARGETS"]) + 64


_VARIANTS: dict[str, Callable[[Defines], Defines]] = {
    "all": lambda shown: shown,
    "direct": direct_defines,
    "single": single_defines,
    "kept": direct_defines,
    "even": direct_defines,
}
"""Programs: beyond glass and mirrors, for what is seen directly, beyond glass of one wavelength, for pixels that a
survey has found even, and for finding these."""


class CameraPrograms:
    """Owns them."""

    def __init__(self, ctx: moderngl.Context, defines: Defines, structs: tuple[Struct, ...], has_lens: bool) -> None:
        """`defines`: of the program that follows listed pixels."""
        self._ctx = ctx
        self.defines, self.structs = defines, structs
        self.has_lens = has_lens
        """The camera has one; a viewer may open and close it."""
        self._compiled: dict[tuple[str, bool], moderngl.ComputeShader] = {}

    def of(self, variant: str) -> moderngl.ComputeShader:
        """One of `_VARIANTS`."""
        key = variant, self.has_lens
        if key not in self._compiled:
            shown = self.defines | switched(LENS=self.has_lens)
            variants = _VARIANTS[variant](shown)
            file = variant if variant in ("kept", "even") else "camera"
            self._compiled[key] = shader.compute(self._ctx, f"camera/{file}.comp", variants, self.structs)
        return self._compiled[key]

    def release(self) -> None:
        """Free those that were compiled."""
        shader.release(*self._compiled.values())
