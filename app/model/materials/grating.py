"""A diffraction grating: a thin sheet of parallel lines that sends light on in orders."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from ...base.errors import UserError
from ..fields import Animated, Direction, Flag, Number, Part, Row, read_fields, write_fields
from ..io.scene_table import SceneTable, Vec3
from ..optics import gratings
from ..optics.glass import Dispersion
from ..vectors import unit
from .material import Material

if TYPE_CHECKING:
    from ..geometry.mesh import Mesh

MAX_ORDER = 50
MIN_LINES, MAX_LINES = 1.0, 10_000.0
_SUM_SLACK = 1e-9
_MIN_SINE = 1e-3
"""Sine of the angle between lines and normal below which the lines have no direction in the surface."""

WAVELENGTH = Dispersion("wavelength", "formula 5", (0.0, 1.0, 1.0))
"""What a grating's deflection is a function of, as n is of a glass's: λ in micrometres. So a grating takes a spectral
column, a row of the index table and a share of the spectral coordinate as glasses do."""

_LINES = Number(
    "lines_per_mm",
    600.0,
    unit="1/mm",
    at_least=MIN_LINES,
    at_most=MAX_LINES,
    row=Row("Lines", "How many lines there are to the millimetre: the more, the wider colours part.", format="%.5g"),
    animated=Animated("Lines of a grating to the millimetre"),
)
_GROOVES = Number(
    "grooves",
    0.0,
    optional=True,
    at_least=0.0,
    at_most=1e7,
    row=Row(
        "Grooves lit",
        "How many lines the light covers, N: order m resolves wavelengths that differ by a part in m N. 0: so many "
        "that spectral lines have no width.",
        high=5000.0,
        format="%.0f",
        is_slider=True,
    ),
    animated=Animated("Lines of a grating that light covers", 1.0),
)
_REFLECTS = Flag("reflects", False, optional=True, row=Row("Reflects", "Orders are reflected instead of transmitted."))


PROFILES = (*gratings.SHARES, "slits")
_BLAZE = Number(
    "blaze_nm",
    550.0,
    unit="nm",
    at_least=-1e5,
    at_most=1e5,
    row=Row(
        "Blaze",
        "Wavelength that order 1 gets all of: where it goes back to where it came from, or of a sheet that transmits, "
        "where it comes upright. Order m has it at the m-th part.",
        1.0,
        format="%.4g",
    ),
    animated=Animated("Wavelength that a grating's facets send into order 1, nm"),
)
_DEPTH = Number(
    "depth_nm",
    250.0,
    unit="nm",
    at_least=0.0,
    at_most=2000.0,
    row=Row(
        "Depth",
        "Depth of the grooves: it decides how light is shared out among the orders at each wavelength.",
        format="%.0f",
        is_slider=True,
    ),
    animated=Animated("Depth of a grating's grooves, nm"),
)
_OPEN = Number(
    "open",
    0.5,
    above=0.0,
    at_most=1.0,
    row=Row("Open", "Share of the grating that its slits take.", 0.0, format="%.3g", is_slider=True),
)
_INDEX = Number("groove_index", 1.5, optional=True, at_least=1.01, at_most=5.0)
_KEYS_OF = {"blazed": (_BLAZE,), "lamellar": (_DEPTH,), "sinusoidal": (_DEPTH,), "slits": (_OPEN,)}


class _Profile(Part):
    """`profile` with the keys that go with it."""

    def read(self, table: SceneTable) -> dict[str, Any]:
        """The attributes; a facet's angle becomes its wavelength."""
        profile = table.choice("profile", PROFILES) if table.has("profile") else ""
        for others, numbers in _KEYS_OF.items():
            for number in numbers:
                if table.has(number.attribute) and number not in _KEYS_OF.get(profile, ()):
                    table.fail(number.attribute, f"goes with a profile only: give 'profile = \"{others}\"' as well")
        found = {"profile": profile} | read_fields(_KEYS_OF.get(profile, ()), table)
        if profile and profile != "slits":
            found |= _INDEX.read(table)
        if table.has("blaze_deg"):
            if profile != "blazed" or table.one_of(("blaze_nm", "blaze_deg"), "the blaze") is None:
                table.fail("blaze_deg", "goes with a profile only: give 'profile = \"blazed\"' as well")
            angle = math.radians(table.number("blaze_deg", above=-90.0, below=90.0))
            per_um = _LINES.value(table, "lines_per_mm") * 1e-3
            index = 0.0 if _REFLECTS.value(table, "reflects") else found["groove_index"]
            found["blaze_nm"] = gratings.blaze_um(angle, per_um, index) * 1e3
            if not math.isfinite(found["blaze_nm"]):
                table.fail("blaze_deg", "is so steep that facets reflect all light; make it less, or 'reflects = true'")
        return found

    def write(self, value: Any, path: Path | None) -> dict[str, Any]:
        """Those of its profile alone."""
        if not value.profile:
            return {}
        parts = _KEYS_OF[value.profile] + ((_INDEX,) if value.profile != "slits" else ())
        return {"profile": value.profile} | write_fields(parts, value, path)


