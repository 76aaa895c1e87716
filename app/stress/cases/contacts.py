"""Solids that touch, nest, overlap or share faces: each against an equivalent scene or a closed form.

Where two surfaces coincide a ray meets both at one distance, in an order that rounding decides; which medium
follows must not depend on it. Two kinds of answer need no other renderer: a scene that is the same light by a
simpler description, and a stack of plates at normal incidence, whose transmittance is a sum over reflections.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from ...gpu.context import Context
from ...model.geometry.mesh import Mesh, make_mesh
from ...model.geometry.primitives import box, prism
from ...model.geometry.primitives_lens import lens
from ...model.geometry.primitives_round import sphere
from ...model.optics.glass import Dispersion, constant
from ...model.scene import Camera, Scene, SceneObject
from ..case import Held, Measured, case
from ..rigs.probe import CAUSTIC, NOISE, SAME_PICTURE, TEXELS, Probe, compared, picture_error, probe, rendered
from ..rigs.scene_parts import CROWN, FLINT, SUN, WATER, solid, stage, tilted

SAME_ENERGY = 2e-3
PLATES = 2e-3
"""Transmittance of a stack of plates: roulette over 32 thousand photons leaves some 1e-4 to 1e-3."""
CONTACT = 6e-5
"""Surfaces nearer than 3e-5 GPU units (`NEAR_DISTANCE` of intersect.glsl; here twice that in scene units) are in
optical contact."""

# ---- two descriptions of one thing ---------------------------------------------------------------


@dataclass(frozen=True)
class Pair:
    """Two descriptions of one thing."""

    label: str
    joined: Callable[[], Scene]
    plain: Callable[[], Scene]
    redrawn: bool = False
    """Lattices, maps or roulette's dice of the two differ, so that chance does."""
    edges: float = 0.0
    """Added to the bound on the picture where one of the two draws direct light by splats, which blur a shadow's
    edge."""
    layer: str = "caustic"
    """"beauty" where what is caustic in one is direct light in the other."""


def cavity(outside: Mesh, inside: Mesh) -> Mesh:
    """`outside` with a hole of the shape `inside` (flat shading)."""
    turned = inside.flipped()
    vertices = np.concatenate([outside.vertices, turned.vertices])
    return make_mesh("hollow", vertices, np.concatenate([outside.triangles, turned.triangles + len(outside.vertices)]))


def _cube(
    side: float | tuple[float, float, float] = 1.0,
    place: tuple[float, float, float] = (0.0, 0.0, 0.0),
    glass: Dispersion = FLINT,
    priority: int = 0,
) -> SceneObject:
    return solid("part", box((side, side, side) if isinstance(side, float) else side), glass, place, priority)


def _ball(radius: float, triangles: int = 320) -> SceneObject:
    return solid("ball", sphere(radius, triangles), FLINT)


def _lit(*items: SceneObject) -> Scene:
    """Turned together over the table, in the sun."""
    return stage(*tilted(*items), lights=[SUN])


def _block() -> Scene:
    return _lit(_cube())


def _seen(*others: SceneObject) -> Scene:
    """A block and others from above, where direct light shows."""
    above = Camera((3.0, -2.0, 5.0), (2.0, 0.0, 0.0), kind="orthographic", vertical_extent=3.0)
    return replace(_lit(_cube(), *others), camera=above)


def _hollow() -> Scene:
    return _lit(solid("hollow", cavity(box(), box((0.5, 0.5, 0.5))), FLINT))


def _vessel(water: float, priority: int, hollow: bool) -> Scene:
    """A vessel of glass and the cube of water in it."""
    glass = cavity(box(), box((0.6, 0.6, 0.6))) if hollow else box()
    return _lit(solid("vessel", glass, CROWN), _cube(water, glass=WATER, priority=priority))


def _carved_out() -> Scene:
    return _vessel(0.6, 1, False)


def _doublet() -> Scene:
    front, back = lens(2.0, -2.0, 0.25, 1.0, 2400, front=-0.25), lens(-2.0, -6.0, 0.1, 1.0, 2400, front=0.0)
    return _lit(solid("front", front, FLINT), solid("back", back, FLINT))


def _lens() -> Scene:
    return _lit(solid("lens", lens(2.0, -6.0, 0.35, 1.0, triangles=2400), FLINT, (0.0, 0.0, -0.075)))


def _prisms(gap: float) -> Scene:
    """Two prisms, base down, whose lower edges meet or nearly do."""
    half = 0.5 + 0.5 * gap
    return stage(*(solid("prism", prism(), FLINT, (x, 0.0, 0.9)) for x in (-half, half)), lights=[SUN])


def _standing(height: float, middle: float) -> Scene:
    """A block whose lowest part is below the table."""
    return stage(_cube((1.0, 0.8, height), (0.0, 0.0, middle)), lights=[SUN])


