"""A plate whose picture is known is found, measured and refused where it must be."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from reference.caustic_plates import densities, picture, plate
from spectrasplat.base.errors import UserError
from spectrasplat.base.image_io import write_image
from spectrasplat.commands.lens import check
from spectrasplat.commands.opened import check_unread
from spectrasplat.model.geometry import primitives
from spectrasplat.model.geometry.mesh import Mesh
from spectrasplat.model.io.mesh_io import load_mesh, save_ply
from spectrasplat.model.optics.catalogue import find
from spectrasplat.model.optics.caustic_plate import landing, plate_of
from spectrasplat.model.optics.glass import LINE_C_NM, LINE_D_NM, LINE_F_NM
from spectrasplat.model.plate_check import check_plate

PMMA = find("PMMA")
DISTANCE, SIDE = 300.0, 100.0


def turned(mesh: Mesh) -> Mesh:
    """Its shaped side to -x."""
    return mesh.transformed(np.array([(0.0, 0, -1, 5), (0, 1.0, 0, 3), (1.0, 0, 0, 0), (0, 0, 0, 1)]))


def test_light_is_led_where_the_densities_say() -> None:
    found = plate_of(plate(DISTANCE, PMMA.n_d), PMMA)
    assert found.side == "+z" and found.size == pytest.approx((SIDE, SIDE))
    xy, flux = landing(found, DISTANCE, LINE_D_NM)
    for axis, density in enumerate(densities(40)):
        light = np.histogram(xy[:, axis] / SIDE, np.linspace(-0.5, 0.5, 41), weights=flux)[0]
        np.testing.assert_allclose(light / light.mean(), density, atol=0.12)
    # All but reflections at normal incidence, and nearly so.
    once = ((PMMA.n_d - 1.0) / (PMMA.n_d + 1.0)) ** 2
    assert flux.sum() / SIDE**2 == pytest.approx((1.0 - once) ** 2, abs=2e-3)


@pytest.mark.parametrize("flat_first", [True, False])
def test_a_wedge_bends_by_the_textbook(flat_first: bool) -> None:
    """Snell's law twice: asin(n sin α) − α from the flat side; the other way first by α, then out of the flat side."""
    alpha, n = 0.1, PMMA.n_d
    x = np.linspace(-0.5, 0.5, 5)
    bent = np.tile(x * np.tan(alpha), (5, 1)) + 2e-2 * x[:, None] ** 2
    xy, _ = landing(plate_of(primitives.height_field(bent, depth=0.2), PMMA), 1e4, LINE_D_NM, flat_first)
    inner = alpha - np.arcsin(np.sin(alpha) / n)
    expected = np.arcsin(n * np.sin(alpha)) - alpha if flat_first else np.arcsin(n * np.sin(inner))
    assert abs(np.arctan(xy[:, 0].mean() / 1e4)) == pytest.approx(expected, rel=2e-3)


def test_colours_part_by_the_dispersion() -> None:
    """To first order every displacement goes with n − 1."""
    found = plate_of(plate(DISTANCE, PMMA.n_d), PMMA)
    places = {nm: landing(found, DISTANCE, nm)[0] for nm in (LINE_F_NM, LINE_D_NM, LINE_C_NM)}
    moved = np.linalg.norm(places[LINE_D_NM] - found.points[:, :2], axis=1)
    apart = np.linalg.norm(places[LINE_F_NM] - places[LINE_C_NM], axis=1)
    share = float(np.subtract(*PMMA.index(np.array([LINE_F_NM, LINE_C_NM])))) / (PMMA.n_d - 1.0)
    assert apart.mean() / moved.mean() == pytest.approx(share, rel=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("shaped", ["+z", "-x"])
def test_a_plate_is_checked_against_its_target(tmp_path: Path, shaped: str) -> None:
    made = plate(DISTANCE, PMMA.n_d)
    save_ply(made if shaped == "+z" else turned(made), tmp_path / "plate.ply")
    wanted = picture() if shaped == "+z" else np.rot90(picture())
    write_image(tmp_path / "target.npy", wanted.astype(np.float32))
    report = check(tmp_path / "plate.ply", tmp_path / "target.npy", "PMMA", DISTANCE if shaped == "+z" else None, [])
    with pytest.raises(UserError, match=r"target\.npy.* choose another name"):
        check_unread(tmp_path / "target.npy")
    assert report.plate.side == shaped and report.flat_first
    assert report.distance == pytest.approx(DISTANCE, rel=0.1)
    assert report.focal_distance == pytest.approx(DISTANCE, rel=0.1)
    assert report.fit.correlation > 0.99 and report.error < 0.06
    assert report.width == pytest.approx(SIDE, rel=0.05) and 0.85 < report.efficiency < report.transmitted < 0.925
    assert 0.1 < report.blur < 0.3
    assert 3.0 < report.tilt_deg < 40.0 and 5.0 < min(report.nearer, report.farther)
    if shaped == "+z":
        assert report.fit.turn == 0
        mirrored = check_plate(
            load_mesh(tmp_path / "plate.ply"), PMMA, wanted[:, ::-1], DISTANCE, cancelled=lambda: True
        )
        assert mirrored.fit.turn == 4 and np.isnan(mirrored.tilt_deg)
        assert dict(mirrored.rows())["tolerance"].startswith("not measured")


@pytest.mark.slow
def test_how_a_blurred_picture_is_turned_is_not_said() -> None:
    """Far from its focus other turns are as like."""
    made = plate(DISTANCE, PMMA.n_d, resolution=61)
    for distance, is_said in ((DISTANCE, True), (3.0 * DISTANCE, False)):
        found = check_plate(made, PMMA, picture(), distance, cancelled=lambda: True)
        assert ("too unlike" not in dict(found.rows())["picture"]) is is_said


@pytest.mark.parametrize(
    "mesh, words",
    [
        (primitives.sphere(1.0, 2_000), "is no plate"),
        (primitives.box((1.0, 1.0, 1.0)), "a block and no plate"),
        (primitives.slab(), "both sides of 'slab' are flat"),
    ],
)
def test_what_is_no_plate_is_refused(mesh: Mesh, words: str) -> None:
    with pytest.raises(UserError, match=words):
        plate_of(mesh, PMMA)


def test_a_blank_target_is_refused() -> None:
    with pytest.raises(UserError, match="blank or a line"):
        check_plate(plate(DISTANCE, PMMA.n_d, resolution=21), PMMA, np.ones((20, 30, 3)), DISTANCE)
