"""A lens as a row of surfaces on one axis: focal lengths by paraxial formulas, spots by exact rays, by wavelength.

Light is parallel to the axis and comes from the first surface. Signs as of optics: a radius is positive when its centre
lies behind the surface (Born and Wolf, Principles of Optics, §4.4).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...base.errors import UserError
from .glass import LINE_C_NM, LINE_D_NM, LINE_F_NM, Dispersion

LINES_NM = (435.8343, LINE_F_NM, 546.0740, LINE_D_NM, LINE_C_NM)
"""Fraunhofer g, F, e, d and C."""
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(48)
_SLACK = 1e-9


@dataclass(frozen=True)
class Surface:
    """One of its surfaces."""

    radius: float
    """Signed; infinite of a plane."""
    thickness: float
    """To the next vertex, behind it."""
    glass: Dispersion | None
    """What is behind it; None: air."""
    semi_diameter: float
    conic: float = 0.0

    @property
    def curvature(self) -> float:
        """1/radius."""
        return 0.0 if math.isinf(self.radius) else 1.0 / self.radius

    def sag(self, r: np.ndarray) -> np.ndarray:
        """How far it has bent away from its vertex's plane at distances `r` from the axis; NaN beyond its reach."""
        root = 1.0 - (1.0 + self.conic) * (self.curvature * r) ** 2
        return self.curvature * r * r / (1.0 + np.sqrt(np.where(root < 0.0, np.nan, root)))


@dataclass(frozen=True)
class Lens:
    """Surfaces in the order in which light meets them: the first and the last are of glass."""

    name: str
    surfaces: tuple[Surface, ...]
    beam_radius: float | None = None
    """Radius of the light that enters; None: as much as passes all surfaces."""
    wavelengths_nm: tuple[float, ...] = LINES_NM
    reference_nm: float = LINE_D_NM
    """Whose back focus the screen stands at."""
    units: str = ""
    is_round: bool = True
    """False: stretched across the axis; all figures are of the section in which it is curved most."""
    notes: tuple[str, ...] = ()
    """What was assumed, one sentence each."""

    def indices(self, nm: np.ndarray) -> np.ndarray:
        """Refractive index before the first surface and behind each, float64 (surfaces + 1, n)."""
        behind = [np.ones(len(nm)) if s.glass is None else s.glass.index(nm) for s in self.surfaces]
        return np.stack([np.ones(len(nm)), *behind])


@dataclass(frozen=True)
class LensRow:
    """One wavelength; lengths in the lens's unit."""

    wavelength_nm: float
    focal_length: float
    back_focus: float
    """From the last vertex; both infinite where light stays parallel."""
    shift: float
    """How far behind the back focus of the reference wavelength its own is."""
    spot: float
    """Root mean square distance from the axis of rays on a screen at the back focus of the reference wavelength."""
    best_shift: float
    """How far behind that screen the spot is smallest."""
    best_spot: float

    def texts(self) -> tuple[str, ...]:
        """As `HEADINGS` has them; a dash where there is no such number."""
        values = (self.focal_length, self.back_focus, self.shift, self.spot, self.best_shift, self.best_spot)
        forms = ("{:.5f}", "{:.5f}", "{:+.5f}", "{:.5f}", "{:+.5f}", "{:.5f}")
        shown = (
            form.format(round(v, 5) + 0.0) if math.isfinite(v) else "–" for form, v in zip(forms, values, strict=True)
        )
        return (f"{self.wavelength_nm:.2f}", *shown)


HEADINGS = {
    "nm": "Wavelength.",
    "Focal length": "By paraxial formulas.",
    "Back focus": "From the last vertex to the paraxial focus.",
    "Shift": "Of the back focus against that of the reference wavelength.",
    "Spot": "Root mean square radius of real rays on a screen at the back focus of the reference wavelength.",
    "Best focus": "How far behind that screen the spot is smallest.",
    "Spot there": "Root mean square radius at the best focus.",
}
"""Columns of a table, and what they are."""


@dataclass(frozen=True)
class LensTable:
    """What a lens does with light parallel to its axis."""

    lens: Lens
    beam_radius: float
    focal_length: float
    back_focus: float
    """Both at the lens's reference wavelength."""
    rows: tuple[LensRow, ...]

    @property
    def f_number(self) -> float:
        """Focal length over the diameter of the beam."""
        return abs(self.focal_length) / (2.0 * self.beam_radius)

    def summary(self) -> str:
        """In a line."""
        unit = f" {self.lens.units}" if self.lens.units else ""
        section = "" if self.lens.is_round else "; of the section in which it is curved most"
        if math.isinf(self.back_focus):
            return f"Afocal, for a beam of {2.0 * self.beam_radius:.5g}{unit}{section}"
        return (
            f"f = {self.focal_length:.6g}{unit} at {self.lens.reference_nm:.2f} nm, f/{self.f_number:.3g} for a beam "
            f"of {2.0 * self.beam_radius:.5g}{unit}{section}"
        )