HALVES = [_cube((0.5, 1.0, 1.0), (x, 0.0, 0.0)) for x in (-0.25, 0.25)]
EIGHTHS = [_cube(0.5, (x, y, z)) for x, y, z in itertools.product((-0.25, 0.25), repeat=3)]
AIR = constant(1.0, "air")
PAIRS = (
    Pair("a block in two passes that share a face", lambda: _lit(*HALVES), _block, redrawn=True),
    Pair("a block in eight parts", lambda: _lit(*EIGHTHS), _block, redrawn=True),
    Pair("the same block twice", lambda: _lit(_cube(), _cube()), _block, redrawn=True),
    Pair("a ball of the same glass in a block", lambda: _lit(_cube(), _ball(0.4, 1280)), _block, redrawn=True),
    Pair(
        "a block of n = 1 half over a block",
        lambda: _seen(_cube(1.0, (0.5, 0.0, 0.0), AIR, -1)),
        _seen,
        redrawn=True,
        edges=0.03,
        layer="beauty",
    ),
    Pair(
        "eight nested shells of one glass",
        lambda: _lit(*(_ball(0.1 * k) for k in range(8, 0, -1))),
        lambda: _lit(_ball(0.8)),
    ),
    Pair(
        "a bubble as a solid of n = 1, and as a cavity",
        lambda: _lit(_cube(), _cube(0.5, glass=AIR, priority=1)),
        _hollow,
    ),
    Pair("water that ends at the wall, and one that is carved out", lambda: _vessel(0.6, 0, True), _carved_out),
    Pair("water that reaches into the wall, and one that is carved out", lambda: _vessel(0.8, -1, True), _carved_out),
    Pair("a cemented doublet of one glass, and a lens", _doublet, _lens, redrawn=True),
    Pair("two prisms that share an edge, and 1e-4 apart", lambda: _prisms(0.0), lambda: _prisms(1e-4)),
    Pair(
        "a block sunk by 0.1 in the table, and by 0.2",
        lambda: _standing(0.9, 0.45 - 0.1),
        lambda: _standing(1.0, 0.3),
        redrawn=True,
    ),
)


@case("contacts", "pair", PAIRS)
def contacts(context: Context, pairs: Sequence[Pair]) -> Measured:
    """Solids that share faces, nest or overlap, against a simpler scene of the same light

    Where faces coincide, rounding decides their order: light leaks or sees a face that is not there. The medium stack
    follows priorities, not the order of hits."""

    @cache
    def drawn(scene: Callable[[], Scene], layer: str, seed: int) -> Probe:
        """A scene, once for all pairs that share it."""
        return probe(context, scene(), replace(CAUSTIC, layer=layer, seed=seed))

    for number, pair in enumerate(pairs, 1):
        base, found = drawn(pair.plain, pair.layer, 1), drawn(pair.joined, pair.layer, 1)
        bounds = SAME_PICTURE, SAME_ENERGY
        if pair.redrawn:
            chance = NOISE * picture_error(drawn(pair.plain, pair.layer, 2).picture, base.picture)
            bounds = TEXELS + pair.edges + chance, 5 * SAME_ENERGY
        yield rendered(number, pair.label, found, compared(found, base, *bounds))


# ---- plates ------------------------------------------------------------------------------------


def plates(*indices: float) -> float:
    """Transmittance at normal incidence of layers of these indices in air, by adding reflections incoherently.

    Each added face turns (R, T) into R + T² r/(1 − R r) seen from the front, and T t/(1 − R' r) through, with R' seen
    from behind (Stokes 1862, "On the intensity of the light reflected from or transmitted through a pile of plates").
    """
    behind, through = 0.0, 1.0
    for a, b in itertools.pairwise([1.0, *indices, 1.0]):
        r = ((a - b) / (a + b)) ** 2
        passed = 1.0 / (1.0 - behind * r)
        through, behind = through * (1.0 - r) * passed, r + (1.0 - r) ** 2 * behind * passed
    return through


def _piled(*layers: tuple[float, float, float]) -> Scene:
    """Plates (index, thickness, gap above the next), the lowest first, over the table; light falls straight down."""
    items, z = [], 0.5
    for n, thickness, gap in layers:
        items.append(_cube((2.0, 2.0, thickness), (0.3, 0.0, z + 0.5 * thickness), constant(n, f"n {n:g}")))
        z += thickness + gap
    return stage(*items)


def transmits(found: Probe, *indices: float) -> Held:
    """Against the sum over reflections."""
    return {"transmittance": (abs(found.shares.get("deposited", 0.0) - plates(*indices)), PLATES)}


@case("gap", "gap, scene units", (1e-1, 1e-3, 1e-4, 1e-5, 1e-7, 0.0))
def gap(context: Context, gaps: Sequence[float]) -> Measured:
    """Two plates with an ever thinner gap, against the sum over reflections

    A ray restarts a little off the surface it left; that must not jump the gap."""
    for width in gaps:
        found, touching = probe(context, _piled((1.5, 0.3, width), (1.5, 0.3, 0.0)), CAUSTIC), width < CONTACT
        held = transmits(found, *((1.5,) if touching else (1.5, 1.0, 1.5)))
        note = "optical contact" if touching else "a film of air"
        yield rendered(width, f"{width:.0e}" if width else "contact", found, held, note)


@case("overlap", "overlap, scene units", (1e-1, 1e-3, 1e-5, 1e-7, 0.0))
def overlap(context: Context, depths: Sequence[float]) -> Measured:
    """Two plates of different glass that reach into each other ever less

    Entering the second before leaving the first, or at once."""
    for depth in depths:
        found = probe(context, _piled((1.5, 0.3, -depth), (1.9, 0.3, 0.0)), CAUSTIC)
        yield rendered(depth, f"{depth:.0e}" if depth else "contact", found, transmits(found, 1.5, 1.9))


@case("stack", "plates", (1, 4, 16, 32))
def stack(context: Context, counts: Sequence[int]) -> Measured:
    """Up to 32 plates in contact, against the sum over reflections

    Many coincident faces in a row, many media in one stack."""
    for count in counts:
        # Of two glasses in turn, and events enough that nothing is left on its way.
        indices, settings = [(1.5, 1.7)[i % 2] for i in range(count)], replace(CAUSTIC, max_depth=64 + 8 * count)
        found = probe(context, _piled(*((n, 0.6 / count, 0.0) for n in indices)), settings)
        yield rendered(count, f"{count} plates", found, transmits(found, *indices))
