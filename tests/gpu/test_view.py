"""Live views in notebooks, driven by the messages that the browser sends."""

from __future__ import annotations

import base64
import io
import json
import shutil
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import spectrasplat as ss
from PIL import Image
from spectrasplat.api import view as view_module
from spectrasplat.api import widget
from spectrasplat.api.view import View
from spectrasplat.base.paths import assets_dir
from spectrasplat.edit.camera_controls import orbit

PATIENCE_S = 60.0
SIZE = (160, 90)


class Browser:
    """Stands in for the widget: keeps what it is sent, and confirms pictures as the JavaScript does."""

    def __init__(self, handle: Callable[[dict[str, Any]], None], size: tuple[int, int]) -> None:
        self.say, self.size = handle, size
        self.pictures: list[tuple[dict[str, Any], np.ndarray]] = []
        self.lights: list[dict[str, Any]] = []
        self.listed: list[dict[str, Any]] = []
        self.told, self.kept = "", ""

    def send(self, message: dict[str, Any], data: bytes | None = None) -> None:
        json.dumps(message, allow_nan=False)
        if message["kind"] == "light":
            self.lights.append(message)
        else:
            assert data is not None
            picture = np.asarray(Image.open(io.BytesIO(data)))
            assert picture.shape == (message["height"], message["width"], 3)
            self.pictures.append((message, picture))
            self.say({"kind": "seen", "number": message["number"]})

    def glasses(self, listed: list[dict[str, Any]]) -> None:
        self.listed = listed

    def keep(self, page: str) -> None:
        self.kept = page

    def tell(self, text: str) -> None:
        self.told = text or self.told

    def mimebundle(self) -> dict[str, Any]:
        return {"application/vnd.jupyter.widget-view+json": {}}

    def close(self) -> None: ...

    def rest(self) -> tuple[dict[str, Any], np.ndarray]:
        """The next finished picture."""
        count = len(self.pictures)
        return until(lambda: next((p for p in self.pictures[count:] if p[0]["done"]), None))

    def light(self, x: float, y: float) -> dict[str, Any]:
        """All that is known of the light at a place."""
        self.say({"kind": "hover", "place": [x, y]})
        return until(
            lambda: next(
                (m for m in reversed(self.lights) if m["place"] == [x, y] and m.get("direct", ()) is not None), None
            )
        )


def until(found: Callable[[], Any]) -> Any:
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        value = found()
        if value is not None:
            return value
        time.sleep(0.01)
    raise AssertionError("it never came")


def viewed(session: ss.Session) -> tuple[View, Browser]:
    made: list[Browser] = []

    def front(handle: Any, size: tuple[int, int]) -> Any:
        made.append(Browser(handle, size))
        return made[0]

    return View(session, front), made[0]


