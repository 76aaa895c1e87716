"""Why each choice of `Features` fell as it did, in words for people: `inspect`, the report of features, tests."""

from __future__ import annotations

from ..model.contacts import contacts, overlapping_solids, standing
from ..model.curved_solids import curved_solids
from ..model.environment_light import why_no_bounces, why_no_environment_light, with_sun
from ..model.flat_shapes import is_flat
from ..model.scene import Scene
from ..model.settings import has_beams
from ..model.tint_bands import tint_curves
from ..model.tint_levels import MAX_LIGHTS
from .features import (
    Features,
    beam_objects,
    dispersive_materials,
    half_spaces,
    has_borders,
    why_no_beams,
    why_no_haze,
)


def explain(scene: Scene, features: Features) -> list[tuple[str, bool, str]]:
    """(feature, compiled in, reason) for every choice, for people."""
    glasses = [o.material.dispersion.name for i, o in enumerate(scene.objects) if i in dispersive_materials(scene)]
    convex = half_spaces(scene)
    curved = curved_solids(scene)
    loose = sum(len(o.mesh.triangles) for i, o in enumerate(scene.objects) if i not in convex and i not in curved)
    solids = [scene.objects[i].name for i in convex]
    touching = [scene.objects[i].name for i in overlapping_solids(scene)]
    on_receivers = list(dict.fromkeys(scene.objects[j].name for _, j in standing(scene)))
    bordered = [item.name for item in scene.objects if has_borders(item)]
    in_contact = [f"{scene.objects[i].name} and {scene.objects[j].name}" for i, j in contacts(scene)]
    diffuse = [o for o in scene.objects if o.material.receives]
    worn = [o.name for o in diffuse if o.material.texture is not None]
    black = sum(o.material.is_black for o in scene.objects)

    def names(items: list[str]) -> str:
        return ", ".join(items[:4]) + (f" and {len(items) - 4} more" if len(items) > 4 else "")

    return [
        (
            "spectral columns",
            features.spectral_groups > 0,
            f"{features.spectral_groups} column(s): {names(glasses)}"
            if features.spectral_groups
            else ("one wavelength a photon" if features.point_spectrum else "nothing disperses"),
        ),
        (
            "shared spectral variable",
            features.merged_groups,
            "more glasses than columns, or the λ-column was asked for"
            if features.merged_groups
            else "each glass has a column of its own",
        ),
        (
            "weights over the band",
            features.spectral_weights,
            "Fresnel, absorption or mirrors differ over a band"
            if features.spectral_weights
            else "nothing differs over a band",
        ),
        (
            "band cuts",
            features.band_cuts,
            "total internal reflection may cut a band" if features.band_cuts else "no band to cut",
        ),
        (
            "landing cuts",
            features.landing_cuts,
            "a band may land on several surfaces" if features.landing_cuts else "there is one surface to land on",
        ),
        (
            "spatial columns",
            features.footprints,
            "footprints are anisotropic" if features.footprints else "the method splats single texels",
        ),
        ("refraction", features.dielectrics, "there is glass" if features.dielectrics else "there is no glass"),
        ("mirrors", features.mirrors, "there are mirrors" if features.mirrors else "there are no mirrors"),
        (
            "thin sheets",
            features.sheets,
            f"of {names([o.name for o in scene.objects if o.material.thin])}"
            if features.sheets
            else "no glass is thin",
        ),
        (
            "surface colours",
            features.filters,
            f"of {names([o.name for o in scene.objects if o.material.filters])}"
            if features.filters
            else "no glass has a coloured surface",
        ),
        (
            "gratings",
            features.gratings,
            "there are gratings" if features.gratings else "there is no grating",
        ),
        (
            "interpolated normals",
            features.smooth_normals,
            "some specular surface is a smooth mesh"
            if features.smooth_normals
            else "no specular surface is a smooth mesh",
        ),
        (
            "normal derivatives",
            features.normal_derivatives,
            "columns bend with the normals"
            if features.normal_derivatives
            else ("no columns" if features.smooth_normals or curved else "all specular facets are flat"),
        ),
        ("polarisation", features.polarised, _polarisation_words(scene, features)),
        (
            "coats",
            features.coats,
            f"glossy: {names([o.name for o in diffuse if o.material.has_coat])}"
            if features.coats
            else "no receiver is glossy",
        ),
        (
            "rough diffuse",
            features.rough_diffuse,
            f"rough: {names([o.name for o in diffuse if o.material.diffuse_roughness])}"
            if features.rough_diffuse
            else "what is diffuse is Lambertian",
        ),
        (
            "rough surfaces",
            features.rough,
            f"of {names([o.name for o in scene.objects if o.material.is_rough])}"
            if features.rough
            else "all glass is polished",
        ),
        (
            "lamp columns",
            features.lamp_columns,
            f"photons know how broad {names([light.name for light in scene.lights if light.has_extent])} is"
            if features.lamp_columns
            else _no_lamp_words(scene, features),
        ),
        (
            "light edges",
            features.light_edges,
            f"footprints end where {names([light.name for light in scene.lights if light.has_hard_edge])} ends"
            if features.light_edges
            else "no light of photons with columns ends at a hard edge",
        ),
        ("absorption", features.absorption, "some glass absorbs" if features.absorption else "all glass is clear"),
        ("tint levels", features.tint_levels > 0, _tint_words(scene, features)),
        (
            "medium stack",
            features.medium_stack,
            f"{names(touching)} nest or touch" if features.medium_stack else "no two solids nest or touch",
        ),
        (
            "contacts",
            features.contacts,
            f"may touch: {names(in_contact)}"
            if features.contacts
            else "no mirror, receiver or blocker touches another surface",
        ),
        (
            "triangle tree",
            features.tree,
            f"{loose} triangles" if features.tree else f"{loose} loose triangle(s) are looped over",
        ),
        (
            "half-space solids",
            features.convex_solids,
            names(solids) if features.convex_solids else "no convex faceted solid",
        ),
        (
            "curved solids",
            features.curved_solids,
            f"met without triangles: {names([scene.objects[i].name for i in curved])}"
            if features.curved_solids
            else "no ball, ellipsoid, lens or cylinder stands by itself",
        ),
        (
            "charts",
            features.charts,
            f"{sum(not is_flat(o) for o in diffuse)} curved receiver(s)"
            if features.charts
            else "all receivers are flat",
        ),
        (
            "nested windows",
            features.nested_windows,
            "flat receivers may get a fine window inside a coarse one"
            if features.nested_windows
            else "no receiver has two windows",
        ),
        (
            "contact lines",
            features.contact_lines,
            f"on a receiver: {names(on_receivers)}" if features.contact_lines else "nothing stands on a receiver",
        ),
        (
            "border images",
            features.border_images,
            f"footprints near a border of {names(bordered)} come back from it"
            if features.border_images
            else "no flat receiver is convex, or no light lands near a border",
        ),
        (
            "local gain",
            features.local_gain,
            "the dispersion brush was used on a receiver" if features.local_gain else "no receiver was painted on",
        ),
        (
            "photons by index",
            features.reindexed,
            "an edit or the brush may move wavelengths between paths"
            if features.reindexed
            else "every path keeps its wavelengths",
        ),
        (
            "camera refraction",
            features.camera_specular,
            "the camera may see glass, mirrors or coats"
            if features.camera_specular
            else "no glass and no mirror is in view",
        ),
        (
            "camera spectral taps",
            features.camera_disperses,
            "the camera may see through dispersive glass"
            if features.camera_disperses
            else ("no dispersive glass is in view" if glasses else "nothing disperses"),
        ),
        (
            "spectral maps",
            features.map_tents > 0,
            f"{features.map_tents} channels beside XYZ: light and camera disperse"
            if features.map_tents
            else "no caustic is seen through dispersive glass",
        ),
        ("spectral bins", features.targets > 1, _target_words(features)),
        (
            "lens",
            features.lens,
            f"radius {scene.camera.lens_radius:.4g}, focused at {scene.camera.plane_of_focus:.4g}"
            if features.lens
            else "the camera is a pinhole"
            if scene.camera.kind == "pinhole"
            else "the camera has no lens",
        ),
        ("textures", bool(worn), f"on {names(worn)}" if worn else "no surface wears a picture"),
        (
            "environment map",
            scene.environment is not None,
            f"a {scene.environment.kind} lies beyond" if scene.environment is not None else "one colour lies beyond",
        ),
        (
            "environment light",
            features.environment_lights,
            "every diffuse surface is lit by it, with visibility, also through glass and over mirrors"
            + ("; its sun is a light of its own" if with_sun(scene) is not scene else "")
            if features.environment_lights
            else why_no_environment_light(scene) or "the picture shows caustics only",
        ),
        (
            "bounces",
            features.bounces > 0,
            f"diffuse surfaces light each other, {features.bounces} time(s) over"
            if features.bounces
            else why_no_bounces(scene) or "the picture shows caustics only",
        ),
        (
            "haze",
            features.haze,
            f"light is seen on its way: {scene.render.haze:.4g} of it is scattered per scene unit"
            if features.haze
            else why_no_haze(scene) or "the picture shows caustics only",
        ),
        (
            "light profiles",
            features.light_profiles,
            f"measured lamps: {names([light.name for light in scene.lights if light.profile is not None])}"
            if features.light_profiles
            else "no light comes from a photometric file",
        ),
        (
            "beams",
            features.beams,
            _beam_words(scene, features),
        ),
        ("blockers", black > 0, f"{black} black object(s)" if black else "no black object"),
    ]


