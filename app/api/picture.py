"""What comes back: pictures, irradiance maps, and what was done for them."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..base.errors import UserError, suggestion
from ..base.image_io import shown_bytes, write_image
from ..model.scene import Scene
from .arguments import in_python

Floats = NDArray[np.float32]


@dataclass(frozen=True)
class Statistics:
    """What was done for a picture."""

    photons: int
    """Photons that the picture was made of."""
    photons_traced: int
    """Those of them that were traced for this picture; the others were kept from an earlier one (`Session`)."""
    camera_samples: int
    """A pixel; 0 where no camera took part."""
    seconds: float
    """From the call to the picture, without starting OpenGL."""
    renderer: str
    """OpenGL's name of the device."""
    is_software: bool
    """The processor drew, not a GPU."""
    stopped: bool = False
    """`cancel` answered true: the picture holds what was done by then."""
    notices: tuple[str, ...] = ()
    """What the command line would note: light that was lost, lights that reached nothing."""
    flux: Mapping[str, float] = field(default_factory=dict)
    """How light ended, as shares of what was emitted: "deposited", "escaped", … ; empty for a `Session`."""


@dataclass(frozen=True)
class _Image:
    """Linear numbers and ways to look at them."""

    rgb: Floats
    """float32 (H, W, 3), linear Rec.709, top row first, not clipped."""
    spectral: Floats | None
    """float32 (H, W, bins), or None without `bins`."""
    bin_edges_nm: NDArray[np.float64] | None
    """float64 (bins + 1,), rising."""
    stats: Statistics
    """What was done for it."""

    @property
    def size(self) -> tuple[int, int]:
        """Width and height, pixels."""
        return self.rgb.shape[1], self.rgb.shape[0]

    def to_exr(self, path: str | os.PathLike[str]) -> Path:
        """Write the linear numbers, spectral channels too, to an .exr. Raises `UserError` where that cannot be."""
        return self._write(path, ".exr", self.rgb, 0.0, self.spectral)

    def _write(
        self,
        path: str | os.PathLike[str],
        suffix: str,
        rgb: Floats,
        exposure_ev: float,
        spectral: Floats | None,
        glare: float = 0.0,
        antialias: bool = True,
    ) -> Path:
        target = Path(path)
        if target.suffix.lower() != suffix:
            raise UserError(f"cannot write {target}: the name must end in {suffix}")
        write_image(
            target,
            rgb,
            exposure_ev=exposure_ev,
            spectral=spectral,
            bin_edges_nm=self.bin_edges_nm,
            glare=glare,
            antialias=antialias,
        )
        return target


@dataclass(frozen=True)
class Picture(_Image):
    """A rendered picture: `rgb` is radiance, lm/(sr unit²) for white, `spectral` W/(sr unit²) per bin."""

    layers: Mapping[str, Floats]
    """float32 (H, W, 3) by name, of the layers that were given; the first of them is `rgb`."""
    exposure_ev: float = 0.0
    """Stops on top of the automatic exposure, as the scene has it; for `to_png` only."""
    glare: float = 0.0
    """Share of the light that the lens scatters, as the scene has it; for `to_png` only."""
    antialias_highlights: bool = True
    """Edges of what is overexposed have no steps, as the scene has it; for `to_png` only."""

    def to_png(self, path: str | os.PathLike[str], exposure_ev: float | None = None, layer: str | None = None) -> Path:
        """Write it as the eye sees it, tone-mapped 8-bit sRGB; `exposure_ev` replaces the picture's own stops.

        Raises `UserError` where it cannot be written.
        """
        stops = self.exposure_ev if exposure_ev is None else exposure_ev
        return self._write(path, ".png", self._layer(layer), stops, None, self.glare, self.antialias_highlights)

    def _repr_png_(self) -> bytes:
        """As notebooks show it."""
        return shown_bytes(self.rgb, self.exposure_ev, self.glare, self.antialias_highlights)

    def _layer(self, name: str | None) -> Floats:
        if name is None:
            return self.rgb
        if name not in self.layers:
            known = ", ".join(f"'{layer}'" for layer in self.layers)
            raise UserError(f"the picture has no layer '{name}'{suggestion(name, self.layers)}; it has {known}")
        return self.layers[name]

    def __repr__(self) -> str:
        width, height = self.size
        return f"Picture({width}×{height}, {self.stats.photons:,} photons, {self.stats.seconds:.1f} s)"


@dataclass(frozen=True)
class CausticMap(_Image):
    """Irradiance that glass and mirrors throw on a receiver, before its own reflectance: `rgb` in lm/unit² for white,
    `spectral` in W/unit² per bin."""

    receiver: str
    """The object's name."""
    placement: Mapping[str, object]
    """Its placement. `kind` "rectangle": `corners_world` (`bottom_left`, `bottom_right`, `top_right`, `top_left`, three
    numbers each), `normal_world`, `size_units` and `texel_size_units` (two numbers each). `kind` "charts" (curved
    receivers): `triangle_uv`, texture coordinates (0, 0 upper left) of the corners of every triangle of `mesh`."""
    _scene: Scene = field(repr=False, kw_only=True)

    def export(
        self, path: str | os.PathLike[str], *, plane: bool = False, source: Sequence[float] | None = None
    ) -> Path:
        """Write it for other programs, as `spectrasplat export` does: the receiver glowing with its caustic (.glb,
        .gltf; .usda, .usdc, .usd), or a spot light's cookie (.png, .exr), and their numbers to a .json next to it.

        `plane`: only the rectangle that is lit, as bright as on a white receiver. `source`: where the cookie's spot
        stands (three numbers). Raises `UserError`.
        """
        from ..render.export_caustic import write_export

        target = Path(path)
        try:
            write_export(self._scene, self.receiver, self.rgb, self.placement, target, plane, source)
        except UserError as error:
            raise UserError(in_python(str(error))) from error
        return target

    def to_png(self, path: str | os.PathLike[str], exposure_ev: float = 0.0) -> Path:
        """Write it as the eye sees it. Raises `UserError` where it cannot be written."""
        return self._write(path, ".png", self.rgb, exposure_ev, None)

    def _repr_png_(self) -> bytes:
        """As notebooks show it."""
        return shown_bytes(self.rgb)

    def __repr__(self) -> str:
        width, height = self.size
        return f"CausticMap('{self.receiver}', {width}×{height}, {self.stats.photons:,} photons)"
