"""Lights that a panorama holds: a sun, windows, lamps. Each small, very bright region becomes a light of its own, and
the rest of the picture lights without it.

Drawn by brightness, the shadow's edge of a sun would be as coarse as a map of the environment's light, and caustics of
whatever is small and bright are a matter for photons. So renderers ask for `with_panorama_lights` first; the scene that
people edit and save keeps its picture as it is.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from weakref import WeakKeyDictionary

import numpy as np

from .environment import direction_of, texel_solid_angles
from .lights.directional import SUN_DIAMETER_DEG, DirectionalLight
from .lights.light import Light
from .lights.outlined import AreaLight
from .optics.colorimetry import daylight_per_lumen, rgb_basis
from .optics.spectrum import Spectrum
from .scene import Scene
from .scene_checks import MAX_LIGHTS
from .texture import Environment
from .vectors import frozen, unit, vec3

SUN, WINDOW = "sun of the panorama", "window of the panorama"
_MOST = 8
"""Lights of a panorama."""
_EDGE = 0.05
"""Share of its brightest texel above which others belong to a region."""
_SUN_SR, _WINDOW_SR = 4e-3, 0.1
"""Largest solid angles: of a sun, 4° across with the glow that cameras put round it; of a window, 18° by 18°."""
_SUN_SHARE, _WINDOW_SHARE = 0.05, 0.1
"""Least shares of the panorama's light."""
_CONTRAST = 20.0
"""Times as bright as what is round it, a region is at least on average."""
_CORE = 0.5
"""Share of its median above which texels of a region show the outline of a window."""
_LIKENESS = 0.85
"""Least share of a window's region and of its outline together that both cover."""
_RING = 3
"""Texels from a region to the outer end of what is round it."""
_FINER = 4
"""Places along a texel's side by which its covered share is counted."""
_FAR = 300.0
"""Distance of a window, in radii of the scene."""


@dataclass(frozen=True)
class PanoramaWindow:
    """A disc or a rectangle far away, of one radiance; world frame."""

    toward: np.ndarray
    """Unit, to its middle."""
    tangent: np.ndarray
    half: tuple[float, float]
    """Tangents of half its angles, along the tangent and across it."""
    is_disc: bool
    radiance: np.ndarray
    """Linear Rec.709, lm/(sr unit²)."""

    def covers(self, directions: np.ndarray) -> np.ndarray:
        """Whether unit directions (…, 3) meet it."""
        ahead = directions @ self.toward
        u, v = (directions @ axis / np.maximum(ahead, 1e-9) for axis in (self.tangent, self._across))
        x, y = u / self.half[0], v / self.half[1]
        inside = x * x + y * y < 1.0 if self.is_disc else np.maximum(np.abs(x), np.abs(y)) < 1.0
        return inside & (ahead > 0.0)

    @property
    def _across(self) -> np.ndarray:
        return np.cross(self.toward, self.tangent)

    @property
    def solid_angle_sr(self) -> float:
        a, b = self.half
        if self.is_disc:
            return 2.0 * math.pi * (1.0 - 1.0 / math.hypot(1.0, a))
        return 4.0 * math.asin(a * b / (math.hypot(1.0, a) * math.hypot(1.0, b)))

    def light(self, name: str, centre: np.ndarray, distance: float) -> AreaLight:
        """Seen from `centre` (3,): so far away that it looks the same from everywhere near."""
        width, height = (2.0 * distance * half for half in self.half)
        tangent, direction = vec3(self.tangent), vec3(-self.toward)
        position, radiance = vec3(centre + distance * self.toward), _spectrum(self.radiance)
        if self.is_disc:
            return AreaLight(name, radiance, position, direction, tangent, "disc", 0.5 * width)
        return AreaLight(name, radiance, position, direction, tangent, "rectangle", width=width, height=height)


_found: WeakKeyDictionary[Environment, tuple[tuple[DirectionalLight | PanoramaWindow, ...], Environment]] = (
    WeakKeyDictionary()
)
_last: list[tuple[Scene, Scene]] = []
"""The last scenes and their results: the same scene gives the same result again."""


def with_panorama_lights(scene: Scene) -> Scene:
    """`scene` with the lights of its panorama as the last of its lights and a panorama without; itself where there are
    none. The same scene gives the same one again, and the same environment the same panorama."""
    for given, answer in _last:
        if given is scene or answer is scene:
            return answer
    answer = _with_panorama_lights(scene)
    _last[:] = [(scene, answer), *_last[:3]]
    return answer