class _Orders(Part):
    """`orders`, whole numbers, with `efficiency`: one number an order, or one that all have."""

    def read(self, table: SceneTable) -> dict[str, Any]:
        """Both, of one length."""
        given = table.numbers("orders", Grating.orders, at_least=0)
        if not given:
            table.fail("orders", "is empty; name at least one order, such as [-1, 0, 1]")
        for order in given:
            if order != int(order):
                table.fail("orders", f"holds {order:g}, but orders are whole numbers")
            if abs(order) > MAX_ORDER:
                table.fail("orders", f"holds {order:g}, but orders go from -{MAX_ORDER} to {MAX_ORDER}")
        orders = tuple(int(order) for order in given)
        twice = next((order for order in orders if orders.count(order) > 1), None)
        if twice is not None:
            table.fail("orders", f"names the order {twice} twice; give each once")
        if table.has("profile"):
            # Its shares add up to 1 or less whatever the orders.
            whole = table.number("efficiency", 1.0, at_least=0.0, at_most=1.0)
            return {"orders": orders, "efficiency": (whole,) * len(orders)}
        if table.has("efficiency") and isinstance(table.raw("efficiency"), list):
            efficiency = table.numbers("efficiency", count=len(orders))
        else:
            shared = min(Grating.efficiency[0], 1.0 / len(orders))
            efficiency = (table.number("efficiency", shared, at_least=0.0, at_most=1.0),) * len(orders)
        for share in efficiency:
            if not 0.0 <= share <= 1.0:
                table.fail("efficiency", f"holds {share:g}, but a share of the light lies between 0 and 1")
        if sum(efficiency) > 1.0 + _SUM_SLACK:
            table.fail("efficiency", f"adds up to {sum(efficiency):g}, but all orders together get at most 1")
        return {"orders": orders, "efficiency": efficiency}

    def write(self, value: Any, path: Path | None) -> dict[str, Any]:
        """Both as lists; with a profile all orders share one number."""
        efficiency = value.efficiency[0] if value.profile else list(value.efficiency)
        return {"orders": list(value.orders), "efficiency": efficiency}


def check_sheet(mesh: Mesh, along: Vec3, what: str, key: str, name: str, file_name: str) -> None:
    """Raise UserError where the mesh of the object `name` is no sheet for `what`, or the direction `along`, which
    `key` gives, is the normal of some face, so that nothing of it lies in the sheet."""
    if mesh.is_closed:
        raise UserError(
            f"{file_name}: object '{name}' is a closed solid and a {what} a thin sheet; give it an open shape such as "
            "'plane' or 'disc', before the solid if need be"
        )
    normals = mesh.face_normals()
    normals = normals[normals.any(axis=1)]
    if np.any(np.linalg.norm(np.cross(normals, np.asarray(along, float)), axis=1) < _MIN_SINE):
        raise UserError(
            f"{file_name}: the {key} of {what} '{name}' runs along the normal of its surface; choose one that lies in "
            "the surface"
        )


