"""The references' polarised light against closed forms: products of shares of s and p, Fresnel's rhomb, Malus.

What a path keeps is the mean over both polarisations of products, and not the product of means; formulas here know
angles of incidence and refraction alone.
"""

from dataclasses import replace

import numpy as np
import pytest
from spectrasplat.model.geometry import primitives
from spectrasplat.model.lights import CollimatedLight
from spectrasplat.model.optics.glass import constant
from spectrasplat.model.optics.spectrum import laser
from spectrasplat.model.scene import Camera, Dielectric, Diffuse, RenderDefaults, Scene, SceneObject
from spectrasplat.reference.photon_reference import reference_key, render_reference
from spectrasplat.reference.polarised import amplitudes, begin_unpolarised, senkrecht, share_of, turn_fields


class Ray:
    """A reference's ray of polarised light, sent through chosen events."""

    def __init__(self, direction: np.ndarray) -> None:
        self.direction = direction / np.linalg.norm(direction)
        self.field = np.zeros((2, 3), complex)
        begin_unpolarised(self.field, tuple(self.direction))
        self.power = 1.0

    def meets(self, normal: np.ndarray, eta: float, reflects: bool) -> None:
        """Reflected or refracted at a plane, `normal` against the ray."""
        normal = normal / np.linalg.norm(normal)
        cosine = float(-self.direction @ normal)
        r_s, r_p, t_s, t_p = amplitudes(cosine, eta)
        a_s, a_p = (r_s, r_p) if reflects else (t_s, t_p)
        s = senkrecht(tuple(self.direction), tuple(normal))
        self.power *= share_of(self.field, tuple(self.direction), s, a_s, a_p)
        if reflects:
            turned = self.direction + 2.0 * cosine * normal
        else:
            turned = eta * self.direction + (eta * cosine - np.sqrt(1.0 - eta**2 * (1.0 - cosine**2))) * normal
        turned = turned / np.linalg.norm(turned)
        turn_fields(self.field, tuple(self.direction), tuple(turned), s, complex(a_s), complex(a_p))
        self.direction = turned

    @property
    def degree(self) -> float:
        """Of polarisation: by the eigenvalues of the coherency matrix."""
        matrix = np.einsum("ij,ik->jk", self.field, self.field.conj())
        return float(np.sqrt(max(2.0 * np.einsum("ij,ji", matrix, matrix).real - 1.0, 0.0)))


def shares(incidence: float, eta: float) -> tuple[float, float]:
    """Transmittance of s and p by the sine and tangent laws."""
    refraction = np.arcsin(eta * np.sin(incidence))
    both, apart = incidence + refraction, incidence - refraction
    return 1.0 - (np.sin(apart) / np.sin(both)) ** 2, 1.0 - (np.tan(apart) / np.tan(both)) ** 2


def incident(angle: float) -> np.ndarray:
    return np.array([np.sin(angle), 0.0, -np.cos(angle)])


UP = np.array([0.0, 0.0, 1.0])


SIDE = np.array([0.0, 1.0, 0.0])


def rotated(about: np.ndarray, angle: float, vector: np.ndarray) -> np.ndarray:
    """Rodrigues."""
    across = np.cross(about, vector)
    return vector * np.cos(angle) + across * np.sin(angle) + about * (about @ vector) * (1.0 - np.cos(angle))


def test_a_pile_of_plates_lets_p_through_at_brewsters_angle():
    n, plates = 1.5168, 6
    ray = Ray(incident(np.arctan(n)))
    for _ in range(plates):
        ray.meets(UP, 1.0 / n, False)
        ray.meets(UP, n, False)
    t_s, t_p = shares(np.arctan(n), 1.0 / n)
    assert t_p == pytest.approx(1.0)
    assert ray.power == pytest.approx(0.5 * (1.0 + t_s ** (2 * plates)), rel=1e-12)
    assert ray.degree == pytest.approx((1.0 - t_s ** (2 * plates)) / (1.0 + t_s ** (2 * plates)), rel=1e-9)


def test_planes_of_incidence_at_an_angle():
    """Of light that a first face let through, a second whose plane of incidence is turned by φ takes s and p by
    Malus's law; across each other, T_s T_p."""
    n, angle = 1.7, np.radians(62.0)
    t_s, t_p = shares(angle, 1.0 / n)
    assert t_p - t_s > 0.2
    for turn in (0.0, 0.3, 1.0, 0.5 * np.pi):
        ray = Ray(incident(angle))
        ray.meets(UP, 1.0 / n, False)
        # Into a medium n times denser still, so that the shares are the same.
        normal = rotated(ray.direction, turn, rotated(SIDE, angle, -ray.direction))
        ray.meets(normal, 1.0 / n, False)
        along, across = np.cos(turn) ** 2, np.sin(turn) ** 2
        wanted = 0.5 * (t_s * (along * t_s + across * t_p) + t_p * (across * t_s + along * t_p))
        assert ray.power == pytest.approx(wanted, rel=1e-9)
    assert ray.power == pytest.approx(t_s * t_p, rel=1e-9)


