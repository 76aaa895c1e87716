"""The bench report on made-up results: everything measured is in it, nothing from outside, and nothing odd breaks
it."""

from __future__ import annotations

import math
import re
from collections import Counter
from html.parser import HTMLParser
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from spectrasplat.base.errors import UserError
from spectrasplat.bench.curves import best_baseline, time_to_error
from spectrasplat.bench.report import curve_plots, pictures, report, style, tables
from spectrasplat.bench.report import text as report_text
from spectrasplat.bench.report.page import PROSE
from spectrasplat.bench.results import BenchResult, Curve, Point, SceneResult, SpeedUp
from spectrasplat.reference.metrics import EPSILON_SHARE

from tests.unit.bench_synthetic import METHODS, synthetic_result, synthetic_scene


class Page(HTMLParser):
    """Collects what a page holds; an element that is closed wrongly is an error."""

    VOID = frozenset({"img", "br", "meta"})

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.open: list[str] = []
        self.tags: Counter[str] = Counter()
        self.attributes: list[tuple[str, str, str]] = []
        self.words: list[str] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags[tag] += 1
        self.attributes += [(tag, key, value or "") for key, value in attrs]
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in self.VOID:
            self.open.pop()

    def handle_endtag(self, tag: str) -> None:
        assert self.open and self.open.pop() == tag, f"</{tag}> closes nothing"

    def handle_data(self, data: str) -> None:
        self.words.append(data)

    @property
    def text(self) -> str:
        return " ".join("".join(self.words).split())


def assert_stands_alone(text: str) -> Page:
    """Well-formed, nothing fetched, no script, ids unique, every reference inside the page resolves."""
    page = Page(text)
    assert not page.open
    assert "http" not in text
    assert page.tags["script"] == 0 and page.tags["link"] == 0 and page.tags["iframe"] == 0
    ids = Counter(value for _, key, value in page.attributes if key == "id")
    assert not [name for name, times in ids.items() if times > 1]
    for tag, key, value in page.attributes:
        assert not key.startswith("on"), f"{tag} has {key}"
        if key == "src":
            assert value.startswith("data:image/png;base64,")
        if key in ("href", "xlink:href"):
            assert value.startswith("#") and value[1:] in ids, value
        for target in re.findall(r"url\(#([^)]+)\)", value):
            assert target in ids, target
    assert "url(" not in text.replace("url(#", "")
    return page


def assert_numbers_are_finite(svg: str) -> None:
    for node in ElementTree.fromstring(svg).iter():
        for key, value in node.attrib.items():
            if key in ("d", "points", "x", "y", "transform", "width", "height", "viewBox"):
                assert not re.search(r"nan|inf", value, re.IGNORECASE), f"{node.tag} {key}={value[:60]}"


def svg_of(figure: object) -> str:
    text = style.svg_text(figure)
    assert_numbers_are_finite(text)
    return text


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> tuple[BenchResult, Path]:
    """A whole run of two scenes, reported once."""
    directory = tmp_path_factory.mktemp("bench")
    result = synthetic_result(
        [synthetic_scene(directory, "ball"), synthetic_scene(directory, "wine_glass", gain=12.5, difficulty=3.0)]
    )
    report.write_report(result, directory)
    return result, directory


def test_page_stands_alone_and_holds_everything(written: tuple[BenchResult, Path]) -> None:
    result, directory = written
    page = assert_stands_alone((directory / "report.html").read_text(encoding="utf-8"))
    told = [result.command, result.version, result.date, *result.machine.values()]
    for scene in result.scenes:
        told += [scene.scene, scene.title, scene.strongest_glass]
        told += [curve.method for curve in scene.curves]
    told += [*PROSE["light"].metrics, *(PROSE["light"].methods[name] for name in METHODS)]
    for words in told:
        assert words in page.text, words
    # Per scene: seven columns in two rows of parts and one of whole pictures, six error maps and their scale.
    assert page.tags["img"] == 2 * (3 * 7 + 6 + 1)
    assert page.tags["svg"] == 2 * 2
    # The headline by both clocks, the kernels that were tried, and every ratio with the baseline that it is against.
    for scene in result.scenes:
        assert {one.clock for one in scene.speed_ups} == {"photon", "whole"}
        for one in scene.speed_ups:
            assert f"{report_text.speed_up_text(one)} {one.baseline}".strip() in page.text
    assert page.text.count("best kernel") >= 2 and "whole process" in page.text
    assert "To a relMSE of 1 % srd is, by photon time, faster than the best of all baselines" in page.text


