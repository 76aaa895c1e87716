"""Pulling a colour: a synthetic prism whose colours lie on a line, where every answer can be written down."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from spectrasplat.base.errors import UserError
from spectrasplat.edit import pull as pulling
from spectrasplat.edit.stored_photons import StoredPhotons
from spectrasplat.model.geometry.mesh import make_mesh
from spectrasplat.model.local_dispersion import gain_at
from spectrasplat.model.optics import glass
from spectrasplat.model.optics.colorimetry import VISIBLE_NM, cmf_xyz
from spectrasplat.model.optics.glass import LINE_D_NM, with_gain
from spectrasplat.model.scene import Camera, Dielectric, Diffuse, Scene, SceneObject

FLINT = glass.from_abbe(1.78, 25.0, "flint")
CROWN = glass.from_abbe(1.52, 64.0, "crown")
VELOCITY = np.array([40.0, 0.0, 0.0])
UP = (0.0, 0.0, 1.0)
QUAD = make_mesh("quad", np.array([[-9.0, -9, 0], [9, -9, 0], [9, 9, 0], [-9, 9, 0]]), np.array([[0, 1, 2], [0, 2, 3]]))
FLOOR, PRISM, OTHER = range(3)


def scene(prism=FLINT, other=CROWN) -> Scene:
    items = (
        SceneObject("floor", QUAD, Diffuse()),
        SceneObject("prism", QUAD, Dielectric(prism)),
        SceneObject("lens", QUAD, Dielectric(other)),
    )
    return Scene("test", Camera((0, 0, 9), (0, 0, 0)), (), items)


def place_of(nm: float, dispersion=FLINT, velocity=VELOCITY) -> np.ndarray:
    """Where light lands; the d line at the origin."""
    return velocity * float(dispersion.index(nm) - dispersion.n_d)


def photons(
    count: int = 400, bands: int = 1, source: int = PRISM, velocity=VELOCITY, anchor_nm: float = 520.0
) -> StoredPhotons:
    """A white beam of width 0.02 through the flint, one record a photon and band."""
    rng = np.random.default_rng(5)
    edges = np.linspace(400.0, 700.0, bands + 1)
    band = np.arange(count) % bands
    jitter = np.column_stack([rng.normal(0.0, 0.01, (count, 2)), np.zeros(count)])
    return StoredPhotons(
        position=place_of(anchor_nm, velocity=velocity) + jitter,
        dposition_dn=np.broadcast_to(velocity, (count, 1, 3)).copy(),
        n_anchor=np.full((count, 1), float(FLINT.index(anchor_nm))),
        flux_w=np.full(count, 1e-3),
        source=np.full(count, source),
        receiver=np.full(count, FLOOR),
        band_nm=np.column_stack([edges[band], edges[band + 1]]),
        light=np.zeros(count, int),
        variables=(FLINT.index,),
        group_of_object={PRISM: 0},
    )


@pytest.mark.parametrize("bands", [1, 7])
@pytest.mark.parametrize("nm", [430.0, 480.0, 660.0])
def test_the_held_colour_follows_the_cursor(bands, nm) -> None:
    pull = pulling.begin_pull(photons(bands=bands), scene(), place_of(nm), UP, 0.05, FLOOR, nm)
    assert (pull.object_index, pull.receiver_index, pull.wavelength_nm) == (PRISM, FLOOR, nm)
    assert pull.reference == pytest.approx([0, 0, 0], abs=1e-9)
    side = 1.0 if nm < LINE_D_NM else -1.0
    assert pull.direction == pytest.approx([side, 0, 0])
    assert pulling.solve(pull, pull.start) == pytest.approx(1.0)
    target = 2.5 * place_of(nm) + [0.0, 0.3, 0.0]  # a drag off the line counts along it
    gain = pulling.solve(pull, target)
    assert gain == pytest.approx(2.5)
    assert place_of(nm, with_gain(FLINT, gain))[0] == pytest.approx(target[0])


def test_the_gain_is_held_in_its_range() -> None:
    pull = pulling.begin_pull(photons(), scene(), place_of(430.0), UP, 0.05, FLOOR, 430.0)
    assert pulling.solve(pull, (-1.0, 0.0, 0.0)) == 0.0
    assert pulling.solve(pull, (1e3, 0.0, 0.0)) == 10.0


def test_without_a_wavelength_the_place_itself_tells_it() -> None:
    pull = pulling.begin_pull(photons(), scene(), place_of(450.0), UP, 0.03, FLOOR)
    assert pull.wavelength_nm == pytest.approx(450.0, abs=6.0)
    assert pull.reference[0] == pytest.approx(0.0, abs=0.1 * abs(place_of(450.0)[0]))


def test_the_colour_of_the_picture_tells_the_wavelength() -> None:
    xyz = np.array([np.interp(470.0, VISIBLE_NM, column) for column in cmf_xyz().T])
    assert pulling.dominant_nm(xyz) == pytest.approx(470.0, abs=2.0)
    assert pulling.dominant_nm(np.array([0.95, 1.0, 1.09])) is None
    assert pulling.dominant_nm(np.array([0.5, 0.2, 0.5])) is None  # a purple
    assert pulling.dominant_nm(np.zeros(3)) is None
    pull = pulling.begin_pull(photons(), scene(), place_of(470.0), UP, 0.05, FLOOR, xyz=xyz)
    assert pull.wavelength_nm == pytest.approx(470.0, abs=2.0)


def two_sources() -> StoredPhotons:
    """The flint's rainbow along x, and twice as much light through the crown along y, crossing at 450 nm of both."""
    one, shift = photons(), place_of(450.0)
    velocity = np.array([0.0, 90.0, 0.0])
    other_position = (
        shift + velocity * float(CROWN.index(520.0) - CROWN.index(450.0)) + (one.position - place_of(520.0))
    )
    n = len(one.position)
    zero = np.zeros((n, 3))
    return StoredPhotons(
        position=np.concatenate([one.position, other_position]),
        dposition_dn=np.concatenate(
            [np.stack([one.dposition_dn[:, 0], zero], 1), np.stack([zero, zero + velocity], 1)]
        ),
        n_anchor=np.tile([float(FLINT.index(520.0)), float(CROWN.index(520.0))], (2 * n, 1)),
        flux_w=np.concatenate([one.flux_w, 2.0 * one.flux_w]),
        source=np.concatenate([one.source, np.full(n, OTHER)]),
        receiver=np.full(2 * n, FLOOR),
        band_nm=np.tile(one.band_nm, (2, 1)),
        light=np.zeros(2 * n, int),
        variables=(FLINT.index, CROWN.index),
        group_of_object={PRISM: 0, OTHER: 1},
    )


