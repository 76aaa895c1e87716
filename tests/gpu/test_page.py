"""Pages: their data against the session's own light, and what is refused. What their scripts draw: tests/interface."""

from __future__ import annotations

import base64
import io
import json
import re
import zlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import spectrasplat as ss
from gpu.page_oracle import irradiance
from PIL import Image
from spectrasplat.api.arguments import settings_of
from spectrasplat.api.device import Device
from spectrasplat.base.errors import UserError
from spectrasplat.edit.parameters import Stage
from spectrasplat.model.optics.colorimetry import K_M, VISIBLE_NM, cmf_xyz, xyz_to_rgb709
from spectrasplat.model.optics.glass import Dispersion, with_gain
from spectrasplat.model.scene import Scene
from spectrasplat.passes.plane_frame import plane_frame
from spectrasplat.passes.texel_map import TexelMap
from spectrasplat.render.export_caustic import check_export
from spectrasplat.render.frame_fit import inputs_of
from spectrasplat.render.page.light import PageLight, beams_alone, page_light
from spectrasplat.render.page.page import check_page, check_page_path, decimated
from spectrasplat.render.page.spectra import Glasses
from spectrasplat.render.viewer.engine import LiveEngine
from spectrasplat.render.viewer.still_engine import finish, still_engine

OBSERVER = xyz_to_rgb709(K_M * cmf_xyz())
BALL = {
    "name": "ball",
    "camera": {"position": [0.0, -6.0, 5.0], "target": [0.0, 0.0, 0.0]},
    "lights": [
        {"kind": "collimated", "position": [0.0, 0.0, 4.0], "target": [0, 0, 0], "radius": 0.8, "illuminance_lx": 2e4}
    ],
    "objects": [
        {"name": "ball", "shape": "sphere", "radius": 1, "triangles": 5120, "glass": "N-SF66", "position": [0, 0, 2]},
        {"name": "table", "shape": "plane", "width": 20.0, "height": 20.0, "material": {"kind": "diffuse"}},
    ],
}


def through(scene: Scene, own: Dispersion, shown: Dispersion) -> Scene:
    """`scene` with another glass."""
    objects = (
        replace(o, material=o.material.changed(dispersion=shown)) if o.material.dispersion == own else o
        for o in scene.objects
    )
    return replace(scene, objects=tuple(objects))