def _with_panorama_lights(scene: Scene) -> Scene:
    environment = scene.environment
    if environment is None or not environment.lights or environment.kind != "map":
        return scene
    if environment not in _found:
        _found[environment] = lights_of(environment)
    found, rest = _found[environment]
    if not found or len(scene.lights) + len(found) > MAX_LIGHTS:  # no photon could name one more
        return scene
    bounds = np.array([item.world_bounds for item in scene.objects] or np.zeros((1, 2, 3)))
    low, high = bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)
    # In steps, so that most edits leave them where they are.
    distance = 2.0 ** math.ceil(math.log2(_FAR * max(0.5 * float(np.linalg.norm(high - low)), 1e-6)))
    centre = np.round(0.5 * (low + high) / distance * 1024.0) * distance / 1024.0
    lights: list[Light] = []
    for each in found:
        kind, number = (SUN if isinstance(each, DirectionalLight) else WINDOW), len(lights) + 1
        name = kind if number == 1 else f"{kind} ({number})"
        lights.append(
            replace(each, name=name) if isinstance(each, DirectionalLight) else each.light(name, centre, distance)
        )
    return replace(scene, lights=(*scene.lights, *lights), environment=rest)


def lights_of(environment: Environment) -> tuple[tuple[DirectionalLight | PanoramaWindow, ...], Environment]:
    """The lights of a panorama, brightest first, and what it is without them; their sum is the panorama."""
    rgb = np.asarray(environment.rgb, float)
    solid = np.broadcast_to(texel_solid_angles(*rgb.shape[:2]), rgb.shape[:2])
    total, found = float((rgb.mean(axis=2) * solid).sum()), list[DirectionalLight | PanoramaWindow]()
    for spot, ring in _regions(rgb.mean(axis=2)):
        around = np.median(rgb[ring], axis=0)
        excess = np.maximum(rgb[spot] - around, 0.0)
        flux = (excess * solid[spot][:, None]).sum(axis=0)
        if excess.mean() < _CONTRAST * around.mean():
            continue
        if solid[spot].sum() <= _SUN_SR and flux.mean() >= _SUN_SHARE * total:
            found.append(_sun(environment, spot, excess, flux, solid[spot]))
            rgb = rgb.copy()
            rgb[spot] = np.minimum(rgb[spot], around)
        elif solid[spot].sum() <= _WINDOW_SR and flux.mean() >= _WINDOW_SHARE * total:
            window = _window(environment, rgb, spot, around, solid)
            if window is not None:
                found.append(window)
                covered = _covered(environment, window)
                covered *= window.solid_angle_sr / (covered * solid).sum()
                rgb = rgb - covered[..., None] * window.radiance
    if not found:
        return (), environment
    return tuple(found), replace(environment, rgb=frozen(rgb.astype(np.float32)))