def test_fresnels_rhomb_turns_linear_into_circular_light():
    """Two total reflections of 45° retardance each: tan(δ/2) = cos θ √(sin²θ − 1/n²) / sin²θ [Born and Wolf, 1.5.4]."""
    n = 1.5168
    angle = np.radians(np.linspace(42.0, 50.0, 200001))
    retardance = 2.0 * np.arctan(np.cos(angle) * np.sqrt(np.sin(angle) ** 2 - n**-2) / np.sin(angle) ** 2)
    theta = angle[np.argmin(np.abs(retardance - np.radians(45.0)))]
    ray = Ray(incident(theta))
    p = np.cross(ray.direction, SIDE)
    ray.field[0], ray.field[1] = (SIDE + p) / np.sqrt(2.0), 0.0
    ray.meets(UP, n, True)
    e_s, e_p = ray.field[0] @ SIDE, ray.field[0] @ np.cross(ray.direction, SIDE)
    assert abs(np.angle(e_s / e_p)) == pytest.approx(np.radians(45.0), abs=1e-4)
    ray.meets(-UP, n, True)
    e_s, e_p = ray.field[0] @ SIDE, ray.field[0] @ np.cross(ray.direction, SIDE)
    assert abs(e_s) == pytest.approx(abs(e_p), rel=1e-9)
    assert abs(np.angle(e_s / e_p)) == pytest.approx(np.radians(90.0), abs=2e-4)
    assert ray.power == pytest.approx(1.0, rel=1e-12)


def test_what_is_not_reflected_is_let_through():
    """Energy, for any state of polarisation: both shares come from amplitudes of their own."""
    rng = np.random.default_rng(3)
    for _ in range(200):
        first, second = (Ray(rng.normal(size=3)) for _ in range(2))
        second.direction, second.field = first.direction.copy(), rng.normal(size=(2, 3)) + 1j * rng.normal(size=(2, 3))
        second.field -= np.outer(second.field @ first.direction, first.direction)
        second.field /= np.sqrt((np.abs(second.field) ** 2).sum())
        first.field = second.field.copy()
        normal = -first.direction + 0.9 * rng.normal(size=3)
        if first.direction @ normal > -0.05 * np.linalg.norm(normal):
            continue
        eta = rng.uniform(0.4, 1.0)
        first.meets(normal, eta, True)
        second.meets(normal, eta, False)
        assert first.power + second.power == pytest.approx(1.0, rel=1e-12)
        for ray in (first, second):
            assert np.abs(ray.field @ ray.direction).max() < 1e-12
            assert (np.abs(ray.field) ** 2).sum() == pytest.approx(1.0)


def slab_scene(n: float, angle: float, polarisation: bool) -> Scene:
    """A pencil of laser light through a wide slab onto a floor."""
    direction = incident(angle)
    light = CollimatedLight("pencil", laser(550.0, 1e12), tuple(-9.0 * direction), tuple(direction), radius=1e-6)
    lowered = np.eye(4)
    lowered[2, 3] = -6.0
    objects = (
        SceneObject("slab", primitives.box((40.0, 40.0, 1.0)), Dielectric(constant(n))),
        SceneObject("floor", primitives.plane(400.0, 400.0), Diffuse((0.8, 0.8, 0.8)), lowered),
    )
    camera = Camera((0.0, 0.0, 9.0), (0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0))
    return Scene("slab", camera, (light,), objects, render=RenderDefaults(polarisation=polarisation))


def test_a_slab_with_all_reflections_inside_it():
    """Each polarisation by itself: (1 − R) / (1 + R). Counts of 2^15 photons scatter by 2e-3."""
    n, angle = 2.0, np.radians(70.0)
    t = np.array(shares(angle, 1.0 / n))
    for polarisation, each in ((True, t), (False, t.mean())):
        picture = render_reference(slab_scene(n, angle, polarisation), 4, 4, photons=1 << 15)
        wanted = np.mean(each / (2.0 - each))
        assert picture.fates["deposited"] / picture.fates["emitted"] == pytest.approx(wanted, rel=8e-3)
    assert np.mean(t / (2.0 - t)) / (t.mean() / (2.0 - t.mean())) > 1.04


def test_references_are_kept_apart():
    scene = slab_scene(1.5, 1.0, True)
    plain = replace(scene, render=RenderDefaults())
    assert reference_key(scene, 4, 4, 8) != reference_key(plain, 4, 4, 8)