def map_of(engine: LiveEngine, receiver: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The engine's irradiance, v upwards along rows, and its rectangle in the receiver's plane."""
    light = engine.live_light
    assert light is not None
    layout, buffers = light.light_pass.layout, light.buffers
    rows = np.concatenate([part for _, part in light.light_pass.maps.portions(layout.tiles[receiver][0], 0)])
    record = layout.placements[layout.receivers[receiver]["placement"]]
    frame = plane_frame(buffers.space.to_gpu(buffers.world_meshes[buffers.receivers[receiver]].vertices))
    corners = TexelMap.of(record, frame).points(record["rect"].astype(float).reshape(2, 2)) / buffers.space.scale
    xyz = rows[..., :3].astype(float) * light.light_pass.maps.scale / float(record["texel_area"])
    return xyz_to_rgb709(xyz), *corners


def coarser(picture: np.ndarray, step: int) -> np.ndarray:
    height, width = (side // step for side in picture.shape[:2])
    return picture[: height * step, : width * step].reshape(height, step, width, step, 3).mean(axis=(1, 3))


def errors(
    scene: ss.Scene, photons: int, size: str, step: int, shown: Callable[[Glasses], list[Dispersion]]
) -> list[float]:
    """nRMSE of a page's light to the session's, in texels `step` times as wide, for each glass of `shown`."""
    model, glasses = scene._model, Glasses.of(scene._model)
    assert glasses.own is not None
    settings = settings_of(scene, size=size, photons=photons, spp=1)
    found = []

    def work(context: object, report: object, stopped: Callable[[], bool]) -> None:
        engine = still_engine(context, settings, exact=False)  # type: ignore[arg-type]

        def show(seen: Scene) -> None:
            engine.set(inputs_of(Stage(seen, seen.camera), settings))
            finish(engine, photons, lambda share, text: None, stopped)

        show(glasses.widened(model))
        assert engine.live_light is not None
        for _ in beams_alone(engine.live_light, photons):
            pass
        page: PageLight = page_light(engine.live_light, 0, glasses)
        for glass in shown(glasses):
            show(through(model, glasses.own, glass))
            light, *window = map_of(engine, 0)
            spectra = [lamp.spectral_power for lamp in model.lights]
            index = [glass.index(VISIBLE_NM)]
            got = irradiance(page.arrays, page.head, OBSERVER, spectra, index, (window[0], window[1]), light.shape[:2])
            got, wanted = coarser(got, step), coarser(light, step)
            found.append(float(np.sqrt(((got - wanted) ** 2).mean() / (wanted**2).mean())))
        engine.release()

    with Device() as device:
        device.run(work)
    return found


def gains(*values: float) -> Callable[[Glasses], list[Dispersion]]:
    def shown(glasses: Glasses) -> list[Dispersion]:
        assert glasses.own is not None
        return [with_gain(glasses.own, value * glasses.own.gain) for value in values]

    return shown


def test_polygons_follow_the_index() -> None:
    assert max(errors(ss.load("prism"), 4000, "96x54", 4, gains(0.5, 1.0, 2.0))) < 0.03


def test_photons_follow_the_index() -> None:
    assert max(errors(ss.Scene(BALL), 8000, "96x54", 8, gains(0.5, 1.0, 2.0))) < 0.035


@pytest.mark.slow
@pytest.mark.parametrize("name", ["prism", "ball"])
def test_glasses_of_like_index(name: str) -> None:
    def shown(glasses: Glasses) -> list[Dispersion]:
        assert glasses.own is not None
        return list(glasses.others[:5])

    assert max(errors(ss.load(name), 50_000, "192x108", 8, shown)) < 0.04


@pytest.mark.slow
def test_a_cut_stones_weak_beams_are_on_its_page() -> None:
    """In texels so wide that the noise of either's roulette is 0.14; without weak beams a third of the light lacks."""
    assert max(errors(ss.load("brilliant"), 4000, "96x54", 88, gains(0.5, 1.0, 2.0))) < 0.25


def test_what_can_be_no_page_says_why(tmp_path: Path) -> None:
    bowl = BALL["objects"][0] | {"name": "bowl", "glass": None, "material": {"kind": "diffuse"}}
    with pytest.raises(UserError, match="'bowl' is curved"):
        check_page(ss.Scene(BALL | {"objects": [*BALL["objects"], bowl]})._model, "bowl")
    with pytest.raises(UserError, match="wears a picture"):
        check_page(ss.load("lens_text")._model, "page")
    with pytest.raises(UserError, match="no receiver of scene 'prism'"):
        check_page(ss.load("prism")._model, "prism")
    for path in (tmp_path / "page.txt", tmp_path / "none" / "page.html"):
        with pytest.raises(UserError, match="cannot write"):
            check_page_path(path)
    with pytest.raises(UserError, match="--plane does not go with a page"):
        check_export(tmp_path / "page.html", plane=True)


def test_a_page_asks_nothing_of_a_network(tmp_path: Path) -> None:
    told: list[float] = []
    page = ss.page(ss.Scene(BALL), size=(64, 36), photons=2000, progress=lambda share, text: told.append(share))
    assert told == sorted(told) and page.head["receiver"] == "table" and page.head["mode"] == "index"
    text = page.to_html(tmp_path / "page.html").read_text(encoding="utf-8")
    assert not re.findall(r"""(?:src|href)=["']?(?!data:)\w+|url\(|@import|fetch\(|import .* from""", text)
    head = json.loads(text.split('id="head">')[1].split("</script>")[0])
    blob = zlib.decompress(base64.b64decode(text.split('id="blob">')[1].split("</script>")[0]))
    listed = head["arrays"]["photons.position"]
    stored = np.frombuffer(blob, listed["dtype"], int(np.prod(listed["shape"])), listed["offset"])
    assert np.array_equal(stored.reshape(listed["shape"]), page.arrays["photons.position"])
    assert "<iframe" in page._repr_html_() and "&lt;!DOCTYPE html&gt;" in page._repr_html_()
    # The photons' places are where the picture's pixels look: the ball's shadow is amid the table.
    weight = np.asarray(Image.open(io.BytesIO(page.arrays["weight"].tobytes())))
    assert weight.shape == (36, 64, 3) and weight[-1].min() > 250 and weight[:18].min() == 0


def test_where_no_light_falls_there_is_no_page() -> None:
    dark = ss.Scene(BALL | {"objects": BALL["objects"][1:]})
    with pytest.raises(UserError, match="no caustic"):
        ss.page(dark, "table", size=(32, 18), photons=1000)


def test_coarse_meshes_keep_their_size() -> None:
    mesh = ss.Scene(BALL)._model.objects[0].mesh
    vertices, triangles = decimated(mesh.vertices, mesh.triangles, 600)
    assert 100 < len(triangles) <= 600
    assert np.allclose(np.ptp(vertices, axis=0), np.ptp(mesh.vertices, axis=0), rtol=0.1)
