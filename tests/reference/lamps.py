"""Photometric files of lamps whose light is known in closed form."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from spectrasplat.model.lights import IesLight
from spectrasplat.model.lights.ies_file import read_ies
from spectrasplat.model.optics.spectrum import Spectrum


def ies_text(
    candela: Callable[[np.ndarray, np.ndarray], np.ndarray],
    vertical: np.ndarray | list[float],
    horizontal: np.ndarray | list[float] = (0.0,),
    multiplier: float = 1.0,
    ballast: float = 1.0,
    tilt: str = "NONE",
    kind: int = 1,
) -> str:
    """An LM-63 file whose candela are a function of the vertical and the horizontal angle, degrees."""
    rows = [candela(np.asarray(vertical, float), np.full(len(vertical), h)) for h in horizontal]
    lines = [
        "IESNA:LM-63-1995",
        "[TEST] computed",
        f"TILT={tilt}",
        f"1 1000 {multiplier:.17g} {len(vertical)} {len(horizontal)} {kind} 2 0 0 0",
        f"{ballast:.17g} 1 0",
        *(" ".join(f"{v:.17g}" for v in listed) for listed in (vertical, horizontal)),
        *(" ".join(f"{v:.17g}" for v in row) for row in rows),
    ]
    return "\n".join(lines) + "\n"


def ldt_text(
    candela: Callable[[np.ndarray, np.ndarray], np.ndarray],
    vertical: np.ndarray | list[float],
    planes: int,
    symmetry: int,
) -> str:
    """A EULUMDAT file with 2 × 600 lm, as many of `planes` equal C planes listed as `symmetry` asks for."""
    angles = 360.0 * np.arange(planes) / planes
    first, count = {
        0: (0, planes),
        1: (0, 1),
        2: (0, planes // 2 + 1),
        3: (3 * planes // 4, planes // 2 + 1),
        4: (0, planes // 4 + 1),
    }[symmetry]
    table = [
        candela(np.asarray(vertical, float), np.full(len(vertical), angles[(first + i) % planes])) for i in range(count)
    ]
    head = [
        "Maker",
        1,
        symmetry,
        planes,
        0,
        len(vertical),
        0,
        "",
        "name",
        "",
        "a.ldt",
        "",
        *[100] * 9,
        100,
        80,
        1,
        0,
        2,
    ]
    sets = [1, "LED", "1200", "3000", "1A", "12", 1, "LED", "600", "4000", "1A", "6"]
    values = [*[0.5] * 10, *angles, *vertical, *(np.concatenate(table) / 1.2)]
    return "\r\n".join(map(str, [*head, *sets, *values])) + "\r\n"


def lamp(folder: Path, spectrum: Spectrum, text: str, **placed: object) -> IesLight:
    """A light of this file; `spectrum` is its intensity at the peak."""
    path = folder / "lamp.ies"
    path.write_text(text, encoding="ascii")
    return IesLight("lamp", spectrum, read_ies(path), **placed)


def isotropic() -> str:
    """The same in all directions."""
    return ies_text(lambda v, h: 100.0 + 0.0 * v, [0.0, 90.0, 180.0])


def cosine(step_deg: float = 1.0) -> str:
    """cos θ downwards, as a Lambertian surface."""
    return ies_text(lambda v, h: 50.0 * np.cos(np.radians(v)), np.arange(0.0, 90.0 + 0.5 * step_deg, step_deg))


def lopsided() -> str:
    """Different in every direction: no symmetry helps a wrong turn."""
    return ies_text(
        lambda v, h: 10.0 + 3.0 * np.cos(np.radians(v)) + 4.0 * np.sin(np.radians(v)) * np.cos(np.radians(h - 40.0)),
        np.arange(0.0, 181.0, 7.5),
        np.arange(0.0, 361.0, 15.0),
    )
