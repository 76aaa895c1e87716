"""What a cut stone looks like from above, in figures: light return, fire, scintillation, tilt; ASET and ideal-scope.

A stone lies in the air, its table up, and is seen from far above. Light is followed from the eye, which is the same as
towards it: a place is as bright as what its paths end on. Definitions with their sources are in docs/gems.md.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...base.errors import UserError
from ..geometry.bvh import build_bvh
from ..geometry.mesh import Mesh
from ..optics.glass import LINE_C_NM, LINE_D_NM, LINE_F_NM, Dispersion

ASET_HEAD_DEG = 15.0
"""Blue of ASET: within this angle from the viewer, who hides that light; red up to 45°, green to the girdle's plane."""
PUPIL_RAD = 0.01
"""An eye's pupil of 3 mm seen from 300 mm: of light spread wider it takes in one colour at a time."""
_NUDGE_DEG = 3.0
"""Turn of the hand that holds the stone, for scintillation."""
_WINDOW, _DARK = 0.5, 0.25
"""Shares of a place's light: more comes from behind, less from before and beside the head."""
LEAST = 1e-4
"""Shares of a ray's light that are not followed."""
_PIECE = 4096
_DIRECTIONS = 97
"""For the weighted return."""
UP = np.array([0.0, 0.0, 1.0])
Report = Callable[[float, str], object]
Cancelled = Callable[[], bool]


@dataclass(frozen=True)
class Stone:
    """A closed solid with flat facets, its table facing +z; scaled so that its box's half diagonal is 1."""

    mesh: Mesh
    """The same about the same middle."""
    corners: np.ndarray
    """float64 (T, 3, 3), in the order of its tree's leaves."""
    normals: np.ndarray
    """float64 (T, 3), outward."""
    bounds: np.ndarray
    """float64 (N, 6), boxes of the tree."""
    links: np.ndarray
    """int64 (N, 2), first child or triangle, and how many triangles."""
    glass: Dispersion
    notes: tuple[str, ...] = ()
    """What was assumed or left out, in sentences."""

    @property
    def name(self) -> str:
        """What its mesh is called."""
        return self.mesh.name

    @cached_property
    def dn(self) -> float:
        """n_F − n_C."""
        return float(self.glass.index(LINE_F_NM) - self.glass.index(LINE_C_NM))

    @cached_property
    def radius(self) -> float:
        """Radius of the circle round it, as seen from above."""
        return float(np.linalg.norm(self.corners[..., :2], axis=-1).max())


def stone_of(mesh: Mesh, glass: Dispersion, notes: tuple[str, ...] = ()) -> Stone:
    """`mesh`, its table facing +z, as a stone. Raises `UserError` where it is no closed solid or its glass no glass."""
    if not mesh.is_closed:
        raise UserError(f"'{mesh.name}' is not closed: close its holes, so that it has an inside, to take its figures")
    volume = mesh.volume()
    if volume == 0.0:
        raise UserError(f"'{mesh.name}' has no inside; give a solid stone")
    index = float(glass.index(LINE_D_NM))
    if index <= 1.0:
        raise UserError(f"'{mesh.name}' has an index of {index:g}: a stone in air needs more than 1")
    if glass.index(LINE_F_NM) == glass.index(LINE_C_NM):
        notes += ("An index alone has no dispersion, so there is no fire",)
    mesh = mesh if volume > 0.0 else mesh.flipped()
    low, high = mesh.bounds()
    scale = np.eye(4) / (0.5 * float(np.linalg.norm(high - low)))
    scale[:3, 3], scale[3, 3] = -scale[0, 0] * 0.5 * (low + high), 1.0
    mesh = mesh.transformed(scale)
    vectors = mesh.area_vectors()
    areas = np.linalg.norm(vectors, axis=1)
    kept = areas > 1e-14
    corners, areas, normals = mesh.corners()[kept], areas[kept], vectors[kept] / areas[kept, None]
    tree = build_bvh(corners.astype(np.float32), use_cache=len(corners) > _PIECE)
    nodes = tree.nodes
    bounds = np.hstack([nodes["bounds_min"], nodes["bounds_max"]]).astype(np.float64)
    links = np.stack([nodes["left_or_first"], nodes["count"]], axis=1).astype(np.int64)
    if not mesh.is_faceted:
        notes += (f"{mesh.name} is smooth in its picture; the figures are of its {len(corners):,} flat facets",)
    table = areas[(normals[:, 2] > 1.0 - 1e-6)].sum()
    largest = int(areas.argmax())
    if table < areas[normals @ normals[largest] > 1.0 - 1e-6].sum() * (1.0 - 1e-6):
        x, y, z = normals[largest] + 0.0
        notes += (f"{mesh.name}: its largest facet faces ({x:.2f}, {y:.2f}, {z:.2f}), not up (+z)",)
    return Stone(mesh, corners[tree.order], normals[tree.order], bounds, links, glass, notes)


