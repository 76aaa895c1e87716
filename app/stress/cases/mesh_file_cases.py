"""Mesh files with faults: loaded as a user would load them, against the same solid without.

What the loader can mend (slivers, doubled vertices, zero normals, faces turned inside out) must leave the light
as it is. What it cannot (a hole) must not make light appear or vanish uncounted.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ...gpu.context import Context
from ...model.geometry.mesh import Mesh, make_mesh
from ...model.geometry.primitives import box
from ...model.geometry.primitives_round import sphere
from ..case import Case, Measurement
from ..rigs.probe import (
    LOST_TO_NUMERICS,
    Held,
    energy_error,
    measurement,
    picture_error,
    probe,
)
from ..rigs.scene_parts import FLINT, SUN, solid, stage
from .contact_cases import CAUSTIC, NOISE, TEXELS, tilted

SLIVER = 1e-6
"""Height of a sliver over its length: float32 tells its corners apart, its plane hardly."""


@dataclass(frozen=True)
class Fault:
    """A way to spoil a mesh."""

    label: str
    spoil: Callable[[Mesh], Mesh]
    smooth: bool = False
    """On a smooth ball instead of a block."""
    mendable: bool = True
    flattened: float = 0.0
    """Added to the bound on the picture: facets whose lost normals become the face's no longer bend light as the ball
    does."""


def measure_faults(context: Context) -> Iterator[Measurement]:
    """Each fault, through an OBJ file. A hole lets rays in and out that no medium can follow: what is lost there only
    has to be said."""
    clean = {}
    for smooth in (False, True):
        scene = stage(*tilted(solid("solid", sound_solid(smooth), FLINT)), lights=[SUN])
        base = probe(context, scene, CAUSTIC)
        clean[smooth] = base, picture_error(probe(context, scene, replace(CAUSTIC, seed=2)).picture, base.picture)
    for number, fault in enumerate(FAULTS, 1):
        mesh, notes = through_file(fault.spoil(sound_solid(fault.smooth)), fault.smooth)
        found = probe(context, stage(*tilted(solid("solid", mesh, FLINT)), lights=[SUN]), CAUSTIC)
        base, noise = clean[fault.smooth]
        errors = {
            "picture": picture_error(found.picture, base.picture),
            "energy": energy_error(found.picture, base.picture),
        }
        bounds = {"picture": NOISE * noise + TEXELS + fault.flattened, "energy": 0.01} if fault.mendable else {}
        yield measurement(
            number,
            fault.label,
            found,
            Held(errors, bounds, "; ".join(notes)),
            LOST_TO_NUMERICS if fault.mendable else 1.0,
        )


def through_file(mesh: Mesh, normals: bool) -> tuple[Mesh, list[str]]:
    """`mesh` written as OBJ and loaded with all checks; what the loader said."""
    from ...model.scene_objects import load_checked_mesh

    notes: list[str] = []
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "spoilt.obj"
        file.write_text(_obj(mesh, normals), encoding="ascii")
        return load_checked_mesh(file, None, notes), notes


def _obj(mesh: Mesh, normals: bool) -> str:
    lines = ["v " + " ".join(f"{c:.9g}" for c in vertex) for vertex in mesh.vertices]
    if not normals or mesh.corner_normals is None:
        return "\n".join(lines + ["f {} {} {}".format(*(t + 1)) for t in mesh.triangles]) + "\n"
    lines += ["vn " + " ".join(f"{c:.9g}" for c in normal) for normal in mesh.corner_normals.reshape(-1, 3)]
    lines += [
        "f " + " ".join(f"{v + 1}//{3 * i + k + 1}" for k, v in enumerate(t)) for i, t in enumerate(mesh.triangles)
    ]
    return "\n".join(lines) + "\n"


def sound_solid(smooth: bool) -> Mesh:
    """The sound solid that faults are made in."""
    return sphere(0.5, 1280) if smooth else box()


def _with_slivers(mesh: Mesh) -> Mesh:
    """Every triangle cut in three at a point SLIVER away from a corner: one normal part, two slivers."""
    corners = mesh.corners()
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    inside = a + SLIVER * (0.5 * (b + c) - a)
    parts = np.concatenate([np.stack(t, axis=1) for t in ((a, b, inside), (b, c, inside), (c, a, inside))])
    return make_mesh(mesh.name, parts.reshape(-1, 3), np.arange(len(parts) * 3).reshape(-1, 3))


def _with_flat_triangles(mesh: Mesh) -> Mesh:
    """Triangles without area along existing edges, and of one point."""
    t = mesh.triangles
    return make_mesh(
        mesh.name,
        mesh.vertices,
        np.concatenate([t, np.stack([t[:, 0], t[:, 1], t[:, 1]], axis=1), np.repeat(t[:, :1], 3, axis=1)]),
    )


def _unwelded(mesh: Mesh) -> Mesh:
    return make_mesh(
        mesh.name, mesh.corners().reshape(-1, 3), np.arange(len(mesh.triangles) * 3).reshape(-1, 3), mesh.corner_normals
    )


def _with_normals(mesh: Mesh, change: Callable[[np.ndarray], np.ndarray]) -> Mesh:
    assert mesh.corner_normals is not None
    return replace(mesh, corner_normals=change(mesh.corner_normals.copy()))


def _some_zero(normals: np.ndarray) -> np.ndarray:
    normals[::37] = 0.0
    return normals


def _stretched(normals: np.ndarray) -> np.ndarray:
    return normals * np.geomspace(1e-6, 1e6, len(normals))[:, None, None]


def _without_first(mesh: Mesh) -> Mesh:
    return make_mesh(
        mesh.name, mesh.vertices, mesh.triangles[1:], None if mesh.corner_normals is None else mesh.corner_normals[1:]
    )


def _doubled(mesh: Mesh) -> Mesh:
    return make_mesh(mesh.name, mesh.vertices, np.concatenate([mesh.triangles, mesh.triangles]))


FAULTS = (
    Fault("nothing", lambda mesh: mesh),
    Fault("every face with a sliver of 1e-6", _with_slivers),
    Fault("triangles without area", _with_flat_triangles),
    Fault("doubled vertices", _unwelded),
    Fault("inside out", lambda mesh: mesh.flipped()),
    Fault("a ball: doubled vertices", _unwelded, smooth=True),
    Fault("a ball: some normals zero", lambda mesh: _with_normals(mesh, _some_zero), smooth=True, flattened=0.2),
    Fault("a ball: normals of length 1e-6 to 1e6", lambda mesh: _with_normals(mesh, _stretched), smooth=True),
    Fault("a ball: all normals point inwards", lambda mesh: _with_normals(mesh, np.negative), smooth=True),
    Fault("a hole: one face missing", _without_first, mendable=False),
    Fault("a ball with a hole", _without_first, smooth=True, mendable=False),
    Fault("every face twice", _doubled, mendable=False),
)

CASES: tuple[Case, ...] = (
    Case(
        "mesh-files",
        "Mesh files with slivers, zero normals, doubled vertices and holes, against the sound solid",
        "Normals of nothing are NaN; slivers leak; holes confuse inside and outside.",
        "fault",
        measure_faults,
        len(FAULTS),
        logarithmic=False,
    ),
)
