"""Cases for any whole scene: bend it (scale, place, turn, depth, blur, batch, size, glass) and see what must not
change.

Invariance needs no reference picture. Its bounds follow from what may change: float32 rounding in GPU
space turns a few of the photons' choices (hits next to an edge, roulette next to its threshold), and each
turned photon moves its own light only; another grid of texels or lattice of photons draws the picture anew
within its noise.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from ...gpu.context import Context
from ...model.optics.glass import Dispersion, from_abbe
from ...model.scene import Scene
from ..case import Case, Measurement
from ..rigs.probe import (
    SMALL,
    Held,
    Probe,
    blocks,
    energy_error,
    light_pass,
    measurement,
    nonfinite,
    picture_error,
    probe,
    read_maps,
    with_photons,
)
from ..rigs.scene_parts import extent, moved, turn, with_glass

SCALES = (1e-8, 1e-4, 1e4, 1e8)
OFFSETS = (1.0, 1e4, 1e6)
TURNS = (30.0, 90.0, 137.0)
DEPTHS = (1, 4, 16, 256)
SMOOTHINGS = (0.01, 0.2, 20.0)
BATCHES = (20, 1000)
SIZES = ((1, 1), (16, 16), (4096, 1), (1, 4096))
COUNTS = (1, 10, 1000)
ABBE_NUMBERS = (1.0, 5.0, 20.0, 1000.0)
PASSES = (4, 64)
AXIS = (1.0, 2.0, 0.5)

SAME_PICTURE = 0.01
"""nRMSE of a picture whose photons are the same but for rounding: one photon in a thousand may choose otherwise
(√(2·1e-3) of its own contrast of about a fifth)."""
SAME_ENERGY = 1e-3
"""The same, summed over the picture: one photon in a thousand."""
SAME_TO_ROUNDING = 1e-5
"""Sums of the same float32 numbers in another order: 6e-8 by the root of some thousand additions."""
NOISE = 3.0
"""A picture drawn anew may differ by as much as two seeds do, times this: two seeds still share the lattice's shape and
the texels."""
TEXELS = 0.05
"""nRMSE of a picture read from maps whose texels (half a pixel) lie otherwise: where an edge crosses a pixel half a
texel more or less of blur is a quarter of the contrast, and in so small a picture some 4 % of the pixels lie on edges:
0.25 √0.04."""
ANEW_ENERGY = 0.01
"""The sum over a picture drawn anew: what enters or leaves over its borders and receivers' edges."""


