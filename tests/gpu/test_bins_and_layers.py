"""What a user asks of `render`, each option against a number it must bring about, on small scenes.

The command line runs in this process.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from spectrasplat.__main__ import main
from spectrasplat.base.image_io import Picture, channel_name, read_image
from spectrasplat.model.optics.colorimetry import K_M, VISIBLE_NM, cmf_xyz, xyz_to_rgb709

Render = Callable[..., Picture]
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
"""Y of linear Rec.709 (IEC 61966-2-1)."""

BEAM = """
[camera]
kind = "orthographic"
position = [0.0, -4.0, 2.0]
target = [0.0, 0.0, 0.0]
vertical_extent = 3.0
[[lights]]
kind = "collimated"
position = [{x}, 0.0, 4.0]
direction = [0.0, 0.0, -1.0]
radius = 0.2
spectrum = "{spectrum}"
illuminance_lx = 100.0
{objects}
[[objects]]
name = "floor"
shape = "plane"
width = 6.0
height = 6.0
material = {{ kind = "diffuse", colour = 0.8 }}
"""
LIGHT_ALONE = "--layer map:floor"
"""Where only the light's balance is asked for: no camera's picture, and so none of its programs."""
SLAB = (
    '[[objects]]\nshape = "slab"\nwidth = 1.0\nheight = 1.0\nthickness = 1.0\nposition = [0.0, 0.0, 2.5]\n'
    "material = {{ n_d = 1.5{} }}\n"
)
PRISM = '[[objects]]\nname = "prism"\nshape = "prism"\nglass = "N-SF11"\nrests_at_z = 0.01\n'


def beam(objects: str, x: float = 0.0, spectrum: str = "D65") -> str:
    return BEAM.format(objects=objects, x=x, spectrum=spectrum)


PRISM_SCENE = beam(PRISM, x=0.25)


@pytest.fixture
def render(commands_share_context: None, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Render:
    """`spectrasplat render SCENE -o out.SUFFIX --size 64x36 --photons 10k --spp 1 --method srd-photons OPTIONS`, and
    what it wrote (beams would take ten times as long).

    The function's `said` then holds stdout, its `notes` stderr.
    """

    def call(scene: str | Path, options: str = "", suffix: str = ".npy") -> Picture:
        output = tmp_path / f"out{suffix}"
        if isinstance(scene, str):
            (tmp_path / "scene.toml").write_text(scene)
            scene = tmp_path / "scene.toml"
        usual = "--size 64x36 --spp 1 " + ("" if "--seconds" in options or "--photons" in options else "--photons 10k ")
        usual += "" if "--method" in options else "--method srd-photons "
        assert main(["render", str(scene), "-o", str(output), *(usual + options).split()]) == 0
        captured = capsys.readouterr()
        call.said, call.notes = captured.out, captured.err  # type: ignore[attr-defined]
        picture = read_image(output)
        assert np.isfinite(picture.rgb).all() and picture.rgb.max() > 0.0
        return picture

    return call


def luminance(picture: Picture) -> np.ndarray:
    return picture.rgb.astype(np.float64) @ LUMINANCE


def share(render: Render, name: str) -> float:
    """A line of `--stats`, as a share of the emitted flux."""
    found = re.search(rf"^\s*{name}\s+(-?[\d.e+-]+)", render.said, re.MULTILINE)  # type: ignore[attr-defined]
    assert found is not None, render.said  # type: ignore[attr-defined]
    return float(found[1])


def stack_transmittance(*indices: float) -> float:
    """Incoherent transmittance of parallel interfaces at normal incidence, with all reflections between them."""
    transmitted, reflected_back = 1.0, 0.0  # of the layers so far, and seen from below
    for above, below in itertools.pairwise(indices):
        r = ((above - below) / (above + below)) ** 2
        echo = 1.0 / (1.0 - reflected_back * r)
        reflected_back = r + (1.0 - r) ** 2 * reflected_back * echo
        transmitted *= (1.0 - r) * echo
    return transmitted


# -- spectral bins and layers ---------------------------------------------------------------


def test_bins_are_named_and_add_up_to_the_picture(render: Render) -> None:
    bins = 8
    scene = beam(PRISM, x=0.25, spectrum="E")  # flat inside a bin, so that its mean colour is exact
    spectral = render(scene, f"--layer caustic --photons 20k --bins {bins}", ".exr")
    plain = render(scene, "--layer caustic --photons 20k", ".exr")
    edges = np.linspace(VISIBLE_NM[0], VISIBLE_NM[-1], bins + 1)
    centres = 0.5 * (edges[1:] + edges[:-1])
    assert spectral.spectral is not None and spectral.spectral.shape == (36, 64, bins)
    assert [channel_name(nm) for nm in spectral.wavelengths_nm] == [channel_name(nm) for nm in centres]
    assert plain.spectral is None
    xyz = np.zeros(3)
    for i, watts in enumerate(spectral.spectral.sum(axis=(0, 1), dtype=np.float64)):
        fine = np.linspace(edges[i], edges[i + 1], 201)
        mean = np.array([np.trapezoid(np.interp(fine, VISIBLE_NM, curve), fine) for curve in cmf_xyz().T]) / np.ptp(
            fine
        )
        xyz += K_M * watts * mean
    total = plain.rgb.sum(axis=(0, 1), dtype=np.float64)
    assert xyz_to_rgb709(xyz) == pytest.approx(total, rel=0.03)
    assert spectral.rgb.sum(axis=(0, 1)) == pytest.approx(total, rel=0.03)


def test_bins_hold_the_spectrum_of_the_light(render: Render) -> None:
    """A laser's light is in its bin alone."""
    scene = PRISM_SCENE.replace('"D65"', "{ laser = 532 }")
    picture = render(scene, "--layer caustic --bins 8", ".exr")
    watts = picture.spectral.sum(axis=(0, 1))
    assert watts.argmax() == np.abs(picture.wavelengths_nm - 532).argmin()
    assert watts.max() == pytest.approx(watts.sum(), rel=1e-6)


