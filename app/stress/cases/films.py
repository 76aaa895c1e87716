"""Thin films from far below a wavelength to a tenth of a millimetre: the stack in float64 by both of its ways, and what
the camera sees of it against that."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ...gpu.context import Context
from ...model.geometry.primitives import box, plane
from ...model.materials.coating import Coating
from ...model.optics.colorimetry import VISIBLE_NM
from ...model.optics.glass import constant
from ...model.optics.metals import metals
from ...model.optics.thin_films import AIR, Film, Layer, Stack
from ...model.scene import Black, Camera, Dielectric, Scene, SceneObject
from ...reference.camera_reference import render_camera_reference
from ...reference.photon_scene import TABLE_NM
from ...reference.thin_films import film_amplitudes, films_of
from ..case import Held, Measured, case, measured
from ..rigs.camera_probe import PROBE, daylight_mean, render_probe, resized
from ..rigs.scene_parts import at, turn

GLASS = constant(1.5)
_SILVER = metals()["silver"]


def _clear(*layers: tuple[float, float]) -> Film:
    return Film(tuple(Layer(constant(n), nm) for n, nm in layers))


STACKS = {
    "1 nm": _clear((2.3, 1.0)),
    "0.4 µm": _clear((1.33, 400.0)),
    "100 µm": _clear((2.3, 1e5)),
    "1,000 layers": _clear(*((1.46, 93.0), (2.3, 61.0)) * 500),
    "index of the glass": _clear((1.5, 300.0)),
    "index of air": _clear((1.0, 300.0)),
    "silver, 20 nm": Film((Layer(_SILVER, 20.0),)),
    "silver, 0.1 mm": Film((Layer(constant(1.4), 80.0), Layer(_SILVER, 1e5))),
    "etalon of silver": Film((Layer(_SILVER, 25.0), Layer(constant(1.5), 2000.0), Layer(_SILVER, 25.0))),
}
_ANGLES = (0.0, 45.0, 80.0, 89.9)


def _shares(stack: Stack, sine: float, nm: np.ndarray, from_back: bool) -> tuple[np.ndarray, np.ndarray]:
    found = stack.amplitudes(np.array(sine), nm, from_back)
    return 0.5 * (abs(found.r_s) ** 2 + abs(found.r_p) ** 2), 0.5 * (abs(found.t_s) ** 2 + abs(found.t_p) ** 2)


@case("film-stacks", "film", tuple(STACKS))
def film_stacks(_: Context, names: Sequence[str]) -> Measured:
    """Thin films in float64, at any angle and from both sides

    Matrices and Airy's sum are two ways to the same amplitudes. What is clear loses nothing, also beyond total
    reflection; what absorbs gains nothing."""
    nm = np.linspace(380.0, 780.0, 23)
    for number, name in enumerate(names):
        film = STACKS[name]
        stack, tables = Stack(AIR, film, GLASS), films_of(_sheet(film, 0.0), TABLE_NM)
        off = differ = gained = 0.0
        for from_back, n in ((False, 1.0), (True, 1.5)):
            for degrees in _ANGLES:
                sine = n * float(np.sin(np.radians(degrees)))
                reflected, passed = _shares(stack, sine, nm, from_back)
                passed = passed if sine <= 1.0 else 0.0 * passed
                off = max(off, 0.0 if film.absorbs else np.abs(reflected + passed - 1.0).max())
                gained = max(gained, (reflected + passed).max() - 1.0)
                ways = stack.amplitudes(np.array(sine), nm, from_back)
                other = [film_amplitudes(tables, 0, 1.0, 1.5, sine, from_back, x, -1.0) for x in nm]
                differ = max(differ, np.abs(np.array(ways) - np.array(other).T).max())
        held: Held = {"energy": (off, 1e-9), "gained": (gained, 1e-9), "two ways": (differ, 1e-7)}
        yield measured(number, name, held)


def _sheet(film: Film, degrees: float) -> Scene:
    """A coated sheet above a black one, seen from above in a white room: what it reflects."""
    camera = Camera((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), "orthographic", vertical_extent=0.002)
    coated = Dielectric(GLASS, thin=True, coating=Coating(film))
    tilt = turn((1.0, 0.0, 0.0), degrees)
    sheet = SceneObject("sheet", plane(2.0, 2.0), coated, at(turned=tilt))
    below = at(turned=tilt)
    below[:3, 3] = -1e-3 * tilt[:, 2]
    black = SceneObject("black", plane(2.0, 2.0), Black(), below)
    return Scene("film", camera, (), (sheet, black), background_rgb=(1.0, 1.0, 1.0))


@case("film-seen", "film", tuple(STACKS))
def film_seen(context: Context, names: Sequence[str]) -> Measured:
    """What a coated sheet reflects, to grazing

    Tables hold 129 cosines and 1,025 wavelengths; between them reflectance is straight. A camera's ray knows the mean
    over each of 24 parts of the spectrum, and takes it to be straight too."""
    for number, name in enumerate(names):
        held: dict[str, tuple[float, float]] = {}
        for degrees in _ANGLES[:3]:
            nm = (VISIBLE_NM[:, None] + (np.arange(64) + 0.5) / 64.0 - 0.5).ravel()
            reflected, _ = _shares(Stack(AIR, STACKS[name], GLASS), float(np.sin(np.radians(degrees))), nm, False)
            expected = daylight_mean(reflected.reshape(-1, 64).mean(axis=1))
            seen = render_probe(context, _sheet(STACKS[name], degrees), PROBE).mean
            # Measured: 2e-4 at most; dips as narrow as the camera's 24 parts of the spectrum, 0.044; of 1,000 layers,
            # whose ripples are finer than the table's wavelengths, 0.013.
            bound = {"etalon of silver": 0.06, "1,000 layers": 0.02}.get(name, 2e-3)
            held[f"reflected at {degrees:g}°"] = float(np.abs(seen - expected).max()), bound
        yield measured(number, name, held)


@case("film-frustrated", "gap of air (nm)", (1000.0, 300.0, 100.0, 30.0, 1.0))
def film_frustrated(context: Context, gaps: Sequence[float]) -> Measured:
    """Total reflection at 45° within a cube of glass, frustrated by glass behind a gap

    What gets through goes on to a white room, what is reflected ends on black. The reference's choices by chance, of
    262,144 paths, are 0.001 off, the tables' cosines no more."""
    for gap, scene in _frustrated(gaps):
        seen = render_probe(context, scene, resized(PROBE, 8, 8, 64)).mean
        expected = render_camera_reference(scene, 8, 8, samples=4096).rgb.mean(axis=(0, 1))
        yield measured(gap, f"{gap:g} nm", {"seen": (float(np.abs(seen - expected).max()), 4e-3)})


def _frustrated(gaps: Sequence[float]) -> Iterator[tuple[float, Scene]]:
    camera = Camera((-4.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), "orthographic", vertical_extent=0.2)
    cube = SceneObject("cube", box((1.0, 1.0, 1.0)), Dielectric(GLASS))
    black = SceneObject("black", plane(3.0, 3.0), Black(), at(0.0, 0.0, 1.0))
    for gap in gaps:
        air = Dielectric(constant(1.0), thin=True, film_nm=gap)
        film = SceneObject("gap", plane(0.9, 0.9), air, at(turned=turn((0.0, 1.0, 0.0), 45.0)))
        yield gap, Scene("gap", camera, (), (cube, film, black), background_rgb=(1.0, 1.0, 1.0))