# ---- rays -------------------------------------------------------------------------------------


def tilted(tilt_x_deg: float, tilt_y_deg: float = 0.0) -> np.ndarray:
    """Where the viewer is for a stone tilted about its x axis, then y."""
    a, b = math.radians(tilt_x_deg), math.radians(tilt_y_deg)
    return np.array([-math.sin(b) * math.cos(a), math.sin(a), math.cos(a) * math.cos(b)])


def face_places(stone: Stone, count: int) -> np.ndarray:
    """Places in the plane of the girdle, float64 (count², 3), rows from +y down, over the square round the stone."""
    return 1.02 * stone.radius * seen_places(count, UP)


def seen_places(count: int, up: np.ndarray) -> np.ndarray:
    """Places over all of a stone as it is seen from `up`, float64 (count², 3), its +y on top."""
    x = np.array([up[2], 0.0, -up[0]]) / math.hypot(up[0], up[2])
    along = (np.arange(count) + 0.5) / count * 2.0 - 1.0
    a, b = np.meshgrid(along, -along)
    return a.reshape(-1, 1) * x + b.reshape(-1, 1) * np.cross(up, x)


def look(
    stone: Stone,
    places: np.ndarray,
    viewer: np.ndarray,
    up: np.ndarray,
    head_deg: float = ASET_HEAD_DEG,
    wavelength_nm: float = LINE_D_NM,
    report: Report | None = None,
    cancelled: Cancelled | None = None,
    least: float = LEAST,
) -> np.ndarray:
    """Sums (N, COLUMNS) of `paths` for what an eye in the direction `viewer` sees through `places` (N, 3), of light
    round `up`.

    Rays that meet nothing have sums of 0. By two threads; `cancelled`: the rest stays 0. `least`: shares of light that
    are not followed.
    """
    from .paths import COLUMNS, room, traced

    out = np.zeros((len(places), COLUMNS))
    n, head = float(stone.glass.index(wavelength_nm)), math.cos(math.radians(head_deg))
    tree = stone.corners, stone.normals, stone.bounds, stone.links

    def piece(first: int) -> None:
        if cancelled is None or not cancelled():
            part = slice(first, first + _PIECE)
            traced(
                places[part] + 4.0 * viewer, -viewer, *tree, n, up, head, stone.dn, PUPIL_RAD, least, *room(), out[part]
            )

    firsts = range(0, len(places), _PIECE)
    with ThreadPoolExecutor(2) as pool:
        for i, _ in enumerate(pool.map(piece, firsts)):
            if report is not None:
                report((i + 1) / len(firsts), "")
    return out


def returned(sums: np.ndarray) -> np.ndarray:
    """What comes from before the stone, (…) of (…, COLUMNS), in light from a whole hemisphere; …"""
    from .paths import HEAD

    return sums[..., HEAD] + beside_head(sums)


def beside_head(sums: np.ndarray) -> np.ndarray:
    """… and of that what the head does not hide."""
    from .paths import HIGH, LOW

    return sums[..., HIGH] + sums[..., LOW]


# ---- figures ----------------------------------------------------------------------------------

_ROWS = (
    ("ISO", "{iso:.1%}", "light return of an even hemisphere, without what the outside reflects"),
    ("COS", "{cos:.1%}", "light return of one that darkens by the cosine"),
    ("ISO, head", "{iso_head:.1%}", "with the shadow of a head, {head_deg:g}°"),
    ("COS, head", "{cos_head:.1%}", "with the shadow of a head, {head_deg:g}°"),
    ("weighted return", "{weighted:.1%}", "into all directions, by the square of the cosine"),
    ("glare", "{glare:.1%}", "reflected on the outside"),
    ("leak", "{leak:.1%}", "light from behind the stone"),
    ("window", "{window:.1%}", "of the area shows mostly what is behind"),
    ("extinction", "{dark:.1%}", "of the area is dark under the head, without being a window"),
    ("fire", "{fire_deg:.2f}°", "mean angle between F and C of returned light"),
    ("coloured", "{coloured:.1%}", "of returned light is spread wider than the eye's pupil"),
    ("scintillation", "{scintillation:.1%}", "change of the picture by a tilt of 3°"),
    ("not followed", "{rest:.4%}", "of the light"),
)
"""Name, value and meaning of each figure."""