@pytest.mark.parametrize(
    ("seconds", "at_once", "baseline", "baseline_at_once", "told"),
    [
        (0.5, False, "stochastic", False, "20×"),
        (0.5, True, "stochastic", False, "≥ 20×"),
        (0.5, False, "", False, "≥ 20×"),
        (0.5, False, "stochastic", True, "≤ 20×"),
        (0.5, True, "stochastic", True, "both at once"),
        (None, False, "stochastic", False, "not reached"),
    ],
)
def test_a_speed_up_says_what_is_known_of_it(
    seconds: float | None, at_once: bool, baseline: str, baseline_at_once: bool, told: str
) -> None:
    one = SpeedUp(0.01, "photon", seconds, at_once, baseline, 10.0, baseline_at_once)
    assert report_text.speed_up_text(one) == told and report_text.speed_up_text(None) == "–"


def test_partial_run_of_one_method_and_one_seed(tmp_path: Path) -> None:
    """Hostile names, no reference, no pictures, an unfinished curve: all is told, nothing breaks, nothing leaks into
    the page."""
    nasty = '<script>alert("1")</script> & $x_$ 桜'
    scene = synthetic_scene(tmp_path, "x", methods=["srd"], seeds=1)
    scene.scene = scene.title = nasty
    scene.reference, scene.pictures, scene.complete = None, {"reference": "pictures/gone.npy"}, False
    scene.curves.append(Curve(nasty, {}, []))
    result = synthetic_result([scene])
    result.command = nasty
    report.write_report(result, tmp_path)
    page = assert_stands_alone((tmp_path / "report.html").read_text(encoding="utf-8"))
    assert page.text.count(nasty) > 5
    for words in (
        "There are no pictures",
        "There is no reference yet",
        "Only one seed",
        "stopped before this scene was complete",
        "No finished point yet",
    ):
        assert words in page.text, words


def test_empty_run_and_refused_folder(tmp_path: Path) -> None:
    report.write_report(synthetic_result([]), tmp_path)
    page = assert_stands_alone((tmp_path / "report.html").read_text(encoding="utf-8"))
    assert "Nothing has been compared yet" in page.text
    (tmp_path / "file").write_text("")
    with pytest.raises(UserError, match="cannot make the folder"):
        report.write_report(synthetic_result([]), tmp_path / "file")


def test_failure_keeps_the_earlier_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "report.html").write_text("earlier")
    monkeypatch.setattr(report, "document", lambda *_: (_ for _ in ()).throw(KeyboardInterrupt))
    with pytest.raises(KeyboardInterrupt):
        report.write_report(synthetic_result([]), tmp_path)
    assert (tmp_path / "report.html").read_text() == "earlier"
    assert not list(tmp_path.glob(".*"))


def made_of(points: list[Point], tmp_path: Path) -> SceneResult:
    scene = synthetic_scene(tmp_path, "odd", methods=["stochastic", "srd"])
    scene.curves[1].points = points
    return scene


