"""The same scene with one feature compiled in and with it left out, for every feature that allows it.

What a scene needs is left out to see what it costs (the result is then wrong; only the time counts), and
what it does not need is forced in, with all the data that the forced program asks for, to see what leaving
it out saves: there both programs must draw the same map. A pair differs in one feature alone, so a feature
that stands on another is measured on top of it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...features.explained import explain
from ...features.features import Features, half_spaces
from ...model.curved_solids import curved_solids
from ...model.geometry.mesh import Mesh
from ...model.scene import Absorption, Scene, SceneObject
from ...reference.exact_shapes import as_triangles

FORCED_BINS = 16
"""Spectral bins that a scene without any is made to pay for."""
MAX_LOOPED_TRIANGLES = 512
"""A loop over more is not tried: it would take minutes to say what everybody knows."""


@dataclass(frozen=True)
class Variant:
    """A program's features and the scene whose data it gets."""

    scene: Scene
    features: Features
    bins: int | None = None


@dataclass(frozen=True)
class Trial:
    """One feature: two variants that differ in it alone, or why there are none."""

    feature: str
    """As `spectrasplat.features.explained.explain` calls it."""
    included: bool
    reason: str
    carried: Variant | None
    """With the feature."""
    absent: Variant | None
    """Without it."""
    same_map: bool
    """Both must draw the same caustic map, since the scene does not need the feature."""
    note: str = ""
    same_splats: bool = True
    """Both splat photons of like footprints, so that the splat's times say something about the feature."""


_CAMERA = ("camera refraction", "camera spectral taps", "textures", "environment map")
DISPERSION = "dispersion in all"
"""Columns, weights and cuts together: what a scene without dispersion does not pay."""


def trials(scene: Scene, features: Features) -> list[Trial]:
    """One trial a feature of `explain`, in its order, after the one for dispersion as a whole."""
    found = [_dispersion(scene, features)]
    for name, included, reason in explain(scene, features):
        carried, absent, note = _pair(name, included, scene, features)
        same = not included or name == "half-space solids"
        found.append(
            Trial(
                name,
                included,
                reason,
                carried,
                absent,
                same and carried is not None,
                note,
                not included or name != "normal derivatives",
            )
        )
    return found


_OF_BANDS = "spectral columns", "weights over the band", "band cuts", "landing cuts"


def _dispersion(scene: Scene, base: Features) -> Trial:
    included = base.spectral_groups > 0
    plain = replace(
        base,
        spectral_groups=0,
        merged_groups=False,
        band_cuts=False,
        landing_cuts=False,
        spectral_weights=(base.spectral_weights and not included) or base.absorption,
    )
    forced = base if included else replace(base, spectral_groups=1, band_cuts=True, spectral_weights=True)
    if base.point_spectrum:
        return Trial(
            DISPERSION, False, "one wavelength a photon", None, None, False, "cannot be forced in: photons have no band"
        )
    reason = "some glass disperses" if included else "nothing disperses"
    note = "columns, weights over the band and band cuts together"
    return Trial(DISPERSION, included, reason, Variant(scene, forced), Variant(scene, plain), not included, note)


def _pair(name: str, included: bool, scene: Scene, base: Features) -> tuple[Variant | None, Variant | None, str]:
    """(with, without, note) for a feature of `explain`."""
    asked = Variant(scene, base)
    if included:
        return _left_out(name, scene, base, asked)
    return _forced_in(name, scene, base, asked)


