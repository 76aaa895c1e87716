"""Lines over the picture: cut where the camera cannot see them, coloured by what runs in them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from spectrasplat.edit.projection import View
from spectrasplat.model.scene import Camera
from spectrasplat.ui.overlay import Canvas, box_corners, mixed_srgb
from spectrasplat.ui.panels.spectral_colour import spectral_srgb

CAMERA = Camera((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), vertical_fov_deg=90.0)


def canvas(camera: Camera = CAMERA) -> Canvas:
    return Canvas(None, View.of(camera, 2.0), 10.0, 20.0, 400.0, 200.0)  # type: ignore[arg-type]


def test_a_visible_segment_goes_to_its_pixels() -> None:
    segments = canvas().segments(np.array([[0.0, 1.0, 0.0], [1.0, 1.0, 0.5]]))
    assert segments.reshape(4) == pytest.approx([210, 120, 310, 70])


def test_what_lies_behind_is_cut_away() -> None:
    assert len(canvas().segments(np.array([[0.0, -1.0, 0.0], [1.0, -2.0, 0.5]]))) == 0
    segments, index = canvas().cut(np.array([[[0, -1.0, 0], [0, -2, 0]], [[0.1, 1.0, 0.1], [0.1, -1.0, 0.1]]]))
    assert index.tolist() == [1]
    assert np.isfinite(segments).all() and np.abs(segments).max() < 1000.0  # not the far side of the pole
    assert (segments[0, 1] - segments[0, 0]) @ [1.0, -1.0] > 0.0  # on towards where it came from: up and to the right


def test_an_orthographic_camera_sees_what_lies_behind_it() -> None:
    flat = canvas(replace(CAMERA, kind="orthographic", vertical_extent=2.0))
    assert flat.segments(np.array([[0.0, -1.0, 0.0], [1.0, -2.0, 0.5]])).reshape(4) == pytest.approx(
        [210, 120, 310, 70]
    )


def test_lines_that_leave_the_picture_keep_their_slope() -> None:
    ((start, end),) = canvas().segments(np.array([[0.0, 1.0, 0.0], [1e6, 1.0, 5e5]]))
    assert np.abs(end).max() < 1000.0
    assert (end - start)[1] / (end - start)[0] == pytest.approx(-0.5)


def test_all_wavelengths_together_are_white_and_one_is_its_own_colour() -> None:
    all_nm = tuple(np.linspace(400.0, 700.0, 9).tolist())
    assert mixed_srgb(all_nm, all_nm) == pytest.approx((1.0, 1.0, 1.0))
    assert mixed_srgb((all_nm[2],), all_nm) == pytest.approx(spectral_srgb()[round(all_nm[2]) - 380])
    red, _, blue = mixed_srgb(all_nm[6:], all_nm)
    assert red > 3.0 * blue
    assert mixed_srgb((550.0,), (550.0,)) == pytest.approx(spectral_srgb()[170])


def test_a_box_stands_as_its_object_does() -> None:
    matrix = np.diag([2.0, 1.0, 1.0, 1.0])
    matrix[:3, 3] = 5.0, 0.0, 0.0
    corners = box_corners(np.array([[0.0, 0, 0], [1, 2, 3]]), matrix)
    assert corners.min(axis=0) == pytest.approx([5, 0, 0]) and corners.max(axis=0) == pytest.approx([7, 2, 3])