def _beam_words(scene: Scene, features: Features) -> str:
    specular = [o for o in scene.objects if o.material.is_specular]
    if features.beams:
        carried = [scene.objects[i].name for i in beam_objects(scene)]
        others = [f"{o.name}: {why_no_beams(o)}" for o in specular if why_no_beams(o)]
        return (
            f"what {', '.join(carried)} throw(s) goes as polygons, unless a survey finds that photons are cheaper"
            + (f"; photons for {'; '.join(others)}" if others else "")
        )
    if not has_beams(features.method):
        return f"method {features.method} follows photons"
    reasons = [f"{o.name}: {why_no_beams(o)}" for o in specular if why_no_beams(o)]
    if not specular or len(reasons) == len(specular):
        return "; ".join(reasons) or "there is neither glass nor mirror"
    if not any(o.material.receives and is_flat(o) for o in scene.objects):
        return "no receiver is flat"
    if any(o.local_dispersion for o in scene.objects):
        return "the dispersion brush was used on a receiver"
    return "no light can be followed as beams"


def _no_lamp_words(scene: Scene, features: Features) -> str:
    if not any(light.has_extent for light in scene.lights):
        return "every light is a point or parallel"
    if features.random_wavelength or not features.footprints:
        return "the method draws places on lights by chance"
    return "beams carry all light"


def _tint_words(scene: Scene, features: Features) -> str:
    if features.tint_levels:
        return "one band holds a whole tint"
    if not features.absorption:
        return "all glass is clear"
    if features.point_spectrum:
        return "a photon has one wavelength"
    if features.beams and not features.spectral_groups:
        return "beams need bands that are cut for tints"
    if features.haze:
        return "haze knows tints at three wavelengths a band"
    if features.anchor_weights:
        return "in the viewer photons know tints at three wavelengths a band"
    if len(scene.lights) > MAX_LIGHTS:
        return f"there are more than {MAX_LIGHTS} lights"
    return "several tints need bands all the same" if len(tint_curves(scene)) else "tints are too faint"


def _polarisation_words(scene: Scene, features: Features) -> str:
    if features.polarised:
        return "the scene asks for it, and there is glass to part s and p"
    return "there is no glass to part s and p" if scene.render.polarisation else "[render] polarisation is not set"


def _target_words(features: Features) -> str:
    if features.targets == 1:
        return "XYZ in one target"
    return f"{features.targets} targets" + (": XYZ and the spectral maps' channels" if features.map_tents else "")
