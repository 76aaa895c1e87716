"""Writes downlight.ies: a made-up recessed lamp whose beam is wider along one axis than across it."""

from __future__ import annotations

import math
from pathlib import Path

VERTICAL = range(0, 91, 5)
HORIZONTAL = (0.0, 22.5, 45.0, 67.5, 90.0)
CENTRE_CD = 900.0


def candela(vertical_deg: float, horizontal_deg: float) -> float:
    """A soft-edged beam: cos^m of the angle, m from 3 (along C0) to 9 (across), shielded to nothing at 85°."""
    exponent = 6.0 - 3.0 * math.cos(math.radians(2.0 * horizontal_deg))
    shield = min(1.0, max(0.0, (85.0 - vertical_deg) / 25.0))
    return CENTRE_CD * math.cos(math.radians(vertical_deg)) ** exponent * shield


def main() -> None:
    """The file beside this one."""
    rows = [
        "IESNA:LM-63-2002",
        "[TEST] none: computed by assets/lights/generate.py",
        "[MANUFAC] SpectraSplat",
        "[LUMINAIRE] Recessed downlight that never was",
        "TILT=NONE",
        f"1 -1 1 {len(VERTICAL)} {len(HORIZONTAL)} 1 2 0.15 0.15 0",
        "1 1 12",
        " ".join(f"{angle:g}" for angle in VERTICAL),
        " ".join(f"{angle:g}" for angle in HORIZONTAL),
        *(" ".join(f"{candela(v, h):.1f}" for v in VERTICAL) for h in HORIZONTAL),
    ]
    (Path(__file__).parent / "downlight.ies").write_text("\n".join(rows) + "\n", encoding="ascii")


if __name__ == "__main__":
    main()