@pytest.mark.parametrize("abscissa", ["seconds", "photons"])
def test_errors_that_have_no_logarithm(tmp_path: Path, abscissa: str) -> None:
    """Zero and negative errors stand on the floor as triangles; NaN and infinity are left out; axes stay finite and
    sane."""
    good = [Point(10**k, 10.0 ** (k - 6), 10.0**-k, 0.5 * 10.0**-k, 2 * 10.0**-k, 0.0, 10.0**-k) for k in range(3, 6)]
    odd = [
        Point(1_000_000, 1.0, 0.0, 0.0, 1e-6, 0.0, 0.0),
        Point(2_000_000, 2.0, -1e-7, -1e-6, 0.0, -1e-7, 0.0),
        Point(3_000_000, 3.0, math.nan, 0.0, 1.0, math.nan, 0.0),
        Point(4_000_000, 4.0, math.inf, 0.0, math.inf, 0.0, math.inf),
        Point(0, 0.0, 1.0, 1.0, 1.0, 0.0, 1.0),
    ]
    scene = made_of(good + odd, tmp_path)
    with style.plot_style():
        figure = curve_plots.error_against(scene, abscissa)
        svg_of(figure)
        axes = figure.axes[0]
        low, high = axes.get_ylim()
        assert 1e-6 < low < 1e-5 and high < 1e3
        on_floor = [line for line in axes.lines if line.get_marker() == "v" and np.all(line.get_ydata() == low)]
        assert [len(line.get_xdata()) for line in on_floor] == [2]
        for points in ([], odd[:2], odd[2:], good[:1]):
            scene = made_of(points, tmp_path)
            svg_of(curve_plots.error_against(scene, abscissa))
    assert "cannot be distinguished from the reference" in " ".join(report_text.warnings_of(made_of(odd[:1], tmp_path)))


def test_readme_plot(tmp_path: Path) -> None:
    """The README's panels say the speed-up over the best baseline; a shortest rendering that is already as good is
    marked ≥."""
    near, far, none = (synthetic_scene(tmp_path, name) for name in ("near", "far", "none"))
    near.curves[-1].points = [Point(1000, 0.025, 1e-6, 1e-6, 1e-6, 0.0, 1e-6)]
    none.curves = []
    # The best baseline by error at the end, not always `stochastic`.
    for curve, errors in zip(
        far.curves, ((5.0, 2.0), (4.0, 1.0), (4.0, 0.5), (9.0, 6.0), (4.0, 3.0), (7.0, 0.25)), strict=True
    ):
        curve.points = [
            Point(n, s, e, e, e, 0.0, e) for n, s, e in zip((1000, 9000), (0.01, 1.28), errors, strict=True)
        ]
    best = best_baseline(far.curves)
    assert best is not None and best.method != "stochastic"
    theirs, own = (time_to_error(c.points, best.points[-1].relmse) for c in (best, far.curves[-1]))
    assert theirs is not None and own is not None and theirs.seconds > own.seconds
    report.readme_plot(synthetic_result([far, near, none]), tmp_path / "readme")
    assert (tmp_path / "readme.png").stat().st_size > 10_000
    svg = (tmp_path / "readme.svg").read_text(encoding="utf-8")
    assert_numbers_are_finite(svg)
    assert f">{report_text.ratio_text(theirs.seconds / own.seconds)} less time<" in svg
    assert ">≥ " in svg, "a shortest rendering that is as good already"
    assert 0 < svg.index(">far<") < svg.index(">near<"), "in the order they were named, not the best first"
    assert ">none<" not in svg and ">regular-7<" not in svg and ">srd-lambda<" in svg
    report.readme_plot(synthetic_result([]), tmp_path / "empty")