class Base:
    """The scene as it is, rendered when a case first asks for it."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self._probe: Probe | None = None

    def probe(self, context: Context) -> Probe:
        """Its rendering under `SMALL`."""
        if self._probe is None:
            self._probe = probe(context, self.scene, SMALL)
        return self._probe


def scene_sweep(scene: Scene, prefix: str = "") -> tuple[Case, ...]:
    """All cases for one scene; `prefix` goes before their names."""
    name, base = scene.name, Base(scene)
    cases = [
        Case(
            "scale",
            f"{name}: the whole scene larger and smaller",
            "Fixed epsilons leak or speckle; GPU space is scaled to the glass.",
            "scale factor",
            lambda context: _scales(context, base),
            len(SCALES),
        ),
        Case(
            "offset",
            f"{name}: the whole scene far from the origin",
            "float32 world coordinates would lose the glass; GPU space is centred in float64.",
            "offset, scene extents",
            lambda context: _offsets(context, base),
            len(OFFSETS),
        ),
        Case(
            "rotation",
            f"{name}: the whole scene turned",
            "Map axes, lattices and trees follow the axes; the picture must not.",
            "angle, degrees",
            lambda context: _turns(context, base),
            len(TURNS),
            logarithmic=False,
        ),
        Case(
            "depth",
            f"{name}: paths cut short",
            "What a depth limit takes must be counted as lost, not vanish.",
            "depth limit",
            lambda context: _depths(context, scene),
            len(DEPTHS),
        ),
        Case(
            "smoothing",
            f"{name}: footprints far too narrow and far too wide",
            "A kernel's width must not change the energy.",
            "footprint σ, lattice spacings",
            lambda context: _smoothings(context, base),
            len(SMOOTHINGS),
        ),
        Case(
            "batch",
            f"{name}: the same photons in tiny batches",
            "How many photons are in flight must not change the picture.",
            "photons in flight",
            lambda context: _batches(context, scene),
            len(BATCHES),
        ),
        Case(
            "size",
            f"{name}: pictures of one pixel, one row, one column",
            "Aspect ratios and windows degenerate.",
            "width / height",
            lambda context: _sizes(context, scene),
            len(SIZES),
        ),
        Case(
            "photons",
            f"{name}: next to no photons",
            "Lattices of a single point; footprints as wide as the scene.",
            "photons",
            lambda context: _counts(context, scene),
            len(COUNTS),
        ),
        Case(
            "bins",
            f"{name}: 32 spectral bins",
            "Eight targets; their sum must be the same light.",
            "bins",
            lambda context: _bins(context, base),
            1,
        ),
        Case(
            "passes",
            f"{name}: the same pass added again and again",
            "Running float32 sums stall; scratch textures are flushed into the total.",
            "passes",
            lambda context: _passes(context, scene),
            len(PASSES),
        ),
        Case(
            "dispersion",
            f"{name}: every glass with another Abbe number",
            "Wide swept splats, bands that total reflection cuts; energy and colours "
            "must be those of one-wavelength photons.",
            "Abbe number V_d",
            lambda context: _dispersions(context, scene),
            len(ABBE_NUMBERS),
        ),
    ]
    return tuple(replace(case, name=prefix + case.name) for case in cases)


def _compared(found: Probe, base: Probe, picture: float, energy: float) -> Held:
    return Held(
        {
            "picture": picture_error(found.picture, base.picture),
            "energy": energy_error(found.picture, base.picture),
            "map": found.map_error,
        },
        {"picture": picture, "energy": energy},
    )


def _scales(context: Context, whole: Base) -> Iterator[Measurement]:
    scene, base = whole.scene, whole.probe(context)
    for scale in SCALES:
        found = probe(context, moved(scene, scale=scale))
        yield measurement(scale, f"× {scale:.0e}", found, _compared(found, base, SAME_PICTURE, SAME_ENERGY))


def _offsets(context: Context, whole: Base) -> Iterator[Measurement]:
    scene, base = whole.scene, whole.probe(context)
    size = extent(scene)
    for offset in OFFSETS:
        found = probe(context, moved(scene, offset=(offset * size, -offset * size, offset * size)))
        yield measurement(offset, f"{offset:.0e} extents", found, _compared(found, base, SAME_PICTURE, SAME_ENERGY))


def _turns(context: Context, whole: Base) -> Iterator[Measurement]:
    scene, base = whole.scene, whole.probe(context)
    noise = picture_error(probe(context, scene, replace(SMALL, seed=2)).picture, base.picture)
    for degrees in TURNS:
        found = probe(context, moved(scene, rotation=turn(AXIS, degrees)))
        yield measurement(
            degrees, f"{degrees:.0f}°", found, _compared(found, base, NOISE * noise + TEXELS, ANEW_ENERGY)
        )


def _depths(context: Context, scene: Scene) -> Iterator[Measurement]:
    """Deeper paths land, absorb or escape more; and what they add is at most what the shorter ones had lost."""
    before: Probe | None = None
    for depth in DEPTHS:
        found = probe(context, scene, replace(SMALL, max_depth=depth))
        ended = sum(share for name, share in found.shares.items() if not name.startswith("lost"))
        held = Held({"lost to depth": found.shares.get("lost_depth", 0.0)})
        if before is not None:
            ended_before = sum(share for name, share in before.shares.items() if not name.startswith("lost"))
            held.errors["ended less"] = max(0.0, ended_before - ended)
            held.errors["ended too much"] = max(0.0, ended - ended_before - before.shares.get("lost_depth", 0.0))
            # Roulette's dice differ once a path is longer: its balance of some 1e-3 moves.
            held.bounds.update({"ended less": 5e-3, "ended too much": 5e-3})
        before = found
        yield measurement(depth, f"{depth} events", found, held)


def _smoothings(context: Context, whole: Base) -> Iterator[Measurement]:
    """Wider footprints reach over receivers' edges and the picture's border, and that is lost; narrow ones keep
    everything."""
    scene, base = whole.scene, whole.probe(context)
    for smoothing in SMOOTHINGS:
        found = probe(context, scene, replace(SMALL, smoothing=smoothing))
        held = Held({"map": found.map_error, "picture": picture_error(found.picture, base.picture)})
        if smoothing <= 1.0:
            held.bounds["map"] = base.map_error + ANEW_ENERGY
        yield measurement(smoothing, f"{smoothing:g} spacings", found, held)


def _batches(context: Context, scene: Scene) -> Iterator[Measurement]:
    photons = 4096
    base = probe(context, scene, with_photons(photons))
    for batch in BATCHES:
        found = probe(context, scene, replace(with_photons(photons), batch=batch))
        yield measurement(
            batch, f"{batch} in flight", found, _compared(found, base, SAME_TO_ROUNDING, SAME_TO_ROUNDING)
        )


def _sizes(context: Context, scene: Scene) -> Iterator[Measurement]:
    for width, height in SIZES:
        found = probe(context, scene, replace(SMALL, width=width, height=height))
        yield measurement(width / height, f"{width}×{height}", found, Held({"map": found.map_error}))


def _counts(context: Context, scene: Scene) -> Iterator[Measurement]:
    for photons in COUNTS:
        found = probe(context, scene, with_photons(photons))
        yield measurement(photons, f"{photons}", found, Held({"map": found.map_error}))


def _bins(context: Context, whole: Base) -> Iterator[Measurement]:
    """White pixels of the two kinds of map differ by the bins' width against the colour matching functions'."""
    base = whole.probe(context)
    found = probe(context, whole.scene, replace(SMALL, bins=32))
    yield measurement(32, "32 bins", found, _compared(found, base, 0.05, 0.02))


def _passes(context: Context, scene: Scene) -> Iterator[Measurement]:
    """Maps after k equal passes against k times the maps after one: every texel, relative to the brightest."""
    photons = 4096
    with light_pass(context, scene, with_photons(photons)) as (light, photon_records):
        light.begin(photons, SMALL.seed)
        light.run_pass(0, photons, lambda _: True)
        one, done = read_maps(light).astype(float), 1
        for passes in PASSES:
            while done < passes:
                light.run_pass(0, photons, lambda _: True)
                done += 1
            light.finish()
            sums = read_maps(light)
            error = float(np.abs(sums - passes * one).max() / (passes * np.abs(one).max())) if one.any() else 0.0
            found = Probe(
                np.zeros((1, 1, 3)),
                light.stats,
                nonfinite(sums) + photon_records.nonfinite_photons,
                photon_records.dropped,
                light.map_flux(),
            )
            yield measurement(passes, f"{passes} passes", found, Held({"sum": error}, {"sum": SAME_TO_ROUNDING}))


def _dispersions(context: Context, scene: Scene) -> Iterator[Measurement]:
    for v_d in ABBE_NUMBERS:
        bent = with_glass(scene, partial(_dispersive, v_d=v_d))
        yield against_single_wavelengths(context, bent, v_d, f"V_d {v_d:g}")


def _dispersive(glass: Dispersion, v_d: float) -> Dispersion:
    return from_abbe(glass.n_d, v_d, f"{glass.name} V_d {v_d:g}")


def against_single_wavelengths(
    context: Context, scene: Scene, severity: float, label: str, smeared: float = 0.0
) -> Measurement:
    """The default method against `stochastic` (one random wavelength a photon, no spectral column) on blocks of ten
    pixels.

    Its bound is the difference between two seeds of `stochastic`, which is what chance alone makes, and 3 % of the
    picture for the kernel's tails across the blocks' borders, and `smeared`; the energy's is 3 %.
    """
    settings = replace(SMALL, layer="caustic")
    found = probe(context, scene, settings)
    reference, other = (
        probe(context, scene, replace(settings, method="stochastic", seed=seed)).picture for seed in (1, 2)
    )
    chance = picture_error(blocks(other), blocks(reference))
    held = Held(
        {
            "blocks": picture_error(blocks(found.picture), blocks(0.5 * (reference + other))),
            "energy": energy_error(found.picture, 0.5 * (reference + other)),
        },
        {"blocks": chance + 0.03 + smeared, "energy": 0.03},
    )
    return measurement(severity, label, found, held)
