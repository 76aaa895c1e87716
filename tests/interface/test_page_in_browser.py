"""The page in a browser: it opens from a file, draws what its photons carry, and follows its controls."""

from __future__ import annotations

import html
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from interface.browser import CHROMIUM, Browser
from interface.page_pixels import difference, gathered
from interface.page_synthetic import TEXELS, beam, beam_map, many_photons, photon_map, photons, written

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium is installed: apt-get install chromium")
FEW = photons([0.12, 0.04], [-0.04, 0.08], [8.0, 3.0], [0.001, 0.001, 0.001], [0.0, 0.5, 1.0])
RISING = photons([0.05, 0.01], [-0.01, 0.04], [8.0, -5.0], [0.0, 0.001, 0.002], [0.2, 0.5, 0.9])
LINES = [[546.1, 3.0], [435.8, 2.0]]
COMB = [[400.0 + 12.0 * k, 1.0 + k % 3] for k in range(25)]
IS_STILL = "!document.getElementById('still').hidden && document.querySelector('.panel').offsetHeight === 0"
PROBLEM = "document.getElementById('problem').textContent"


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with Browser() as one:
        yield one


def shown_map(browser: Browser, thin: int = 1, texels: int = TEXELS) -> np.ndarray:
    """Irradiance (rows, columns, 3), v upwards along rows, seen from above, by one photon in `thin`."""
    browser.run("spectrasplat.frame()")
    step = 2.0 / texels
    to_uv = np.array([[step, 0.0, -1.0], [0.0, -step, 1.0], [0.0, 0.0, 1.0]])
    return gathered(browser, to_uv, texels, texels, thin)[::-1]


def test_it_opens_from_a_file_and_asks_for_nothing(browser: Browser, tmp_path: Path) -> None:
    page = written(tmp_path, FEW)
    browser.requests.clear()
    browser.open(page)
    assert browser.requests == [page.as_uri()]
    assert browser.mistakes == [] and browser.run(PROBLEM) == ""
    assert browser.run("spectrasplat.light.isFull")
    browser.run("spectrasplat.set({ gain: 0.7 })")
    browser.run("spectrasplat.frame()")
    assert browser.run("spectrasplat.light.draws") <= 3


@pytest.mark.parametrize(
    ("things", "gain", "lines", "bound"),
    [
        (FEW, 1.0, None, 0.035),  # in coarser texels
        (RISING, 1.0, None, 0.02),
        (RISING, 0.5, None, 0.02),
        (RISING, 1.0, LINES, 0.02),
        (RISING, 1.0, COMB, 0.02),
    ],
)
def test_photons_are_what_they_integrate_to(
    browser: Browser, tmp_path: Path, things: dict, gain: float, lines: list | None, bound: float
) -> None:
    browser.open(written(tmp_path, things, lines))
    browser.run(f"spectrasplat.set({{ gain: {gain} }})")
    found, right = shown_map(browser), photon_map(things, gain, lines)
    assert difference(found, right) < bound
    np.testing.assert_allclose(found.sum(axis=(0, 1)), right.sum(axis=(0, 1)), rtol=0.01)


