"""What a scene needs, as one frozen value from which every program is built.

(Scene, RenderSettings) → Features → defines (`passes/variants.py`): nothing else chooses a shader variant. What is
False or 0 here is absent from the program that runs, not skipped by it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..model.contacts import contacts, overlapping_solids, standing, world_bounds
from ..model.curved_solids import curved_solids
from ..model.environment_light import why_no_bounces, why_no_environment_light
from ..model.flat_shapes import is_faceted, is_flat
from ..model.geometry.outline import convex_outline
from ..model.scene import (
    Camera,
    Scene,
    SceneObject,
)
from ..model.scene_camera import camera_frame
from ..model.settings import RANDOM_METHODS, RenderSettings, divides_spectrum, has_beams
from ..model.tint_levels import LEVELS, tint_levels
from .program_switches import PROGRAM_SWITCHES

MAX_GROUPS = 4
"""Spectral columns a photon may carry; further dispersive materials share the last one."""

MAX_LOOSE_TRIANGLES = 24
"""Up to so many triangles a plain loop beats a tree."""

MAP_TENTS = 8
"""Spectral channels of a caustic map that is seen through dispersive glass."""

MAX_SOLID_PLANES = 96
"""A convex solid of more faces goes to the tree."""
MOST_PLANES = 256
"""Of all convex solids of a scene. A pass of 65,536 photons among glass boxes by planes and by a tree (llvmpipe): 0.18
and 0.18 s with 120 planes, 0.22 and 0.15 s with 240, 1.2 and 0.28 s with 960."""


SYMBOLS = {
    "MERGED_GROUPS": "merged_groups",
    "SPECTRAL_WEIGHTS": "spectral_weights",
    "FOOTPRINTS": "footprints",
    "POINT_SPECTRUM": "point_spectrum",
    "BAND_CUTS": "band_cuts",
    "LANDING_CUTS": "landing_cuts",
    "HAS_DIELECTRIC": "dielectrics",
    "HAS_SHEET": "sheets",
    "SURFACE_FILTERS": "filters",
    "HAS_MIRROR": "mirrors",
    "HAS_GRATING": "gratings",
    "SMOOTH_NORMALS": "smooth_normals",
    "NORMAL_DERIVATIVES": "normal_derivatives",
    "ABSORPTION": "absorption",
    "MEDIUM_STACK": "medium_stack",
    "CONTACTS": "contacts",
    "HAS_TREE": "tree",
    "LOOSE_TRIANGLES": "loose_triangles",
    "CONVEX_SOLIDS": "convex_solids",
    "CURVED_SOLIDS": "curved_solids",
    "CHARTS": "charts",
    "NESTED_WINDOWS": "nested_windows",
    "ANCHOR_WEIGHTS": "anchor_weights",
    "LIGHT_PROFILES": "light_profiles",
    "BEAMS": "beams",
    "HERO": "hero",
    "POLARISED": "polarised",
    "ROUGH_SURFACES": "rough",
    "LOBE_COLUMNS": "has_lobe_columns",
    "LAMP_COLUMNS": "lamp_columns",
    "LIGHT_EDGES": "light_edges",
    "FLIGHTS": "flights",
}
"""Switch in the shaders → its field."""

OWN_SYMBOLS = {
    "LOCAL_GAIN": "local_gain",
    "REINDEXED": "reindexed",
    "CONTACT_LINES": "contact_lines",
    "BORDER_IMAGES": "border_images",
    "COATS": "coats",
    "ROUGH_DIFFUSE": "rough_diffuse",
    "LENS": "lens",
}
"""Of single passes (`passes/variants.py`)."""


def all_symbols() -> tuple[str, ...]:
    """Every name that shaders test as a switch, of 0 or 1."""
    return tuple(dict.fromkeys([*SYMBOLS, *OWN_SYMBOLS, *PROGRAM_SWITCHES]))


@dataclass(frozen=True)
class Features:
    """The compile-time choices of one rendering."""

    method: str
    """How wavelengths are sampled."""
    spectral_groups: int
    """Spectral columns carried by every photon (0: nothing disperses, or the method needs none)."""
    merged_groups: bool
    """More dispersive materials than columns (or the paper's λ-column): some columns are by a shared variable."""
    spectral_weights: bool
    """Throughput differs within a band and is carried at three wavelengths."""
    footprints: bool
    """Photons carry spatial columns."""
    point_spectrum: bool
    """Each photon has one wavelength instead of a band."""
    random_wavelength: bool
    """That wavelength is drawn at random."""
    even_wavelengths: bool
    """Random wavelengths follow a low-discrepancy sequence instead of chance."""
    band_cuts: bool
    """Total internal reflection may cut a band."""
    dielectrics: bool
    sheets: bool
    """Some glass is a thin sheet, with one medium on both sides."""
    filters: bool
    """Some surface of glass lets through only a share of what enters."""
    mirrors: bool
    gratings: bool
    smooth_normals: bool
    """Some specular surface has interpolated normals."""
    normal_derivatives: bool
    """They, or those of curved solids, bend columns too."""
    absorption: bool
    medium_stack: bool
    """Transparent solids nest or touch, so priorities decide the medium."""
    contacts: bool
    """Other surfaces touch each other or glass: what lies at one place is one interface."""
    tree: bool
    """Triangles are found through a tree; otherwise by a loop."""
    loose_triangles: bool
    """There are triangles besides the convex solids."""
    convex_solids: bool
    """Convex faceted solids are intersected as half-spaces."""
    curved_solids: bool
    """Balls, ellipsoids, lenses and cylinders are met as the quadrics they are, not as triangles."""
    charts: bool
    """A receiver is curved and carries charts."""
    nested_windows: bool
    """Flat receivers carry a fine window inside a coarse one."""
    targets: int
    """RGBA32F accumulation targets."""
    local_gain: bool = False
    """The dispersion brush scales spectral displacements on some receiver."""
    reindexed: bool = False
    """Photons stand for intervals of the one index that disperses, and carry whatever wavelengths an edit puts
    there."""
    camera_specular: bool = False
    """The camera may see glass or a mirror: its rays go on behind them."""
    camera_disperses: bool = False
    """The camera may see through glass that disperses: its rays carry a band of the spectrum, and look up along their
    sweep."""
    map_tents: int = 0
    """Spectral channels of the caustic maps beside XYZ, for light whose dispersion the camera's adds to."""
    light_profiles: bool = False
    """Some light shines by a table of intensities over directions."""
    beams: bool = False
    """What meets certain flat-faceted objects first is left to beams (`spectrasplat.beams`): photons end there."""
    anchor_weights: bool = False
    """Fresnel weights are those at the band's anchor, so that an edited dispersion leaves the photons as they are."""
    draws_by_power: bool = False
    """Random wavelengths are drawn by radiant power instead of brightness: for maps of spectral bins."""
    environment_lights: bool = False
    """What lies beyond everything lights receivers: camera rays look up how much."""
    lens: bool = False
    """The camera has a lens: its rays begin all over it, and carry columns of the place there."""
    hero: bool = False
    """Three more wavelengths share the path of the one that is followed, as long as it is theirs too."""
    polarised: bool = False
    """Paths carry their light's state of polarisation from surface to surface."""
    bounces: int = 0
    """How often light goes on from one diffuse surface to another: camera rays look up what arrived."""
    contact_lines: bool = False
    """Something stands on a flat receiver: in a still, what lands beneath it is kept from what lands beside it."""
    border_images: bool = False
    """A flat receiver is convex: what footprints would spread beyond its borders comes back as their mirror image."""
    coats: bool = False
    """Some receiver has a glossy coat: camera rays go on from it."""
    rough_diffuse: bool = False
    """Some receiver is rougher than Lambert's law has it."""
    haze: bool = False
    """The air scatters: the camera sees light on its way (`passes.haze`)."""
    flights: bool = False
    """Where rays fly outside glass is recorded: of photons that are traced for haze alone."""
    landing_cuts: bool = False
    """Of one band some wavelengths may meet another surface than its anchor does."""
    tint_levels: int = 0
    """Steps of the way through one tinted glass that photons tell (`model.tint_levels`)."""
    rough: bool = False
    """Some glass has a ground surface, whose microfacets turn paths by chance."""
    light_edges: bool = False
    """Some light's emission ends at a hard edge: photons beside it carry where, and their footprints are cut off
    there."""
    lamp_columns: bool = False
    """Some light is extended: photons carry how far the light of its other points lands beside theirs."""

    @property
    def has_lobe_columns(self) -> bool:
        """Photons carry how the light of a microfacet spreads beside the spatial columns."""
        return self.rough and self.footprints

    def defines(self) -> dict[str, int]:
        """Preprocessor symbols; a feature that is out is not defined at all (use #ifdef) — counts are numbers."""
        numbers = {
            "SPECTRAL_GROUPS": self.spectral_groups,
            "TARGETS": self.targets,
            "COLUMNS": 2 * (self.footprints + self.has_lobe_columns + self.lamp_columns) + self.spectral_groups,
        }
        levels = {"TINT_LEVELS": self.tint_levels} if self.tint_levels else {}
        return numbers | levels | {symbol: 1 for symbol, field in SYMBOLS.items() if getattr(self, field)}

    @staticmethod
    def of(scene: Scene, settings: RenderSettings) -> Features:
        """The features that `scene` needs under `settings`."""
        dielectrics = [o for o in scene.objects if o.material.transmits]
        dispersive = dispersive_materials(scene)
        random = settings.method in RANDOM_METHODS
        single = random or settings.method.startswith("regular")
        groups = 0 if single else min(len(dispersive), 1 if settings.method == "srd-lambda" else MAX_GROUPS)
        convex = half_spaces(scene)
        curved = curved_solids(scene)
        loose = [o for i, o in enumerate(scene.objects) if i not in convex and i not in curved]
        loose_triangles = sum(len(o.mesh.triangles) for o in loose)
        absorbing = any(o.material.absorption is not None for o in dielectrics if o.material.is_solid)
        smooth = any(
            o.mesh.corner_normals is not None and (o.material.is_specular or o.material.has_coat) for o in loose
        )
        footprints = settings.method != "stochastic-point"
        camera_specular, camera_disperses = camera_needs(scene, settings)
        tents = (
            MAP_TENTS
            if camera_disperses
            and settings.layer == "beauty"
            and not settings.bins
            and scene.lights
            and _has_receivers(scene)
            else 0
        )
        hazy = settings.layer == "beauty" and why_no_haze(scene) is None
        beams = _has_beams(scene, settings)
        # Light on its way and what the viewer reads from photons know weights at three wavelengths alone; where no band
        # may be cut, photons carry on what beams leave in bands of the same tables.
        plain = single or hazy or settings.anchor_weights or (beams and not groups)
        told = absorbing and not plain and tint_levels(scene) is not None
        by_beams = set(beam_objects(scene)) if beams else set()
        by_photons = any(o.material.is_specular for i, o in enumerate(scene.objects) if i not in by_beams)
        coloured = any((o.material.is_mirror or o.material.transmits) and o.material.is_coloured for o in scene.objects)
        return Features(
            method=settings.method,
            spectral_groups=groups,
            merged_groups=groups > 0 and (settings.method == "srd-lambda" or len(dispersive) > MAX_GROUPS),
            spectral_weights=not single and ((groups > 0 and bool(dielectrics)) or absorbing or coloured),
            footprints=footprints,
            point_spectrum=single,
            random_wavelength=random,
            even_wavelengths=settings.method == "stochastic-even",
            band_cuts=groups > 0,
            landing_cuts=groups > 0
            and footprints
            and bool(dielectrics)
            and sum(not o.material.is_specular for o in scene.objects) > 1,
            dielectrics=bool(dielectrics),
            sheets=any(o.material.thin for o in dielectrics),
            filters=any(o.material.filters for o in dielectrics),
            mirrors=any(o.material.is_mirror for o in scene.objects),
            gratings=any(o.material.is_grating for o in scene.objects),
            smooth_normals=smooth,
            normal_derivatives=bool(smooth or curved) and (footprints or groups > 0),
            absorption=absorbing,
            medium_stack=bool(overlapping_solids(scene)),
            contacts=bool(contacts(scene)),
            tree=loose_triangles > MAX_LOOSE_TRIANGLES,
            loose_triangles=loose_triangles > 0,
            convex_solids=bool(convex),
            curved_solids=bool(curved),
            charts=any(o.material.receives and not is_flat(o) for o in scene.objects),
            nested_windows=any(o.material.receives and is_flat(o) for o in scene.objects),
            targets=-(-settings.bins // 4) if settings.bins else 1 + -(-tents // 4),
            camera_specular=camera_specular,
            camera_disperses=camera_disperses,
            map_tents=tents,
            reindexed=_reindexed(scene, settings, groups, coloured=absorbing or coloured),
            local_gain=groups > 0 and settings.local_gain and any(o.local_dispersion for o in scene.objects),
            anchor_weights=settings.anchor_weights,
            beams=beams,
            light_profiles=any(light.profile is not None for light in scene.lights),
            draws_by_power=random and settings.bins is not None,
            environment_lights=why_no_environment_light(scene) is None and settings.layer == "beauty",
            lens=scene.camera.lens_radius > 0.0,
            hero=settings.method == "hero",
            polarised=scene.render.polarisation and bool(dielectrics),
            bounces=scene.render.bounces if settings.layer == "beauty" and why_no_bounces(scene) is None else 0,
            contact_lines=bool(standing(scene)),
            border_images=footprints and any(has_borders(o) for o in scene.objects),
            coats=settings.layer == "beauty" and any(o.material.has_coat for o in scene.objects),
            rough_diffuse=settings.layer == "beauty" and any(o.material.diffuse_roughness for o in scene.objects),
            haze=hazy,
            tint_levels=LEVELS if told else 0,
            rough=any(o.material.is_rough for o in dielectrics),
            light_edges=footprints and not single and by_photons and any(light.has_hard_edge for light in scene.lights),
            lamp_columns=footprints and not random and by_photons and any(light.has_extent for light in scene.lights),
        )


def why_no_haze(scene: Scene) -> str | None:
    """Why no light is seen on its way; None: it is."""
    if scene.render.haze == 0.0:
        return "[render] haze is 0"
    if not scene.lights:
        return "no light shines (an environment's light is not seen in haze)"
    return None


def _reindexed(scene: Scene, settings: RenderSettings, groups: int, *, coloured: bool) -> bool:
    """Whether an edit of the dispersion, or the brush, moves wavelengths between paths: where n alone says what a path
    is and weighs."""
    from ..model.optics.spectral_tables import SpectralAxis

    edited = settings.anchor_weights or (settings.local_gain and any(o.local_dispersion for o in scene.objects))
    if not edited or groups != 1 or coloured or not divides_spectrum(settings.method):
        return False
    if any(o.material.is_grating for o in scene.objects):
        return False
    (turning,) = SpectralAxis.build([o.material.dispersion for o in scene.objects if o.material.transmits]).turning_nm
    return len(turning) == 2


MAX_BEAM_TRIANGLES = 8192
"""A mesh of more is never tried as facets of beams; whether fewer pay is measured (`render.beam_light`)."""


def why_no_beams(item: SceneObject) -> str | None:
    """Why beams cannot carry what an object of glass or a mirror throws; None: they can."""
    if item.material.is_grating:
        return "a grating sends light into several orders"
    if item.material.thin:
        return "it is a thin sheet"
    if item.material.filters:
        return "its surface is coloured"
    if item.material.is_rough:
        return "its surface is rough"
    if len(item.mesh.triangles) > MAX_BEAM_TRIANGLES:
        return f"it has {len(item.mesh.triangles)} triangles"
    if not is_faceted(item):
        return "its normals are interpolated"
    return None


def beam_objects(scene: Scene) -> list[int]:
    """Objects of flat-faceted glass or mirrors, whose light may go as beams."""
    return [i for i, o in enumerate(scene.objects) if o.material.is_specular and why_no_beams(o) is None]


def is_painted(scene: Scene, local_gain: bool) -> bool:
    """Whether the dispersion brush moves light: photons follow it, beams do not."""
    return local_gain and any(o.local_dispersion for o in scene.objects)


def _has_beams(scene: Scene, settings: RenderSettings) -> bool:
    painted = is_painted(scene, settings.local_gain)
    receives = any(o.material.receives and is_flat(o) for o in scene.objects)
    shines = any(light.profile is None for light in scene.lights)
    return has_beams(settings.method) and receives and shines and not painted and bool(beam_objects(scene))


def camera_needs(scene: Scene, settings: RenderSettings) -> tuple[bool, bool]:
    """Whether the camera may see glass, mirrors or what is glossy, and whether it may see through glass that
    disperses."""
    if settings.layer != "beauty":
        return False, False
    mirrors = any(o.material.is_mirror or o.material.has_coat for o in scene.objects)
    glass = [o for o in scene.objects if o.material.transmits or o.material.is_grating]
    if not (settings.any_view or mirrors):
        # What is refracted or reflected first must be seen first; all else follows from it.
        glass = glass if any(in_view(o, scene.camera, settings.width / settings.height) for o in glass) else []
    return bool(glass) or mirrors, any(o.material.disperses for o in glass)


def in_view(item: SceneObject, camera: Camera, aspect: float) -> bool:
    """Whether the camera may see the object's bounding box: False only where one side of the view leaves out all of
    it."""
    right, up, forward = camera_frame(camera)
    low, high = world_bounds(item)
    corners = np.array(np.meshgrid(*zip(low, high, strict=True), indexing="ij")).reshape(3, 8).T - np.array(
        camera.position
    )
    x, y, depth = corners @ right, corners @ up, corners @ forward
    # A lens sees by as much more as a point there is out of focus.
    beside = camera.lens_radius * np.abs(1.0 - depth / camera.plane_of_focus)
    if camera.kind == "orthographic":
        half = 0.5 * camera.vertical_extent * np.ones_like(depth)
    else:
        half = np.tan(np.radians(0.5 * camera.vertical_fov_deg)) * depth
    across, up_to = aspect * half + beside, half + beside
    outside = [x > across, x < -across, y > up_to, y < -up_to, depth < 0.0]
    return not any(side.all() for side in outside)


def _has_receivers(scene: Scene) -> bool:
    return any(o.material.receives for o in scene.objects)


def dispersive_materials(scene: Scene) -> list[int]:
    """Object indices that first show each distinct dispersive glass, or a grating, in order."""
    seen, first = set(), []
    for index, item in enumerate(scene.objects):
        glass = item.material.dispersion
        if item.material.disperses and glass not in seen:
            seen.add(glass)
            first.append(index)
    return first


def half_spaces(scene: Scene) -> dict[int, np.ndarray]:
    """`Mesh.convex_planes` (P, 4), by index, of objects that are intersected as intersections of half-spaces. None is
    where they have more than `MOST_PLANES` together: every ray asks all of them, and a tree of triangles leaves most
    out."""
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
    if not item.material.receives or not is_flat(item):
        return False
    points = item.mesh.vertices - item.mesh.vertices.mean(axis=0)
    in_plane = points @ np.linalg.svd(points, full_matrices=False)[2][:2].T
    return convex_outline(in_plane, item.mesh.triangles) is not None
