"""More photons are never worse: in ten kinds of scenes the error against the independent reference does not rise."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from spectrasplat.base.paths import shipped_scenes
from spectrasplat.bench.rendering import MethodRig
from spectrasplat.gpu.context import Context
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.reference.metrics import ReferencePicture, measure
from spectrasplat.reference.photon_reference import cached_reference

SIZE = (64, 36)
PHOTONS = (5_000, 20_000, 80_000, 320_000)
REFERENCE_PHOTONS = 8_000_000
SCENE = """
camera = {{ position = [{camera}], target = [0.5, 0.0, -1.0], vertical_fov_deg = {fov} }}
lights = [{{ kind = "spot", position = [-5, 0, 8.66], target = [0, 0, 0], half_angle_deg = 6.5, intensity_cd = 9e3 }}]
objects = [{{ shape = "{shape}", {size}, material = {{ kind = "glass", cauchy = {cauchy} }} }},
    {{ shape = "plane", width = 40.0, height = 40.0, position = [0.0, 0.0, -1.001], material = "diffuse" }}]
"""
BALL, GEM = ("8.0, -6.0, 6.0", 8.0, "sphere", "radius = 1.0"), ("0.0, -6.4, 4.6", 36.0, "brilliant", "diameter = 1.5")
OWN = {
    "a strongly dispersive ball": (*BALL, [1.46, 0.02]),
    "a crown ball": (*BALL, [1.5046, 0.0042]),
    "a gem from 2.2 to 1.2": (*GEM, [0.8888, 0.18935]),
    "a diamond": (*GEM, [2.38, 0.0135]),
}
SHIPPED = ("ball", "lens", "wine_glass", "achromat", "spectrometer", "prism")

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("name", [*OWN, *SHIPPED])
def test_more_photons_are_never_worse(gl: Context, tmp_path: Path, name: str) -> None:
    path = shipped_scenes().get(name, tmp_path / "scene.toml")
    if name in OWN:
        keys = dict(zip(("camera", "fov", "shape", "size", "cauchy"), OWN[name], strict=True))
        path.write_text(SCENE.format(**keys), encoding="utf-8")
    scene = load_scene(path)
    picture = cached_reference(scene, *SIZE, photons=REFERENCE_PHOTONS, max_depth=scene.render.max_depth)
    reference = ReferencePicture(picture.xyz, picture.variance)
    rig = MethodRig(gl, scene, "srd-photons", *SIZE)
    errors = np.array([measure(rig.render(n, 1).xyz, reference)["nrmse"] for n in PHOTONS])
    rig.release()
    # What the reference's own noise leaves of an error near 0.
    noise = 2.0 * np.sqrt(reference.variance.sum() / (reference.xyz**2).sum() / reference.xyz.size**0.5)
    assert (errors[1:] <= 1.1 * errors[:-1] + max(noise, 1e-3)).all(), (errors, noise)