def _left_out(name: str, scene: Scene, base: Features, asked: Variant) -> tuple[Variant | None, Variant | None, str]:
    uncut = replace(base, band_cuts=False, landing_cuts=False)
    plain = replace(uncut, spectral_groups=0, merged_groups=False)
    match name:
        case "spectral columns":
            return Variant(scene, uncut), Variant(scene, plain), "both without band cuts, which need columns"
        case "shared spectral variable":
            return asked, Variant(scene, replace(base, merged_groups=False)), ""
        case "weights over the band":
            return (
                Variant(scene, plain),
                Variant(scene, replace(plain, spectral_weights=False)),
                "both without columns and cuts, which need weights",
            )
        case "band cuts":
            return asked, Variant(scene, uncut), ""
        case "landing cuts":
            return (
                asked,
                Variant(scene, replace(base, landing_cuts=False)),
                "without it borders have colours",
            )
        case "spatial columns":
            bare = replace(plain, footprints=False, normal_derivatives=False, lamp_columns=False, light_edges=False)
            return (
                Variant(scene, plain),
                Variant(scene, bare),
                "without them every splat is one texel; both without spectral columns",
            )
        case "normal derivatives":
            return (
                asked,
                Variant(scene, replace(base, normal_derivatives=False)),
                "without them footprints are wrong, but light goes the same ways",
            )
        case "absorption":
            return asked, Variant(scene, replace(base, absorption=False, tint_levels=0)), ""
        case "tint levels":
            return (
                asked,
                Variant(scene, replace(base, tint_levels=0)),
                "without them a band knows three places of a tint",
            )
        case "polarisation":
            return asked, Variant(scene, replace(base, polarised=False)), "without it light is weighed another way"
        case "rough surfaces":
            return asked, Variant(scene, replace(base, rough=False)), "without it all glass is polished"
        case "light edges":
            return asked, Variant(scene, replace(base, light_edges=False)), "without it beams end in a comb"
        case "lamp columns":
            return asked, Variant(scene, replace(base, lamp_columns=False)), "without it each lamp is drawn as a point"
        case "contacts":
            return asked, Variant(scene, replace(base, contacts=False)), "without it light is lost between surfaces"
        case "medium stack":
            return asked, Variant(scene, replace(base, medium_stack=False)), "without it nested solids refract wrongly"
        case "triangle tree":
            exact = {*half_spaces(scene), *curved_solids(scene)}
            loose = sum(len(o.mesh.triangles) for i, o in enumerate(scene.objects) if i not in exact)
            if loose > MAX_LOOPED_TRIANGLES:
                return None, None, f"cannot be left out here: a loop would test {loose:,} triangles for every ray"
            return asked, Variant(scene, replace(base, tree=False)), "against a loop"
        case "half-space solids":
            meshed = _without_half_spaces(scene)
            round_ones = curved_solids(scene)
            loose = sum(len(o.mesh.triangles) for i, o in enumerate(meshed.objects) if i not in round_ones)
            features = replace(base, convex_solids=False, loose_triangles=True, tree=loose > 24)
            return (
                asked,
                Variant(meshed, features),
                f"against {'a tree' if features.tree else 'a loop'} over the same facets",
            )
        case "curved solids":
            features = replace(base, curved_solids=False, smooth_normals=True, loose_triangles=True, tree=True)
            return asked, Variant(as_triangles(scene), features), "against a tree over triangles that stand for them"
        case "nested windows":
            return asked, Variant(scene, replace(base, nested_windows=False)), "against the finest window alone"
        case "border images":
            return asked, Variant(scene, replace(base, border_images=False)), "without them borders are too dark"
        case "contact lines":
            return None, None, "asks the picture's own pixels, which the map that is drawn here does not have"
        case "surface colours":
            return asked, Variant(scene, replace(base, filters=False)), "without it surfaces are clear"
        case "refraction" | "mirrors" | "gratings" | "thin sheets":
            return None, None, "cannot be left out here: light would end there"
        case "interpolated normals" | "charts":
            return None, None, "cannot be left out here: light would land elsewhere"
        case "spectral maps":
            return asked, Variant(scene, replace(base, targets=1, map_tents=0)), "against XYZ alone"
        case "spectral bins" if base.map_tents:
            return None, None, "these are the spectral maps' channels"
        case "spectral bins":
            return asked, Variant(scene, replace(base, targets=1)), "against XYZ"
        case _ if name in _CAMERA:
            return None, None, "part of the picture; here only the map is drawn"
        case _:
            return None, None, "has no code of its own"


