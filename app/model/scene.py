"""The scene as plain, validated float64 values: what there is, not how it is drawn.

Nothing here knows OpenGL, files or the command line. A loader (`scene_file`, `gltf`) makes
a `Scene`; `features` decides from it what the programs must hold; `gpu.scene_buffers`
packs it. Lengths are in the scene's own unit, angles in names say their unit.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from .geometry.mesh import Mesh
from .optics.glass import Dispersion
from .optics.spectrum import Spectrum
from .texture import Environment, Texture

Vec3 = tuple[float, float, float]


@dataclass(frozen=True)
class Camera:
    """Pinhole or orthographic camera; rows of the picture run along `up`."""

    position: Vec3
    target: Vec3
    up: Vec3 = (0.0, 0.0, 1.0)
    kind: Literal["pinhole", "orthographic"] = "pinhole"
    vertical_fov_deg: float = 35.0
    vertical_extent: float = 1.0
    """Height of the picture in scene units (orthographic only)."""


@dataclass(frozen=True)
class Light:
    """One emitter.

    `spectral_power` holds the spectral density per nanometre of the quantity that belongs
    to the kind, already scaled to absolute units:

    | kind | quantity | shape fields |
    |---|---|---|
    | point | radiant intensity, W/sr | – |
    | spot | radiant intensity on the axis, W/sr | inner/outer half angle (equal = hard edge) |
    | directional | irradiance on a plane across the direction, W/unit² | angular_diameter_deg |
    | collimated | irradiance on a plane across the direction, W/unit² | shape, radius or size |
    | area | radiance, W/(sr unit²), one-sided, Lambertian | shape, radius or size |

    A photometric scene file (cd, lm, lux, nits) is converted with K_m = 683.002 lm/W, so the
    renderer's Y is always in lm/(sr unit²).
    """

    name: str
    kind: Literal["point", "spot", "directional", "collimated", "area"]
    spectral_power: Spectrum
    position: Vec3 = (0.0, 0.0, 0.0)
    direction: Vec3 = (0.0, 0.0, -1.0)
    """Unit propagation direction of the axis (spot, directional, collimated, area)."""
    tangent: Vec3 | None = None
    """Direction of a rectangle's width; None picks one."""
    inner_half_angle_deg: float = 30.0
    outer_half_angle_deg: float = 30.0
    angular_diameter_deg: float = 0.0
    shape: Literal["disc", "rectangle"] = "disc"
    radius: float = 1.0
    width: float = 1.0
    height: float = 1.0

    @property
    def has_extent(self) -> bool:
        """Whether it is more than a point or a strictly parallel beam, so that a camera ray can run into it."""
        return self.kind == "area" or (self.kind == "directional" and self.angular_diameter_deg > 0.0)


@dataclass(frozen=True)
class Absorption:
    """Absorption coefficient alpha(wavelength), per scene unit, on the visible grid of `spectrum`."""

    coefficient: np.ndarray
    """float64 (401,), 1/unit, at 380, 381, … 780 nm."""


@dataclass(frozen=True)
class Dielectric:
    """A transparent solid."""

    dispersion: Dispersion
    absorption: Absorption | None = None
    priority: int = 0
    """Where solids overlap, the higher priority decides; equal ones: the later object."""


@dataclass(frozen=True)
class Mirror:
    """A perfect specular reflector with linear Rec.709 reflectance."""

    reflectance_rgb: Vec3 = (1.0, 1.0, 1.0)


@dataclass(frozen=True)
class Diffuse:
    """A two-sided Lambertian receiver; `reflectance` (401,) on the visible grid overrides RGB."""

    reflectance_rgb: Vec3 = (0.8, 0.8, 0.8)
    reflectance: np.ndarray | None = None
    texture: Texture | None = None
    """Multiplies `reflectance_rgb` by the mesh's texture coordinates; never beside `reflectance`."""


@dataclass(frozen=True)
class Black:
    """A perfect absorber."""


Material = Dielectric | Mirror | Diffuse | Black


@dataclass(frozen=True)
class Dab:
    """One touch of the dispersion brush on a receiver: a local gain of dispersion. Not physical; `local_dispersion`
    says how dabs add up."""

    position: Vec3
    """Centre, in the receiver's own coordinates, so that it moves with the object."""
    radius: float
    """In the receiver's own units; beyond it the dab does nothing."""
    log2_gain: float
    """Doublings of the gain at the centre: positive widens colours, negative narrows them. Unused by an eraser."""
    falloff: float = 0.5
    """Share of the radius over which the dab fades out: 0 is a hard edge, 1 fades from the centre on."""
    erase: float = 0.0
    """Share of what earlier dabs did that this one takes away at its centre (0: it is no eraser)."""


@dataclass(frozen=True)
class SceneObject:
    """A mesh placed in the world. Instances share one `Mesh` value."""

    name: str
    mesh: Mesh
    material: Material
    object_to_world: np.ndarray = field(default_factory=lambda: np.eye(4))
    """float64 (4, 4), column vectors: p_world = M @ p_object."""
    local_dispersion: tuple[Dab, ...] = ()
    """Touches of the dispersion brush on this receiver, oldest first."""


@dataclass(frozen=True)
class RenderDefaults:
    """What a scene asks for where the command line says nothing."""

    width: int = 960
    height: int = 540
    photons: int = 1_000_000
    exposure_ev: float = 0.0
    max_depth: int = 64


@dataclass(frozen=True)
class Scene:
    """Everything there is."""

    name: str
    camera: Camera
    lights: tuple[Light, ...]
    objects: tuple[SceneObject, ...]
    background_rgb: Vec3 = (0.0, 0.0, 0.0)
    """Linear Rec.709 radiance seen where a camera ray leaves the scene (lights nothing)."""
    environment: Environment | None = None
    """Seen instead of `background_rgb`."""
    render: RenderDefaults = RenderDefaults()
    notes: tuple[str, ...] = ()
    """What was assumed while loading, one sentence each; shown to the user."""