@pytest.fixture(autouse=True)
def no_pages(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where nothing asks for the page of a saved notebook, none is made."""
    monkeypatch.setattr(view_module, "_PAGE_AFTER_S", float("inf"))


@pytest.fixture(scope="module")
def live() -> Iterator[tuple[ss.Session, Browser]]:
    with ss.Session(ss.load("prism"), size=SIZE, photons=20_000, spp=2) as session:
        view, browser = viewed(session)
        until(lambda: next((p for p in browser.pictures if p[0]["done"]), None))
        yield session, browser
        view.close()


def test_pictures_follow_the_mouse_and_are_whole_afterwards(live: tuple[ss.Session, Browser]) -> None:
    session, browser = live
    place, count = np.array(session.scene.camera.position), len(browser.pictures)
    wanted = session.scene._model.camera
    for _ in range(4):
        wanted = orbit(wanted, 0.02, 0.01)
    for _ in range(4):
        browser.say({"kind": "orbit", "dx": 0.02, "dy": 0.01})
        time.sleep(0.1)
    last, _ = browser.rest()
    moving = [told for told, _ in browser.pictures[count:] if told["moving"]]
    assert moving
    assert min(told["samples"] for told in moving) < last["samples"]
    assert (last["width"], last["height"]) == SIZE and last["samples"] >= 2
    now = np.array(session.scene.camera.position)
    target = np.array(session.scene.camera.target)
    assert now == pytest.approx(np.array(wanted.position)) and np.linalg.norm(now - place) > 0.1
    assert np.linalg.norm(now - target) == pytest.approx(np.linalg.norm(place - target))
    browser.say({"kind": "zoom", "amount": 2.0, "x": 0.5, "y": 0.5})
    assert np.linalg.norm(np.array(session.scene.camera.position) - target) < 0.8 * np.linalg.norm(now - target)
    browser.say({"kind": "home"})
    assert session.scene.camera.position == pytest.approx(place)


def test_a_cell_that_edits_the_scene_is_followed(live: tuple[ss.Session, Browser]) -> None:
    session, browser = live
    session.set_glass("prism", dispersion_gain=0.0)
    browser.rest()
    assert browser.listed[0]["gain"] == 0.0


def test_what_is_under_glass_and_beyond_everything_is_told(live: tuple[ss.Session, Browser]) -> None:
    _, browser = live
    assert browser.light(0.33, 0.25)["object"] == "prism"
    assert "direct" not in browser.lights[-1]


def test_a_mistake_is_a_sentence(live: tuple[ss.Session, Browser]) -> None:
    _, browser = live
    browser.say({"kind": "gain", "object": "prysm", "value": 1.0})
    assert "did you mean 'prism'" in browser.told
    browser.say({"kind": "never heard of"})


SLAB = {
    "camera": {"position": [0.0, -5.0, 0.9], "target": [0.0, 0.0, 0.2]},
    "lights": [{"kind": "directional", "direction": [0.0, 0.0, -1.0], "illuminance_lx": 1000.0}],
    "objects": [
        {"name": "floor", "shape": "plane", "width": 12.0, "height": 12.0, "material": "diffuse"},
        {"name": "slab", "shape": "box", "size": [2.0, 2.0, 0.2], "position": [0.0, 0.0, 2.0], "glass": "N-BK7"},
    ],
}


@pytest.fixture(scope="module")
def slab() -> Iterator[ss.Session]:
    with ss.Session(ss.load(SLAB), size=(96, 54), photons=20_000, spp=1) as session:
        yield session


def test_the_spectrum_under_the_cursor_is_true(slab: ss.Session) -> None:
    """Below a slab as much light arrives as two faces let through, all reflections between them counted: (1 − R)/(1 +
    R) with R = ((n − 1)/(n + 1))²; beside it all of it, as direct light."""
    light = slab.scene._model.lights[0].spectral_power
    view, browser = viewed(slab)
    until(lambda: next((p for p in browser.pictures if p[0]["done"]), None))
    below, beside = browser.light(0.5, 0.55), browser.light(0.05, 0.55)
    assert repr(view) == "View of 'scene'"
    view.close()
    assert abs(below["position"][0]) < 0.9 and abs(below["position"][1]) < 0.9 < abs(beside["position"][0])
    nm = np.array(below["wavelength_nm"])
    half = 0.5 * (nm[1] - nm[0])
    n = ss.glass("N-BK7").index(nm)
    reflected = ((n - 1.0) / (n + 1.0)) ** 2
    arriving = light.binned(np.append(nm - half, nm[-1] + half))
    expected = arriving * (1.0 - reflected) / (1.0 + reflected)
    caustic = np.array(below["caustic"])
    assert caustic.sum() == pytest.approx(expected.sum(), rel=0.07)
    assert np.abs(caustic - expected).max() < max(4.0 * below["error"], 0.05) * expected.max()
    assert np.allclose(below["direct"], 0.0)
    assert np.allclose(beside["caustic"], 0.0)
    nm = np.array(beside["wavelength_nm"])
    half = 0.5 * (nm[1] - nm[0])
    assert beside["direct"] == pytest.approx(light.binned(np.append(nm - half, nm[-1] + half)), rel=1e-6)


def test_without_a_kernel_it_is_a_picture_with_a_sentence(slab: ss.Session) -> None:
    view = slab.view()
    assert not view.is_live and repr(view).startswith("View of ")
    bundle = view._repr_mimebundle_()
    assert bundle["text/plain"] in bundle["text/html"]
    assert bundle["text/plain"].endswith((": pip install anywidget, then restart the kernel", "alone"))


def test_without_anywidget_the_sentence_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "anywidget", None)
    assert "pip install anywidget" in (widget.lack_of_front_end() or "")


def test_the_widget_carries_messages_both_ways(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("anywidget")
    heard: list[dict[str, Any]] = []
    front = widget.Front(heard.append, (640, 360))
    assert front.widget.size == [640, 360] and "export default" in front.widget._esm
    front.widget._handle_custom_msg({"kind": "home"}, [])
    assert heard == [{"kind": "home"}]
    sent: list[Any] = []
    monkeypatch.setattr(front.widget, "_send", lambda message, buffers=None: sent.append((message, buffers)))
    front.send({"kind": "picture"}, b"jpeg")
    assert sent == [({"method": "custom", "content": {"kind": "picture"}}, [b"jpeg"])]
    front.keep("<p>")
    assert front.widget.get_state()["page"] == "<p>"
    front.glasses([{"object": "a", "gain": 1.0, "most": 10.0}])
    assert front.widget.glasses[0]["object"] == "a"


def test_a_displayed_view_keeps_a_page_for_readers_without_a_kernel(
    live: tuple[ss.Session, Browser], monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, value in (("_PAGE_AFTER_S", 0.0), ("PAGE_SIZE", (64, 36)), ("PAGE_PHOTONS", 2000)):
        monkeypatch.setattr(view_module, name, value)
    session, _ = live
    view, browser = viewed(session)
    bundle = view._repr_mimebundle_()
    assert "application/vnd.jupyter.widget-view+json" in bundle
    assert base64.b64decode(bundle["image/jpeg"])[:2] == b"\xff\xd8"
    until(lambda: browser.kept or None)
    assert browser.kept.startswith("<!DOCTYPE html>") and '"scene": "prism"' in browser.kept
    view.close()
    assert not view.is_live and repr(view).endswith(", closed")


@pytest.mark.skipif(shutil.which("node") is None, reason="node is not installed")
def test_the_script_is_a_module_that_parses(tmp_path: Path) -> None:
    file = tmp_path / "view.mjs"
    shutil.copy(assets_dir() / "notebook" / "view.js", file)
    done = subprocess.run(["node", "--check", str(file)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_both_sides_use_the_same_messages() -> None:
    """Every kind that the browser sends is handled."""
    script = (assets_dir() / "notebook" / "view.js").read_text(encoding="utf-8")
    handled = Path(view_module.__file__).read_text(encoding="utf-8")
    for kind in ("seen", "hello", "hover", "gain", "orbit", "pan", "zoom", "home"):
        assert f'"{kind}"' in script and f'"{kind}"' in handled
