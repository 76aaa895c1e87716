"""What the bench report says of methods, metrics and protocol: assets/templates/bench_prose.toml, which a writer may
edit."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass

from ...base.paths import assets_dir


@dataclass(frozen=True)
class Prose:
    """One pass's explanations. Plain text; pages escape it."""

    methods: Mapping[str, str]
    metrics: Mapping[str, str]
    stages: Mapping[str, str]
    protocol: tuple[str, ...]
    not_covered: Mapping[str, str]


def _read() -> dict[str, Prose]:
    held = tomllib.loads((assets_dir() / "templates" / "bench_prose.toml").read_text(encoding="utf-8"))
    common = held["light"]["metrics"]
    return {name: Prose(**(entry | {"metrics": common | entry["metrics"]})) for name, entry in held.items()}


PROSE = _read()
"""By the name of the measured pass; metrics that a pass does not describe are the light pass's."""
