"""A baked caustic as files that other programs open: glTF, USD, or a spot light's cookie; numbers in a `.json` next
to it. A page for a browser is not baked: `render/page`."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..base.atomic import atomic_outputs
from ..base.errors import UserError
from ..base.image_io import check_finite, save_codes, write_image
from ..model.io.lit_mesh import check_usd, texture_path, write_lit_gltf, write_lit_usd
from ..model.io.scene_pictures import nearest_levels
from ..model.scene import Scene
from .bake import written_with
from .cookie import cookie
from .lit_receiver import lit_receiver, up_of

GLTF_SUFFIXES = (".glb", ".gltf")
USD_SUFFIXES = (".usda", ".usdc", ".usd")
COOKIE_SUFFIXES = (".png", ".exr")
PAGE_SUFFIXES = (".html",)
SUFFIXES = GLTF_SUFFIXES + USD_SUFFIXES + COOKIE_SUFFIXES + PAGE_SUFFIXES


def check_export(path: Path, plane: bool = False, source: Sequence[float] | None = None) -> list[Path]:
    """All files that will be written. Raises `UserError` for a suffix that none of them has, for options that do not
    fit it, and where usd-core is absent."""
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise UserError(
            f"cannot export to {path}: use .glb or .gltf, .usda, .usdc or .usd, .png or .exr for a spot's cookie, "
            ".html for a page, or .asc for a stone's facets"
        )
    if suffix in PAGE_SUFFIXES and plane:
        raise UserError(f"--plane does not go with a page, {path.name}: it belongs to .glb and .usd files")
    if suffix in COOKIE_SUFFIXES and plane:
        raise UserError(f"--plane does not go with a cookie, {path.name}: it belongs to .glb and .usd files")
    if suffix not in COOKIE_SUFFIXES and source is not None:
        raise UserError(f"--source does not go with {path.name}: it belongs to a spot's cookie, .png or .exr")
    if suffix in USD_SUFFIXES:
        check_usd()
        return written_with(path, texture_path(path))
    return [path] if suffix in PAGE_SUFFIXES else written_with(path)


def write_export(
    scene: Scene,
    receiver: str,
    rgb: np.ndarray,
    placement: Mapping[str, Any],
    path: Path,
    plane: bool = False,
    source: Sequence[float] | None = None,
) -> None:
    """Write the map `rgb` (h, w, 3), irradiance in lm/unit², by the suffix of `path`, with its numbers next to it.

    Raises `UserError`.
    """
    check_export(path, plane, source)
    check_finite(path.name, rgb)
    numbers: dict[str, Any] = {"scene": scene.name, "receiver": receiver, "file": path.name, "up_axis": up_of(scene)}
    if path.suffix.lower() in COOKIE_SUFFIXES:
        _write_cookie(scene, receiver, rgb, placement, path, source, numbers)
        return
    lit = lit_receiver(scene, receiver, rgb, placement, plane)
    light = "a white receiver" if plane else "the receiver's own reflectance"
    numbers |= {
        "emission": f"radiance, cd/unit² (linear Rec.709), with {light}",
        "largest_emission": lit.strength,
        "placement": dict(placement),
    }
    is_gltf = path.suffix.lower() in GLTF_SUFFIXES
    white = "8-bit sRGB; white is largest_emission (KHR_materials_emissive_strength)"
    numbers["texture"] = white if is_gltf else f"{texture_path(path).name}, linear (raw)"
    with atomic_outputs(*check_export(path, plane, source)) as (file, *texture, note):
        if is_gltf:
            write_lit_gltf(lit, path, file)
        else:
            write_lit_usd(lit, path, file, *texture)
        note.write_text(_text(numbers), encoding="utf-8")


def _write_cookie(
    scene: Scene,
    receiver: str,
    rgb: np.ndarray,
    placement: Mapping[str, Any],
    path: Path,
    source: Sequence[float] | None,
    numbers: dict[str, Any],
) -> None:
    made = cookie(scene, receiver, rgb, placement, max(rgb.shape[:2]), source)
    is_png = path.suffix.lower() == ".png"
    numbers |= made.numbers() | {"encoding": "8-bit sRGB" if is_png else "linear Rec.709", "white_is": "intensity_cd"}
    with atomic_outputs(*written_with(path)) as (picture, note):
        if is_png:
            save_codes(picture, nearest_levels(made.rgb))
        else:
            write_image(path, made.rgb, into=picture)
        note.write_text(_text(numbers), encoding="utf-8")


def _text(numbers: Mapping[str, Any]) -> str:
    return json.dumps(numbers, indent=1, ensure_ascii=False) + "\n"
