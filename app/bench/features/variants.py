"""The same scene with one feature compiled in and with it left out, for every feature that allows it.

What a scene needs is left out to see what it costs (the result is then wrong; only the time counts), and what it does
not need is put in, with all the data that the program then reads, to see what leaving it out saves: there both programs
must draw the same map. A pair differs in one feature alone, so one whose code needs another's is measured on top of it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...features.facts import Facts
from ...features.features import OF_PICTURES, ROWS, Features
from ...features.surfaces import MAX_LOOSE_TRIANGLES
from ...model.scene import Absorption, Scene, SceneObject
from ...reference.scene_surfaces import as_triangles

FORCED_BINS = 16
"""Spectral bins that are put into a scene without any."""
MAX_LOOPED_TRIANGLES = 512
"""A loop over more is not tried: it would take minutes."""
DISPERSION = "dispersion in all"
"""Columns and cuts together: what a scene without dispersion does not pay."""


@dataclass(frozen=True)
class Variant:
    """A program's features and the scene whose data it gets."""

    scene: Scene
    features: Features


@dataclass(frozen=True)
class Trial:
    """One feature: two variants that differ in it alone, or why there are none."""

    feature: str
    """As the table of features names it."""
    included: bool
    reason: str
    carried: Variant | None = None
    """With the feature."""
    absent: Variant | None = None
    """Without it."""
    same_map: bool = False
    """Both must draw the same caustic map, since the scene does not need the feature."""
    note: str = ""
    same_splats: bool = True
    """Both splat photons of like footprints, so that the splat's times say something about the feature."""


def trials(facts: Facts, features: Features) -> list[Trial]:
    """One trial a feature of the table, in its order, after the one for dispersion as a whole."""
    found = [_dispersion(facts.scene, features)]
    by_name = {row.name: field for field, row in ROWS.items()}
    for name, included, reason in features.explain(facts):
        field = by_name[name]
        pair = _left_out(field, facts, features) if included else _put_in(field, facts, features)
        trial = Trial(name, included, reason)
        if isinstance(pair, str):
            found.append(replace(trial, note=pair))
            continue
        carried, absent, note = pair
        same_map = not included or field == "convex_solids"
        same_splats = not included or field != "normal_derivatives"
        found.append(
            replace(trial, carried=carried, absent=absent, same_map=same_map, note=note, same_splats=same_splats)
        )
    return found


_Pair = tuple[Variant, Variant, str]
"""With, without, and a note."""


def _dispersion(scene: Scene, base: Features) -> Trial:
    included = base.spectral_groups > 0
    plain = base.without("spectral_groups")
    forced = base if included else replace(base, spectral_groups=1, band_cuts=True)
    reason = "some glass disperses" if included else "nothing disperses"
    note = "columns and band cuts together"
    return Trial(DISPERSION, included, reason, Variant(scene, forced), Variant(scene, plain), not included, note)


def _left_out(field: str, facts: Facts, base: Features) -> _Pair | str:
    """Both without what needs the feature; or why there is no pair."""
    row, scene = ROWS[field], facts.scene
    if field in OF_PICTURES:
        return "part of the picture; here only the map is drawn"
    if row.stays:
        return f"cannot be left out here: {row.stays}"
    if field == "tree" and facts.loose_triangles > MAX_LOOPED_TRIANGLES:
        return f"cannot be left out here: a loop would test {facts.loose_triangles:,} triangles for every ray"
    absent = base.without(field)
    carried = absent.changed(**{field: getattr(base, field)})
    alone = {name for name in ROWS if getattr(carried, name) != getattr(base, name)}
    needing = ", ".join(row.name for name, row in ROWS.items() if name in alone and row.name)
    note = "; ".join(filter(None, (row.left_out, f"both without {needing}, on top of it" if needing else "")))
    without = scene
    if field == "convex_solids":
        without, triangles = _without_half_spaces(facts), facts.loose_triangles
        triangles += sum(len(scene.objects[i].mesh.triangles) for i in facts.half_spaces)
        absent = replace(absent, loose_triangles=True, tree=triangles > MAX_LOOSE_TRIANGLES)
    if field == "curved_solids":
        without = as_triangles(scene)
        absent = replace(absent, smooth_normals=True, loose_triangles=True, tree=True)
    return Variant(scene, carried), Variant(without, absent), note


def _put_in(field: str, facts: Facts, base: Features) -> _Pair | str:
    """Both with what the feature's code needs; or why there is no pair."""
    row = ROWS[field]
    if field in OF_PICTURES:
        return "part of the picture; here only the map is drawn"
    if row.forced is None:
        return f"cannot be put in: {row.not_forced}" if row.not_forced else "nothing in the scene to try it on"
    needed = _needed(field)
    scene = _DATA[field](facts) if field in _DATA else facts.scene
    absent = base.changed(**{name: _least(name) for name in needed if not getattr(base, name)})
    carried = absent.changed(**{field: _least(field)})
    also = ", ".join(ROWS[name].name for name in ROWS if name in needed and not getattr(base, name))
    note = "; ".join(filter(None, (row.forced, f"both with {also}, which it needs" if also else "")))
    return Variant(scene, carried), Variant(scene, absent), note


def _needed(field: str) -> set[str]:
    """Features that one's code needs, and theirs."""
    found = set(ROWS[field].requires)
    return found.union(*(_needed(name) for name in found)) if found else found


def _least(field: str) -> bool | int:
    """The smallest value with which a feature is in."""
    return FORCED_BINS if field == "bins" else type(ROWS[field].off)(1)


# -- scenes -------------------------------------------------------------------------------


def _with_normals(facts: Facts) -> Scene:
    """Every specular facet with its own normal at all three corners: smooth in name, flat in truth."""

    def smoothed(index: int, item: SceneObject) -> SceneObject:
        exact = index in facts.half_spaces or index in facts.curved
        if exact or not item.material.is_specular or item.mesh.corner_normals is not None:
            return item
        normals = np.repeat(item.mesh.face_normals()[:, None, :], 3, axis=1)
        return replace(item, mesh=replace(item.mesh, corner_normals=normals))

    return replace(facts.scene, objects=tuple(smoothed(i, o) for i, o in enumerate(facts.scene.objects)))


def _with_absorption(facts: Facts) -> Scene:
    """Every glass with an absorption of zero."""

    def filled(item: SceneObject) -> SceneObject:
        if not item.material.transmits:
            return item
        return replace(item, material=item.material.changed(absorption=Absorption(np.zeros(401))))

    return replace(facts.scene, objects=tuple(map(filled, facts.scene.objects)))


def _without_half_spaces(facts: Facts) -> Scene:
    """Convex solids as the triangles they came from."""

    def opened(index: int, item: SceneObject) -> SceneObject:
        if index not in facts.half_spaces:
            return item
        mesh = replace(item.mesh)
        vars(mesh)["convex_planes"] = None  # the cached property's own place
        return replace(item, mesh=mesh)

    return replace(facts.scene, objects=tuple(opened(i, o) for i, o in enumerate(facts.scene.objects)))


_DATA = {"smooth_normals": _with_normals, "normal_derivatives": _with_normals, "absorption": _with_absorption}
"""The scene whose data a feature reads that is put in."""