def _forced_in(name: str, scene: Scene, base: Features, asked: Variant) -> tuple[Variant | None, Variant | None, str]:
    columns = replace(base, spectral_groups=1, spectral_weights=True)
    match name:
        case _ if base.point_spectrum and name in _OF_BANDS:
            return None, None, "cannot be forced in: photons have no band"
        case "spectral columns":
            return (
                Variant(scene, columns),
                Variant(scene, replace(base, spectral_weights=True)),
                "one column, which stays zero; both with weights, which it needs",
            )
        case "weights over the band":
            return Variant(scene, replace(base, spectral_weights=True)), asked, ""
        case "band cuts":
            return (
                Variant(scene, replace(columns, band_cuts=True)),
                Variant(scene, columns),
                "both with a column, which cuts need",
            )
        case "landing cuts":
            cut = replace(columns, band_cuts=True)
            return (
                Variant(scene, replace(cut, landing_cuts=True)),
                Variant(scene, cut),
                "both with a column and band cuts, which it needs",
            )
        case "refraction":
            return Variant(scene, replace(base, dielectrics=True)), asked, ""
        case "rough surfaces":
            return Variant(scene, replace(base, rough=True)), asked, "every surface of width zero"
        case "light edges":
            return Variant(scene, replace(base, light_edges=True)), asked, "no light with an edge"
        case "lamp columns":
            return Variant(scene, replace(base, lamp_columns=True)), asked, "every light of no breadth"
        case "mirrors":
            return Variant(scene, replace(base, mirrors=True)), asked, ""
        case "gratings":
            return Variant(scene, replace(base, gratings=True)), asked, ""
        case "thin sheets" if base.dielectrics:
            return Variant(scene, replace(base, sheets=True)), asked, "no surface is thin"
        case "surface colours":
            return Variant(scene, replace(base, filters=True)), asked, "no surface has a colour"
        case "interpolated normals" | "normal derivatives":
            every = len(half_spaces(scene)) + len(curved_solids(scene)) == len(_specular(scene))
            note = (
                "what has no triangles has no corners to interpolate: the code is there and waits"
                if every
                else "every facet with three equal normals"
            )
            smooth = Variant(_with_normals(scene), replace(base, smooth_normals=True))
            if name == "interpolated normals":
                return smooth, asked, note
            return replace(smooth, features=replace(smooth.features, normal_derivatives=True)), smooth, note
        case "absorption" if base.dielectrics:
            return (
                Variant(_with_absorption(scene), replace(base, absorption=True)),
                asked,
                "every glass with an absorption of zero",
            )
        case "medium stack" if base.dielectrics:
            return Variant(scene, replace(base, medium_stack=True)), asked, "every solid on the stack"
        case "contacts" if base.loose_triangles:
            return Variant(scene, replace(base, contacts=True)), asked, ""
        case "triangle tree" if base.loose_triangles:
            return Variant(scene, replace(base, tree=True)), asked, "against a loop"
        case "charts":
            return Variant(scene, replace(base, charts=True)), asked, ""
        case "nested windows":
            return Variant(scene, replace(base, nested_windows=True)), asked, ""
        case "border images":
            return None, None, "no border near which light lands"
        case "spectral bins":
            return (
                Variant(scene, replace(base, targets=FORCED_BINS // 4), FORCED_BINS),
                asked,
                f"{FORCED_BINS} bins in {FORCED_BINS // 4} targets",
            )
        case "shared spectral variable":
            return None, None, "cannot be forced in: light would be drawn another way"
        case "polarisation":
            return None, None, "cannot be forced in: light would be weighed another way"
        case "spectral maps":
            return None, None, "cannot be forced in: the channels are those of glass that the camera sees"
        case _ if name in _CAMERA:
            return None, None, "part of the picture; here only the map is drawn"
        case "half-space solids" | "curved solids" | "absorption" | "tint levels" | "medium stack" | "triangle tree":
            return None, None, "nothing in the scene to put it to"
        case _:
            return None, None, "has no code of its own"


# -- scenes -------------------------------------------------------------------------------


def _specular(scene: Scene) -> list[SceneObject]:
    return [o for o in scene.objects if o.material.is_specular]


def _with_normals(scene: Scene) -> Scene:
    """Every specular facet with its own normal at all three corners: smooth in name, flat in truth."""

    convex = half_spaces(scene)

    def smoothed(index: int, item: SceneObject) -> SceneObject:
        if not item.material.is_specular or item.mesh.corner_normals is not None or index in convex:
            return item
        normals = np.repeat(item.mesh.face_normals()[:, None, :], 3, axis=1)
        return replace(item, mesh=replace(item.mesh, corner_normals=normals))

    return replace(scene, objects=tuple(smoothed(i, o) for i, o in enumerate(scene.objects)))


def _with_absorption(scene: Scene) -> Scene:
    """Every glass with an absorption of zero."""

    def filled(item: SceneObject) -> SceneObject:
        if not item.material.transmits:
            return item
        return replace(item, material=item.material.changed(absorption=Absorption(np.zeros(401))))

    return replace(scene, objects=tuple(filled(o) for o in scene.objects))


def _without_half_spaces(scene: Scene) -> Scene:
    """Convex solids as the triangles they came from."""

    convex = half_spaces(scene)

    def opened(index: int, item: SceneObject) -> SceneObject:
        return replace(item, mesh=_no_half_spaces(item.mesh)) if index in convex else item

    return replace(scene, objects=tuple(opened(i, o) for i, o in enumerate(scene.objects)))


def _no_half_spaces(mesh: Mesh) -> Mesh:
    copy = replace(mesh)
    vars(copy)["convex_planes"] = None  # the cached property's own place
    return copy
