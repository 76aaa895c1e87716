"""Solids that touch, nest, overlap or share faces: each against an equivalent scene or a closed form.

Where two surfaces coincide a ray meets both at one distance, in an order that rounding decides; which medium
follows must not depend on it. Two kinds of answer need no other renderer: a scene that is the same light by a
simpler description, and a stack of plates at normal incidence, whose transmittance is a sum over reflections.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...gpu.context import Context
from ...model.geometry.mesh import Mesh, make_mesh
from ...model.geometry.primitives import box, prism
from ...model.geometry.primitives_lens import doublet, lens
from ...model.geometry.primitives_round import sphere
from ...model.optics.glass import constant
from ...model.scene import Camera, Scene, SceneObject
from ..case import Case, Measurement
from ..rigs.probe import (
    SMALL,
    Held,
    Probe,
    energy_error,
    measurement,
    picture_error,
    probe,
)
from ..rigs.scene_parts import (
    CROWN,
    FLINT,
    SUN,
    WATER,
    solid,
    stage,
    turn,
)

CAUSTIC = replace(SMALL, layer="caustic")
SAME_PICTURE = 0.01
"""nRMSE where only rounding differs: see `sweep_cases`."""
NOISE, TEXELS = 3.0, 0.05
"""As in `sweep_cases`, for scenes whose lattices or maps differ."""
SAME_ENERGY = 2e-3
PLATES = 2e-3
"""Transmittance of a stack of plates: roulette over 32 thousand photons leaves some 1e-4 to 1e-3."""
GAPS = (1e-1, 1e-3, 1e-4, 1e-5, 1e-7, 0.0)
OVERLAPS = (1e-1, 1e-3, 1e-5, 1e-7, 0.0)
CONTACT = 6e-5
"""Surfaces nearer than 3e-5 GPU units (`NEAR_DISTANCE` of intersect.glsl; here twice that in scene units) are in
optical contact."""
STACKS = (1, 4, 16, 32)
_TILT = turn((1.0, 0.4, 0.2), 28.0)
_CENTRE = np.array([0.0, 0.0, 1.2])


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


def measure_pairs(context: Context) -> Iterator[Measurement]:
    """Each pair: same picture, same energy, no leak."""
    plain: dict[tuple[Callable[[], Scene], int], Probe] = {}

    def rendered(pair: Pair, seed: int) -> Probe:
        """The plain scene, once for all pairs that share it."""
        key = pair.plain, seed
        if key not in plain:
            plain[key] = probe(context, pair.plain(), replace(CAUSTIC, layer=pair.layer, seed=seed))
        return plain[key]

    for number, pair in enumerate(PAIRS, 1):
        base, found = rendered(pair, 1), probe(context, pair.joined(), replace(CAUSTIC, layer=pair.layer))
        bound = SAME_PICTURE
        if pair.redrawn:
            bound = TEXELS + pair.edges + NOISE * picture_error(rendered(pair, 2).picture, base.picture)
        held = Held(
            {
                "picture": picture_error(found.picture, base.picture),
                "energy": energy_error(found.picture, base.picture),
            },
            {"picture": bound, "energy": 5 * SAME_ENERGY if pair.redrawn else SAME_ENERGY},
        )
        yield measurement(number, pair.label, found, held)


def measure_gaps(context: Context) -> Iterator[Measurement]:
    """Two plates of one glass: four faces while there is a gap, two when there is none."""
    for gap in GAPS:
        found = probe(context, _plates([(1.5, 0.3, gap), (1.5, 0.3, 0.0)]), CAUSTIC)
        touching = gap < CONTACT
        error = abs(found.shares["deposited"] - plates([1.5] if touching else [1.5, 1.0, 1.5]))
        held = Held(
            {"transmittance": error}, {"transmittance": PLATES}, "optical contact" if touching else "a film of air"
        )
        yield measurement(gap, f"{gap:.0e}" if gap else "contact", found, held)


def measure_overlaps(context: Context) -> Iterator[Measurement]:
    """Two plates of different glass that reach into each other: three faces at every depth of overlap."""
    expected = plates([1.5, 1.9])
    for overlap in OVERLAPS:
        found = probe(context, _plates([(1.5, 0.3, -overlap), (1.9, 0.3, 0.0)]), CAUSTIC)
        error = abs(found.shares["deposited"] - expected)
        yield measurement(
            overlap,
            f"{overlap:.0e}" if overlap else "contact",
            found,
            Held({"transmittance": error}, {"transmittance": PLATES}),
        )


def measure_stacks(context: Context) -> Iterator[Measurement]:
    """So many plates in contact, of two glasses in turn, and events enough that nothing is left on its way."""
    for count in STACKS:
        indices = [(1.5, 1.7)[i % 2] for i in range(count)]
        found = probe(
            context, _plates([(n, 0.6 / count, 0.0) for n in indices]), replace(CAUSTIC, max_depth=64 + 8 * count)
        )
        error = abs(found.shares["deposited"] - plates(indices))
        yield measurement(count, f"{count} plates", found, Held({"transmittance": error}, {"transmittance": PLATES}))


def plates(indices: Sequence[float]) -> float:
    """Transmittance at normal incidence of layers of these indices in air, by adding reflections incoherently.

    Each added face turns (R, T) into R + T² r/(1 − R r) seen from the front, and T t/(1 − R' r) through, with R' seen
    from behind (Stokes 1862, "On the intensity of the light reflected from or transmitted through a pile of plates").
    """
    media = [1.0, *indices, 1.0]
    behind, through = 0.0, 1.0
    for a, b in itertools.pairwise(media):
        r = ((a - b) / (a + b)) ** 2
        passed = 1.0 / (1.0 - behind * r)
        through, behind = through * (1.0 - r) * passed, r + (1.0 - r) ** 2 * behind * passed
    return through


def cavity(outside: Mesh, inside: Mesh) -> Mesh:
    """`outside` with a hole of the shape `inside` (flat shading)."""
    turned = inside.flipped()
    vertices = np.concatenate([outside.vertices, turned.vertices])
    return make_mesh("hollow", vertices, np.concatenate([outside.triangles, turned.triangles + len(outside.vertices)]))


def tilted(*items: SceneObject) -> list[SceneObject]:
    """Objects modelled round the origin, turned together and lifted over the table."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = _TILT, _CENTRE
    return [replace(item, object_to_world=matrix @ item.object_to_world) for item in items]


def _plates(layers: Sequence[tuple[float, float, float]]) -> Scene:
    """Plates (index, thickness, gap above the next), the lowest first, over the table; light falls straight down."""
    items, z = [], 0.5
    for number, (n, thickness, gap) in enumerate(layers):
        items.append(
            solid(
                f"plate {number}", box((2.0, 2.0, thickness)), constant(n, f"n {n:g}"), (0.3, 0.0, z + 0.5 * thickness)
            )
        )
        z += thickness + gap
    return stage(*items)


def _standing(depth: float) -> Scene:
    """A block whose lowest `depth` is below the table."""
    return stage(solid("block", box((1.0, 0.8, 0.9)), FLINT, (0.0, 0.0, 0.45 - depth)), lights=[SUN])


def _block(*others: SceneObject, priority: int = 0) -> Scene:
    return stage(*tilted(solid("block", box(), FLINT, priority=priority), *others), lights=[SUN])


def _seen(*others: SceneObject) -> Scene:
    """`_block` from above, where direct light shows."""
    return replace(
        _block(*others), camera=Camera((3.0, -2.0, 5.0), (2.0, 0.0, 0.0), kind="orthographic", vertical_extent=3.0)
    )


def _eighths() -> list[SceneObject]:
    places = [(x, y, z) for x in (-0.25, 0.25) for y in (-0.25, 0.25) for z in (-0.25, 0.25)]
    return [solid(f"part {i}", box((0.5, 0.5, 0.5)), FLINT, place) for i, place in enumerate(places)]


def _ball(radius: float, name: str = "ball", triangles: int = 1280) -> SceneObject:
    return solid(name, sphere(radius, triangles), FLINT)


def _prisms(gap: float) -> Scene:
    """Two prisms, base down, whose lower edges meet or nearly do."""
    half = 0.5 + 0.5 * gap
    return stage(
        solid("left", prism(), FLINT, (-half, 0.0, 0.9)), solid("right", prism(), FLINT, (half, 0.0, 0.9)), lights=[SUN]
    )


def _vessel(water: float, water_priority: int, hollow: bool) -> Scene:
    glass = cavity(box(), box((0.6, 0.6, 0.6))) if hollow else box()
    return stage(
        *tilted(
            solid("vessel", glass, CROWN), solid("water", box((water, water, water)), WATER, priority=water_priority)
        ),
        lights=[SUN],
    )


def _doublet() -> Scene:
    front, back = doublet(2.0, -2.0, -6.0, 0.25, 0.1, 1.0, triangles=4800)
    return stage(*tilted(solid("front", front, FLINT), solid("back", back, FLINT)), lights=[SUN])


def _lens() -> Scene:
    return stage(
        *tilted(solid("lens", lens(2.0, -6.0, 0.35, 1.0, triangles=2400), FLINT, (0.0, 0.0, -0.075))), lights=[SUN]
    )


PAIRS = (
    Pair(
        "a block in two passes that share a face",
        lambda: stage(
            *tilted(
                solid("a", box((0.5, 1.0, 1.0)), FLINT, (-0.25, 0.0, 0.0)),
                solid("b", box((0.5, 1.0, 1.0)), FLINT, (0.25, 0.0, 0.0)),
            ),
            lights=[SUN],
        ),
        _block,
        redrawn=True,
    ),
    Pair("a block in eight parts", lambda: stage(*tilted(*_eighths()), lights=[SUN]), _block, redrawn=True),
    Pair("the same block twice", lambda: _block(solid("again", box(), FLINT)), _block, redrawn=True),
    Pair("a ball of the same glass in a block", lambda: _block(_ball(0.4)), _block, redrawn=True),
    Pair(
        "a block of n = 1 half over a block",
        lambda: _seen(solid("air", box(), constant(1.0, "air"), (0.5, 0.0, 0.0), priority=-1)),
        _seen,
        redrawn=True,
        edges=0.03,
        layer="beauty",
    ),
    Pair(
        "eight nested shells of one glass",
        lambda: stage(*tilted(*(_ball(0.1 * k, f"shell {k}", 320) for k in range(8, 0, -1))), lights=[SUN]),
        lambda: stage(*tilted(_ball(0.8, triangles=320)), lights=[SUN]),
    ),
    Pair(
        "a bubble as a solid of n = 1, and as a cavity",
        lambda: _block(solid("bubble", box((0.5, 0.5, 0.5)), constant(1.0, "air"), priority=1)),
        lambda: stage(*tilted(solid("hollow", cavity(box(), box((0.5, 0.5, 0.5))), FLINT)), lights=[SUN]),
    ),
    Pair(
        "water that ends at the wall, and one that is carved out",
        lambda: _vessel(0.6, 0, True),
        lambda: _vessel(0.6, 1, False),
    ),
    Pair(
        "water that reaches into the wall, and one that is carved out",
        lambda: _vessel(0.8, -1, True),
        lambda: _vessel(0.6, 1, False),
    ),
    Pair("a cemented doublet of one glass, and a lens", _doublet, _lens, redrawn=True),
    Pair("two prisms that share an edge, and 1e-4 apart", lambda: _prisms(0.0), lambda: _prisms(1e-4)),
    Pair(
        "a block sunk by 0.1 in the table, and by 0.2",
        lambda: _standing(0.1),
        lambda: stage(solid("block", box((1.0, 0.8, 1.0)), FLINT, (0.0, 0.0, 0.3)), lights=[SUN]),
        redrawn=True,
    ),
)

CASES: tuple[Case, ...] = (
    Case(
        "contacts",
        "Solids that share faces, nest or overlap, against a simpler scene of the same light",
        "Where faces coincide, rounding decides their order: "
        "light leaks or sees a face that is not there. The medium stack goes by priority, not by order.",
        "pair",
        measure_pairs,
        len(PAIRS),
        logarithmic=False,
    ),
    Case(
        "gap",
        "Two plates with an ever thinner gap, against the sum over reflections",
        "A ray restarts a little off the surface it left; that must not jump the gap.",
        "gap, scene units",
        measure_gaps,
        len(GAPS),
    ),
    Case(
        "overlap",
        "Two plates of different glass that reach into each other ever less",
        "Entering the second before leaving the first, or at once.",
        "overlap, scene units",
        measure_overlaps,
        len(OVERLAPS),
    ),
    Case(
        "stack",
        "Up to 32 plates in contact, against the sum over reflections",
        "Many coincident faces in a row, many media in one stack.",
        "plates",
        measure_stacks,
        len(STACKS),
    ),
)
