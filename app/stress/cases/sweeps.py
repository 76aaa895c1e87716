"""Cases for any whole scene: bend it (scale, place, turn, depth, blur, batch, size, glass): what must not change.

Invariance needs no reference picture. Its bounds follow from what may change: float32 rounding in GPU
space turns a few of the photons' choices (hits next to an edge, roulette next to its threshold), and each
turned photon moves its own light only; another grid of texels or lattice of photons draws the picture anew
within its noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from ...gpu.context import Context
from ...model.optics.glass import Dispersion, from_abbe
from ...model.scene import Scene
from ..case import Case, Held, Measured, case, not_finite
from ..rigs.probe import (
    NOISE,
    SAME_ENERGY,
    SAME_PICTURE,
    SMALL,
    TEXELS,
    Probe,
    against_single_wavelengths,
    compared,
    light_pass,
    picture_error,
    probe,
    read_maps,
    rendered,
    with_photons,
)
from ..rigs.scene_parts import extent, moved, turn, with_glass

SAME_TO_ROUNDING = 1e-5
"""Sums of the same float32 numbers in another order: 6e-8 by the root of some thousand additions."""
ANEW_ENERGY = 0.01
"""The sum over a picture drawn anew: what enters or leaves over its borders and receivers' edges."""
FEW = with_photons(4096)


class Base:
    """The scene as it is, rendered when a case first needs it."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self._probe: Probe | None = None

    def probe(self, context: Context) -> Probe:
        """Its rendering under `SMALL`."""
        if self._probe is None:
            self._probe = probe(context, self.scene, SMALL)
        return self._probe


def scene_sweep(scene: Scene, prefix: str = "") -> tuple[Case, ...]:
    """All cases for one scene; `prefix` begins their names."""
    base = Base(scene)
    return tuple(
        replace(
            each,
            name=prefix + each.name,
            title=f"{scene.name}: {each.title[0].lower()}{each.title[1:]}",
            run=partial(each.run, base=base),
        )
        for each in SWEEP
    )


def unchanged(found: Probe, base: Probe, picture: float = SAME_PICTURE, energy: float = SAME_ENERGY) -> Held:
    """A bent scene against the scene as it is."""
    return {**compared(found, base, picture, energy), "map": (found.map_error, None)}


@case("scale", "scale factor", (1e-8, 1e-4, 1e4, 1e8))
def scale(context: Context, factors: Sequence[float], base: Base) -> Measured:
    """The whole scene larger and smaller

    Fixed epsilons leak or speckle; GPU space is scaled to the glass."""
    for factor in factors:
        found = probe(context, moved(base.scene, scale=factor))
        yield rendered(factor, f"× {factor:.0e}", found, unchanged(found, base.probe(context)))


@case("offset", "offset, scene extents", (1.0, 1e4, 1e6))
def offset(context: Context, offsets: Sequence[float], base: Base) -> Measured:
    """The whole scene far from the origin

    float32 world coordinates would lose the glass; GPU space is centred in float64."""
    size = extent(base.scene)
    for far in offsets:
        found = probe(context, moved(base.scene, offset=(far * size, -far * size, far * size)))
        yield rendered(far, f"{far:.0e} extents", found, unchanged(found, base.probe(context)))


@case("rotation", "angle, degrees", (30.0, 90.0, 137.0))
def rotation(context: Context, angles_deg: Sequence[float], base: Base) -> Measured:
    """The whole scene turned

    Map axes, lattices and trees follow the axes; the picture must not."""
    plain = base.probe(context)
    noise = picture_error(probe(context, base.scene, replace(SMALL, seed=2)).picture, plain.picture)
    for degrees in angles_deg:
        found = probe(context, moved(base.scene, rotation=turn((1.0, 2.0, 0.5), degrees)))
        held = unchanged(found, plain, NOISE * noise + TEXELS, ANEW_ENERGY)
        yield rendered(degrees, f"{degrees:.0f}°", found, held)


@case("depth", "depth limit", (1, 4, 16, 256))
def depth(context: Context, limits: Sequence[int], base: Base) -> Measured:
    """Paths cut short

    What a depth limit takes must be counted as lost, not vanish."""
    before: tuple[float, float] | None = None
    for limit in limits:
        found = probe(context, base.scene, replace(SMALL, max_depth=limit))
        ended = sum(share for name, share in found.shares.items() if not name.startswith("lost"))
        lost = found.shares.get("lost_depth", 0.0)
        held: dict[str, tuple] = {"lost to depth": (lost, None)}
        if before is not None:
            # Deeper paths land, absorb or escape more; and what they add is at most what the shorter ones had lost.
            # Roulette's dice differ once a path is longer: its balance of some 1e-3 moves.
            more = ended - before[0]
            held["ended less"] = max(0.0, -more), 5e-3
            held["ended too much"] = max(0.0, more - before[1]), 5e-3
        before = ended, lost
        yield rendered(limit, f"{limit} events", found, held)


@case("smoothing", "footprint σ, lattice spacings", (0.01, 0.2, 20.0))
def smoothing(context: Context, widths: Sequence[float], base: Base) -> Measured:
    """Footprints far too narrow and far too wide

    A kernel's width must not change the energy."""
    plain = base.probe(context)
    for width in widths:
        found = probe(context, base.scene, replace(SMALL, smoothing=width))
        # Wider footprints reach over receivers' edges and the picture's border, and that is lost; narrow ones keep
        # everything.
        bound = plain.map_error + ANEW_ENERGY if width <= 1.0 else None
        held: Held = {
            "map": (found.map_error, bound),
            "picture": (picture_error(found.picture, plain.picture), None),
        }
        yield rendered(width, f"{width:g} spacings", found, held)


