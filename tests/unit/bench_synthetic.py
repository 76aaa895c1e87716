"""Made-up bench results that behave as real ones do.

Variance falls as a power of the photons and a method's bias floor stays; the pictures are a coloured band with each
method's own noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from spectrasplat.bench.curves import speed_ups
from spectrasplat.bench.results import BenchResult, Curve, Point, ReferenceInfo, Sample, SceneResult, Trial

# Seconds per photon, variance at 1000 photons, its exponent, bias².
METHODS = {
    "stochastic-point": (0.8e-6, 60.0, -1.0, 0.0),
    "stochastic": (1.0e-6, 8.0, -0.85, 2e-5),
    "regular-7": (2.2e-6, 2.0, -0.9, 2e-2),
    "regular-16": (4.0e-6, 1.2, -0.9, 5e-3),
    "srd-lambda": (1.6e-6, 0.35, -1.2, 1.5e-2),
    "srd": (2.0e-6, 0.30, -1.3, 3e-5),
}
SIZE = (96, 54)


def synthetic_curve(method: str, difficulty: float, seeds: int, longest_s: float, rng: np.random.Generator) -> Curve:
    per_photon, start, exponent, bias2 = METHODS[method]
    overhead_s = 0.01
    samples, points = [], []
    for seconds in np.geomspace(0.025, longest_s, 10):
        photons = int((seconds - overhead_s) / per_photon)
        variance = difficulty * start * (photons / 1000) ** exponent
        spread = variance * np.exp(rng.normal(0, 0.12, seeds))
        errors = bias2 * difficulty + spread
        for seed, error in enumerate(errors, 1):
            share = seconds - overhead_s
            samples.append(
                Sample(
                    photons,
                    seed,
                    photons,
                    int(photons * 1.7),
                    {"trace": 0.6 * share, "splat": 0.4 * share, "resolve": overhead_s, "camera": 0.02},
                    {
                        "relmse": float(error),
                        "relmse_trimmed": float(error) * 0.7,
                        "smape": 0.2,
                        "chroma": 0.01,
                        "nrmse": 0.1,
                        "flip": 0.05,
                        "energy_ratio": 0.999,
                    },
                )
            )
        points.append(
            Point(
                photons,
                float(seconds),
                float(errors.mean()),
                float(errors.min()),
                float(errors.max()),
                bias2 * difficulty,
                float(spread.mean()),
                float(seconds) + 1.4,
            )
        )
    kernels = [] if method in ("srd", "stochastic-point") else np.geomspace(0.6, 6.0, len(points)).tolist()
    return Curve(
        method,
        {"start": 0.5, "buffers": 0.05, "compile": 1.2, "pilot": 0.08, "first run": 0.1},
        samples,
        points=points,
        slope=exponent,
        slope_half_width=0.06,
        buffers_mib=42.0,
        budgets=[p.photons for p in points],
        kernels=kernels,
        sweep=[
            Trial(p.photons, width, p.seconds, p.relmse * (1.0 + 4.0 * np.log(width / best) ** 2))
            for p, best in zip(points[::3], kernels[::3], strict=True)
            for width in (0.5 * best, best, 2.0 * best)
        ]
        if kernels
        else [],
    )


def synthetic_pictures(directory: Path, scene: str, methods: Sequence[str], rng: np.random.Generator) -> dict[str, str]:
    """A curved spectrum on black, with noise and blur that suit each method; XYZ float32 files."""
    from spectrasplat.model.optics.colorimetry import cmf_xyz

    (directory / "pictures").mkdir(parents=True, exist_ok=True)
    y, x = np.mgrid[0 : SIZE[1], 0 : SIZE[0]] / SIZE[1]
    position = np.clip((np.hypot(x - 0.9, y + 0.2) - 0.55) / 0.5, 0, 1)
    inside = np.exp(-(((np.arctan2(y + 0.2, x - 0.9) - 1.7) / 0.55) ** 4)) * (position > 0) * (position < 1)
    reference = inside[..., None] * cmf_xyz()[(20 + 300 * (1 - position)).astype(int)]
    noise = {
        "stochastic": 0.35,
        "stochastic-point": 0.6,
        "regular-7": 0.1,
        "regular-16": 0.08,
        "srd-lambda": 0.05,
        "srd": 0.015,
    }
    files = {}
    for name in ("reference", *methods, *(f"{method} early" for method in methods)):
        level = noise.get(name.removesuffix(" early"), 0.0) * (3.0 if name.endswith("early") else 1.0)
        picture = reference * np.exp(rng.normal(0, level, reference.shape))
        files[name] = f"pictures/{scene}_{name.replace(' ', '_')}.npy"
        np.save(directory / files[name], picture.astype(np.float32))
    return files


def synthetic_scene(
    directory: Path,
    name: str,
    *,
    gain: float = 40.0,
    methods: Sequence[str] = tuple(METHODS),
    seeds: int = 5,
    difficulty: float = 1.0,
    own_error: float = 2e-5,
    longest_s: float = 3.0,
) -> SceneResult:
    rng = np.random.default_rng(sum(name.encode()))
    curves = [synthetic_curve(m, difficulty, seeds, longest_s, rng) for m in methods]
    scene = SceneResult(
        name,
        f"A made-up {name}",
        SIZE,
        seeds,
        longest_s,
        ReferenceInfo("photon histogram", 400_000_000, 61.0, own_error, "a1b2c3"),
        curves,
        strongest_glass="N-SF66",
        strongest_abbe=20.9,
        equal_time=longest_s,
        complete=True,
        pictures=synthetic_pictures(directory, name, methods, rng),
    )
    for curve in curves:
        scene.picture_samples[curve.method] = curve.samples[-1]
        scene.picture_samples[f"{curve.method} early"] = curve.samples[0]
    if {"srd", "stochastic"} <= set(methods):
        scene.speed_ups = speed_ups(curves)
    return scene


def synthetic_result(scenes: list[SceneResult]) -> BenchResult:
    machine = {
        "processor": "A processor",
        "cores": "2",
        "renderer": "llvmpipe",
        "driver": "Mesa",
        "opengl": "4.5",
        "system": "Linux",
        "python": "3.12",
    }
    return BenchResult("0.1.0", "2026-11-21 10:00", "spectrasplat bench ball prism -o out --seeds 5", machine, scenes)
