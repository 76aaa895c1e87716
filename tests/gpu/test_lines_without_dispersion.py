"""A lamp of several emission lines before facets that do not disperse: all its lines go the same way."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.settings import RenderSettings
from spectrasplat.reference.photon_reference import cached_reference
from spectrasplat.render.still import render

from tests.unit.scene_texts import load

SCENE = """
[camera]
position = [-0.5, -2.7, 6.9]
target = [0.2, 0.2, 0.0]
vertical_fov_deg = 40.0
[[lights]]
kind = "{kind}"
position = [-4.2, -1.0, 4.4]
spectrum = {{ lines = [[450.0, 1.0], [546.1, 2.0], [611.0, 1.5]] }}
{lamp}
[[objects]]
name = "block"
shape = "box"
size = [0.52, 0.81, 0.31]
material = {{ n_d = 1.92{tint} }}
rotation_deg = [43.0, 216.0, 303.0]
rests_at_z = {height}
[[objects]]
name = "table"
shape = "plane"
width = 8.0
height = 8.0
material = "diffuse"
"""
WIDE = 'target = [0.0, 0.0, 0.3]\nshape = "rectangle"\nsize = [0.57, 0.71]\nflux_lm = 53000.0'


@pytest.mark.parametrize(
    ("kind", "lamp", "tint"),
    [
        ("point", "intensity_cd = 9000.0", ""),
        ("area", WIDE, ", absorption = { colour = [0.9, 0.3, 0.4], distance = 0.3 }"),
    ],
)
def test_all_lines_of_a_lamp_are_drawn(gl, tmp_path: Path, tint: str, kind: str, lamp: str) -> None:
    """What beams left to photons had no band of the spectral tables, and ended in a traceback; now the strongest line's
    stand for all. Each channel of the light in all is within 1 %."""
    scene = load(tmp_path, SCENE.format(kind=kind, lamp=lamp, tint=tint, height=0.2))
    settings = RenderSettings(96, 54, layer="caustic", photons=60_000)
    picture = render(scene, settings, context=gl).rgb.astype(float).sum(axis=(0, 1))
    xyz = cached_reference(scene, 96, 54, photons=400_000).xyz.sum(axis=(0, 1))
    to_rgb = np.array([[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]])
    assert picture == pytest.approx(to_rgb @ xyz, rel=0.02)


def test_light_that_pilot_photons_missed_is_kept(gl, tmp_path: Path) -> None:
    """A path through a block that begins in one corner of a wide lamp, and is totally reflected twice: 0.7 % of the
    light, far from the rest. Pilot photons did not find it, and maps ended where theirs had."""
    path = tmp_path / "scene.toml"
    text = SCENE.format(kind="area", lamp=WIDE, tint="", height=1.19)
    path.write_text(text.replace("material = { n_d = 1.92 }", 'glass = "N-SF66"'))
    scene = load_scene(path)
    settings = RenderSettings(96, 54, layer="caustic", photons=100_000)
    picture = render(scene, settings, context=gl).rgb @ [0.2126, 0.7152, 0.0722]
    reference = cached_reference(scene, 96, 54, photons=400_000).xyz[..., 1]
    far = np.s_[:8, 24:40]
    assert reference[far].sum() > 0.003 * reference.sum()
    assert picture[far].sum() == pytest.approx(reference[far].sum(), rel=0.25)
