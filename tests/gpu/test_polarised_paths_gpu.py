"""Whole paths of polarised light, GPU against float64: Stokes parameters here, electric fields there.

Planes of incidence turn against each other from surface to surface, total reflection gives light that is elliptic, and
mirrors turn that over; every photon's throughput at three wavelengths is held against exact paths.
"""

from __future__ import annotations

from pathlib import Path

import pytest
from spectrasplat.model.geometry.primitives_gem import brilliant
from spectrasplat.model.scene import Mirror, SceneObject
from spectrasplat.stress.rigs.gpu_paths import glass, placed

from tests.gpu.mutants import mutate
from tests.gpu.test_whole_paths_gpu import Case, ball, touching, weights_agree


def stone() -> tuple[SceneObject, ...]:
    """A brilliant of diamond in a light from aside: facets at every angle, many total reflections."""
    return (placed("stone", brilliant(), glass("diamond")),)


CASES = {
    "stone": Case(stone, depth=5, refractions=2, tinted=False, lattice=120, polarisation=True, compared=60),
    "touching glass": Case(touching, refractions=3, lattice=200, polarisation=True),
    "curved, with a mirror": Case(
        lambda: (ball(glass("N-SF11"), (0.0, 0.6, 0.0), 0.8), ball(Mirror((0.9, 0.9, 0.9)), (0.3, -0.9, 0.1), 0.6)),
        depth=4,
        tinted=False,
        lattice=120,
        polarisation=True,
        compared=60,
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_throughput_of_whole_paths(gl, name: str) -> None:
    weights_agree(gl, CASES[name])


LIBRARY, FLIGHT = "lib/polarisation.glsl", "light/trace_polarisation.glsl"
MUTANTS = {
    "planes do not turn": (LIBRARY, "state.q = cosine * q + sine * state.u;", "state.q = q;", "stone"),
    "no retardance": (LIBRARY, "mix(2.0 * x * y * per, vec3(0.0), passes)", "vec3(0.0)", "stone"),
    "circular light keeps its sense": (
        LIBRARY,
        "vec3(-1.0), vec3(0.0));",
        "vec3(1.0), vec3(0.0));",
        "curved, with a mirror",
    ),
    "unpolarised again": (FLIGHT, "ray.stokes_q = state.q;", "ray.stokes_q = vec3(0.0);", "touching glass"),
}
QUICK = ("planes do not turn",)


@pytest.mark.parametrize(
    "name", [*QUICK, *(pytest.param(name, marks=pytest.mark.slow) for name in MUTANTS if name not in QUICK)]
)
def test_mutants_are_caught(gl, name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file, old, new, case = MUTANTS[name]
    mutate(monkeypatch, tmp_path, file, old, new)
    with pytest.raises(AssertionError, match="^throughput|^flux"):
        weights_agree(gl, CASES[case])