@dataclass(frozen=True)
class Grating(Material):
    """Parallel lines on a thin sheet, with the same medium on both sides."""

    lines_per_mm: float = 600.0
    orders: tuple[int, ...] = (-1, 0, 1)
    efficiency: tuple[float, ...] = (0.3, 0.3, 0.3)
    """Share of the light that each order gets, or with a profile that all would have together, were they all there; the
    rest is absorbed, and so is that of an order that cannot leave."""
    reflects: bool = False
    direction: Vec3 = (0.0, 1.0, 0.0)
    """Along the lines, in the object's own coordinates; what of it lies in the surface counts."""
    profile: str = ""
    """One of `PROFILES`, whose shares depend on wavelength and angle; "": `efficiency` has each order's."""
    blaze_nm: float = 550.0
    """Wavelength that facets send whole into order 1 (`gratings.facet_angle`); below 0: into order -1."""
    depth_nm: float = 250.0
    open: float = 0.5
    groove_index: float = 1.5
    """Refractive index of what the grooves are ruled in, where it transmits."""
    grooves: float = 0.0
    """How many of the lines light covers, which gives each order the width of light behind a slit as wide as they are
    together; 0: none."""

    kind: ClassVar = "grating"
    title: ClassVar = "Grating"
    gpu_code: ClassVar = 4
    parts: ClassVar[tuple[Part, ...]] = (
        _LINES,
        _Orders(),
        _REFLECTS,
        Direction("direction", (0.0, 1.0, 0.0)),
        _GROOVES,
        _Profile(),
    )
    is_specular: ClassVar = True
    is_grating: ClassVar = True
    why_no_beams: ClassVar = "a grating sends light into several orders"
    dispersion = WAVELENGTH

    @property
    def shift_per_um(self) -> np.ndarray:
        """float64 (orders,): what each adds to the tangential part of a unit direction, per micrometre of wavelength in
        the medium."""
        return np.array(self.orders, float) * self.lines_per_mm * 1e-3

    @property
    def profile_code(self) -> int:
        """0 where shares do not depend on wavelength and angle."""
        return 1 + list(gratings.SHARES).index(self.profile) if self.profile in gratings.SHARES else 0

    @property
    def relief(self) -> float:
        """As of `gratings.waves_of`. Raises UserError where no facet has this blaze."""
        if self.profile != "blazed":
            return self.depth_nm * 1e-3
        angle = gratings.facet_angle(self.blaze_nm * 1e-3, self.lines_per_mm * 1e-3, self.relief_index)
        if math.isfinite(angle):
            return angle
        raise UserError(
            f"no facet sends {self.blaze_nm:g} nm into order 1 of a grating whose lines are "
            f"{1e6 / self.lines_per_mm:.4g} nm apart; choose a smaller 'blaze_nm' or fewer lines"
        )

    @property
    def spread_per_um(self) -> float:
        """One over the width that light covers."""
        return self.lines_per_mm * 1e-3 / self.grooves if self.grooves else 0.0

    @property
    def relief_index(self) -> float:
        """Index of what the grooves are in; 0: it reflects."""
        return 0.0 if self.reflects else self.groove_index

    @property
    def fixed_shares(self) -> np.ndarray:
        """float64 (orders,): the part of each order's share that does not depend on wavelength and angle."""
        shares = np.array(self.efficiency, float)
        return (
            shares * (self.open * np.sinc(np.array(self.orders) * self.open)) ** 2
            if self.profile == "slits"
            else shares
        )

    def shares(self, wavelength_nm: np.ndarray, light: np.ndarray, n: float = 1.0) -> np.ndarray:
        """float64 (orders, ...): share of each order of light of these wavelengths (...), in a medium of index n;
        `light` (..., 3): unit direction it comes in, across the lines, along them and along the outward normal."""
        um = 1e-3 * np.asarray(wavelength_nm, float)
        fixed = self.fixed_shares.reshape(-1, *(1,) * um.ndim)
        if not self.profile_code:
            return fixed * np.ones_like(um)
        per_um = self.lines_per_mm * 1e-3
        waves = gratings.waves_of(self.profile, self.relief, per_um, self.relief_index, light, n, um)
        orders = np.array(self.orders).reshape(fixed.shape)
        return fixed * gratings.SHARES[self.profile](orders, waves)

    @property
    def left(self) -> np.ndarray:
        """float64 (orders,): share of the light that those before each order have left, where shares are fixed."""
        return 1.0 - np.concatenate([[0.0], np.cumsum(self.fixed_shares)[:-1]])

    def lines_in_world(self, object_to_world: np.ndarray) -> np.ndarray:
        """Unit vector (3,) along the lines, of an object placed so."""
        return unit(np.asarray(object_to_world)[:3, :3] @ np.asarray(self.direction, float))

    def words(self) -> str:
        """Its lines, and where light goes."""
        way = f"{'reflection' if self.reflects else 'transmission'} grating, {self.lines_per_mm:g} lines/mm"
        return way + {"": "", "blazed": f", blazed for {self.blaze_nm:g} nm"}.get(self.profile, f", {self.profile}")

    def shown_numbers(self) -> tuple[Number, ...]:
        """With those of its profile."""
        return super().shown_numbers() + _KEYS_OF.get(self.profile, ())

    def content(self) -> tuple[object, ...]:
        """All its numbers."""
        own = (self.profile, self.blaze_nm, self.depth_nm, self.open, self.groove_index) if self.profile else ()
        return (self.lines_per_mm, *self.orders, *self.efficiency, self.reflects, *self.direction, self.grooves, *own)

    def is_like(self, other: Material) -> bool:
        """Numbers may differ, not how many there are."""
        if not isinstance(other, Grating):
            return False
        kinds = [(type(one), len(one.orders), one.profile_code, one.grooves > 0.0) for one in (self, other)]
        return kinds[0] == kinds[1]

    def check_on(self, mesh: Mesh, name: str, file_name: str) -> None:
        """Thin sheets only, whose lines lie in them."""
        check_sheet(mesh, self.direction, "grating", "direction", name, file_name)
        try:
            _ = self.relief
        except UserError as error:
            raise UserError(f"{file_name}: object '{name}': {error}") from error
