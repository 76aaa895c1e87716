"""The reference's crystals and polarisers: against Berreman's matrix, and answers that are known in closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest
from reference import crystals as berreman
from spectrasplat.model.geometry.mesh import make_mesh
from spectrasplat.model.geometry.primitives import box, plane
from spectrasplat.model.lights import CollimatedLight
from spectrasplat.model.optics.crystals import find_crystal
from spectrasplat.model.optics.spectrum import laser
from spectrasplat.model.scene import Black, Camera, Dielectric, Polariser, Scene, SceneObject
from spectrasplat.reference.crystals import FIELD_SHAPE, begin_in_crystal, solve_interface, take_wave, through_sheet
from spectrasplat.reference.photon_intersect import nearest
from spectrasplat.reference.photon_scene import photon_scene
from spectrasplat.reference.polarised import amplitudes, begin_unpolarised, senkrecht, share_of
from spectrasplat.reference.sampling import scratch
from spectrasplat.reference.scattering import AIR

from tests.unit.camera_scenes import scatter

UP = np.array([0.0, 0.0, 1.0])
NM = 589.3
CALCITE = find_crystal("calcite")
N_O, N_E = float(CALCITE.ordinary.index(NM)), float(CALCITE.extraordinary.index(NM))
VACUUM = (1.0, 1.0, (0.0, 0.0, 1.0), False)
Medium = tuple[float, float, tuple[float, ...], bool]


def unit(vector: object) -> np.ndarray:
    return np.asarray(vector, float) / np.linalg.norm(np.asarray(vector, float))


def crystal(axis: object, n_o: float = N_O, n_e: float = N_E) -> Medium:
    return n_o, n_e, tuple(unit(axis)), True


class Light:
    """A ray with its fields, taken through chosen waves."""

    def __init__(self, direction: object, medium: Medium = VACUUM, is_extraordinary: bool = False) -> None:
        self.direction, self.medium = unit(direction), medium
        self.field = np.zeros(FIELD_SHAPE, complex)
        if medium[3]:
            begin_in_crystal(self.field, tuple(self.direction), *medium[:3], is_extraordinary)
        else:
            begin_unpolarised(self.field, tuple(self.direction))

    def polarised_along(self, across: object) -> Light:
        self.field[0, :3], self.field[1, :3] = unit(across), 0.0
        return self

    def shares(self, normal: object, behind: Medium) -> np.ndarray:
        """Of power: two reflected, two transmitted."""
        found = solve_interface(self.field, tuple(self.direction), tuple(unit(normal)), self.medium, behind)
        return np.array(found)

    def meets(self, normal: object, behind: Medium, wave: int) -> float:
        """Go on as a wave (0, 1: reflected; 2, 3: ordinary, extraordinary beyond): its share."""
        share = self.shares(normal, behind)[wave]
        self.medium = self.medium if wave < 2 else behind
        self.direction = np.array(take_wave(self.field, wave, self.medium))
        return float(share)


def random_interfaces(count: int, least: float) -> list[tuple[Light, np.ndarray, Medium, bool]]:
    """Light that comes to a normal (cosine of at least `least`) from any medium, and what is behind."""
    rng, found = np.random.default_rng(5), []
    while len(found) < count:
        media = [
            (n, n, (0.0, 0.0, 1.0), False)
            if rng.random() < 0.3
            else crystal(rng.normal(size=3), *rng.uniform(1.2, 2.6, 2))
            for n in rng.uniform(1.0, 2.0, 2)
        ]
        second_kind = bool(rng.random() < 0.5)
        light, normal = Light(rng.normal(size=3), media[0], second_kind), unit(rng.normal(size=3))
        cosine = float(light.direction @ normal)
        if abs(cosine) > least:
            found.append((light, normal * -np.sign(cosine), media[1], second_kind))
    return found


def test_energy_at_every_interface() -> None:
    """To 1e-10, whatever comes from and goes into what; and light goes along Poynting's vector, across its field."""
    for light, normal, behind, _ in random_interfaces(3000, 0.02):
        shares = light.shares(normal, behind)
        assert abs(shares.sum() - 1.0) < 1e-10 and shares.min() > -1e-12
        wave = int(shares.argmax())
        light.meets(normal, behind, wave)
        assert (light.direction @ normal > 0.0) == (wave < 2)
        assert np.abs(light.field[:2, :3] @ light.direction).max() < 1e-9


