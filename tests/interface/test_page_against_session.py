"""A page's pixels in a browser against `ss.Session`'s at the same n(λ).

Both are estimates, which agree as photons grow. A page traces the indices of all gains up to 2, so at gain 0.5 it shows
a quarter of its photons: at every gain it must be as near to a session of many more as a session of that quarter is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import pytest
import spectrasplat as ss
from interface import page_pixels as page_pixels_module
from interface.browser import CHROMIUM, Browser
from interface.page_pixels import BALL, difference, page_pixels, session_pixels

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium is installed: apt-get install chromium")
GAINS = (0.5, 2.0)
"""The fewest photons, and the widest spread: all between is looked up alike."""
OWN = 0.015
"""nRMSE that a page may have beyond that of a session of a quarter of its photons."""
RIGHT = 5
"""Times a page's photons: of the session that is right."""


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with Browser() as one:
        yield one


def with_gain(names: Sequence[str], gain: float) -> Callable[[ss.Session], None]:
    def change(session: ss.Session) -> None:
        for name in names:
            session.scene.objects[name].dispersion_gain = gain

    return change


def with_glass(names: Sequence[str], glass: str) -> Callable[[ss.Session], None]:
    def change(session: ss.Session) -> None:
        for name in names:
            session.set_glass(name, glass, dispersion_gain=1.0)

    return change


def errors(
    browser: Browser, folder: Path, scene: ss.Scene, size: tuple[int, int], photons: int, glasses: int
) -> dict[str, tuple[float, float]]:
    """nRMSE, to a session of `RIGHT` times as many photons, of a page's pixels, and of a session of a quarter of the
    page's photons; by what is shown: gains, then other glasses."""
    page = ss.page(scene, size=size, photons=photons)
    names = [name for group in page.head["groups"] for name in group["objects"]]
    rows = page.head["groups"][0]["choices"][1:][:glasses] if glasses else []
    assert len(rows) == glasses
    others = {page.head["glasses"][row]["name"]: row for row in rows}
    own = page.head["groups"][0]["row"]
    settings = [f"{{ gain: {gain}, rows: spectrasplat.state.rows.with(0, {own}) }}" for gain in GAINS]
    settings += [f"{{ gain: 1, rows: spectrasplat.state.rows.with(0, {row}) }}" for row in others.values()]
    changes = [with_gain(names, gain) for gain in GAINS] + [with_glass(names, name) for name in others]
    pictures, seen = page_pixels(browser, page, folder, settings)
    fewer, right = (session_pixels(scene, size, int(share * photons), changes) for share in (0.25, RIGHT))
    told = [f"gain {gain}" for gain in GAINS] + list(others)
    found = {
        shown: (difference(one[seen], truth[seen]), difference(few[seen], truth[seen]))
        for shown, one, few, truth in zip(told, pictures, fewer, right, strict=True)
    }
    for shown, (page_error, session_error) in found.items():
        print(f"{page.head['scene']}, {shown}: page {page_error:.4f}, a session of fewer {session_error:.4f}")
    return found


def check(found: dict[str, tuple[float, float]]) -> None:
    assert {shown: pair for shown, pair in found.items() if pair[0] > OWN + pair[1]} == {}


@pytest.mark.slow
def test_photons_are_as_a_sessions(browser: Browser, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A ball's caustic is broad: pixels of a session that are half as wide will do."""
    monkeypatch.setattr(page_pixels_module, "FINER", 2)
    check(errors(browser, tmp_path, ss.Scene(BALL), (96, 64), 2000, 0))


@pytest.mark.slow
@pytest.mark.parametrize(("name", "glasses"), [("prism", 5), ("ball", 5), ("lens", 5), ("brilliant", 0)])
def test_a_scene_is_as_a_session_shows_it(browser: Browser, tmp_path: Path, name: str, glasses: int) -> None:
    check(errors(browser, tmp_path, ss.load(name), (160, 96), 20_000, glasses))
