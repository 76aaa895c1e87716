"""Bad triangles: slivers and needles, triangles without area, normals that are zero, long or short, and files with
faults, loaded as a user would load them. No light may leak.

What the loader can mend must leave the light as it is. What it cannot (a hole) must not make light appear or vanish
uncounted.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ...gpu.context import Context
from ...gpu.records import FLAG_FOOTPRINT_DROPPED
from ...model.geometry.mesh import Mesh, make_mesh
from ...model.geometry.mesh_health import examine, repair
from ...model.geometry.primitives import box
from ...model.geometry.primitives_round import sphere as sphere_mesh
from ...model.scene import Diffuse, Mirror, Scene
from ...model.scene_objects import load_checked_mesh
from ...reference.glasses import D_NM
from ..case import EPSILON, Held, Measured, case, length
from ..rigs.gpu_paths import (
    MIRRORED,
    REFRACTED,
    Photons,
    beam_light,
    glass,
    placed,
    screen,
    trace_beam,
    trace_light,
    traced,
)
from ..rigs.probe import CAUSTIC, LOST_TO_NUMERICS, NOISE, TEXELS, compared, picture_error, probe, rendered
from ..rigs.scene_parts import FLINT, SUN, solid, stage, tilted
from .caustics import BEAM_RADIUS, HOLLOW_BEAM, HOLLOW_START, hollow_mirror, mirrored_landing
from .chains import of_both

TIES = 1e-3
"""Share of photons that may meet an edge so exactly that another rounding gives them its other facet: on a GPU one of
1,145 did, and was displaced by 0.11. The mean is of the others there; of all on a processor."""


def through_ball(context: Context, mesh: Mesh) -> Photons:
    """Light through a ball on to a wall."""
    direction = np.array([1.0, 0.11, -0.23])
    objects = placed("ball", mesh, glass("N-BK7")), placed("wall", screen([1.6, 0, 0], [1, 0, 0], 6.0), Diffuse())
    return trace_light(context, objects, beam_light(-2.0 * direction, direction, 0.9), [(D_NM, D_NM)], 1500, 6)


def dropped(photons: Photons) -> int:
    """Photons that carry the flag of a lost footprint."""
    return int(np.count_nonzero(photons.records["flags"] & FLAG_FOOTPRINT_DROPPED))


def share(photons: Photons, *ends: str) -> float:
    """Share of the light that ended so; "lost_numeric": it left the scene from inside glass."""
    return sum(photons.tally.ended[end] for end in ends) / photons.tally.emitted


def with_slivers(mesh: Mesh, height: float) -> Mesh:
    """Each triangle in three: one a sliver whose apex is `height` (a share of the triangle's) over the middle of an
    edge."""
    a, b, c = np.moveaxis(mesh.corners(), 1, 0)
    middle = 0.5 * (a + b)
    (i, j, k), p = mesh.triangles.T, len(mesh.vertices) + np.arange(len(mesh.triangles))
    split = np.concatenate([np.column_stack(part) for part in ((i, j, p), (j, k, p), (k, i, p))])
    return make_mesh("slivers", np.concatenate([mesh.vertices, middle + height * (c - middle)]), split)


@case("slivers", "aspect of the slivers", (1e2, 1e4, 1e5, 1e6, 1e7, np.inf))
def slivers(context: Context, aspects: Sequence[float]) -> Measured:
    """A ball whose every face holds a sliver, from 100:1 to no area at all

    A thin triangle's normal is mostly rounding, and the edge tests of its neighbours must overlap or light leaks into
    the glass for good. Light through a sliver may go astray; how much light that is shrinks as fast."""
    # A flat-faceted ball: too many planes for half-spaces, so the tree is used.
    smooth = sphere_mesh(1.0, 320)
    whole = make_mesh("ball", smooth.vertices, smooth.triangles)
    plain = through_ball(context, whole)
    straight = plain.of_choices(REFRACTED, REFRACTED)
    edge = float(np.median(length(np.diff(whole.corners(), axis=1))))
    for aspect in aspects:
        cut = with_slivers(whole, 1.0 / aspect)
        mended, notes = repair(cut)
        photons = through_ball(context, mended)
        a, b = of_both(straight, photons.of_choices(REFRACTED, REFRACTED))
        apart = length(a.position - b.position)
        # A sliver of height h tilts by u/h when its apex is rounded, and refraction twice bends light by less than
        # that; but light meets it with the chance 2h/edge. On the mean over all light that leaves a few roundings over
        # the edge, from each face.
        near = apart <= np.quantile(apart, 1.0 if context.is_software else 1.0 - TIES)
        # Triangles without area are dropped with a note, or kept as a closed mesh's stitches and named by `inspect`.
        noted = any("degenerate" in note for note in (*notes, examine(cut).summary()))
        held: Held = {
            "light leaked": (share(photons, "lost_numeric"), 0.0),
            "light displaced, mean": (np.average(apart[near], weights=a.weight[near]), 16.0 * EPSILON / edge * 2.6),
            "light on other ways": (abs(len(a.records) - len(straight.records)) / len(plain.records), 2e-3),
            "faults not said": (bool(examine(cut).degenerate_triangles) and not noted, 0.0),
        }
        label = f"{aspect:g} : 1" if np.isfinite(aspect) else "no area"
        summary, lost = examine(mended).summary(), dropped(photons)
        yield traced(min(aspect, 1e8), label, photons, held, dropped=lost, note=summary)


@case("needles", "aspect of the needles", (300, 1000, 3000, 10_000, 22_000))
def needles(context: Context, segments: Sequence[int]) -> Measured:
    """A mirror made of needles in no direction in particular

    The cross product of a needle's two long edges loses as many digits as the needle is thin. Every triangle is turned
    to begin at its best corner, so a needle shows its short edge."""
    # The hollow mirror of the cusp, turned so that nothing is aligned with an axis: each strip is two needles.
    turn = np.linalg.qr(np.array([[0.3, -0.8, 0.5], [0.7, 0.1, 0.6], [-0.4, 0.5, 0.9]]))[0]
    turn *= np.sign(np.linalg.det(turn))
    matrix = np.eye(4)
    matrix[:3, :3] = turn
    floor = screen([0, 0, 0], [0, 0, 1], 3.0).transformed(matrix)
    start, direction = turn @ HOLLOW_START, turn @ HOLLOW_BEAM
    for count in segments:
        width = 2.0 * np.pi / 3.0 / count
        mirror = hollow_mirror(count).transformed(matrix)
        photons = trace_beam(context, mirror, Mirror(), floor, start, direction, BEAM_RADIUS, D_NM, 800, 1)
        landed = photons.of_choices(MIRRORED)
        missed = length((landed.position @ turn)[:, :2] - mirrored_landing(landed.start @ turn, HOLLOW_BEAM))
        held: Held = {
            # As in the cusp; what a needle's normal and place lose must not show.
            "landing": (missed, width**2 / 4.0 + 24.0 * EPSILON),
            "light that slipped through": (share(photons, "direct", "escaped"), 0.0),
        }
        # Boxes of slanting needles all overlap, and llvmpipe stops a ray's walk after 65,535 rounds: lost, and noted.
        given_up = share(photons, "lost_numeric")
        note = f"{given_up:.0%} of the light given up by the software renderer" if given_up else ""
        yield traced(2.3 / width, f"{2.3 / width:.0f} : 1", photons, held, dropped=dropped(photons), note=note)


NORMAL_FAULTS = ("a tenth zero", "all zero", "lengths 1e-6 to 1e6", "a tenth backwards", "all backwards", "at random")


@case("bad-normals", "kind of fault", NORMAL_FAULTS)
def bad_normals(context: Context, faults: Sequence[str]) -> Measured:
    """Shading normals that are zero, unnormalised, backwards or random

    What can be repaired is, with a note; whatever is left, the geometric normal judges, no ray leaks and nothing is
    NaN."""
    smooth = sphere_mesh(1.0, 1280)
    normals = smooth.corner_normals
    assert normals is not None
    plain = through_ball(context, smooth).of_choices(REFRACTED, REFRACTED)
    rng = np.random.default_rng(11)
    some = (rng.random(normals.shape[:2]) < 0.1)[..., None]
    lengths = 10.0 ** rng.uniform(-6.0, 6.0, (*some.shape[:2], 1))
    broken = (
        np.where(some, 0.0, normals),
        np.zeros_like(normals),
        normals * lengths,
        np.where(some, -1.0, 1.0) * normals,
        -normals,
        rng.normal(size=normals.shape),
    )
    spoilt_by = dict(zip(NORMAL_FAULTS, broken, strict=True))
    for number, label in enumerate(faults):
        mended, notes = repair(make_mesh("ball", smooth.vertices, smooth.triangles, spoilt_by[label]))
        photons = through_ball(context, mended)
        silent = label in ("a tenth zero", "all zero", "all backwards") and not notes
        held: dict[str, tuple] = {"light leaked": (share(photons, "lost_numeric"), 0.0)}
        if label in ("lengths 1e-6 to 1e6", "all backwards"):
            a, b = of_both(plain, photons.of_choices(REFRACTED, REFRACTED))
            held["light displaced"] = (length(a.position - b.position), 1e-5)
        held["faults not said"] = (silent, 0.0)
        yield traced(number, label, photons, held, dropped=dropped(photons), note="; ".join(notes))


# ---- files -----------------------------------------------------------------------------------

SLIVER = 1e-6
"""Height of a sliver over its length: float32 distinguishes its corners, its plane hardly."""


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

    def loaded(self) -> tuple[Mesh, list[str]]:
        """The spoilt solid, written as OBJ and loaded with all checks; what the loader reported."""
        mesh, notes = self.spoil(sphere_mesh(0.5, 1280) if self.smooth else box()), list[str]()
        lines = ["v " + " ".join(f"{c:.9g}" for c in vertex) for vertex in mesh.vertices]
        if self.smooth and mesh.corner_normals is not None:
            lines += ["vn " + " ".join(f"{c:.9g}" for c in normal) for normal in mesh.corner_normals.reshape(-1, 3)]
            for i, t in enumerate(mesh.triangles):
                lines.append("f " + " ".join(f"{v + 1}//{3 * i + k + 1}" for k, v in enumerate(t)))
        else:
            lines += ["f {} {} {}".format(*(t + 1)) for t in mesh.triangles]
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "spoilt.obj"
            file.write_text("\n".join(lines) + "\n", encoding="ascii")
            return load_checked_mesh(file, None, notes), notes


def _with_tiny_slivers(mesh: Mesh) -> Mesh:
    """Every triangle cut in three at a point SLIVER away from a corner: one normal part, two slivers."""
    a, b, c = np.moveaxis(mesh.corners(), 1, 0)
    inside = a + SLIVER * (0.5 * (b + c) - a)
    parts = np.concatenate([np.stack(t, axis=1) for t in ((a, b, inside), (b, c, inside), (c, a, inside))])
    return make_mesh(mesh.name, parts.reshape(-1, 3), np.arange(len(parts) * 3).reshape(-1, 3))


def _with_flat_triangles(mesh: Mesh) -> Mesh:
    """Triangles without area along existing edges, and of one point."""
    t = mesh.triangles
    return make_mesh(mesh.name, mesh.vertices, np.concatenate([t, t[:, [0, 1, 1]], t[:, [0, 0, 0]]]))


def _unwelded(mesh: Mesh) -> Mesh:
    corners = np.arange(len(mesh.triangles) * 3).reshape(-1, 3)
    return make_mesh(mesh.name, mesh.corners().reshape(-1, 3), corners, mesh.corner_normals)


def _with_normals(change: Callable[[np.ndarray], np.ndarray]) -> Callable[[Mesh], Mesh]:
    return lambda mesh: replace(mesh, corner_normals=change(np.array(mesh.corner_normals)))


def _some_zero(normals: np.ndarray) -> np.ndarray:
    normals[::37] = 0.0
    return normals


def _stretched(normals: np.ndarray) -> np.ndarray:
    return normals * np.geomspace(1e-6, 1e6, len(normals))[:, None, None]


def _without_first(mesh: Mesh) -> Mesh:
    normals = None if mesh.corner_normals is None else mesh.corner_normals[1:]
    return make_mesh(mesh.name, mesh.vertices, mesh.triangles[1:], normals)


def _doubled(mesh: Mesh) -> Mesh:
    return make_mesh(mesh.name, mesh.vertices, np.concatenate([mesh.triangles, mesh.triangles]))


FAULTS = (
    Fault("nothing", lambda mesh: mesh),
    Fault("every face with a sliver of 1e-6", _with_tiny_slivers),
    Fault("triangles without area", _with_flat_triangles),
    Fault("doubled vertices", _unwelded),
    Fault("inside out", lambda mesh: mesh.flipped()),
    Fault("a ball: doubled vertices", _unwelded, smooth=True),
    Fault("a ball: some normals zero", _with_normals(_some_zero), smooth=True, flattened=0.2),
    Fault("a ball: normals of length 1e-6 to 1e6", _with_normals(_stretched), smooth=True),
    Fault("a ball: all normals point inwards", _with_normals(np.negative), smooth=True),
    Fault("a hole: one face missing", _without_first, mendable=False),
    Fault("a ball with a hole", _without_first, smooth=True, mendable=False),
    Fault("every face twice", _doubled, mendable=False),
)


@case("mesh-files", "fault", FAULTS)
def mesh_files(context: Context, faults: Sequence[Fault]) -> Measured:
    """Mesh files with slivers, zero normals, doubled vertices and holes, against the intact solid

    Normals of nothing are NaN; slivers leak; holes confuse inside and outside: what is lost there only has to be
    counted."""

    def lit(mesh: Mesh) -> Scene:
        return stage(*tilted(solid("solid", mesh, FLINT)), lights=[SUN])

    clean = {}
    for smooth, mesh in ((False, box()), (True, sphere_mesh(0.5, 1280))):
        base, other = (probe(context, lit(mesh), replace(CAUSTIC, seed=seed)) for seed in (1, 2))
        clean[smooth] = base, picture_error(other.picture, base.picture)
    for number, fault in enumerate(faults, 1):
        mesh, notes = fault.loaded()
        found, (base, noise) = probe(context, lit(mesh), CAUSTIC), clean[fault.smooth]
        held = compared(found, base, NOISE * noise + TEXELS + fault.flattened, 0.01)
        if not fault.mendable:
            held = {name: (error, None) for name, (error, _) in held.items()}
        lost = LOST_TO_NUMERICS if fault.mendable else 1.0
        yield rendered(number, fault.label, found, held, "; ".join(notes), lost)