def test_caustic_layer_is_beauty_without_direct_light(render: Render) -> None:
    # A beam wider than the slab: a bright ring round it, which is no caustic.
    scene = beam(
        SLAB.format("").replace("1.0\nheight = 1.0", "0.3\nheight = 0.3").replace("thickness = 1.0", "thickness = 0.2")
    )
    scene = scene.replace("vertical_extent = 3.0", "vertical_extent = 0.6")  # a ring of some pixels
    caustic, beauty = luminance(render(scene, "--layer caustic")), luminance(render(scene))
    assert 0.0 < caustic.sum() < 0.95 * beauty.sum()
    assert (caustic <= beauty + 1e-3 * beauty.max()).all()


def test_map_layer_is_the_receivers_irradiance(render: Render) -> None:
    """Under a plane-parallel slab the map shows the beam: its illuminance times the slab's transmittance."""
    picture = render(beam(SLAB.format("")), "--layer map:floor --photons 40k")
    inside = np.median(luminance(picture)[luminance(picture) > 50.0])
    assert inside == pytest.approx(100.0 * stack_transmittance(1.0, 1.5, 1.0), rel=0.03)


def test_a_map_is_asked_from_a_receiver(render: Render, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "scene.toml").write_text(PRISM_SCENE)
    assert main(["render", str(tmp_path / "scene.toml"), "-o", str(tmp_path / "x.npy"), "--layer", "map:prism"]) == 2
    told = capsys.readouterr().err
    assert "'map:prism' names no receiver" in told and "'map:floor'" in told
    assert not (tmp_path / "x.npy").exists()


# -- the other options -----------------------------------------------------------------------


def test_exposure_is_for_the_png_alone(render: Render) -> None:
    assert np.array_equal(render(PRISM_SCENE).rgb, render(PRISM_SCENE, "--exposure 2").rgb)
    dark, bright = (render(PRISM_SCENE, f"--exposure {ev}", ".png").rgb.mean() for ev in (-2, 2))
    assert bright > 2.0 * dark


def test_depth_darkens(render: Render) -> None:
    """One event leads into the slab and never out; two let most light through; the rest needs more."""
    scene = beam(SLAB.format(""))
    wide = scene.replace("radius = 0.2", "radius = 1.5")  # lights the floor round the slab's shadow as well
    shallow, deep = (luminance(render(wide, f"--max-depth {depth}")).sum() for depth in (1, 64))
    assert 0.5 * deep < shallow < 0.95 * deep
    render(scene, "--max-depth 2 --stats")
    two, lost = share(render, "deposited"), share(render, "lost_depth")
    assert two == pytest.approx((4.0 * 1.5 / 2.5**2) ** 2, abs=0.005) and lost > 0.0
    render(scene, "--stats")
    assert two < share(render, "deposited") == pytest.approx(stack_transmittance(1.0, 1.5, 1.0), abs=0.003)
    assert share(render, "lost_depth") == pytest.approx(0.0, abs=1e-6)


