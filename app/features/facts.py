"""What a scene and its settings say that decides features: each fact is found once, for all rows that need it."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from ..model.curved_solids import Face, curved_solids
from ..model.environment_light import why_no_bounces, why_no_environment_light
from ..model.geometry.outline import convex_outline
from ..model.optics.glass import Dispersion
from ..model.scene import Camera, Material, Scene, SceneObject
from ..model.scene_camera import camera_frame
from ..model.settings import RANDOM_METHODS, RenderSettings, divides_spectrum, has_beams
from ..model.tint_levels import tint_levels

MAX_GROUPS = 4
"""Spectral columns a photon may carry; further dispersive materials share the last one."""
MAP_TENTS = 8
"""Spectral channels of a caustic map that is seen through dispersive glass."""
MAX_SOLID_PLANES = 96
"""A convex solid of more faces goes to the tree."""
MOST_PLANES = 256
"""Most planes of all convex solids of a scene: rays test every plane, and a tree leaves most triangles out."""
MAX_BEAM_TRIANGLES = 8192
"""A mesh of more is never tried as facets of beams; whether fewer pay is measured (`render.beam_light`)."""


@dataclass(frozen=True)
class Facts:
    """A scene under settings."""

    scene: Scene
    settings: RenderSettings

    def having(self, test: Callable[[Material], object]) -> list[SceneObject]:
        """Objects whose material passes `test`."""
        return [item for item in self.scene.objects if test(item.material)]

    # -- method ---------------------------------------------------------------------------

    @property
    def is_picture(self) -> bool:
        """All light is shown, not caustics alone."""
        return self.settings.layer == "beauty"

    @property
    def is_random(self) -> bool:
        """Each photon has one wavelength, drawn at random."""
        return self.settings.method in RANDOM_METHODS

    @property
    def is_single(self) -> bool:
        """Each photon has one wavelength."""
        return self.is_random or self.settings.method.startswith("regular")

    @property
    def has_columns(self) -> bool:
        """Photons carry spatial columns."""
        return self.settings.method != "stochastic-point"

    # -- materials ------------------------------------------------------------------------

    @cached_property
    def glass(self) -> list[SceneObject]:
        return self.having(lambda material: material.transmits)

    @cached_property
    def receivers(self) -> list[SceneObject]:
        return self.having(lambda material: material.receives)

    @cached_property
    def flat_receivers(self) -> list[SceneObject]:
        return [item for item in self.receivers if item.mesh.is_flat]

    @cached_property
    def dispersive(self) -> list[Dispersion]:
        """What light is dispersed by, each once: glasses, both indices of crystals, wavelengths at gratings."""
        return dispersive_glasses(self.scene)

    @property
    def distinct_glasses(self) -> int:
        return len({dispersion for item in self.glass for dispersion in item.material.dispersions})

    @cached_property
    def absorbing(self) -> list[SceneObject]:
        return [item for item in self.glass if item.material.is_solid and item.material.absorption is not None]

    @cached_property
    def mirrors(self) -> list[SceneObject]:
        return self.having(lambda material: material.is_mirror)

    @cached_property
    def films(self) -> list[SceneObject]:
        return self.having(lambda material: material.film)

    @cached_property
    def crystals(self) -> list[SceneObject]:
        return self.having(lambda material: material.is_crystal)

    @cached_property
    def polarisers(self) -> list[SceneObject]:
        return self.having(lambda material: material.is_polariser)

    @cached_property
    def is_coloured(self) -> bool:
        """Some surface of glass or a mirror has a colour."""
        return bool(self.having(lambda m: (m.is_mirror or m.transmits) and m.is_coloured))

    # -- shapes ---------------------------------------------------------------------------

    @cached_property
    def half_spaces(self) -> dict[int, np.ndarray]:
        return half_spaces(self.scene)

    @cached_property
    def curved(self) -> dict[int, tuple[Face, ...]]:
        return curved_solids(self.scene)

    @cached_property
    def loose(self) -> list[SceneObject]:
        """Objects of triangles: neither half-spaces nor curved solids."""
        exact = {*self.half_spaces, *self.curved}
        return [item for i, item in enumerate(self.scene.objects) if i not in exact]

    @cached_property
    def loose_triangles(self) -> int:
        return sum(len(item.mesh.triangles) for item in self.loose)

    @cached_property
    def smooth(self) -> list[SceneObject]:
        """Objects of triangles whose interpolated normals turn specular rays."""
        return [
            item
            for item in self.loose
            if item.mesh.corner_normals is not None and (item.material.is_specular or item.material.has_coat)
        ]

    @property
    def smooth_triangles(self) -> int:
        return sum(len(item.mesh.triangles) for item in self.smooth if item.material.is_specular)

    # -- light ----------------------------------------------------------------------------

    @cached_property
    def groups(self) -> int:
        """Spectral columns of a photon."""
        most = 1 if self.settings.method == "srd-lambda" else MAX_GROUPS
        return 0 if self.is_single else min(len(self.dispersive), most)

    @cached_property
    def beam_objects(self) -> list[int]:
        """Objects whose light goes as beams."""
        if not has_beams(self.settings.method) or not self.flat_receivers or self.is_painted:
            return []
        return beam_objects(self.scene) if any(light.profile is None for light in self.scene.lights) else []

    @cached_property
    def is_by_photons(self) -> bool:
        """Photons carry what some glass or mirror does with light, or may: beams end at what is flat alone."""
        by_photons = any(o.material.is_specular for i, o in enumerate(self.scene.objects) if i not in self.beam_objects)
        return by_photons or len(self.flat_receivers) < len(self.receivers)

    @property
    def is_painted(self) -> bool:
        return is_painted(self.scene, self.settings.local_gain)

    @cached_property
    def no_haze(self) -> str | None:
        """Why no light is seen on its way."""
        return why_no_haze(self.scene) or self._no_picture

    @cached_property
    def no_environment_light(self) -> str | None:
        """Why no light of the environment is looked up."""
        return why_no_environment_light(self.scene) or self._no_picture

    @cached_property
    def no_bounces(self) -> str | None:
        """Why no light of other receivers is looked up."""
        return why_no_bounces(self.scene) or self._no_picture

    @property
    def _no_picture(self) -> str | None:
        return None if self.is_picture else "the picture shows caustics only"

    @cached_property
    def has_tint_levels(self) -> bool:
        """Photons count how far they have come through the glass that tints most. What haze shows of photons, and what
        the viewer reads of them, knows weights at three wavelengths alone; where no band is cut, photons carry what
        beams leave in bands of the same tables."""
        plain = self.is_single or self.no_haze is None or self.settings.editable
        plain |= bool(self.beam_objects) and not self.groups
        return bool(self.absorbing) and not plain and tint_levels(self.scene) is not None

    @cached_property
    def is_reindexed(self) -> bool:
        """An edit of the dispersion, or the brush, moves wavelengths between paths: the refractive index alone says
        what a path is and what it weighs."""
        from ..model.optics.spectral_tables import SpectralAxis

        if not (self.settings.editable or self.is_painted) or not divides_spectrum(self.settings.method):
            return False
        weighed = self.absorbing or self.is_coloured or self.films or self.crystals or self.polarisers
        if self.groups != 1 or weighed or self.having(lambda m: m.is_grating):
            return False
        (turning,) = SpectralAxis.build([item.material.dispersion for item in self.glass]).turning_nm
        return len(turning) == 2

    # -- camera ---------------------------------------------------------------------------

    @cached_property
    def camera_needs(self) -> tuple[bool, bool]:
        return camera_needs(self.scene, self.settings)

    @cached_property
    def tents(self) -> int:
        """Spectral channels of caustic maps beside XYZ."""
        seen = self.camera_needs[1] and not self.settings.bins
        return MAP_TENTS if seen and self.scene.lights and self.receivers else 0


# -- of scenes ----------------------------------------------------------------------------


def why_no_haze(scene: Scene) -> str | None:
    """Why no light is seen on its way; None: it is."""
    if scene.render.haze == 0.0:
        return "[render] haze is 0"
    if not scene.lights:
        return "no light shines (an environment's light is not seen in haze)"
    return None


def why_no_beams(item: SceneObject) -> str | None:
    """Why beams cannot carry what an object of glass or a mirror does with light; None: they can."""
    if item.material.why_no_beams is not None:
        return item.material.why_no_beams
    if len(item.mesh.triangles) > MAX_BEAM_TRIANGLES:
        return f"it has {len(item.mesh.triangles)} triangles"
    if not item.mesh.is_faceted:
        return "its normals are interpolated"
    return None


def beam_objects(scene: Scene) -> list[int]:
    """Objects of flat-faceted glass or mirrors, whose light may go as beams."""
    return [i for i, o in enumerate(scene.objects) if o.material.is_specular and why_no_beams(o) is None]


def is_painted(scene: Scene, local_gain: bool) -> bool:
    """Whether the dispersion brush moves light: photons follow it, beams do not."""
    return local_gain and any(o.local_dispersion for o in scene.objects)


def camera_needs(scene: Scene, settings: RenderSettings) -> tuple[bool, bool]:
    """Whether the camera may see glass, mirrors or what is glossy, and whether it may see through glass that
    disperses."""
    if settings.layer != "beauty":
        return False, False
    mirrors = any(o.material.is_mirror or o.material.has_coat for o in scene.objects)
    glass = [o for o in scene.objects if o.material.transmits or o.material.is_grating or o.material.is_polariser]
    if not (settings.any_view or mirrors):
        # What is refracted or reflected first must be seen first; all else follows from it.
        glass = glass if any(in_view(o, scene.camera, settings.width / settings.height) for o in glass) else []
    return bool(glass) or mirrors, any(o.material.disperses for o in glass)


def in_view(item: SceneObject, camera: Camera, aspect: float) -> bool:
    """Whether the camera may see the object's bounding box: False only where one side of the view leaves out all of
    it."""
    right, up, forward = camera_frame(camera)
    low, high = item.world_bounds
    corners = np.array(np.meshgrid(*zip(low, high, strict=True), indexing="ij")).reshape(3, 8).T - np.array(
        camera.position
    )
    x, y, depth = corners @ right, corners @ up, corners @ forward
    # A lens sees by as much more as a point there is out of focus.
    blur = camera.lens_radius * np.abs(1.0 - depth / camera.plane_of_focus)
    if camera.kind == "orthographic":
        half = 0.5 * camera.vertical_extent * np.ones_like(depth)
    else:
        half = np.tan(np.radians(0.5 * camera.vertical_fov_deg)) * depth
    across, up_to = aspect * half + blur, half + blur
    outside = [x > across, x < -across, y > up_to, y < -up_to, depth < 0.0]
    return not any(side.all() for side in outside)


def dispersive_glasses(scene: Scene) -> list[Dispersion]:
    """Each distinct dispersion of glasses, crystals and gratings, in order of the objects."""
    dispersing = (item.material for item in scene.objects if item.material.disperses)
    return list(dict.fromkeys(d for material in dispersing for d in material.dispersions if d.is_dispersive))


def half_spaces(scene: Scene) -> dict[int, np.ndarray]:
    """`Mesh.convex_planes` (P, 4), by index, of objects that are intersected as intersections of half-spaces; none
    where they have more than `MOST_PLANES` together."""
    found: dict[int, np.ndarray] = {}
    planes = 0
    for index, item in enumerate(scene.objects):
        own = item.mesh.convex_planes if item.material.is_solid else None
        if own is not None and len(own) <= MAX_SOLID_PLANES:
            found[index] = own
            planes += len(own)
            if planes > MOST_PLANES:
                return {}
    return found


def has_borders(item: SceneObject) -> bool:
    """Whether an object is a flat receiver of a convex outline, at whose straight borders footprints have images."""
    if not item.material.receives or not item.mesh.is_flat:
        return False
    points = item.mesh.vertices - item.mesh.vertices.mean(axis=0)
    in_plane = points @ np.linalg.svd(points, full_matrices=False)[2][:2].T
    return convex_outline(in_plane, item.mesh.triangles) is not None


class Named(Protocol):
    @property
    def name(self) -> str: ...


def names(items: Iterable[Named]) -> str:
    """For people."""
    return listed([item.name for item in items])


def listed(words: list[str]) -> str:
    """The first four, each once, and how many more."""
    words = list(dict.fromkeys(words))
    return ", ".join(words[:4]) + (f" and {len(words) - 4} more" if len(words) > 4 else "")