def test_small_photons_are_the_same_in_larger_pixels(browser: Browser, tmp_path: Path) -> None:
    """They widen along their sides, also where they are smaller than a pixel."""
    things = RISING | {"photons.fan": np.tile([0.5, -0.3], (3, 1)).astype("f2")}
    browser.open(written(tmp_path, things))
    large, small = shown_map(browser, texels=TEXELS // 4), shown_map(browser)
    assert difference(large, small.reshape(TEXELS // 4, 4, TEXELS // 4, 4, 3).mean(axis=(1, 3))) < 0.01


@pytest.mark.parametrize(("half", "moves", "turns"), [((0.1, 0.3), [0.7, 0.5], 0.4), ((0.006, 0.3), [0.7, 0.5], 0.0)])
def test_beams_are_what_their_edges_hold(
    browser: Browser, tmp_path: Path, half: tuple, moves: list, turns: float
) -> None:
    things = beam(half, moves, turns)
    browser.open(written(tmp_path, things))
    found, right = shown_map(browser), beam_map(things, 3)
    assert difference(found, right) < 0.025
    np.testing.assert_allclose(found.sum(axis=(0, 1)), right.sum(axis=(0, 1)), rtol=0.01)


def test_a_still_polygon_that_fills_no_pixel_keeps_its_colours(browser: Browser, tmp_path: Path) -> None:
    """Its density depends on the wavelength, its place does not: in one part its red is 3 % off."""
    things = beam((0.006, 0.3), [0.0, 0.0], 0.0)
    browser.open(written(tmp_path, things))
    np.testing.assert_allclose(shown_map(browser).sum(axis=(0, 1)), beam_map(things, 5).sum(axis=(0, 1)), rtol=0.015)


@contextmanager
def lacking(browser: Browser, method: str, *arguments: str, answer: str = "null") -> Iterator[None]:
    """A device of which WebGL's `method` answers so, asked for these (JavaScript)."""
    script = f"""{{
        const all = WebGL2RenderingContext.prototype.{method};
        WebGL2RenderingContext.prototype.{method} = function (what) {{
            return [{", ".join(arguments)}].includes(what) ? {answer} : all.call(this, what);
        }};
    }}"""
    added = browser.call("Page.addScriptToEvaluateOnNewDocument", source=script)["identifier"]
    try:
        yield
    finally:
        browser.call("Page.removeScriptToEvaluateOnNewDocument", identifier=added)


def test_a_device_that_blends_half_floats_alone_is_less_exact(browser: Browser, tmp_path: Path) -> None:
    with lacking(browser, "getExtension", "'EXT_float_blend'"):
        browser.open(written(tmp_path, FEW))
    assert not browser.run("spectrasplat.light.isFull") and "16 bits" in browser.run("document.body.innerText")
    assert difference(shown_map(browser), photon_map(FEW, 1.0, None)) < 0.04


def test_a_device_that_cannot_add_light_up_shows_the_still(browser: Browser, tmp_path: Path) -> None:
    page = written(tmp_path, FEW)
    with lacking(browser, "getExtension", "'EXT_color_buffer_float'", "'EXT_color_buffer_half_float'"):
        browser.open(page)
        assert "floating-point" in browser.run(PROBLEM) and browser.run(IS_STILL)
    with lacking(browser, "getParameter", "WebGL2RenderingContext.MAX_TEXTURE_SIZE", answer="1024"):
        browser.open(page)
        assert "cannot hold as many photons" in browser.run(PROBLEM) and browser.run(IS_STILL)


def test_a_key_on_the_slider_changes_the_picture(browser: Browser, tmp_path: Path) -> None:
    browser.open(written(tmp_path, FEW))
    before = shown_map(browser)
    browser.run("document.getElementById('gain').focus()")
    for _ in range(5):
        browser.call(
            "Input.dispatchKeyEvent", type="keyDown", key="ArrowLeft", code="ArrowLeft", windowsVirtualKeyCode=37
        )
    assert browser.run("spectrasplat.state.gain") == pytest.approx(0.95)
    assert difference(shown_map(browser), before) > 0.02
    assert "0.95" in browser.run("document.getElementById('gain').getAttribute('aria-valuetext')")


def test_a_finger_reads_the_spectrum(browser: Browser, tmp_path: Path) -> None:
    browser.open(written(tmp_path, FEW))
    browser.run("spectrasplat.set({ isSingle: true, nm: 587, mark: [-0.31 - 8 * 0.01, 0.12 - 3 * 0.01] })")
    browser.run("spectrasplat.frame()")
    assert "most of it at 585 nm" in browser.run("document.getElementById('here-says').textContent")
    browser.run("spectrasplat.set({ mark: [0.9, 0.9] })")
    browser.run("spectrasplat.frame()")
    assert "No light" in browser.run("document.getElementById('here-says').textContent")


@pytest.mark.parametrize(
    ("width", "height"), [(320, 560), (360, 740), (740, 360), (640, 400), (820, 1180), (1200, 700)]
)
def test_the_picture_stays_in_sight_of_its_controls(browser: Browser, tmp_path: Path, width: int, height: int) -> None:
    """On phones upright and on their side, on tablets, and where text is twice as large as usual."""
    browser.open(written(tmp_path, FEW), width, height, "dark")
    assert browser.run("document.documentElement.scrollWidth") == width
    assert browser.run("Math.min(...[...document.querySelectorAll('button')].map((b) => b.offsetHeight || 99))") >= 40
    for control in ("gain", "exposure"):
        middle = f"""(() => {{
            const control = document.getElementById('{control}'), picture = document.getElementById('picture');
            control.scrollIntoView({{ block: 'center' }});
            const box = control.getBoundingClientRect(), seen = picture.getBoundingClientRect();
            const met = document.elementFromPoint(box.x + box.width / 2, box.y + box.height / 2);
            return [met === control, seen.top, seen.bottom];
        }})()"""
        is_met, top, bottom = browser.run(middle)
        assert is_met and -1 <= top < bottom <= height, control


def test_a_screen_reader_names_what_is_set(browser: Browser, tmp_path: Path) -> None:
    browser.open(written(tmp_path, FEW))
    nodes = browser.call("Accessibility.getFullAXTree")["nodes"]
    found = {(n["role"]["value"], n["name"]["value"]) for n in nodes if not n["ignored"] and "name" in n}
    sliders = ("Dispersion", "Wavelength in nanometres", "Exposure", "Refractive index by wavelength")
    assert {name for role, name in found if role == "slider"} == set(sliders)
    others = {("checkbox", "One wavelength only"), ("combobox", "Glass"), ("combobox", "Light")}
    assert others | {("application", "A test: the light, live"), ("button", "Sweep the dispersion")} <= found
    assert not [role for role, name in found if role in ("button", "combobox", "checkbox") and not name]


def test_without_webgl2_it_says_what_is_needed(tmp_path: Path) -> None:
    with Browser("--disable-3d-apis") as bare:
        bare.open(written(tmp_path, FEW))
        assert "WebGL2" in bare.run(PROBLEM) and bare.run(IS_STILL)


@pytest.mark.parametrize("cut", [lambda t: t[:-3000], lambda t: t.replace('id="blob">', 'id="blob">?', 1)])
def test_a_damaged_page_shows_its_still(browser: Browser, tmp_path: Path, cut: Callable[[str], str]) -> None:
    page = written(tmp_path, FEW)
    page.write_text(cut(page.read_text("utf-8")), "utf-8")
    browser.open(page)
    assert "damaged or cut off" in browser.run(PROBLEM) and browser.run(IS_STILL)


WAITS = "document.getElementById('waits').offsetHeight > 0"


@pytest.mark.parametrize("last", ["data:image/jpeg;base64,", "requestAnimationFrame"])
def test_a_page_cut_off_before_its_data_says_so(browser: Browser, tmp_path: Path, last: str) -> None:
    """Within its still, and within its script."""
    page = written(tmp_path, FEW)
    browser.open(page)
    assert not browser.run(WAITS)
    page.write_text(page.read_text("utf-8").partition(last)[0] + last, "utf-8")
    browser.call("Page.navigate", url=page.as_uri())
    browser.wait(f"document.readyState === 'complete' && !window.spectrasplat && {WAITS}")
    shown = "(one) => one.checkVisibility({ visibilityProperty: true })"
    assert not browser.run(f"[...document.querySelectorAll('button, input')].some({shown})")


@pytest.mark.slow
def test_the_still_is_shown_first_and_within_two_seconds(tmp_path: Path) -> None:
    """Of 100,000 photons by software WebGL: milliseconds since a fresh browser was asked for the page, the least of
    three; the live picture follows."""
    page, times = written(tmp_path, many_photons(100_000)), []
    shown = """new Promise((done) => new PerformanceObserver((list) => done(list.getEntries()[0].startTime))
        .observe({ type: 'element', buffered: true }))"""
    for _ in range(3):
        with Browser() as fresh:
            fresh.open(page, 1200, 900)
            times.append((fresh.run(shown), fresh.run("spectrasplat.times.first")))
    assert all(0.0 < still < live for still, live in times)
    assert min(still for still, _ in times) < 2000.0, times


def test_fewer_photons_show_as_much_light(browser: Browser, tmp_path: Path) -> None:
    """While something moves: one photon in 16, wider and brighter."""
    browser.open(written(tmp_path, many_photons(70_000)))
    whole, thin = shown_map(browser), shown_map(browser, 16)
    np.testing.assert_allclose(thin.sum(axis=(0, 1)), whole.sum(axis=(0, 1)), rtol=0.03)
    assert 0.02 < difference(thin, whole) < 0.4


def test_a_lost_context_is_told_and_comes_back(browser: Browser, tmp_path: Path) -> None:
    browser.open(written(tmp_path, FEW))
    before = shown_map(browser)
    browser.run("window.lost = spectrasplat.light.gl.getExtension('WEBGL_lose_context'), lost.loseContext()")
    browser.wait(f"{PROBLEM}.includes('graphics card')")
    assert browser.run(IS_STILL)
    browser.run("lost.restoreContext()")
    browser.wait(f"spectrasplat.light && {PROBLEM} === '' && !({IS_STILL})")
    np.testing.assert_array_equal(shown_map(browser), before)
    assert browser.mistakes == []


def test_several_pages_live_in_one_notebook(browser: Browser, tmp_path: Path) -> None:
    inner = html.escape(written(tmp_path, FEW).read_text("utf-8"))
    outer = tmp_path / "notebook.html"
    outer.write_text(f'<iframe srcdoc="{inner}" sandbox="allow-scripts allow-same-origin"></iframe>' * 2, "utf-8")
    browser.call("Page.navigate", url=outer.as_uri())
    browser.wait("frames.length === 2 && frames[0].spectrasplat?.light && frames[1].spectrasplat?.light")
    assert browser.mistakes == []


def test_a_learning_platform_may_keep_it_in_a_sandbox(tmp_path: Path) -> None:
    """Where it has no origin, no storage and may save nothing, which it says."""
    script = """<script>const poll = setInterval(() => {
        if (!window.spectrasplat) return;
        clearInterval(poll);
        document.getElementById('save').click();
        const { hidden } = document.getElementById('framed');
        parent.postMessage([origin, Boolean(spectrasplat.light), hidden], '*');
    }, 50)</script>"""
    inner = html.escape(written(tmp_path, FEW).read_text("utf-8") + script)
    outer = tmp_path / "platform.html"
    told = "<script>onmessage = ({ data }) => (window.told = data)</script>"
    outer.write_text(f'{told}<iframe srcdoc="{inner}" sandbox="allow-scripts"></iframe>', "utf-8")
    with Browser() as browser:
        browser.call("Page.navigate", url=outer.as_uri())
        browser.wait("window.told")
        assert browser.run("told") == ["null", True, False] and browser.mistakes == []