def test_the_most_important_glass_is_taken_or_the_selected_one() -> None:
    both = two_sources()
    point = place_of(450.0)
    most = pulling.begin_pull(both, scene(), point, UP, 0.05, FLOOR, 450.0)
    assert most.object_index == OTHER
    assert most.direction == pytest.approx([0, 1, 0])
    preferred = pulling.begin_pull(both, scene(), point, UP, 0.05, FLOOR, 450.0, prefer=PRISM)
    assert preferred.object_index == PRISM
    assert preferred.direction == pytest.approx([1, 0, 0])
    assert pulling.begin_pull(both, scene(), point, UP, 0.05, FLOOR, 450.0, prefer=FLOOR).object_index == OTHER


def test_light_first_met_by_a_mirror_belongs_to_the_glass_that_opens_it() -> None:
    pull = pulling.begin_pull(photons(source=FLOOR), scene(), place_of(450.0), UP, 0.05, FLOOR, 450.0)
    assert pull.object_index == PRISM


def test_one_glass_of_two_on_the_same_path() -> None:
    """A doublet: pulling one glass leaves the other's share of the displacement where it is."""
    one = photons()
    n = len(one.position)
    back = np.array([0.0, -30.0, 0.0])
    doublet = replace(
        one,
        dposition_dn=np.concatenate([one.dposition_dn, np.broadcast_to(back, (n, 1, 3))], axis=1),
        n_anchor=np.column_stack([one.n_anchor, np.full(n, float(CROWN.index(520.0)))]),
        position=one.position + back * float(CROWN.index(520.0) - CROWN.n_d),
        variables=(FLINT.index, CROWN.index),
        group_of_object={PRISM: 0, OTHER: 1},
    )
    by_crown = back * float(CROWN.index(440.0) - CROWN.n_d)
    point = place_of(440.0) + by_crown
    pull = pulling.begin_pull(doublet, scene(), point, UP, 0.05, FLOOR, 440.0)
    assert pull.reference == pytest.approx(by_crown, abs=1e-9)
    assert pull.direction == pytest.approx([1, 0, 0])
    whole = pulling.begin_pull(doublet, scene(), point, UP, 0.05, FLOOR, 440.0, local=True)
    assert whole.reference == pytest.approx([0, 0, 0], abs=1e-9)