def test_tables_as_markdown(tmp_path: Path) -> None:
    """What documents are made of: every table has each scene once, in the order they were named, and says what the
    page says."""
    scene, bare = synthetic_scene(tmp_path, "a|b"), synthetic_scene(tmp_path, "bare")
    scene.speed_ups = [
        SpeedUp(0.1, "photon", 0.05, False, "stochastic", 0.6, False),
        SpeedUp(0.1, "whole", 2.0, False, "stochastic", 2.2, False),
        SpeedUp(0.01, "photon", 0.1, False, "", 1.0, False),
    ]
    bare.speed_ups, bare.curves, bare.reference = [], [], None
    text = tables.markdown(synthetic_result([scene, bare]))
    lines = text.splitlines()
    for block in text.split("\n\n"):
        if block.startswith("|"):
            assert len({len(re.findall(r"(?<!\\)\|", line)) for line in block.splitlines()}) == 1, block
    photon, whole = (line for line in lines if line.startswith("| a\\|b |"))
    assert "12× stochastic" in photon and "≥ 10×" in photon and "1.1× stochastic" in whole
    last = next(curve for curve in scene.curves if curve.method == "srd").points[-1]
    assert f"{report_text.number(last.relmse)}, {last.seconds:.2g} s" in text
    assert "## relMSE after 0.1 s of photon time" in text and "## nRMSE at the end" in text
    rows_of_bare = [line for line in lines if line.startswith("| `bare` |")]
    assert len(rows_of_bare) == 5 and all(set(line[9:]) <= set("|– ") for line in rows_of_bare)


def test_crop_finds_structure_and_error_maps_are_true() -> None:
    rng = np.random.default_rng(3)
    reference = np.full((60, 90, 3), 0.05)
    reference[35:50, 60:80] = 1.0 + rng.random((15, 20, 1))
    window = pictures.choose_window(reference)
    covered = window.of(np.ones((60, 90)))
    assert covered.shape == (window.height, window.width) == (16, 24)
    assert window.of(reference)[..., 1].sum() > 0.9 * reference[35:50, 60:80, 1].sum()
    for black in (np.zeros((60, 90, 3)), np.zeros((1, 1, 3)), np.zeros((3, 200, 3))):
        assert pictures.choose_window(black).of(black).size
    picture = reference * (1 + 0.1 * rng.standard_normal(reference.shape))
    epsilon = EPSILON_SHARE * reference.mean() ** 2
    relmse_y = np.mean(((picture - reference) ** 2 / (reference**2 + epsilon))[..., 1])
    assert np.mean(pictures.signed_error(picture, reference) ** 2) == pytest.approx(relmse_y, rel=1e-12)
    brighter = pixels(pictures.error_map(np.array([[-1.0, -0.25, 0.0, 0.25, 1.0]]), 1.0))[0].astype(int)
    assert brighter[2].min() > 240 and abs(np.ptp(brighter[2])) < 4
    assert brighter[4, 0] > brighter[4, 2] + 50 and brighter[0, 2] > brighter[0, 0] + 50
    scale = pixels(pictures.error_scale())[0]
    assert np.array_equal(scale[[0, 16, 32, 48, 64]], brighter), (
        "the scale is marked at −1, 0 and 1; a quarter lies half-way"
    )


def pixels(address: str) -> np.ndarray:
    """RGB of a picture in a data: address."""
    import base64
    import io

    from PIL import Image

    return np.asarray(Image.open(io.BytesIO(base64.b64decode(address.partition(",")[2]))).convert("RGB"))


def test_broken_pictures_are_left_out(tmp_path: Path) -> None:
    whole = np.ones((4, 6, 3), np.float32)
    np.save(tmp_path / "reference.npy", whole)
    np.save(tmp_path / "srd.npy", 2 * whole)
    np.save(tmp_path / "size.npy", whole[:2])
    np.save(tmp_path / "nan.npy", np.where(np.arange(6)[:, None] == 3, np.nan, whole))
    np.save(tmp_path / "object.npy", np.array([{}], object))
    (tmp_path / "cut.npy").write_bytes((tmp_path / "srd.npy").read_bytes()[:200])
    files = {name: f"{name}.npy" for name in ("reference", "srd", "size", "nan", "object", "cut", "gone")}
    assert sorted(pictures.load_pictures(files, tmp_path)) == ["reference", "srd"]
    assert pictures.load_pictures({"srd": "srd.npy"}, tmp_path) == {}