@case("batch", "photons in flight", (20, 1000))
def batch(context: Context, sizes: Sequence[int], base: Base) -> Measured:
    """The same photons in tiny batches

    How many photons are in flight must not change the picture."""
    plain = probe(context, base.scene, FEW)
    for size in sizes:
        found = probe(context, base.scene, replace(FEW, batch=size))
        yield rendered(size, f"{size} in flight", found, unchanged(found, plain, SAME_TO_ROUNDING, SAME_TO_ROUNDING))


@case("size", "width / height", ((1, 1), (16, 16), (4096, 1), (1, 4096)))
def size(context: Context, sizes: Sequence[tuple[int, int]], base: Base) -> Measured:
    """Pictures of one pixel, one row, one column

    Aspect ratios and windows degenerate."""
    for width, height in sizes:
        found = probe(context, base.scene, replace(SMALL, width=width, height=height))
        yield rendered(width / height, f"{width}×{height}", found, {"map": (found.map_error, None)})


@case("photons", "photons", (1, 10, 1000))
def photons(context: Context, counts: Sequence[int], base: Base) -> Measured:
    """Next to no photons

    Lattices of a single point; footprints as wide as the scene."""
    for count in counts:
        found = probe(context, base.scene, with_photons(count))
        yield rendered(count, f"{count}", found, {"map": (found.map_error, None)})


@case("bins", "bins", (32,))
def bins(context: Context, counts: Sequence[int], base: Base) -> Measured:
    """32 spectral bins

    Eight targets; their sum must be the same light."""
    for count in counts:
        found = probe(context, base.scene, replace(SMALL, bins=count))
        # White pixels of the two kinds of map differ by the bins' width against the colour matching functions'.
        yield rendered(count, f"{count} bins", found, unchanged(found, base.probe(context), 0.05, 0.02))


@case("passes", "passes", (4, 64))
def passes(context: Context, counts: Sequence[int], base: Base) -> Measured:
    """The same pass added again and again

    Running float32 sums stall; scratch textures are flushed into the total."""
    count = FEW.photons or 1
    with light_pass(context, base.scene, FEW) as (light, records):
        light.begin(count, SMALL.seed)
        light.run_pass(0, count, lambda _: True)
        one, done = read_maps(light).astype(float), 1
        for wanted in counts:
            for _ in range(done, wanted):
                light.run_pass(0, count, lambda _: True)
            done = max(done, wanted)
            light.finish()
            sums = read_maps(light)
            # Every texel against as many times the maps after one pass, relative to the brightest.
            error = np.abs(sums - wanted * one).max() / (wanted * np.abs(one).max()) if one.any() else 0.0
            bad = not_finite([sums]) + records.nonfinite_photons
            found = Probe(np.zeros((1, 1, 3)), light.stats, bad, records.dropped, light.maps.flux())
            yield rendered(wanted, f"{wanted} passes", found, {"sum": (error, SAME_TO_ROUNDING)})


@case("dispersion", "Abbe number V_d", (1.0, 5.0, 20.0, 1000.0))
def dispersion(context: Context, abbe_numbers: Sequence[float], base: Base) -> Measured:
    """Every glass with another Abbe number

    Wide swept splats, bands that total reflection cuts; energy and colours must be those of one-wavelength photons."""
    for v_d in abbe_numbers:
        bent = with_glass(base.scene, partial(_dispersing, v_d=v_d))
        yield against_single_wavelengths(context, bent, v_d, f"V_d {v_d:g}")


def _dispersing(glass: Dispersion, v_d: float) -> Dispersion:
    return from_abbe(glass.n_d, v_d, f"{glass.name} V_d {v_d:g}")


SWEEP = (scale, offset, rotation, depth, smoothing, batch, size, photons, bins, passes, dispersion)
