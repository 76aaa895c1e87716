"""Derivatives of caustic maps and pictures by the numbers of a scene."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..base.colour_maps import signed_codes
from ..base.errors import UserError
from ..base.image_io import png_bytes, save_codes
from ..commands.solving_table import GRADIENT_SIZE
from .arguments import Count, Size, settings_of
from .device import Cancel, Progress, worked_out
from .picture import Floats
from .rendering import check_receiver
from .scene import Scene


@dataclass(frozen=True)
class Gradient:
    """How a map or a picture changes with one number of the scene; arrays go to others by NumPy or DLPack."""

    of: str
    """The parameter's path."""
    rgb: Floats
    """float32 (H, W, 3): what changes per unit of the parameter, linear Rec.709, top row first."""
    spectral: Floats | None
    """float32 (H, W, bins), or None without `bins`."""
    base: Floats
    """What `rgb` is the derivative of."""
    base_spectral: Floats | None
    """What `spectral` is the derivative of."""
    bin_edges_nm: np.ndarray | None
    """float64 (bins + 1,), rising."""
    step: float
    """Change of the parameter to either side by which it was found."""
    noise: float
    """Error of `rgb` by chance and blur, over its norm: of single texels; means over several have less."""
    placement: Mapping[str, object] | None
    """Where a map lies, see `CausticMap.placement`."""
    seconds: float
    """From the call to the result."""

    @property
    def codes(self) -> NDArray[np.uint8]:
        """uint8 (H, W, 3), sRGB, to look at: what becomes brighter is red, what becomes darker blue."""
        return signed_codes(self.rgb)

    def to_png(self, path: str | os.PathLike[str]) -> Path:
        """Write `codes`. Raises `UserError` where it cannot be written."""
        target = Path(path)
        if target.suffix.lower() != ".png":
            raise UserError(f"cannot write {target}: the name must end in .png")
        save_codes(target, self.codes)
        return target

    def _repr_png_(self) -> bytes:
        """As notebooks show it."""
        return png_bytes(self.codes)

    def __repr__(self) -> str:
        height, width, _ = self.rgb.shape
        found = f"step {self.step:.3g}, noise {100.0 * self.noise:.2g} %"
        return f"Gradient('{self.of}', {width}×{height}, {found}, {self.seconds:.1f} s)"


def gradient(
    scene: Scene,
    of: str,
    receiver: str | None = None,
    *,
    size: Size = GRADIENT_SIZE,
    photons: Count | None = None,
    seed: int | None = None,
    bins: int | None = None,
    spp: int | None = None,
    step: float | None = None,
    progress: Progress | None = None,
    cancel: Cancel | None = None,
) -> Gradient:
    """∂/∂`of` of the caustic map on `receiver`, or of the picture where that is None.

    `of`: a parameter's path as `spectrasplat animate` has it ("objects.prism.n_d", "lights.sun.rotation.x"), or
    "objects.prism.index" for the glass's whole curve n(λ): with `bins`, each bin is then the derivative by the index
    in that bin. `step`: change of the parameter to either side; found where it is not given. Raises `UserError`, also
    where `cancel` stopped it.
    """
    settings = settings_of(scene, size=size, photons=photons, seed=seed, bins=bins, spp=spp)
    if receiver is not None:
        check_receiver(scene, receiver)
        settings = replace(settings, layer=f"map:{receiver}")
    if step is not None and not (isinstance(step, int | float) and 0.0 < step < float("inf")):
        raise UserError(f"step {step!r} is no change of a parameter: give a number above 0")
    from ..edit.parameters import Stage
    from ..render.gradient import gradient

    stage, started = Stage(scene._model, scene._model.camera), time.perf_counter()
    steps = None if step is None else {of: float(step)}
    found = worked_out(
        "solving", lambda context: gradient(context, stage, settings, [of], steps, noise=True), progress, cancel
    )
    (its,), base = found.derivatives, found.base
    return Gradient(
        of=of,
        rgb=its.picture.rgb,
        spectral=its.picture.spectral,
        base=base.rgb,
        base_spectral=base.spectral,
        bin_edges_nm=base.bin_edges_nm,
        step=its.step,
        noise=its.noise,
        placement=found.placement,
        seconds=time.perf_counter() - started,
    )