@pytest.mark.parametrize(
    "point, nm, light, words",
    [
        ((5.0, 5.0, 0.0), 450.0, photons(), "no dispersed light"),
        ((0.0, 0.0, 0.0), LINE_D_NM, photons(), "hardly moves"),
        ((0.0, 0.0, 0.0), 450.0, photons().chosen(np.zeros(0, int)), "no dispersed light"),
        (place_of(450.0), 450.0, replace(photons(), group_of_object={}), "no dispersive glass"),
    ],
)
def test_where_there_is_nothing_to_pull_the_reason_is_said(point, nm, light, words) -> None:
    with pytest.raises(UserError, match=words):
        pulling.begin_pull(light, scene(), point, UP, 0.05, FLOOR, nm)


def test_a_glass_already_changed_is_pulled_from_its_gain() -> None:
    doubled = with_gain(FLINT, 2.0)
    shown = replace(
        photons(), variables=(doubled.index,)
    )  # traced with the plain glass, shown with twice its dispersion
    point = place_of(450.0, doubled)
    pull = pulling.begin_pull(shown, scene(doubled), point, UP, 0.05, FLOOR, 450.0)
    # To first order the d line's own landing point has not moved.
    assert pull.reference == pytest.approx([0, 0, 0], abs=1e-9)
    assert pull.gain_at_start == 2.0
    assert pulling.solve(pull, 1.5 * point) == pytest.approx(3.0)


def test_a_local_pull_lays_one_dab_and_moves_it() -> None:
    world = scene()
    pull = pulling.begin_pull(photons(), world, place_of(450.0), UP, 0.05, FLOOR, 450.0, local=True)
    assert pull.gain_at_start == 1.0
    for factor in (1.5, 3.0, 0.5):
        dabs = pulling.local_dabs(world.objects[FLOOR], pull, pulling.solve(pull, factor * place_of(450.0)), 0.2, 0.5)
        floor = replace(world.objects[FLOOR], local_dispersion=dabs)
        world = replace(world, objects=(floor, *world.objects[1:]))
        assert len(dabs) == 1
        assert gain_at(dabs, np.zeros((1, 3)))[0] == pytest.approx(factor)


def test_the_scene_is_edited_under_a_telling_name() -> None:
    pull = pulling.begin_pull(photons(), scene(), place_of(450.0), UP, 0.05, FLOOR, 450.0)
    edited, label = pulling.apply(scene(), pull, 2.0 * place_of(450.0), 0.2, 0.5)
    assert label == "Pull colour of prism"
    assert edited.objects[PRISM].material.dispersion.gain == pytest.approx(2.0)
    assert edited.objects[PRISM].material.dispersion.n_d == FLINT.n_d
