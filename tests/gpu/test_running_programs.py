"""Every program that really runs lacks what its scene does not need; putting it in changes no light."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from spectrasplat.bench.programs import compiled_programs
from spectrasplat.commands.inspect_features import prove
from spectrasplat.features.features import Features
from spectrasplat.gpu.context import Context
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.scene import Scene
from spectrasplat.model.settings import RenderSettings
from spectrasplat.render.still import render

LAMP = '[[lights]]\nname = "lamp"\nkind = "point"\nposition = [0.4, 0.2, 6]\nspectrum = "D65"\nintensity_cd = 100\n'
FLOOR = (
    '[[objects]]\nname = "floor"\nshape = "plane"\nwidth = 20\nheight = 20\nposition = [0, 0, -2]\n'
    'material = { kind = "diffuse", colour = 0.5 }\n'
)
BALL = '[[objects]]\nname = "ball"\nshape = "sphere"\ntriangles = 1280\n'
GEM = '[[objects]]\nname = "gem"\nshape = "box"\nsize = [1, 1, 1]\nrotation_deg = [20, 30, 0]\n'
NEST = '[[objects]]\nname = "core"\nshape = "sphere"\ntriangles = 320\nradius = 0.4\n'
SCENES = {
    "plain ball": BALL + "material = { n_d = 1.6 }\n",
    "box of flint": GEM + 'glass = "N-SF11"\n',
    "nested": BALL
    + 'glass = "N-BK7"\n'
    + NEST
    + (
        "material = { n_d = 1.33, V_d = 55.0, absorption = { colour = [0.5, 0.9, 0.9], distance = 1.0 }, priority = "
        "4 }\n"
    ),
}


def scene_of(tmp_path: Path, name: str) -> Scene:
    path = tmp_path / "scene.toml"
    path.write_text(
        f'name = "{name}"\n[render]\nsize = [96, 54]\nphotons = 20000\nmax_depth = 12\n{LAMP}{FLOOR}{SCENES[name]}'
    )
    return load_scene(path)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "absent"),
    [
        (
            "plain ball",
            {
                "camera spectral taps",
                "spectral maps",
                "spectral columns",
                "band cuts",
                "absorption",
                "medium stack",
                "mirrors",
                "half-space solids",
            },
        ),
        (
            "box of flint",
            {"interpolated normals", "normal derivatives", "triangle tree", "absorption", "medium stack", "local gain"},
        ),
        ("nested", {"half-space solids", "mirrors", "charts"}),
    ],
)
def test_running_programs_lack_what_the_scene_does_not_need(
    gl: Context, tmp_path: Path, name: str, absent: set[str]
) -> None:
    scene = scene_of(tmp_path, name)
    settings = RenderSettings(max_depth=scene.render.max_depth, method="srd-photons")
    sources = [stage for built in compiled_programs(gl, scene, settings) for stage in built.stages]
    assert {
        "light/emit.comp",
        "light/trace.comp",
        "light/footprint.comp",
        "light/splat.vert",
        "light/splat_swept.frag",
        "camera/camera.comp",
    } <= {s.name for s in sources}
    proofs = prove(sources, Features.of(scene, settings))
    assert absent <= {proof.feature for proof in proofs if not proof.programs}
    assert [proof.feature for proof in proofs if not proof.holds] == []


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "put_in"),
    [
        ("plain ball", {"spectral_groups": 1, "band_cuts": True}),
        ("plain ball", {"medium_stack": True, "dielectrics": True}),
        ("box of flint", {"loose_triangles": True, "tree": True}),
    ],
)
def test_putting_a_feature_in_leaves_the_picture_as_it_is(
    gl: Context, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, put_in: dict[str, int]
) -> None:
    scene = scene_of(tmp_path, name)
    settings = RenderSettings(width=96, height=54, photons=20_000, spp=4, max_depth=12, method="srd-photons")
    needed = Features.of
    without = render(scene, settings, context=gl).rgb
    monkeypatch.setattr(Features, "of", staticmethod(lambda *asked: needed(*asked).changed(**put_in)))
    with_it = render(scene, settings, context=gl).rgb
    assert np.abs(with_it - without).sum() <= 1e-2 * np.abs(without).sum()