# -- materials and ways to open a scene --------------------------------------------------------


def test_water_in_a_glass(render: Render) -> None:
    """Nested solids: the water reaches into the wall, where the glass has priority."""
    outer = (
        '[[objects]]\nname = "glass"\nshape = "slab"\nthickness = 1.0\nposition = [0, 0, 1]\n'
        "material = { n_d = 1.6, priority = 2 }\n"
    )
    # A glass tank whose hollow is a second shell, facing inward; the water overlaps 0.05 of all walls.
    hollow = (
        '[[objects]]\nname = "air"\nshape = "box"\nsize = [0.8, 0.8, 0.6]\nposition = [0, 0, 1]\n'
        "material = { n_d = 1.0, priority = 3 }\n"
    )
    water = (
        '[[objects]]\nname = "water"\nshape = "box"\nsize = [0.8, 0.8, 0.6]\nposition = [0, 0, 1]\n'
        "material = { n_d = 1.333, priority = 3 }\n"
    )
    for inner, index in ((hollow, 1.0), (water, 1.333)):
        render(beam(outer + inner), f"{LIGHT_ALONE} --stats")
        assert share(render, "deposited") == pytest.approx(stack_transmittance(1.0, 1.6, index, 1.6, 1.0), abs=0.005)


def test_overlap_belongs_to_the_higher_priority(render: Render) -> None:
    lower = (
        '[[objects]]\nname = "a"\nshape = "slab"\nthickness = 0.6\nposition = [0, 0, 0.8]\n'
        "material = {{ n_d = 1.5, priority = {} }}\n"
    )
    upper = (
        '[[objects]]\nname = "b"\nshape = "slab"\nthickness = 0.6\nposition = [0, 0, 1.2]\n'
        "material = {{ n_d = 2.4, priority = {} }}\n"
    )
    for first, second in ((1, 2), (2, 1), (0, 0)):  # one interface between the two, wherever it lies
        render(beam(lower.format(first) + upper.format(second)), f"{LIGHT_ALONE} --stats")
        assert share(render, "deposited") == pytest.approx(stack_transmittance(1.0, 2.4, 1.5, 1.0), abs=0.005)


def test_a_mirror_casts_its_colour(render: Render) -> None:
    mirror = '[[objects]]\nshape = "plane"\nposition = [0, 0, 1]\naxis = [0, 1, 0]\nangle_deg = 60\nmaterial = {}\n'
    white = render(beam(mirror.format('"mirror"')), "--layer caustic --stats").rgb.sum(axis=(0, 1))
    assert share(render, "deposited") == pytest.approx(1.0, abs=0.002)
    tinted = render(
        beam(mirror.format('{ kind = "mirror", reflectance = [0.9, 0.5, 0.2] }')), "--layer caustic"
    ).rgb.sum(axis=(0, 1))
    assert tinted / white == pytest.approx([0.9, 0.5, 0.2], abs=0.05)


def test_instances_each_cast_a_caustic(render: Render) -> None:
    ball = '[[objects]]\nshape = "sphere"\nradius = 0.3\ntriangles = 2000\n{}\n'
    one = ball.format("position = [-0.5, 0, 0.6]")
    two = ball.format("instances = [{ position = [-0.5, 0, 0.6] }, { position = [0.5, 0, 0.6] }]")
    scene = beam("{}").replace("radius = 0.2", "radius = 2.0")
    single, double = (
        luminance(render(scene.replace("{}", objects), "--layer map:floor --photons 40k --stats"))
        for objects in (one, two)
    )
    assert share(render, "lost_numeric") < 1e-4
    assert single.max() > 0.0 and double.max() > 0.0
    pictures = [
        luminance(render(scene.replace("{}", objects), "--layer caustic --photons 40k")) for objects in (one, two)
    ]
    left, right = np.split(pictures[1], 2, axis=1)
    assert left.sum() == pytest.approx(right.sum(), rel=0.05)
    assert pictures[1].sum() == pytest.approx(2.0 * pictures[0].sum(), rel=0.05)