def test_shares_and_rays_are_berremans() -> None:
    """Eigenvectors of his matrix know no ordinary wave."""
    tried = 0
    for light, normal, behind, second_kind in random_interfaces(600, 0.05):
        if not (light.medium[3] and behind[3]):
            continue
        k = light.field[2, :3].real
        along = k - (k @ normal) * normal
        q = float(np.linalg.norm(along))
        frame = np.stack([along / q, np.cross(-normal, along / q), -normal])
        sides = [berreman.permittivity(frame @ np.array(m[2]), *m[:2]) for m in (light.medium, behind)]
        waves = [berreman.waves(e, q, m[0]) for e, m in zip(sides, (light.medium, behind), strict=True)]
        incident = int(second_kind)
        if not waves[0].passes[:2].all():
            continue
        wanted = np.abs(berreman.amplitudes(*waves, waves[0].fields[:, incident : incident + 1])[:, 0]) ** 2
        np.testing.assert_allclose(light.shares(normal, behind), wanted, atol=1e-7)
        for wave in (2, 3):
            if wanted[wave] > 1e-3:
                ray = frame.T @ waves[1].poynting(wave - 2, q, sides[1])
                np.testing.assert_allclose(take_wave(light.field, wave, behind), ray, atol=1e-7)
                tried += 1
    assert tried > 200


@pytest.mark.parametrize("n", [0.6, 1.5, 2.4])
@pytest.mark.parametrize("degrees", [0.0, 30.0, 56.3, 85.0])
def test_equal_indices_are_fresnels(n: float, degrees: float) -> None:
    """Both waves of a crystal whose indices are equal together, and a glass by these equations."""
    light = Light([math.sin(math.radians(degrees)), 0.0, -math.cos(math.radians(degrees))])
    r_s, r_p, _, _ = amplitudes(-light.direction[2], 1.0 / n)
    wanted = share_of(light.field, tuple(light.direction), senkrecht(tuple(light.direction), tuple(UP)), r_s, r_p)
    for behind in ((n, n, (0.0, 0.0, 1.0), False), crystal([1.0, 2.0, 3.0], n, n), crystal(UP, n, n)):
        shares = light.shares(UP, behind)
        assert shares[:2].sum() == pytest.approx(wanted, abs=1e-12)
        assert shares.sum() == pytest.approx(1.0, abs=1e-12)


def test_malus_and_wave_plates() -> None:
    """Half of unpolarised light passes a polariser, cos² of that another one; between crossed ones a plate lets
    sin² 2φ sin² δ/2 through, and a quarter-wave plate at 45° makes light circular."""
    for turn in np.radians([0.0, 20.0, 60.0, 90.0]):
        light = Light(-UP)
        assert through_sheet(light.field, tuple(-UP), (1.0, 0.0, 0.0), 1.0, 0.0, 0.0) == pytest.approx(0.5)
        second = (math.cos(turn), math.sin(turn), 0.0)
        assert through_sheet(light.field, tuple(-UP), second, 1.0, 0.0, 0.0) == pytest.approx(math.cos(turn) ** 2)
    for turn in np.radians([10.0, 45.0]):
        for waves in (0.1, 0.25, 0.5, 3.3):
            light = Light(-UP).polarised_along([1.0, 0.0, 0.0])
            plate = (math.cos(turn), math.sin(turn), 0.0)
            assert through_sheet(light.field, tuple(-UP), plate, 1.0, 1.0, waves) == pytest.approx(1.0)
            passed = through_sheet(light.field, tuple(-UP), (0.0, 1.0, 0.0), 1.0, 0.0, 0.0)
            assert passed == pytest.approx((math.sin(2.0 * turn) * math.sin(math.pi * waves)) ** 2, abs=1e-12)
    light = Light(-UP).polarised_along([1.0, 0.0, 0.0])
    through_sheet(light.field, tuple(-UP), tuple(unit([1.0, 1.0, 0.0])), 1.0, 1.0, 0.25)
    for turn in np.radians([0.0, 35.0, 77.0]):
        axis = np.array([math.cos(turn), math.sin(turn), 0.0])
        assert (np.abs(light.field[:2, :3] @ axis) ** 2).sum() == pytest.approx(0.5)


