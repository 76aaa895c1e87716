"""How the grooves of a grating share light out among its orders, by scalar theory.

Each groove delays light by a phase of its own over its width, and the share of order m is the squared m-th Fourier
coefficient of that (Goodman, Introduction to Fourier Optics, 4th ed. 2017, §5.4; Loewen, Popov 1997, ch. 2, 4): all
orders together have all of the light. Of a sawtooth, orders get the more the nearer they go to where single facets
would send the light (`blaze`); steps and waves delay light as their depth does.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

LAST_MINIMUM = 8
"""Up to which a table knows the light of a line."""
STEPS_BESSEL = 256
"""Parts of a period over which Bessel's integral is summed."""


def sawtooth_shares(order: np.ndarray, waves: np.ndarray) -> np.ndarray:
    """Share of an order, where facets send light as if to an order of the number `waves`."""
    shares: np.ndarray = np.sinc(order - waves) ** 2
    return shares


def lamellar_shares(order: np.ndarray, waves: np.ndarray) -> np.ndarray:
    """Shares of grooves with steep walls, as wide as the ridges between; `waves`: their depth, by the light's phase."""
    odd = np.asarray(order) % 2 != 0
    others = np.where(order == 0, np.cos(np.pi * waves) ** 2, 0.0)
    return np.where(odd, (2.0 / (np.pi * np.where(odd, order, 1)) * np.sin(np.pi * waves)) ** 2, others)


def sinusoidal_shares(order: np.ndarray, waves: np.ndarray) -> np.ndarray:
    """Shares of grooves that are a sine's: J_m², by Bessel's integral."""
    turn = 2.0 * np.pi * (np.arange(STEPS_BESSEL) + 0.5) / STEPS_BESSEL
    order, waves = np.broadcast_arrays(order, waves)
    phase = order[..., None] * turn - np.pi * waves[..., None] * np.sin(turn)
    shares: np.ndarray = np.cos(phase).mean(axis=-1) ** 2
    return shares


SHARES: dict[str, Callable[[np.ndarray, np.ndarray], np.ndarray]] = {
    "blazed": sawtooth_shares,
    "lamellar": lamellar_shares,
    "sinusoidal": sinusoidal_shares,
}
"""By the word for the profile, in the order of their codes from 1 on (PROFILE_… of shaders/lib/grating.glsl)."""


def facet_angle(blaze_um: float, lines_per_um: float, index: float) -> float:
    """Angle (rad) between the facets of a sawtooth and its plane, so that light of this wavelength fares best in order
    1: in one that reflects (`index` 0) where it goes back to where it came from (Littrow); in one of a transparent
    `index` where it comes along the normal. NaN where no facet does."""
    sine = blaze_um * lines_per_um
    if not index:
        return math.asin(0.5 * sine) if abs(sine) < 2.0 else math.nan
    if abs(sine) >= 1.0:
        return math.nan
    cosine = math.sqrt(1.0 - sine * sine)
    angle = math.atan2(sine, index - cosine)
    # Beyond, light would leave a facet into it: it is reflected totally.
    return angle if abs(math.asin(sine) + angle) < 0.5 * math.pi else math.nan


def blaze_um(angle: float, lines_per_um: float, index: float) -> float:
    """The inverse of `facet_angle`; NaN where facets reflect totally."""
    if not index:
        return 2.0 * math.sin(angle) / lines_per_um
    sine = index * math.sin(angle)
    return math.sin(math.asin(sine) - angle) / lines_per_um if abs(sine) < 1.0 else math.nan


def waves_of(
    profile: str, relief: float, lines_per_um: float, index: float, light: np.ndarray, n: float, um: np.ndarray
) -> np.ndarray:
    """What `SHARES` is a function of. `relief`: of a sawtooth its `facet_angle`, else the depth of the grooves (µm);
    `light` (..., 3): unit direction that light comes in, across the lines (the way of positive orders), along them and
    along the outward normal, in a medium of index `n`; `um`: its wavelength in vacuum."""
    k = n * np.asarray(light, float)
    if profile != "blazed":
        rise = np.abs(k[..., 2])
        fall = 2.0 * rise if not index else _inside(k, index) - rise
        return relief * fall / um
    if not index:
        facet = np.array([math.sin(relief), 0.0, math.cos(relief)])
        return -2.0 * (k @ facet) * facet[0] / (lines_per_um * um)
    # The flat side is the outward one, the grooves are behind it.
    facet = -np.array([math.sin(relief), 0.0, math.cos(relief)])
    onward = k[..., 2] < 0.0
    met = np.where(onward, k[..., 0] * facet[0] - _inside(k, index) * facet[2], k @ facet)
    behind = np.where(onward, n**2 - index**2, index**2 - n**2) + met**2
    turned = np.where(onward, 1.0, -1.0) * np.sqrt(np.maximum(behind, 0.0))
    return facet[0] * (turned - met) / (lines_per_um * um)


def line_quantiles(samples: int) -> np.ndarray:
    """How far off the middle of a line, in parts λ / W of a direction's sine, a share of its light is that goes in even
    steps from 0 to 1, float64 (samples,): of the light behind an opening of width W, distributed as sinc². The last
    steps, beyond the eighth minimum, are empty: there the share left over is 1 / (π² times that)."""
    place = np.linspace(0.0, LAST_MINIMUM, 64 * 1024 + 1)
    density = np.sinc(place) ** 2
    inner = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]))]) * 2.0 * (place[1] - place[0])
    return np.interp(np.linspace(0.0, 1.0, samples), inner, place)


def _inside(k: np.ndarray, index: float) -> np.ndarray:
    """Part along the normal of waves `k` (..., 3) within a sheet of this index."""
    return np.sqrt(np.maximum(index**2 - (k[..., :2] ** 2).sum(axis=-1), 0.0))
