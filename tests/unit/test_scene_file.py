"""Scene files: what they mean, how they are refused, and that saving gives the same scene back."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from spectrasplat.base.errors import UserError
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.lights.point import spot_solid_angle_sr
from spectrasplat.model.scene import Black, Diffuse, Mirror
from spectrasplat.model.scene_checks import contains

from tests.unit.scene_texts import FLOOR, THREE_LINES, load, refusal

pytestmark = pytest.mark.core

# -- defaults -----------------------------------------------------------------------------


def test_three_lines_make_a_scene_whose_caustic_is_in_view(tmp_path: Path) -> None:
    scene = load(tmp_path, THREE_LINES)
    sphere, table = scene.objects
    assert sphere.material.dispersion.n_d == pytest.approx(1.784720, abs=1e-6)
    assert isinstance(table.material, Diffuse)
    top = table.object_to_world[2, 3]
    assert -0.51 < top < -0.5
    assert len(scene.notes) == 2
    # The light through the ball's centre meets the table inside the picture.
    direction = np.array(scene.lights[0].direction)
    spot = direction * (top / direction[2])
    to_spot, to_target = spot - scene.camera.position, np.subtract(scene.camera.target, scene.camera.position)
    angle = math.acos(to_spot @ to_target / np.linalg.norm(to_spot) / np.linalg.norm(to_target))
    assert math.degrees(angle) < 0.4 * scene.camera.vertical_fov_deg


@pytest.mark.parametrize(("line", "segments"), [("", 512), ("segments = 48", 48)])
def test_a_parameter_that_may_be_none_is_left_out_or_of_its_type(tmp_path: Path, line: str, segments: int) -> None:
    cone = '[[objects]]\nshape = "revolution"\nprofile = [[0, 0], [1, 0], [0, 1]]\nglass = "N-BK7"\n'
    mesh = load(tmp_path, cone + line).objects[0].mesh
    assert np.count_nonzero(np.isclose(np.hypot(*mesh.vertices[:, :2].T), 1.0)) == segments


@pytest.mark.parametrize(("kind", "most"), [("lights", 256), ("objects", 65_535)])
def test_more_than_a_photon_can_tell_apart_is_refused(tmp_path: Path, kind: str, most: int) -> None:
    from dataclasses import replace

    from spectrasplat.model.scene_checks import check_scene

    scene = load(tmp_path, THREE_LINES)
    some = getattr(scene, kind)
    with pytest.raises(UserError, match=f"{most + 1} {kind}, and at most {most} may be"):
        check_scene(replace(scene, **{kind: some + some[:1] * (most + 1 - len(some))}), "much.toml")


def test_a_bare_mesh_becomes_glass_on_a_table(tmp_path: Path) -> None:
    from spectrasplat.model.geometry.primitives import box
    from spectrasplat.model.io.mesh_io import save_ply

    save_ply(box((1.0, 1.0, 1.0)), tmp_path / "block.ply")
    scene = load_scene(tmp_path / "block.ply")
    assert [o.name for o in scene.objects] == ["block", "table"]
    assert scene.objects[0].material.dispersion.n_d == pytest.approx(1.5168, abs=1e-6)


def test_a_missing_file_and_an_unknown_kind_are_told(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="does not exist"):
        load_scene(tmp_path / "nothing.toml")
    with pytest.raises(UserError, match="is a folder"):
        load_scene(tmp_path)
    (tmp_path / "scene.blend").write_bytes(b"BLENDER")
    with pytest.raises(UserError, match="'.blend' is not a kind of scene"):
        load_scene(tmp_path / "scene.blend")


def test_american_spelling_of_colour(tmp_path: Path) -> None:
    text = THREE_LINES + '[[objects]]\nshape = "plane"\nmaterial = {{ kind = "diffuse", {} = [0.1, 0.2, 0.3] }}'
    one, other = (load(tmp_path, text.format(word)).objects[1].material for word in ("color", "colour"))
    assert one == other


# -- refusals -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (THREE_LINES + "glas = 1", "unknown key 'objects[0].glas', did you mean 'glass'?"),
        ('colour = "red"\n' + THREE_LINES, "unknown key 'colour', a scene knows"),
        (THREE_LINES + "[camera]\nposition = [0, -5, 1]\nfov = 3", "unknown key 'camera.fov', did you mean"),
        ('[[objects]]\nshap = "sphere"', "unknown key 'objects[0].shap', did you mean 'shape'?"),
        ('[[objects]]\nglass = "N-BK7"', "objects[0].shape is missing"),
        ('[[objects]]\nshape = "sfere"', "objects[0].shape is 'sfere', which is not known: did you mean 'sphere'?"),
        *(
            (
                f'[[objects]]\nshape = "{word}"',
                f"objects[0].shape is '{word}', which is not known: did you mean '{shape}'?",
            )
            for word, shape in [("cube", "box"), ("UV sphere", "sphere"), ("donut", "torus"), ("cilinder", "cylinder")]
        ),
        ('[[objects]]\nshape = "pyramid"', "which is not known: choose one of sphere, ellipsoid,"),
        (
            THREE_LINES + "[camera]\nposition = [0, -5, 1]\nlook_at = [0, 0, 1]",
            "unknown key 'camera.look_at', did you mean 'target'?",
        ),
        ('[[objects]]\nshape = "sphere"\nglass = "N-SF1l"', "objects[0].glass: unknown glass 'N-SF1l', did you mean"),
        ('[[objects]]\nshape = "sphere"\nradius = -1', "sphere: radius must be a number greater than 0, not -1"),
        ('[[objects]]\nshape = "sphere"\nradius = nan', "objects[0].radius is nan but must be a finite number"),
        ('[[objects]]\nshape = "sphere"\nmaterial = {n_d = -1.5}', "objects[0].material.n_d: the refractive index is"),
        ('[[objects]]\nshape = "sphere"\nmaterial = {n_d = 1.5, V_d = 0}', "V_d is 0"),
        (
            '[[objects]]\nshape = "sphere"\nmaterial = {sellmeier = {B = [1.0, nan], C = [0.1, 0.2]}}',
            "sellmeier.B[1] is nan",
        ),
        ('[[objects]]\nshape = "sphere"\nmaterial = {n_d = 1.5, abbe = 30}', "unknown key 'objects[0].material.abbe'"),
        ('[[objects]]\nshape = "sphere"\nmaterial = "milk"', "names 'milk', which is not defined under [materials]"),
        ('[[objects]]\nshape = "sphere"\nscale = [1, 0, 1]', "objects[0].scale is zero on an axis"),
        ('[[objects]]\nshape = "sphere"\naxis = [0, 0, 0]\nangle_deg = 3', "objects[0].axis is the zero vector"),
        ('[[objects]]\nshape = "sphere"\nangle_deg = 3', "objects[0].angle_deg needs 'axis' beside it"),
        ('[[objects]]\nshape = "sphere"\nmesh = "a.ply"', "objects[0].shape cannot stand beside 'mesh'"),
        ('[[objects]]\nmesh = "gone.ply"', "which is not a file"),
        (THREE_LINES + '[[objects]]\nshape = "box"\nname = "sphere"', "which another object has already"),
        (THREE_LINES + "[camera]\nposition = [0, 0, 1]\ntarget = [0, 0, 1]", "camera.target lies at the camera's own"),
        (THREE_LINES + "[camera]\nposition = [0, 0, 1]\ntarget = [0, 0, 0]", "camera.up is parallel"),
        (THREE_LINES + "[camera]\nposition = [0, -5, 1]\nvertical_fov_deg = 180", "must be below 180"),
        (THREE_LINES + "[render]\nsize = [0, 540]", "render.size is 0 × 540"),
        (THREE_LINES + "[render]\nphotons = 1.5", "render.photons is 1.5 but must be a whole number"),
        (
            THREE_LINES + '[[lights]]\nkind = "spott"',
            "lights[0].kind is 'spott', which is not known: did you mean 'spot'?",
        ),
        (THREE_LINES + "[[lights]]\nflux_lm = 3\nflux_w = 3", "lights[0].flux_w cannot stand beside 'flux_lm'"),
        (THREE_LINES + "[[lights]]\nradius = 3", "unknown key 'lights[0].radius', a light of kind 'point' knows"),
        (THREE_LINES + '[[lights]]\nspectrum = "D66"', "lights[0].spectrum is not known: unknown illuminant 'D66'"),
        (
            THREE_LINES + "[[lights]]\nspectrum = {laser = 1064}",
            "lights[0].spectrum.laser is at 1064 nm, outside the visible",
        ),
        (THREE_LINES + "[[lights]]\nspectrum = {blackbody = -3}", "must be at least 500"),
        (THREE_LINES + '[[lights]]\nkind = "directional"\ndirection = [0, 0, 0]', "direction is the zero vector"),
        (THREE_LINES + '[[lights]]\nkind = "spot"\nhalf_angle_deg = 0', "half_angle_deg is 0 but must be above 0"),
        (THREE_LINES + '[[lights]]\nkind = "area"\nsize = [1, -1]', "must be a width and a height above 0"),
        (THREE_LINES + "[[lights]]\nposition = [0, 0, 5]", "nothing receives the light"),
        (THREE_LINES + FLOOR + "[[lights]]\nposition = [0, 0, 0.49]", "stands inside the glass of 'sphere'"),
        ("lights = []\n" + THREE_LINES + FLOOR, "holds no light"),
        ("objects = []", "objects is missing or empty"),
        ("[[objects]\n", "is not valid TOML"),
    ],
)
def test_every_mistake_has_its_sentence(tmp_path: Path, text: str, expected: str) -> None:
    assert expected in refusal(tmp_path, text)


def test_a_laser_outside_the_glass_data_is_refused_and_a_broad_light_noted(tmp_path: Path) -> None:
    glass = (
        '[[objects]]\nshape = "sphere"\nmaterial = {name = "X", cauchy = [1.5, 0.01], range_nm = [450, 700]}\n' + FLOOR
    )
    sun = '[[lights]]\nkind = "directional"\ndirection = [0, 0, -1]\nspectrum = '
    assert "line at 405 nm" in refusal(tmp_path, glass + sun + "{laser = 405}")
    load(tmp_path, glass + sun + "{laser = 532}")
    notes = load(tmp_path, glass + sun + '"D65"').notes
    assert any("450 to 700 nm" in note for note in notes)


def test_an_open_mesh_is_a_note_in_glass_and_none_on_a_table(tmp_path: Path) -> None:
    sheet = '[[objects]]\nshape = "inline"\nvertices = [[0,0,0],[1,0,0],[0,1,0]]\ntriangles = [[0,1,2]]\n'
    assert any(note.startswith("open mesh") for note in load(tmp_path, sheet).notes)
    assert not any(note.startswith("open mesh") for note in load(tmp_path, sheet + 'material = "diffuse"').notes)


# -- meaning ------------------------------------------------------------------------------


def test_rotation_is_about_fixed_x_then_y_then_z(tmp_path: Path) -> None:
    text = '[[objects]]\nshape = "box"\nscale = [2, 3, 4]\nrotation_deg = [90, 0, 90]\nposition = [1, 2, 3]\n'
    matrix = load(tmp_path, text).objects[0].object_to_world
    # y·3 turns to z by the first turn and stays; x·2 turns to y by the second.
    np.testing.assert_allclose(matrix @ [0, 1, 0, 1], [1, 2, 6, 1], atol=1e-12)
    np.testing.assert_allclose(matrix @ [1, 0, 0, 1], [1, 4, 3, 1], atol=1e-12)


def test_axis_frame_and_rest_place_an_object(tmp_path: Path) -> None:
    text = '[[objects]]\nshape = "box"\naxis = [0, 0, 2]\nangle_deg = 90\nrests_at_z = 7\n'
    matrix = load(tmp_path, text).objects[0].object_to_world
    np.testing.assert_allclose(matrix @ [1, 0, 0, 1], [0, 1, 7.5, 1], atol=1e-12)
    text = '[[objects]]\nshape = "lens"\nz_axis = [0, -3, 0]\nx_axis = [1, 1, 0]\n'
    matrix = load(tmp_path, text).objects[0].object_to_world
    np.testing.assert_allclose(matrix[:3, :3], np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]]), atol=1e-12)
    assert np.linalg.det(matrix[:3, :3]) == pytest.approx(1.0)


def test_instances_share_one_mesh_and_compose_with_the_objects_own_placement(tmp_path: Path) -> None:
    text = (
        THREE_LINES
        + 'scale = 2\ninstances = [{position = [1, 0, 0]}, {name = "far", position = [9, 0, 0], scale = 0.5}]\n'
    )
    near, far, _ = load(tmp_path, text).objects
    assert near.mesh is far.mesh and far.name == "far"
    np.testing.assert_allclose(near.object_to_world[:3], [[2, 0, 0, 1], [0, 2, 0, 0], [0, 0, 2, 0]])
    np.testing.assert_allclose(far.object_to_world[:3], [[1, 0, 0, 9], [0, 1, 0, 0], [0, 0, 1, 0]])


def test_all_kinds_of_material(tmp_path: Path) -> None:
    (tmp_path / "n.csv").write_text("wavelength_nm,n\n380,1.6\n780,1.5\n")
    (tmp_path / "t.csv").write_text("400 0.5\n700 0.25\n")
    text = """
        [materials.mirror1]
        kind = "mirror"
        reflectance = "#ffffff"
        [materials.paint]
        kind = "diffuse"
        reflectance = {csv = "t.csv"}
        [materials.tinted]
        csv = "n.csv"
        priority = 3
        absorption = {csv = "t.csv", distance = 2.0}
    """ + "".join(
        f'\n[[objects]]\nshape = "box"\nmaterial = "{name}"' for name in ("mirror1", "paint", "tinted", "black")
    )
    mirror, paint, tinted, black = (o.material for o in load(tmp_path, text).objects)
    assert mirror == Mirror((1.0, 1.0, 1.0)) and black == Black()
    assert paint.reflectance[170] == pytest.approx(0.5 - 0.25 * 150 / 300)
    assert tinted.dispersion.index(380.0) == pytest.approx(1.6) and tinted.priority == 3
    assert tinted.absorption.coefficient[-1] == pytest.approx(math.log(4.0) / 2.0)


@pytest.mark.parametrize(
    ("light", "photometric"),
    [
        ('kind = "point"\nposition = [0, 0, 5]\nflux_lm = 12.0', 12.0 / (4 * math.pi)),
        ('kind = "spot"\nposition = [0, 0, 5]\nhalf_angle_deg = 60\nflux_lm = 12.0', 12.0 / math.pi),
        ('kind = "collimated"\nradius = 2.0\nflux_lm = 12.0', 12.0 / (4 * math.pi)),
        ('kind = "area"\nsize = [2.0, 3.0]\nflux_lm = 12.0', 12.0 / (6 * math.pi)),
        ('kind = "area"\nluminance_nt = 12.0', 12.0),
        ('kind = "directional"\nilluminance_lx = 12.0', 12.0),
        ('kind = "point"\nposition = [0, 0, 5]\nspectrum = {laser = 555}\nintensity_w_sr = 2.0', 2.0 * 683.002),
    ],
)
def test_power_is_brought_to_the_quantity_of_the_kind(tmp_path: Path, light: str, photometric: float) -> None:
    scene = load(tmp_path, THREE_LINES + FLOOR + "[[lights]]\n" + light)
    assert scene.lights[0].spectral_power.luminous() == pytest.approx(photometric, rel=2e-5)


@pytest.mark.parametrize(("inner", "outer"), [(0.0, 1e-3), (10.0, 10.0), (5.0, 40.0), (0.0, 90.0), (1.0, 2.3)])
def test_spot_solid_angle_is_the_integral_of_its_fall_off(inner: float, outer: float) -> None:
    edges = np.radians(np.linspace(0.0, outer, 400_001))
    theta = 0.5 * (edges[1:] + edges[:-1])
    t = np.clip((math.radians(outer) - theta) / max(math.radians(outer - inner), 1e-9), 0.0, 1.0)
    integral = 2.0 * math.pi * np.sum(t * t * (3.0 - 2.0 * t) * np.sin(theta)) * (edges[1] - edges[0])
    assert spot_solid_angle_sr(inner, outer) == pytest.approx(integral, rel=1e-5)


def test_spectra_add_by_power(tmp_path: Path) -> None:
    text = (
        "[[lights]]\nposition = [0,0,5]\nintensity_w_sr = 4.0\nspectrum = [{laser = 450, weight = 3}, {laser = 650}]\n"
    )
    lines = load(tmp_path, THREE_LINES + FLOOR + text).lights[0].spectral_power.lines
    assert lines == ((450.0, pytest.approx(3.0)), (650.0, pytest.approx(1.0)))


@pytest.mark.parametrize("scale", [(1.0, 1.0, 1.0), (2.0, -0.5, 1.0)])
def test_counting_crossings_is_the_winding_number(scale: tuple[float, float, float]) -> None:
    from spectrasplat.model.geometry import primitives
    from spectrasplat.model.scene import SceneObject
    from spectrasplat.model.scene_checks import _winding

    matrix = np.diag((*scale, 1.0))
    matrix[:3, 3] = (0.5, 0.25, -1.0)
    for mesh in (primitives.torus(0.5, 0.2, 900), primitives.brilliant(), primitives.box((1.5, 1.5, 1.0))):
        item = SceneObject("", mesh, Black(), matrix)
        # The ray from a whole or half step runs through vertices and along edges: the diagonal of the box, the rows of
        # the ring.
        random = np.random.default_rng(4).uniform(-0.8, 0.8, (150, 3))
        grid = np.array([(x, y, 0.05) for x in (-0.5, -0.25, 0.0, 0.25, 0.5) for y in (-0.5, -0.25, 0.0, 0.25, 0.5)])
        found = 0
        for point in np.concatenate([random, grid]):
            winding = abs(_winding(mesh, point))
            if winding < 0.01 or winding > 0.99:  # on the surface either answer will do
                inside = contains(item, matrix[:3, :3] @ point + matrix[:3, 3])
                assert inside == (winding > 0.5), (mesh.name, point, winding)
                found += inside
        assert 5 < found < 170
