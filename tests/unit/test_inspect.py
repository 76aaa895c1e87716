"""`inspect` says what a scene holds in true numbers."""

from __future__ import annotations

import io
import math
from pathlib import Path

import pytest
from rich.console import Console
from spectrasplat.commands.inspect_report import inspect, inspect_text, light_flux
from spectrasplat.commands.scenes import find_scene
from spectrasplat.commands.table import Inspect
from spectrasplat.features.receivers import picture_bytes
from spectrasplat.features.row import size_words
from spectrasplat.gpu.texture_store import _sources
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.scene import Scene

from tests.unit.scene_texts import load

SCENE = """
[[objects]]
name = "gem"
shape = "brilliant"
glass = "diamond"
rests_at_z = 0.5
[[objects]]
name = "ball"
shape = "sphere"
triangles = 320
material = {{ n_d = 1.7, V_d = 30.0, absorption = {{ colour = [0.5, 0.9, 0.9], distance = 1.0 }}, priority = 4 }}
position = [3, 0, 0]
[[objects]]
name = "floor"
shape = "plane"
width = 20
height = 10
position = [0, 0, -3]
material = {{ kind = "diffuse", colour = 0.18 }}
[[lights]]
{light}
"""
LAMP = (
    'name = "lamp"\nkind = "spot"\nposition = [0, 0, 9]\nhalf_angle_deg = 60\nspectrum = {blackbody = 3200}\n'
    "flux_lm = 900"
)


def scene(tmp_path: Path, light: str = LAMP) -> Scene:
    return load(tmp_path, SCENE.format(light=light))


def said(value: Scene) -> str:
    page = io.StringIO()
    Console(file=page, width=200).print(inspect_text(value))
    return page.getvalue()


def row(text: str, name: str) -> str:
    """The table row that begins with `name`."""
    return next(line for line in text.splitlines() if line.startswith(f"│ {name} "))


def test_objects_glasses_and_lights_are_listed_with_their_numbers(tmp_path: Path) -> None:
    text = said(scene(tmp_path))
    assert "bounds 20 × 10 × " in text
    gem = row(text, "gem")
    assert "110" in gem and "diamond" in gem and "flat" in gem and "watertight" in gem
    ball = row(text, "ball")
    assert "320" in ball and "1 × 1 × 1 about (3, 0, 0)" in ball and "absorbing, priority 4" in ball
    assert "smooth" in ball
    assert "4 boundary edges" in row(text, "floor") and "diffuse 0.18" in row(text, "floor")
    assert "2.417486" in text and "55.30" in text and "226–760 nm" in text
    lamp = row(text, "lamp")
    assert "spot, half angle 60°, hard edge" in lamp and "black body 3200 K" in lamp
    # 900 lm over 2π (1 - cos 60°) = π steradian
    assert f"{900 / math.pi:.5g} cd" in lamp and "900 lm" in lamp


def test_features_come_with_their_reasons(tmp_path: Path) -> None:
    text = said(scene(tmp_path))
    assert " in " in row(text, "spectral columns") and "2 column(s)" in row(text, "spectral columns")
    assert " in " in row(text, "absorption") and " out " in row(text, "mirrors")
    assert "gem" in row(text, "half-space solids")


def test_features_that_are_in_tell_what_they_add(tmp_path: Path) -> None:
    text = said(scene(tmp_path))
    # Two vec4 a column in a ray, one in a photon; both lists hold two glasses.
    assert "64 B a ray, 32 B a photon" in row(text, "spectral columns") and "64 B a ray" in row(text, "spatial columns")
    assert "16 B a ray, 32 tables" in row(text, "tint levels")
    assert "73 planes" in row(text, "half-space solids")
    assert " B" not in row(text, "mirrors")
    # Both glasses stand before the camera: the maps hold eight spectral channels beside XYZ.
    assert "32 B a texel" in row(text, "spectral maps") and "a second program" in row(text, "camera refraction")
    assert (
        "A ray is 240 bytes with 4 derivative column(s), a photon record 128, its splats 432, a map's texel 48."
        in " ".join(text.split())
    )


def test_notes_of_the_loader_are_shown(tmp_path: Path) -> None:
    value = scene(tmp_path)
    text = " ".join(said(value).split())
    assert "Note: No camera given" in text and "226 to 760 nm" in text
    assert len(value.notes) == text.count("Note: ")


@pytest.mark.parametrize(
    ("light", "words", "lumen"),
    [
        ('kind = "point"\nposition = [0, 0, 9]\nspectrum = {laser = 532}\nflux_lm = 5', "laser 532 nm", 5.0),
        ('kind = "area"\nposition = [0, 0, 9]\nsize = [2, 3]\nluminance_nt = 7', "D65", 7.0 * 6.0 * math.pi),
        (
            'kind = "collimated"\nposition = [0, 0, 9]\nradius = 2\nspectrum = "A"\nilluminance_lx = 7',
            "A",
            28.0 * math.pi,
        ),
        (
            'kind = "directional"\ndirection = [0, 0, -1]\nspectrum = {lines = [[450, 1], [650, 1]]}',
            "lines at 450, 650 nm",
            None,
        ),
        (
            'kind = "directional"\ndirection = [0, 0, -1]\nspectrum = {nm = [400, 700], values = [0, 1]}',
            "table 401–700 nm",
            None,
        ),
    ],
)
def test_spectra_and_fluxes_in_words(tmp_path: Path, light: str, words: str, lumen: float | None) -> None:
    value = scene(tmp_path, f'name = "lamp"\n{light}')
    assert f" {words} " in row(said(value), "lamp")
    flux = light_flux(value.lights[0])
    assert (flux is None) == (lumen is None)
    if flux is not None:
        assert flux[0] == pytest.approx(lumen, rel=1e-12)


def test_pictures_are_listed_with_their_memory() -> None:
    text = said(load_scene(find_scene("lens_text")))
    assert "wears a picture" in row(text, "page") and " in " in row(text, "textures")
    assert " out " in row(text, "environment map")
    studio = said(load_scene(find_scene("brilliant_studio")))
    assert "about 12.0 MiB" in row(studio, "environment map") and " out " in row(studio, "textures")


@pytest.mark.parametrize("name", ["lens_text", "brilliant_studio"])
def test_memory_told_is_what_is_packed(name: str) -> None:
    (source,) = _sources(load_scene(find_scene(name)))
    assert picture_bytes(source.owner) == pytest.approx(16 * math.prod(source.cell), rel=0.02)  # a row a level more
    assert size_words(picture_bytes(source.owner)) in said(load_scene(find_scene(name)))


def test_lights_of_a_panorama_are_told_with_what_follows_from_them(capsys: pytest.CaptureFixture[str]) -> None:
    assert inspect(Inspect(scene="prism_sill")) == 0
    text = capsys.readouterr().out
    assert "area rectangle" in row(text, "window of the panorama")
    # The sill is taken apart into flat faces, so that no photon is needed.
    assert " out " in row(text, "lamp columns") and " in " in row(text, "beams")
    assert " out " in row(text, "charts") and "sill and sill" not in text
