"""A page of a few photons or one beam, and the same light by quadrature in float64."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image
from spectrasplat.render.page.document import document

NM = np.arange(380.0, 781.0)
N_AT_0, N_AT_1 = 1.56, 1.50
TEXELS = 128
"""Across the map of these pages, of 2 by 2 units."""
AXES = [[0, 0, 1], [1, 0, 0], [0, 1, 0]]
"""Of the horizon, and up."""
STILL = io.BytesIO()
Image.new("RGB", (64, 48), "grey").save(STILL, "jpeg")


def glass(slope: float = 0.0042) -> np.ndarray:
    """n(λ) by Cauchy's formula, 1.52 at the d line."""
    return 1.52 + slope * ((1000.0 / NM) ** 2 - (1000.0 / 587.5618) ** 2)


def bump(nm: float, width: float) -> np.ndarray:
    return np.exp(-0.5 * ((NM - nm) / width) ** 2)


OBSERVER = 683.0 * np.stack([bump(600, 45) - 0.2 * bump(500, 20), bump(550, 40), bump(450, 25)], axis=1)
EVEN = 1.0 + 0.5 * np.sin(NM / 30.0)


def page(things: dict[str, np.ndarray], lines: list[list[float]] | None = None) -> str:
    """One lamp: `lines` [[nm, W]], else a continuum. `things`: arrays by their names (docs/pages.md)."""
    head: dict[str, Any] = {
        "mode": "index", "n_at_0": N_AT_0, "n_at_1": N_AT_1, "title": "A test", "description": "Few photons.",
        "scene": "test", "receiver": "floor", "exposure_ev": -8.0, "steps": [], "notes": ["A note."],
        "lit": {"centre": [0, 0], "across": 2.0},
        "around": {"target": [0, 0, 0], "axes": AXES, "turn": 0.0, "lift": 0.9, "radius": 1.5},
        "meshes": [],
        "plane": {"origin": [0, 0, 0], "u": [1, 0, 0], "v": [0, 0, -1]}, "limits": {"gain_max": 2.0},
        "lights": [{"spectrum": 0, "luminous": 1.0}], "photons": {"unit": 1.0, "smoothing": 0.45},
        "spectra": [{"name": "own", "lines": lines or []}, {"name": "line", "lines": [[546.1, 9.0]], "choice": True}],
        "glasses": [{"name": "own", "V_d": 40.0}, {"name": "other", "V_d": 30.0}],
        "groups": [{"name": "own", "objects": ["ball"], "row": 0, "choices": [0, 1]}],
    }  # fmt: skip
    arrays = things | {
        "still": np.frombuffer(STILL.getvalue(), "u1"),
        "observer": OBSERVER.T.astype("f4"), "response": OBSERVER.T.astype("f4"),
        "spectra.density": np.stack([EVEN * (not lines), 0 * EVEN]).astype("f4"),
        "glass_n": np.stack([glass(), glass(0.006)]).astype("f4"), "nm": NM.astype("f4"),
        "variable": glass()[None].astype("f4"),
    }  # fmt: skip
    return document(arrays, head)


def written(folder: Path, things: dict[str, np.ndarray], lines: list[list[float]] | None = None) -> Path:
    target = folder / "page.html"
    target.write_text(page(things, lines), encoding="utf-8")
    return target


def photons(
    s: list[float], t: list[float], change: list[float], carried: list[float], x: list[float]
) -> dict[str, np.ndarray]:
    """Three alike at different places."""
    place = np.array([[-0.31, 0.12], [0.07, -0.33], [0.26, 0.28]])
    bits = np.rint(65535.0 * np.array(x))
    return {
        "photons.position": place.astype("f4"), "photons.axis_s": np.tile(s, (3, 1)).astype("f2"),
        "photons.axis_t": np.tile(t, (3, 1)).astype("f2"), "photons.x": np.tile(bits, (3, 1)).astype("u2"),
        "photons.dposition_dn": np.tile([change], (3, 1, 1)).astype("f2"), "photons.light": np.zeros(3, "u1"),
        "photons.throughput": np.tile(carried, (3, 1)).astype("f2"), "photons.lattice": np.zeros(3, "u4"),
        "photons.edge": np.zeros(3, "u4"), "photons.fan": np.zeros((3, 2), "f2"),
    }  # fmt: skip


def many_photons(count: int) -> dict[str, np.ndarray]:
    """As a page holds them: here and there, some longer, some wider, of some part of the spectrum each."""
    random = np.random.default_rng(1)
    one = photons([1, 0], [0, 1], [1, 0], [1e-5] * 3, [0, 0.5, 1])
    held = {name: np.repeat(values[:1], count, axis=0) for name, values in one.items()}
    held["photons.position"] = random.normal(0.0, 0.25, (count, 2)).astype("f4")
    held["photons.x"] = np.sort(random.integers(0, 65536, (count, 3)), axis=1).astype("u2")
    for name in ("axis_s", "axis_t", "dposition_dn"):
        held[f"photons.{name}"] = random.normal(0.0, 0.03, held[f"photons.{name}"].shape).astype("f2")
    return held