# -- paths through scenes ---------------------------------------------------------------------


def scene_of(*things: SceneObject) -> Scene:
    beam = CollimatedLight("beam", laser(NM, 1.0), (0.0, 0.0, 5.0), (0.0, 0.0, -1.0), radius=0.1)
    return Scene("test", Camera((0.0, -5.0, 2.0), (0.0, 0.0, 0.0)), (beam,), things)


def lands(scene: Scene, start: tuple[float, float, float], draws: int) -> dict[tuple[float, ...], float]:
    """Share of a ray's power by where it ends (x, y): −z from `start`, at evenly spread chances of one event each."""
    photons, centre = photon_scene(scene)
    memory, found = scratch(), {}
    rng = np.random.default_rng(0)
    for _ in range(draws):
        place, way, share = np.array(start) - centre, (0.0, 0.0, -1.0), 1.0
        begin_unpolarised(memory.field, way)
        last, within, mask, alone = -1, False, np.uint64(0), AIR
        while True:
            t, surface, u, v = nearest(photons, tuple(place), way, last, within, mask, memory)
            if surface < 0:
                break
            place, last = place + t * np.array(way), surface
            if photons.kind[photons.owner[surface]] == 0:
                spot = tuple(np.round((place + centre)[:2], 6) + 0.0)
                found[spot] = found.get(spot, 0.0) + share / draws
                break
            way, mask, alone, within, _, kept, _ = scatter(
                photons, surface, tuple(place), u, v, way, mask, alone, NM, rng.random(), np.uint64(1), 0, memory.field
            )
            share *= kept
    return found


def spar(axis: object) -> Dielectric:
    return Dielectric(CALCITE.ordinary, extraordinary=CALCITE.extraordinary, axis=tuple(unit(axis)))


def placed(name: str, z: float) -> np.ndarray:
    matrix = np.eye(4)
    matrix[2, 3] = z
    return matrix


FLOOR = SceneObject("floor", plane(50.0, 50.0), Black(), placed("floor", -3.0))


def test_crossed_polarisers_are_dark_and_a_third_brings_light() -> None:
    sheets = [
        SceneObject(f"sheet {i}", plane(2.0, 2.0), Polariser(axis=tuple(unit(axis))), placed("sheet", 1.0 - i))
        for i, axis in enumerate(([1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]))
    ]
    (passed,) = lands(scene_of(*sheets, FLOOR), (0.0, 0.1, 3.0), 1).values()
    assert passed == pytest.approx(0.125, abs=1e-12)
    (dark,) = lands(scene_of(sheets[0], sheets[2], FLOOR), (0.0, 0.1, 3.0), 1).values()
    assert dark < 1e-12


def test_wollastons_prism_as_two_solids_that_touch() -> None:
    """Most light lands where closed forms send the two rays, half of it each: the interface is one of two crystals."""
    angle, plate = math.radians(30.0), box((2.0, 2.0, 1.0))
    cut = plate.vertices[:, 0] * -math.tan(angle)
    wedges = []
    for axis, (top, bottom) in (([1.0, 0.0, 0.0], (1.0, cut)), ([0.0, 1.0, 0.0], (cut, -1.0))):
        vertices = plate.vertices.copy()
        vertices[:, 2] = np.where(vertices[:, 2] > 0.0, top, bottom)
        wedges.append(SceneObject(f"wedge {axis}", make_mesh("wedge", vertices, plate.triangles), spar(axis)))
    found = lands(scene_of(*wedges, FLOOR), (0.0, 0.1, 3.0), 1000)
    spots = sorted(found.items(), key=lambda each: -each[1])[:2]
    assert sum(share for _, share in spots) > 0.85 and abs(spots[0][1] - spots[1][1]) < 0.06
    wanted = []
    for n_1, n_2 in ((N_E, N_O), (N_O, N_E)):
        inside = math.asin(n_1 * math.sin(angle) / n_2) - angle
        wanted.append(abs(math.tan(inside) + 2.0 * math.tan(math.asin(n_2 * math.sin(inside)))))
    np.testing.assert_allclose(sorted(abs(spot[0]) for spot, _ in spots), sorted(wanted), atol=1e-5)
    assert spots[0][0][0] * spots[1][0][0] < 0.0
