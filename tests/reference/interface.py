"""CPU reference of shaders/lib/interface.glsl and band.glsl: how a surface turns a ray, and what a band is cut by."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq
from spectrasplat.reference import optics

MIN_SHADING_COSINE = 1e-6


@dataclass(frozen=True)
class Frame:
    """The normals of one place, turned against the ray."""

    normal: np.ndarray
    normal_g: np.ndarray
    interpolated: bool
    refused: bool


def shading_frame(direction: np.ndarray, normal_g: np.ndarray, corners: np.ndarray | None, bary: np.ndarray) -> Frame:
    """Of a facet with outward normal `normal_g` and its corners' normals (3, 3), or None for a flat one."""
    side = 1.0 if direction @ normal_g < 0 else -1.0
    if corners is None:
        return Frame(side * normal_g, side * normal_g, False, False)
    normal = side * optics.unit(np.array([1.0 - bary.sum(), *bary]) @ corners)
    used = bool(direction @ normal < -MIN_SHADING_COSINE)
    return Frame(normal if used else side * normal_g, side * normal_g, used, not used)


def reflected(frame: Frame, direction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(direction, normal that turned it): the facet's normal where the shading one leads into the facet."""
    turned = optics.reflect(direction, frame.normal)
    if turned @ frame.normal_g > 0:
        return turned, frame.normal
    return optics.reflect(direction, frame.normal_g), frame.normal_g


def refracted(frame: Frame, direction: np.ndarray, eta_it: float) -> tuple[np.ndarray, np.ndarray] | None:
    """The same; None where the normal that judges transmits nothing."""
    for normal in (frame.normal, frame.normal_g):
        if optics.transmitted_cosine2(direction, normal, eta_it) <= 0:
            return None
        turned = optics.refract(direction, normal, eta_it)
        if turned @ frame.normal_g < 0:
            return turned, normal
    return None


def onset(passing: Callable[[float], float], low: float, high: float) -> float:
    """Where `passing` (the squared cosine of the transmitted angle at x) changes its sign between `low` and `high`."""
    return float(brentq(passing, low, high, xtol=1e-14))