def _regions(bright: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Bright regions and what is round them, bool (H, W) each, the one with the brightest texel first."""
    from scipy import ndimage

    width, left, dim = bright.shape[1], bright.copy(), _CONTRAST * np.median(bright)
    for _ in range(2 * _MOST):
        row, column = np.unravel_index(int(left.argmax()), left.shape)
        peak = left[row, column]
        if peak <= dim or peak <= 0.0:
            return
        # The seam of the columns is turned away from the region.
        turn = width // 2 - int(column)
        labels, _ = ndimage.label(np.roll(left > _EDGE * peak, turn, axis=1))
        own = {labels[row, width // 2]}
        for pole in (labels[0], labels[-1]):  # where all columns meet
            own |= set(pole[pole > 0]) if own & set(pole) else set()
        spot, ring = np.isin(labels, list(own)), np.zeros(left.shape, bool)
        (rows, columns), room = ndimage.find_objects(spot.astype(np.uint8))[0], _RING + 1
        box = (
            slice(max(rows.start - room, 0), rows.stop + room),
            slice(max(columns.start - room, 0), columns.stop + room),
        )
        near, far = (ndimage.binary_dilation(spot[box], iterations=reach) for reach in (1, _RING))
        ring[box] = far & ~near
        spot, ring = np.roll(spot, -turn, axis=1), np.roll(ring, -turn, axis=1)
        if ring.any():
            yield spot, ring
        left[spot] = 0.0


def _sun(
    environment: Environment, spot: np.ndarray, excess: np.ndarray, flux: np.ndarray, solid: np.ndarray
) -> DirectionalLight:
    weights = excess.mean(axis=1) * solid
    toward = unit(weights @ _directions(environment, spot))
    # A disc of the brightest texel's radiance has the same light.
    size = flux.mean() / excess.mean(axis=1).max()
    diameter = max(SUN_DIAMETER_DEG, 2.0 * math.degrees(math.asin(math.sqrt(min(size / math.pi, 1.0)))))
    return DirectionalLight(SUN, _spectrum(flux), vec3(-toward), diameter)


def _window(
    environment: Environment, rgb: np.ndarray, spot: np.ndarray, around: np.ndarray, solid: np.ndarray
) -> PanoramaWindow | None:
    """The disc or rectangle of a region; None where it is like neither."""
    from scipy import ndimage

    bright = rgb.mean(axis=2)
    core = spot & (bright > _CORE * np.median(bright[spot]))
    places, weights = _directions(environment, core), solid[core]
    toward = unit(weights @ places)
    guide = environment.world_to_local[2]
    if abs(toward @ guide) > 0.99:
        guide = environment.world_to_local[0]
    level = unit(np.cross(guide, toward))
    # On the plane that touches the sphere there, where a window far away has its own shape.
    ahead = places @ toward
    flat = np.stack([places @ level, places @ np.cross(toward, level)], axis=1) / ahead[:, None]
    share = weights / ahead**3
    middle = share @ flat / share.sum()
    covariance = (share[:, None] * (flat - middle)).T @ (flat - middle) / share.sum()
    variances, axes = np.linalg.eigh(covariance)
    if variances[1] < 1.5 * variances[0] or variances[0] <= 0.0:
        variances, axes = np.diag(covariance), np.eye(2)  # as likely upright
    toward = unit(toward + middle @ np.stack([level, np.cross(toward, level)]))
    tangent = axes[0, 0] * level + axes[1, 0] * np.cross(toward, level)
    tangent = unit(tangent - toward * (toward @ tangent))
    inner = ndimage.binary_erosion(core)
    # Hardly any of the rest is below nothing.
    radiance = np.maximum(np.quantile(rgb[inner if inner.any() else core], 0.1, axis=0) - around, 0.0)
    best, likeness = None, _LIKENESS
    for is_disc, factor in ((False, 3.0), (True, 4.0)):
        half = np.sqrt(factor * variances)
        if is_disc:
            half[:] = np.sqrt(half[0] * half[1])
        window = PanoramaWindow(toward, tangent, (float(half[0]), float(half[1])), is_disc, radiance)
        covered = _covered(environment, window) * solid
        common = covered[core].sum()
        if (like := common / (covered.sum() + weights.sum() - common)) > likeness:
            best, likeness = window, like
    return best


def _covered(environment: Environment, window: PanoramaWindow) -> np.ndarray:
    """Share of each texel that a window covers, float64 (H, W)."""
    height, width = environment.rgb.shape[:2]
    angle = math.atan(math.hypot(*window.half)) + 2.0 * math.pi / height
    polar = math.acos(np.clip((environment.world_to_local @ window.toward)[2], -1.0, 1.0))
    near_rows = np.flatnonzero(np.abs((np.arange(height) + 0.5) * math.pi / height - polar) < angle)
    columns, rows = np.meshgrid(np.arange(width), near_rows)
    reach = math.cos(angle)
    near = direction_of(environment, (columns + 0.5) / width, (rows + 0.5) / height) @ window.toward > reach
    rows, columns = rows[near], columns[near]
    places = (np.arange(_FINER) + 0.5) / _FINER
    u = (columns[:, None, None] + places[None, None]) / width + np.zeros((1, _FINER, 1))
    v = (rows[:, None, None] + places[None, :, None]) / height + np.zeros((1, 1, _FINER))
    found = np.zeros((height, width))
    covers = window.covers(direction_of(environment, u, v))
    found[rows, columns] = np.average(covers, axis=(1, 2), weights=np.sin(np.pi * v))  # by solid angle
    return found


def _directions(environment: Environment, chosen: np.ndarray) -> np.ndarray:
    """World directions (n, 3) of the chosen texels' middles."""
    rows, columns = np.nonzero(chosen)
    height, width = chosen.shape
    return direction_of(environment, (columns + 0.5) / width, (rows + 0.5) / height)


def _spectrum(rgb: np.ndarray) -> Spectrum:
    return Spectrum(np.maximum(rgb_basis() @ rgb, 0.0) * daylight_per_lumen())