@dataclass(frozen=True)
class GemFigures:
    """What a stone does with light, face up; shares of what an eye sees of it, 0 to 1, as `rows` explains."""

    iso: float
    cos: float
    head_deg: float
    """Half the angle of the head that hides light."""
    iso_head: float
    cos_head: float
    weighted: float
    glare: float
    leak: float
    rest: float
    """Not followed to its end."""
    window: float
    dark: float
    """Extinction."""
    fire_deg: float
    coloured: float
    scintillation: float

    def rows(self) -> tuple[tuple[str, str, str], ...]:
        """Name, value and meaning of each."""
        known = vars(self)
        return tuple((name, _shown(value, known), _shown(meaning, known)) for name, value, meaning in _ROWS)


def _shown(text: str, values: dict[str, float]) -> str:
    return text.format(**values).replace("%", " %")


def seen_mean(sums: np.ndarray) -> np.ndarray:
    """Over the stone's area."""
    seen = sums[:, :6].sum(axis=1) > 0.0
    if not seen.any():
        raise UserError("no ray met the stone: it is too thin to be seen from above; turn its table up")
    return np.asarray(sums[seen].mean(axis=0))


def figures(
    stone: Stone,
    head_deg: float = ASET_HEAD_DEG,
    count: int = 160,
    report: Report | None = None,
    cancelled: Cancelled | None = None,
) -> GemFigures | None:
    """Figures of `stone` by `count`² rays, and some more; None where that was `cancelled`. Raises `UserError`."""
    from . import paths as g

    told, stopped = report or (lambda share, text: None), cancelled or (lambda: False)
    told(0.0, "light return")
    face = look(stone, face_places(stone, count), UP, UP, head_deg, cancelled=stopped)
    if stopped():
        return None
    sums = seen_mean(face)
    seen = face[:, :6].sum(axis=1) > 0.0
    above = float(returned(sums))
    windows = (face[:, g.LEAK] > _WINDOW)[seen]
    dark = (beside_head(face) < _DARK)[seen] & ~windows
    told(0.3, "scintillation")
    places = face_places(stone, count // 2)
    ways = (tilted(x * _NUDGE_DEG, y * _NUDGE_DEG) for x, y in ((0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)))
    still, *moved = (beside_head(look(stone, places, way, way, head_deg, cancelled=stopped)) for way in ways)
    change = sum(float(np.abs(each - still).sum()) for each in moved) / max(4.0 * float(still.sum()), 1e-12)
    told(0.6, "weighted return")
    weighted = _weighted(stone, 4 * count, stopped)
    if stopped():
        return None
    told(1.0, "")
    sums = sums.tolist()
    return GemFigures(
        iso=above,
        cos=sums[g.COSINE],
        head_deg=head_deg,
        iso_head=above - sums[g.HEAD],
        cos_head=sums[g.COSINE] - sums[g.COSINE_HEAD],
        weighted=weighted,
        glare=sums[g.GLARE],
        leak=sums[g.LEAK],
        rest=sums[g.REST],
        window=float(windows.mean()),
        dark=float(dark.mean()),
        fire_deg=math.degrees(sums[g.SPREAD] / above) if above > 0.0 else 0.0,
        coloured=sums[g.SEEN] / above if above > 0.0 else 0.0,
        scintillation=change,
    )


def _weighted(stone: Stone, count: int, stopped: Cancelled) -> float:
    """∫∫ L cos²θ dA dω of all directions above by the light on the crown, ∫∫ dA dω, L what the stone sends there out of
    an even hemisphere of 1 above its table: after Hemphill et al. 1998. By `count` places on the crown."""
    edges = stone.corners[:, 1:] - stone.corners[:, :1]
    areas = np.where(stone.normals[:, 2] > 1e-6, 0.5 * np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1), 0.0)
    if areas.sum() == 0.0:
        return 0.0
    ends = np.cumsum(areas) / areas.sum()
    which = np.minimum(np.searchsorted(ends, (np.arange(count) + 0.5) / count), len(ends) - 1)
    u, v = (np.arange(count) * step % 1.0 for step in (0.7548776662466927, 0.5698402909980532))  # Roberts' R2
    u, v = np.where(u + v > 1.0, 1.0 - u, u), np.where(u + v > 1.0, 1.0 - v, v)
    places = stone.corners[which, 0] + u[:, None] * edges[which, 0] + v[:, None] * edges[which, 1]
    normals = stone.normals[which]
    places += 1e-9 * normals
    total = area = 0.0
    for i in range(_DIRECTIONS):
        c, turn = (i + 0.5) / _DIRECTIONS, 2.0 * math.pi * i * 0.6180339887498949
        s = math.sqrt(1.0 - c * c)
        to = np.array([s * math.cos(turn), s * math.sin(turn), c])
        facing = normals @ to
        seen = facing > 0.0
        sums = look(stone, places[seen] - 4.0 * to, to, UP, cancelled=stopped)
        total += float(facing[seen] @ returned(sums)) * c * c
        area += float(facing[seen].sum())
        if stopped():
            return math.nan
    return total / area
