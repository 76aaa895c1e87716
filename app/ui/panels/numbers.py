"""Numbers as words of fixed width and sensible precision, and the name of a scene's unit in labels."""

from __future__ import annotations

import re


def count(number: float) -> str:
    """A count with a metric suffix: "1.25 M", "640"."""
    for limit, divisor, suffix in ((1e3, 1.0, ""), (1e6, 1e3, " k"), (1e9, 1e6, " M"), (1e12, 1e9, " G")):
        if abs(number) < 0.9995 * limit:
            return f"{number:.0f}" if divisor == 1.0 else f"{number / divisor:.3g}{suffix}"
    return f"{number / 1e12:.3g} T"


def size(number: int) -> str:
    """Bytes in binary units: "96 MiB"."""
    value = float(number)
    for suffix in ("B", "KiB", "MiB"):
        if value < 1024:
            return f"{value:.0f} {suffix}"
        value /= 1024
    return f"{value:.2f} GiB"


def milliseconds(value: float) -> str:
    """A duration in ms: "0.42 ms", "18.3 ms", "120 ms"."""
    digits = 2 if value < 10 else 1 if value < 100 else 0
    return f"{value:.{digits}f} ms"


def percent(share: float) -> str:
    """A share: "1.6 %", "0.02 %", "< 0.01 %"."""
    if 0.0 < share < 1e-4:
        return "< 0.01 %"
    return f"{100 * share:.3g} %"


def kelvin(temperature_k: float) -> str:
    """A colour temperature: "6,504 K", "25,370 K"; to ten kelvin from 10,000 K on, as well as it can be said."""
    return f"{round(temperature_k, -1 if temperature_k >= 1e4 else 0):,.0f} K"


_UNITS = re.compile(r"unit²|\b(?:scene )?units\b")
_label = {"now": ""}


def use_units(label: str) -> None:
    """Call units so from now on; empty where the scene does not say."""
    _label["now"] = label


def named(text: str) -> str:
    """`text` with the scene's label in place of "units", "scene units" and "unit²". A "scene unit" stays: what is said
    of one is true of any."""
    label = _label["now"]
    if not label or "unit" not in text:
        return text
    return _UNITS.sub(lambda found: label + "²" * found[0].endswith("²"), text)
