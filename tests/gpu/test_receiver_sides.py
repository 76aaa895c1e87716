"""Light on one side of a sheet does not show on the other: a board in the sun over a mirror, which lights its underside
alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from spectrasplat.__main__ import main
from spectrasplat.base.image_io import read_image

SCENE = """
[camera]
kind = "orthographic"
position = [0.0, 0.0, {height}]
target = [0.0, 0.0, 1.0]
up = [0.0, 1.0, 0.0]
vertical_extent = 0.8
[[lights]]
kind = "directional"
direction = [1.0, 0.0, -1.0]
illuminance_lx = 100.0
[[objects]]
name = "mirror"
shape = "plane"
width = 8.0
height = 8.0
material = {{ kind = "mirror", reflectance = 1.0 }}
[[objects]]
name = "board"
{board}
material = {{ kind = "diffuse", colour = 0.8 }}
"""
FLAT = 'shape = "plane"\nwidth = 1.0\nheight = 1.0\nposition = [0.0, 0.0, 1.0]'
RADIANCE = 0.8 / np.pi * 100.0 * np.sqrt(0.5)


def strips(count: int = 16, bend: float = 0.02) -> str:
    """A bent board of so many strips: none but charts hold its map."""
    x = np.linspace(-0.5, 0.5, count + 1)
    vertices = [[float(at), y, 1.0 + bend * float(at) ** 2] for at in x for y in (-0.5, 0.5)]
    triangles = [corners for k in range(0, 2 * count, 2) for corners in ([k, k + 2, k + 3], [k, k + 3, k + 1])]
    return f'shape = "inline"\nvertices = {vertices}\ntriangles = {triangles}'


BOARDS = {
    "face up": FLAT,
    "face down": f"{FLAT}\nrotation_deg = [180.0, 0.0, 0.0]",
    "bent": strips(),
    # Neighbours in a file may be wound either way.
    "wound both ways": 'shape = "inline"\nvertices = [[-0.5, -0.5, 1], [0.5, -0.5, 1], [0.5, 0.5, 1], [-0.5, 0.5, 1]]\n'
    "triangles = [[0, 1, 2], [0, 3, 2]]",
}


@pytest.mark.parametrize(
    ("board", "method"), [*((board, "srd") for board in BOARDS), (next(iter(BOARDS)), "srd-photons")]
)
def test_only_the_lit_side_of_a_board_shows_it(
    commands_share_context: None, tmp_path: Path, board: str, method: str
) -> None:
    """In the middle of the picture, away from the outline: evenly lit from below, to 2 %, and black from above."""
    found = {}
    for side, height in (("above", 3.0), ("below", 0.5)):
        scene, output = tmp_path / f"{side}.toml", tmp_path / f"{side}.npy"
        scene.write_text(SCENE.format(height=height, board=BOARDS[board]))
        options = f"--size 32x32 --spp 4 --photons 4k --layer caustic --method {method}"
        assert main(["render", str(scene), "-o", str(output), *options.split()]) == 0
        found[side] = read_image(output).rgb[4:28, 4:28, 1]
    assert found["above"].max() == 0.0
    assert found["below"] == pytest.approx(RADIANCE, rel=0.02)
