"""A diffraction grating: a thin sheet of parallel lines that sends light on in orders."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from ...base.errors import UserError
from ..fields import Animated, Direction, Flag, Number, Part, Row
from ..io.scene_table import SceneTable, Vec3
from ..optics.glass import Dispersion
from .material import Material

if TYPE_CHECKING:
    from ..geometry.mesh import Mesh

MAX_ORDER = 50
MIN_LINES, MAX_LINES = 1.0, 10_000.0
_SUM_SLACK = 1e-9
MIN_SINE = 1e-3
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
    row=Row(
        "Lines",
        "How many lines there are to the millimetre: the more, the wider colours part.",
        MIN_LINES,
        MAX_LINES,
        600.0,
        "%.5g",
    ),
    animated=Animated("Lines of a grating to the millimetre", MIN_LINES, MAX_LINES),
)
_REFLECTS = Flag("reflects", False, optional=True, row=Row("Reflects", "Orders are reflected instead of transmitted."))


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
        """Both as lists."""
        return {"orders": list(value.orders), "efficiency": list(value.efficiency)}


@dataclass(frozen=True)
class Grating(Material):
    """Parallel lines on a thin sheet, with the same medium on both sides."""

    lines_per_mm: float = 600.0
    orders: tuple[int, ...] = (-1, 0, 1)
    efficiency: tuple[float, ...] = (0.3, 0.3, 0.3)
    """Share of the light that each order gets; the rest is absorbed, and so is that of an order that cannot leave."""
    reflects: bool = False
    direction: Vec3 = (0.0, 1.0, 0.0)
    """Along the lines, in the object's own coordinates; what of it lies in the surface counts."""

    kind: ClassVar = "grating"
    title: ClassVar = "Grating"
    gpu_code: ClassVar = 4
    parts: ClassVar = (_LINES, _Orders(), _REFLECTS, Direction("direction", (0.0, 1.0, 0.0)))
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
    def left(self) -> np.ndarray:
        """float64 (orders,): share of the light that those before each order have left."""
        return 1.0 - np.concatenate([[0.0], np.cumsum(self.efficiency)[:-1]])

    def lines_in_world(self, object_to_world: np.ndarray) -> np.ndarray:
        """Unit vector (3,) along the lines, of an object placed so."""
        along = np.asarray(object_to_world)[:3, :3] @ np.asarray(self.direction, float)
        return along / np.linalg.norm(along)

    def words(self) -> str:
        """Its lines, and where light goes."""
        return f"{'reflection' if self.reflects else 'transmission'} grating, {self.lines_per_mm:g} lines/mm"

    def content(self) -> tuple[object, ...]:
        """All its numbers."""
        return (self.lines_per_mm, *self.orders, *self.efficiency, self.reflects, *self.direction)

    def is_like(self, other: Material) -> bool:
        """Numbers may differ, not how many there are."""
        return isinstance(other, Grating) and len(self.orders) == len(other.orders)

    def check_on(self, mesh: Mesh, name: str, file_name: str) -> None:
        """Thin sheets only, whose lines lie in them."""
        if mesh.is_closed:
            raise UserError(
                f"{file_name}: object '{name}' is a closed solid and a grating a thin sheet; "
                "give it an open shape such as 'plane' or 'disc', before the solid if need be"
            )
        normals = mesh.face_normals()
        normals = normals[normals.any(axis=1)]
        sines = np.linalg.norm(np.cross(normals, np.asarray(self.direction, float)), axis=1)
        if np.any(sines < MIN_SINE):
            raise UserError(
                f"{file_name}: the lines of grating '{name}' run along the normal of its surface; "
                "choose a 'direction' that lies in the surface"
            )
