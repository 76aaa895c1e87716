"""The Python interface on a device: pictures equal the command line's, edits cost what they must, and a caller's own
OpenGL is left alone."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import spectrasplat as ss
from spectrasplat.__main__ import main
from spectrasplat.base.image_io import read_image
from spectrasplat.gpu.context import Context
from spectrasplat.model.settings import RenderSettings
from spectrasplat.render.still import render

SMALL = {"size": (48, 27), "photons": 20_000, "spp": 4}


@pytest.fixture(scope="module")
def picture() -> ss.Picture:
    """The prism in its two layers."""
    return ss.render(ss.load("prism"), layers=("beauty", "caustic"), **SMALL)


def test_a_picture_is_the_command_lines_to_the_bit(picture: ss.Picture, tmp_path: Path) -> None:
    for layer in ("beauty", "caustic"):
        path = tmp_path / f"{layer}.npy"
        assert main(["render", "prism", "--size", "48x27", "--photons", "20k", "--spp", "4", "--layer", layer,
                     "-o", str(path)]) == 0  # fmt: skip
        one, other = picture.layers[layer], np.load(path)
        # Alone, the caustic's maps have no spectral channels for glass: another program rounds otherwise.
        assert np.array_equal(one, other) or (layer == "caustic" and np.abs(one - other).max() < 1e-12 * other.max())
    assert picture.rgb is picture.layers["beauty"] and picture.rgb.dtype == np.float32
    assert picture.stats.photons == picture.stats.photons_traced == 20_000
    assert sum(picture.stats.flux.values()) == pytest.approx(1.0, abs=0.01)


def test_a_picture_is_written_and_shown(picture: ss.Picture, tmp_path: Path) -> None:
    picture.to_exr(tmp_path / "a.exr")
    assert np.array_equal(read_image(tmp_path / "a.exr").rgb, picture.rgb)
    picture.to_png(tmp_path / "a.png")
    assert (tmp_path / "a.png").read_bytes() == picture._repr_png_()
    picture.to_png(tmp_path / "b.png", layer="caustic", exposure_ev=2.0)
    with pytest.raises(ss.UserError, match="no layer 'caustics', did you mean 'caustic'"):
        picture.to_png(tmp_path / "c.png", layer="caustics")
    with pytest.raises(ss.UserError, match=r"must end in \.exr"):
        picture.to_exr(tmp_path / "a.png")


def test_callbacks_come_in_the_callers_thread_and_can_stop() -> None:
    import threading

    seen: list[tuple[float, str, int]] = []
    scene = ss.load("prism")
    picture = ss.render(
        scene,
        size=(48, 27),
        photons=2_000_000,
        spp=1,
        progress=lambda share, text: seen.append((share, text, threading.get_ident())),
        cancel=lambda: any(text == "tracing photons" and share > 0.0 for share, text, _ in seen),
    )
    assert picture.stats.stopped and picture.stats.photons < 2_000_000
    assert {thread for *_, thread in seen} == {threading.get_ident()}
    with pytest.raises(ZeroDivisionError):
        ss.render(scene, progress=lambda share, text: 1 / 0, **SMALL)


@pytest.fixture(scope="module")
def live() -> Iterator[ss.Session]:
    with ss.Session(ss.load("prism"), **SMALL) as session:
        yield session


def test_the_first_picture_is_traced_and_near_a_rendering(live: ss.Session, picture: ss.Picture) -> None:
    first = live.render()
    assert first.stats.photons_traced == 20_000
    assert first.rgb.sum() == pytest.approx(picture.rgb.sum(), rel=0.05)  # four samples a pixel


def test_an_edit_of_the_dispersion_traces_nothing(live: ss.Session) -> None:
    before = live.render()
    live.set_glass("prism", dispersion_gain=2.0)
    after = live.render()
    assert after.stats.photons_traced == 0 and after.stats.photons == 20_000
    assert np.abs(after.rgb - before.rgb).max() > 0.1 * before.rgb.max()
    # To first order it is what tracing through that glass gives.
    scene = ss.load("prism")
    scene.objects["prism"].dispersion_gain = 2.0
    with ss.Session(scene, **SMALL) as other:
        traced = other.render()
    assert traced.stats.photons_traced == 20_000
    assert np.abs(after.rgb - traced.rgb).mean() < 0.2 * np.abs(after.rgb - before.rgb).mean()


def test_a_camera_that_moves_traces_nothing(live: ss.Session) -> None:
    live.scene.camera.position = [1.6, -7.0, 6.0]
    # Beams are drawn into other maps, and some photons carry on what is too weak for them.
    assert live.render().stats.photons_traced < 0.1 * 20_000


def test_another_index_is_traced(live: ss.Session) -> None:
    live.set_glass("prism", "N-BK7")
    assert live.render().stats.photons_traced == 20_000


def test_a_mistake_leaves_it_usable(live: ss.Session) -> None:
    with pytest.raises(ss.UserError, match="unknown glass"):
        live.set_glass("prism", "N-SF1111")
    assert live.render().stats.photons_traced == 0


@pytest.mark.slow
def test_one_pass_is_enough_whatever_it_emits() -> None:
    """The lens's lattice has fewer points than it is asked for."""
    with ss.Session(ss.load("lens"), **SMALL) as session:
        assert 15_000 < session.render().stats.photons <= 20_000
        session.scene.objects["lens"].dispersion_gain = 2.0
        assert session.render().stats.photons_traced == 0


