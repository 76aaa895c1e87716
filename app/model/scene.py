"""The scene as plain, validated float64 values: what there is, not how it is drawn.

Nothing here knows OpenGL, files or the command line. A loader (`scene_file`, `gltf`) makes
a `Scene`; `features` decides from it what the programs must hold; `gpu.scene_buffers`
packs it. Lengths are in the scene's own unit, angles in names say their unit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from .geometry.mesh import Mesh
from .lights import Light
from .materials import Absorption, Black, Dielectric, Diffuse, Grating, Material, Mirror, Polariser
from .texture import Environment
from .vectors import Vec3

__all__ = [
    "Absorption",
    "Black",
    "Camera",
    "Dab",
    "Dielectric",
    "Diffuse",
    "Grating",
    "Light",
    "Material",
    "Mirror",
    "Polariser",
    "RenderDefaults",
    "Scene",
    "SceneObject",
    "Vec3",
]


@dataclass(frozen=True)
class Camera:
    """Pinhole or orthographic camera, with a thin lens where `lens_radius` is not 0; rows of the picture run along
    `up`."""

    position: Vec3
    target: Vec3
    up: Vec3 = (0.0, 0.0, 1.0)
    kind: Literal["pinhole", "orthographic"] = "pinhole"
    vertical_fov_deg: float = 35.0
    vertical_extent: float = 1.0
    """Height of the picture in scene units (orthographic only)."""
    lens_radius: float = 0.0
    """Half the lens's aperture, scene units; 0: no lens, all is in focus."""
    focus_distance: float | None = None
    """Distance of the plane of focus from the lens, along the view, scene units; None: the target is in focus."""

    @property
    def plane_of_focus(self) -> float:
        """`focus_distance`, or the distance of the target."""
        return math.dist(self.position, self.target) if self.focus_distance is None else self.focus_distance


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

    @property
    def whole(self) -> SceneObject:
        """The object that this is a flat face of (`flat_faces`), or itself."""
        return self if self.mesh.whole is None else replace(self, mesh=self.mesh.whole)

    @property
    def world_vertices(self) -> np.ndarray:
        """float64 (n, 3)."""
        return self.mesh.vertices @ self.object_to_world[:3, :3].T + self.object_to_world[:3, 3]

    @property
    def world_bounds(self) -> np.ndarray:
        """Lowest and highest corner of the box along the world's axes, float64 (2, 3)."""
        points = self.world_vertices
        return np.stack([points.min(axis=0), points.max(axis=0)])

    @property
    def stretch(self) -> np.ndarray:
        """float64 (3, 3): what its matrix does to the mesh before it is turned, symmetric."""
        _, sizes, right = np.linalg.svd(self.object_to_world[:3, :3])
        return right.T @ np.diag(sizes) @ right


@dataclass(frozen=True)
class RenderDefaults:
    """What a scene asks for where the command line says nothing."""

    width: int = 960
    height: int = 540
    photons: int = 1_000_000
    exposure_ev: float = 0.0
    max_depth: int = 64
    glare: float = 0.0
    """Share of the light that the camera's lens scatters (`base.glare`); of pictures to look at only."""
    antialias_highlights: bool = True
    """Edges of what is overexposed have no steps (`base.highlights`); of pictures to look at only."""
    polarisation: bool = False
    """Light keeps its polarisation from surface to surface; otherwise every event takes the mean of s and p."""
    bounces: int = 0
    """How often light goes on from one diffuse surface to another; 0: these do not light each other."""
    haze: float = 0.0
    """Scattering coefficient of the haze round all objects, 1/scene unit; 0: the air is clear."""
    haze_anisotropy: float = 0.0
    """Mean cosine of the angle by which it scatters (Henyey and Greenstein's g)."""


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
    units: str = ""
    """What people call the unit of length ("mm"); converts nothing. Empty: unknown."""

    @property
    def polarised(self) -> bool:
        """Light keeps its polarisation from surface to surface: as asked, or because an object polarises it."""
        return self.render.polarisation or any(item.material.polarises for item in self.objects)

    @property
    def receiver_names(self) -> list[str]:
        """Names of the diffuse objects, in their order."""
        return list(dict.fromkeys(item.name for item in self.objects if item.material.receives))