@np.errstate(all="ignore")
def paraxial(lens: Lens, wavelengths_nm: Sequence[float] | np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Focal lengths and back focal lengths, float64 (n,): refraction nu' = nu − y(n' − n)/R, transfer y' = y + tu."""
    n = lens.indices(np.asarray(wavelengths_nm, np.float64))
    y, slope, last = np.ones(n.shape[1]), np.zeros(n.shape[1]), len(lens.surfaces) - 1
    for i, surface in enumerate(lens.surfaces):
        slope = slope - y * (n[i + 1] - n[i]) * surface.curvature
        if i < last:
            y = y + surface.thickness * slope / n[i + 1]
    return -1.0 / slope, -y / slope


@np.errstate(all="ignore")
def traced(
    lens: Lens, heights: np.ndarray, wavelengths_nm: Sequence[float] | np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Where rays that enter at `heights` (r,) cross the plane of the last vertex, and dy/dz there, float64 (r, n).

    Exact, by Snell's law on conics. NaN where a ray misses a surface, is stopped at a rim or totally reflected.
    """
    n = lens.indices(np.asarray(wavelengths_nm, np.float64))
    y = np.repeat(np.asarray(heights, np.float64)[:, None], n.shape[1], axis=1)
    z, across, along = np.zeros_like(y), np.zeros_like(y), np.ones_like(y)
    last = len(lens.surfaces) - 1
    for i, surface in enumerate(lens.surfaces):
        c, q, eta = surface.curvature, 1.0 + surface.conic, n[i] / n[i + 1]
        # c (y² + q z²) − 2 z = 0, of the two places the one on the vertex's side.
        a = c * (across**2 + q * along**2)
        b = along - c * (y * across + q * z * along)
        constant = c * (y**2 + q * z**2) - 2.0 * z
        t = constant / (b + _root(b**2 - a * constant))
        y, z = y + t * across, z + t * along
        y = np.where(np.abs(y) > surface.semi_diameter * (1.0 + _SLACK), np.nan, y)
        length = np.hypot(c * y, 1.0 - c * q * z)
        normal_y, normal_z = -c * y / length, (1.0 - c * q * z) / length
        cosine = across * normal_y + along * normal_z
        bend = _root(1.0 - eta**2 * (1.0 - cosine**2)) - eta * cosine
        across, along = eta * across + bend * normal_y, eta * along + bend * normal_z
        if i < last:
            z = z - surface.thickness
    slope = across / along
    return y - z * slope, slope


def _root(square: np.ndarray) -> np.ndarray:
    return np.sqrt(np.where(square < 0.0, np.nan, square))


def widest_beam(lens: Lens) -> float:
    """Radius up to which rays of the reference wavelength pass all surfaces. Raises `UserError` where none does."""
    low, high = 0.0, lens.surfaces[0].semi_diameter
    for _ in range(5):
        heights = np.linspace(low, high, 65)[1:]
        fails = np.isnan(traced(lens, heights, (lens.reference_nm,))[0][:, 0])
        if not fails.any():
            return high
        first = int(fails.argmax())
        low, high = (low if first == 0 else float(heights[first - 1])), float(heights[first])
    if low == 0.0:
        raise UserError(f"{lens.name}: no light passes its surfaces; check radii, thicknesses and semi-diameters")
    return low


@np.errstate(all="ignore")
def lens_table(
    lens: Lens, wavelengths_nm: Sequence[float] | None = None, beam_radius: float | None = None
) -> LensTable:
    """Focal lengths, chromatic shift and spots at `wavelengths_nm`, for a beam of `beam_radius`; None: the lens's own.

    Raises `UserError` for a beam that does not pass.
    """
    nm = np.asarray(lens.wavelengths_nm if wavelengths_nm is None else wavelengths_nm, np.float64)
    widest = widest_beam(lens)
    beam = beam_radius or lens.beam_radius or widest
    if beam > widest * (1.0 + 1e-6):
        if beam_radius is not None:
            raise UserError(
                f"{lens.name}: a beam of diameter {2.0 * beam:g} does not pass its surfaces; {2.0 * widest:.6g} does"
            )
        beam = widest
    (focal,), (back,) = paraxial(lens, (lens.reference_nm,))
    focal_lengths, back_foci = paraxial(lens, nm)
    shares = 0.5 * (_NODES + 1.0)  # of the area of the beam, or of its width
    y, slope = traced(lens, beam * (np.sqrt(shares) if lens.is_round else shares), nm)
    weights = np.where(np.isnan(y), 0.0, _WEIGHTS[:, None])
    weights /= weights.sum(axis=0)
    y, slope = np.nan_to_num(y), np.nan_to_num(slope)
    if math.isinf(back):
        spot = best = least = np.full(len(nm), math.nan)
    else:
        screen = y + slope * back
        spot = np.sqrt((weights * screen**2).sum(axis=0))
        best = -(weights * screen * slope).sum(axis=0) / (weights * slope**2).sum(axis=0)
        least = np.sqrt((weights * (screen + slope * best) ** 2).sum(axis=0))
    columns = np.stack([nm, focal_lengths, back_foci, back_foci - back, spot, best, least])
    return LensTable(lens, beam, float(focal), float(back), tuple(LensRow(*row) for row in columns.T.tolist()))