def test_exact_traces_again_after_an_edit_of_the_dispersion() -> None:
    with ss.Session(ss.load("prism"), exact=True, **SMALL) as session:
        session.render()
        session.set_glass("prism", dispersion_gain=2.0)
        assert session.render().stats.photons_traced == 20_000


def test_a_closed_one_says_so() -> None:
    session = ss.Session(ss.load("prism"), **SMALL)
    session.close()
    session.close()
    with pytest.raises(ss.UserError, match="this session is closed"):
        session.render()


@pytest.mark.slow
def test_photons_carry_the_light_that_landed(gl: Context) -> None:
    scene = ss.load("prism")
    photons = ss.trace(scene, photons=20_000)
    fewer = ss.trace(scene, photons=20_000, limit=2_000)
    assert photons.position.shape == (len(photons.flux_w), 3) and len(photons.dposition_dn) == len(photons.flux_w)
    assert 1_000 <= len(fewer.flux_w) <= 2_000
    assert fewer.flux_w.sum() == pytest.approx(photons.flux_w.sum(), rel=0.05)
    light = render(scene._model, RenderSettings(48, 27, photons=20_000, spp=1), context=gl).stats.light
    assert photons.flux_w.sum() == pytest.approx(light.tally.ended["deposited"] / light.photons, rel=0.01)
    # They land on the table, and red and blue apart.
    assert {scene._model.objects[i].name for i in np.unique(photons.receiver)} == {"table"}
    assert np.abs(photons.position[:, 2]).max() < 1e-4
    places = photons.landing(np.array([450.0, 650.0]))
    assert np.linalg.norm(places[:, 1] - places[:, 0], axis=-1).max() > 0.05


def test_a_fan_obeys_snell() -> None:
    """Minimum deviation of the prism, by its index: the least angle between a ray before and after."""
    scene = ss.load("prism")
    fan = ss.fan(scene, "prism", light="slit", rays=5, wavelengths_nm=(486.13, 656.27))
    assert fan.points.shape[:2] == (5, 2) and (fan.lengths == 4).all()
    first = fan.points[:, :, 1] - fan.points[:, :, 0]
    first /= np.linalg.norm(first, axis=-1, keepdims=True)
    inside = fan.points[:, :, 2] - fan.points[:, :, 1]
    inside /= np.linalg.norm(inside, axis=-1, keepdims=True)
    normal = first - np.array([ss.glass("N-SF11").index(nm) for nm in fan.wavelengths_nm])[:, None] * inside
    # Snell's law in vectors: incident − n × refracted is along the surface's normal, the same for all rays of a face.
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    assert np.allclose(normal, normal[0, 0], atol=2e-4)
    assert (np.einsum("ri,ri->r", fan.directions[:, 0], fan.directions[:, 1]) < 0.9999).all()


def test_the_callers_own_context_stays_current_and_whole() -> None:
    import moderngl
    from spectrasplat.gpu.context import create_context

    with create_context() as own:
        mine = moderngl.get_context()
        buffer = own.ctx.buffer(b"mine")
        with ss.Session(ss.load("prism"), **SMALL) as session:
            session.render()
            assert buffer.read() == b"mine"
            texture = own.ctx.texture((2, 2), 4, data=bytes(range(16)))
        assert texture.read() == bytes(range(16)) and own.ctx.error == "GL_NO_ERROR"
        assert moderngl.get_context() is mine


def test_a_device_that_fails_is_a_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SPECTRASPLAT_BACKEND", "vulkan")
    with pytest.raises(ss.UserError, match="SPECTRASPLAT_BACKEND is 'vulkan'"):
        ss.render(ss.load("prism"), **SMALL)