def light_by_place(gain: float, lines: list[list[float]] | None) -> tuple[np.ndarray, np.ndarray]:
    """x (n,) and energy (n, 3) of narrow parts of the spectrum."""
    nm = np.array([line[0] for line in lines]) if lines else np.linspace(380.0, 780.0, 801)[1::2]
    watts = np.array([line[1] for line in lines]) if lines else np.interp(nm, NM, EVEN)
    energy = watts[:, None] * np.stack([np.interp(nm, NM, OBSERVER[:, c]) for c in range(3)], axis=1)
    n = 1.52 + gain * (np.interp(nm, NM, glass()) - 1.52)
    return (n - N_AT_0) / (N_AT_1 - N_AT_0), energy


def photon_map(things: dict[str, np.ndarray], gain: float, lines: list[list[float]] | None) -> np.ndarray:
    """Irradiance (rows, columns, 3), averaged over texels as a Gaussian of their variance is."""
    x, energy = light_by_place(gain, lines)
    centres = (np.arange(TEXELS) + 0.5) * 2.0 / TEXELS - 1.0
    u, v = np.meshgrid(centres, centres)
    found = np.zeros((TEXELS, TEXELS, 3))
    given = {name.removeprefix("photons."): values.astype(float) for name, values in things.items()}
    given["x"] /= 65535.0
    for i, place in enumerate(given["position"]):
        sides = 0.45 * np.stack([given["axis_s"][i], given["axis_t"][i]], axis=1)
        inverse = np.linalg.inv(sides @ sides.T + np.eye(2) * (2.0 / TEXELS) ** 2 / 12.0)
        inside = (x >= given["x"][i, 0]) & (x < given["x"][i, 2])
        share = np.interp(x, given["x"][i], given["throughput"][i]) * inside
        for at, power in zip(x[inside], (energy * share[:, None])[inside], strict=True):
            du, dv = np.array([u, v]) - (
                place + given["dposition_dn"][i, 0] * (at - given["x"][i, 1]) * (N_AT_1 - N_AT_0)
            ).reshape(2, 1, 1)
            square = inverse[0, 0] * du * du + 2.0 * inverse[0, 1] * du * dv + inverse[1, 1] * dv * dv
            found += (np.exp(-0.5 * square) * np.sqrt(np.linalg.det(inverse)) / (2.0 * np.pi))[..., None] * power
    return found


def beam(half: tuple[float, float], moves: list[float], turns: float) -> dict[str, np.ndarray]:
    """A rectangle about (-0.3, -0.2) that moves and turns over all of the spectrum."""
    ends = []
    for place, angle in ((np.array([-0.3, -0.2]), 0.3), (np.array([-0.3, -0.2]) + moves, 0.3 + turns)):
        a, b = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
        ends.append([[*n, h - n @ place, 0.0] for n, h in ((a, half[0]), (-a, half[0]), (b, half[1]), (-b, half[1]))])
    low, high = np.minimum(0.0, moves) - 0.8, np.maximum(0.0, moves) + 0.2
    corners = [[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]]
    return {
        "beams.x": np.array([[0, 1]], "f4"), "beams.density": np.array([[1, 2, 2]], "f4"),
        "beams.slope": np.array([[0.5, -0.3]], "f4"), "beams.centre": np.zeros((1, 2), "f4"),
        "beams.light": np.zeros(1, "u1"), "beams.first": np.array([0, 4], "u4"), "beams.hull": np.array(corners, "f4"),
        "beams.edge": np.concatenate(ends, axis=1).astype("f4"), "beams.hull_first": np.array([0, 4], "u4"),
    }  # fmt: skip


def beam_map(things: dict[str, np.ndarray], parts: int) -> np.ndarray:
    """Irradiance (rows, columns, 3) by `parts`² places a texel."""
    x, energy = light_by_place(1.0, None)
    x, energy = x.reshape(-1, 4).mean(axis=1), energy.reshape(-1, 4, 3).sum(axis=1)
    centres = (np.arange(TEXELS * parts) + 0.5) * 2.0 / TEXELS / parts - 1.0
    u, v = np.meshgrid(centres, centres)
    tilt, found = 1.0 + 0.5 * u - 0.3 * v, np.zeros((TEXELS, TEXELS, 3))
    for at, power in zip(x, energy, strict=True):
        lines = [edge[:4] + at * (edge[4:] - edge[:4]) for edge in things["beams.edge"].astype(float)]
        lit = np.logical_and.reduce([a * u + b * v + c >= 0.0 for a, b, c, _ in lines]) * tilt
        density = 1.0 + at * (3.0 - 2.0 * at)
        found += lit.reshape(TEXELS, parts, TEXELS, parts).mean(axis=(1, 3))[..., None] * power * density
    return found
