"""Crystals where their two waves are almost one, or part as far as indices can."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...gpu.context import Context
from ...model.geometry.primitives import slab
from ...model.optics.glass import constant
from ...model.scene import Dielectric
from ...reference.crystals import FIELD_SHAPE, solve_interface, take_wave
from ...reference.optics import unit
from ...reference.polarised import begin_unpolarised
from ..case import EPSILON, Measured, Measurement, case, length
from ..rigs.gpu_paths import placed, screen, trace_beam, traced

_UP = (0.0, 0.0, 1.0)
_AIR = (1.0, 1.0, _UP, False)
_WAY = unit(np.array([0.45, 0.2, -1.0]))
_THICK, _BELOW = 0.5, 1.0
ROUNDINGS, _OF_POWER = 64.0, 2e-5


def _waves(crystal: tuple) -> list[tuple[float, np.ndarray]]:
    """Share of the light, and way along the slab from where it enters to the floor, of the ordinary and the
    extraordinary wave, float64."""
    found = []
    for wave in (2, 3):
        field = np.zeros(FIELD_SHAPE, complex)
        begin_unpolarised(field, tuple(_WAY))
        share = solve_interface(field, tuple(_WAY), _UP, _AIR, crystal)[wave]
        inside = np.array(take_wave(field, wave, crystal))
        passed = solve_interface(field, tuple(inside), _UP, crystal, _AIR)[2:]
        found.append((share * sum(passed), inside * (_THICK / -inside[2]) + _WAY * (_BELOW / -_WAY[2])))
    return found


def _through(
    context: Context,
    severity: float,
    label: str,
    axis: np.ndarray,
    n_o: float,
    n_e: float,
    of_power: float = _OF_POWER,
) -> Measurement:
    """A thin beam askew through a slab of crystal, by what goes straight through: places of both waves, and power.
    `of_power`: bound; more where both waves are one and how they are told apart is free."""
    axis = unit(axis)
    material = Dielectric(constant(n_o), extraordinary=constant(n_e), axis=tuple(axis.tolist()))
    block = placed("slab", slab(4.0, 4.0, _THICK), material)
    floor = screen(np.array([0.0, 0.0, -0.5 * _THICK - _BELOW]), np.array([0.0, 0.0, 1.0]), 20.0)
    found = trace_beam(context, [block], None, floor, -0.8 * _WAY, _WAY, 1e-3, 550.0, 64, 3)
    some = found.of_depth(2)
    entered = some.start + ((some.start[:, 2] - 0.5 * _THICK) / -_WAY[2])[:, None] * _WAY
    waves = _waves((n_o, n_e, tuple(axis.tolist()), True))
    off = np.array([length(some.position - entered - way) for _, way in waves])
    parted = length(waves[0][1] - waves[1][1])
    places = {int(i) for i in off.argmin(axis=0)} if parted > 1e-4 else {0, 1}
    power = float((some.records["flux_w"] / some.weight).sum() / found.lattice_in_disc)
    wanted = sum(share for share, _ in waves)
    return traced(
        severity,
        label,
        found,
        {
            "landing": (off.min(axis=0), ROUNDINGS * EPSILON * 4.0),
            "power": (abs(power / wanted - 1.0), of_power),
            "waves missing": (2.0 - len(places), 0.0),
        },
    )


@case("birefringence", "n_e − n_o", (1e-6, 1e-5, 1e-3, -0.17, 0.3, 1.0, -1.2))
def birefringence(context: Context, differences: Sequence[float]) -> Measured:
    """From indices that are next to equal to such as no mineral has

    Both waves' vectors are roots of one equation, whose difference is lost where they are close; polarisations must
    still be told apart, and no light may fall between them."""
    for difference in differences:
        n_o = 2.6 if difference < -1.0 else 1.6
        yield _through(context, difference, f"{difference:g}", np.array([0.4, 0.3, 0.8]), n_o, n_o + difference)


_N_O, _N_E = 1.6584, 1.4864
_AXES = (90.0, 30.0, 1.0, 0.1, 1e-3, 0.0, "in the surface", "along the normal")


@case("crystal-axis", "degrees from the ray to the axis", _AXES)
def crystal_axis(context: Context, axes: Sequence[float | str]) -> Measured:
    """The optic axis along the ray, in the surface, and across it

    Along the ray both waves are one and any two directions are theirs; beside it they turn with it."""
    tangential = _WAY[:2] / _N_O
    along = np.array([*tangential, -np.sqrt(1.0 - tangential @ tangential)])
    across = unit(np.cross(along, [0.3, -0.8, 0.2]))
    for number, given in enumerate(axes):
        if isinstance(given, str):
            axis = np.array([0.8, -0.6, 0.0]) if given == "in the surface" else np.array(_UP)
            yield _through(context, number, given, axis, _N_O, _N_E)
        else:
            angle = np.radians(given)
            axis = along * np.cos(angle) + across * np.sin(angle)
            yield _through(context, number, f"{given:g}°", axis, _N_O, _N_E, 1e-3 if given == 0.0 else _OF_POWER)
