"""Thin films: known answers of the stack, of both ways to compute it, and the words of a scene file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from spectrasplat.base.errors import UserError
from spectrasplat.model.film_stacks import film_curves, film_stacks, film_tables, film_thickness
from spectrasplat.model.geometry.primitives import box, plane
from spectrasplat.model.io.scene_table import SceneTable
from spectrasplat.model.materials.coating import PRESETS, RADIUS, Coating
from spectrasplat.model.materials.material_file import read_material
from spectrasplat.model.optics.catalogue import find
from spectrasplat.model.optics.glass import constant
from spectrasplat.model.optics.metals import metals
from spectrasplat.model.optics.thin_films import AIR, Film, Layer, Stack, power
from spectrasplat.model.scene import Camera, Dielectric, Material, Mirror, Scene, SceneObject
from spectrasplat.reference.thin_films import film_amplitudes, film_nm, films_of
from spectrasplat.render.viewer.invalidation import DirtyLevel, _object

NM = np.linspace(380.0, 780.0, 41)
GLASS = constant(1.52)
GRID = np.linspace(380.0, 780.0, 8001)
SHEET = plane(1.0, 1.0)


def stack(*layers: tuple[float, float]) -> Stack:
    return Stack(AIR, Film(tuple(Layer(constant(n), nm) for n, nm in layers)), GLASS)


@pytest.mark.parametrize("nm", [1.0, 137.0, 2000.0, 1e5])
@pytest.mark.parametrize("degrees", [0.0, 45.0, 89.0])
def test_one_layer_is_as_airy_says(nm: float, degrees: float) -> None:
    """Two faces and all that goes to and fro between them. [Born and Wolf, 1.6.4, eq. 62]"""
    n = (1.0, 1.38, 1.52)
    cosines = [np.sqrt(1.0 - (np.sin(np.radians(degrees)) / index) ** 2) for index in n]
    expected = np.zeros(len(NM))
    phase = 2.0 * np.pi * n[1] * nm * cosines[1] / NM
    for admittance in (
        [i * c for i, c in zip(n, cosines, strict=True)],
        [i / c for i, c in zip(n, cosines, strict=True)],
    ):
        a, b, c = admittance
        r, s = (a - b) / (a + b), (b - c) / (b + c)
        cosine = 2.0 * r * s * np.cos(2.0 * phase)
        expected += 0.5 * (r * r + s * s + cosine) / (1.0 + r * r * s * s + cosine)
    reflected, passed = power(stack((1.38, nm)), cosines[0], NM)
    np.testing.assert_allclose(reflected, expected, atol=1e-12)
    np.testing.assert_allclose(passed, 1.0 - expected, atol=1e-12)


def test_energy() -> None:
    """What is clear loses nothing, a thousand layers neither, and metal no less than nothing; both sides let as much
    through."""
    for film in (
        *PRESETS.values(),
        Film(tuple(Layer(constant(1.4 + 0.9 * (k % 2)), 80.0 + k % 7) for k in range(1000))),
    ):
        for cosine in (1.0, 0.6, 0.01):
            reflected, passed = power(Stack(AIR, film, GLASS), cosine, NM)
            np.testing.assert_allclose(reflected + passed, 1.0, atol=1e-9)
    for metal in metals().values():
        for nm in (1.0, 20.0, 1e5):
            of = Stack(AIR, Film((Layer(metal, nm),)), GLASS)
            front, back = of.amplitudes(np.array(0.5), NM), of.amplitudes(np.array(0.5), NM, from_back=True)
            for r, t, other in ((front.r_s, front.t_s, back.t_s), (front.r_p, front.t_p, back.t_p)):
                assert (abs(r) ** 2 + abs(t) ** 2 < 1.0).all()
                np.testing.assert_allclose(abs(t), abs(other), rtol=1e-9)
            assert nm < 1e5 or abs(front.t_s).max() < 1e-60


def test_metals_are_as_bright_as_they_are() -> None:
    """Normal reflectance at 650, 550 and 450 nm, from n and k of the same papers: |(1 − n − ik) / (1 + n + ik)|²."""
    assert set(metals()) == {"gold", "silver", "copper", "aluminium"}
    for metal in metals().values():
        n = metal.index(NM)
        reflected, _ = power(Stack(AIR, Film(()), metal), 1.0, NM)
        np.testing.assert_allclose(reflected, abs((1.0 - n) / (1.0 + n)) ** 2, atol=1e-12)
    gold = power(Stack(AIR, Film(()), metals()["gold"]), 1.0, np.array([450.0, 650.0]))[0]
    assert gold[0] < 0.42 and gold[1] > 0.95


def one(material: Material) -> Scene:
    mesh = plane(1.0, 1.0) if material.thin or material.is_mirror else box((1.0, 1.0, 1.0))
    return Scene("one", Camera((0, 0, 5), (0, 0, 0)), (), (SceneObject("one", mesh, material),))


def test_the_reference_has_the_same_by_another_way() -> None:
    films = {name: Film(film.layers, film.share) for name, film in PRESETS.items()}
    films["metals"] = Film((Layer(metals()["gold"], 20.0), Layer(constant(1.5), 300.0), Layer(metals()["silver"], 9.0)))
    films["thick"] = Film((Layer(constant(1.33), 1e5),))
    films["thin"] = Film((Layer(constant(2.5), 1.0),))
    rng = np.random.default_rng(5)
    for film in films.values():
        material = Dielectric(GLASS, coating=Coating(film))
        tables = films_of(one(material), GRID)
        for _ in range(24):
            nm, sine, back = GRID[rng.integers(1, 8000)], rng.uniform(0.0, 1.0), bool(rng.integers(2))
            sine *= 1.5 if back else 1.0  # beyond total reflection, from behind
            wanted = Stack(AIR, film, GLASS).amplitudes(np.array([sine]), np.array([nm]), back)
            found = film_amplitudes(tables, 0, 1.0, 1.52, sine, back, nm, -1.0)
            np.testing.assert_allclose([a[0] for a in wanted], found, atol=1e-8)


def test_films_know_the_media_that_they_touch() -> None:
    soap = Dielectric(constant(1.33), thin=True, film_nm=300.0)
    things = (
        SceneObject("solid", box((1.0, 1.0, 1.0)), Dielectric(GLASS)),
        SceneObject("within", plane(0.5, 0.5), soap),
        SceneObject("far", plane(0.5, 0.5), soap, translated(4.0)),
        SceneObject("below", plane(1.0, 1.0), Mirror(metal="gold"), translated(-0.5)),
    )
    found = film_stacks(Scene("in", Camera((0, 0, 5), (0, 0, 0)), (), things))
    media = [
        [None if stack is None else (stack.before.name, stack.behind.name) for stack in of] for of in found.values()
    ]
    assert media == [
        [("air", "air"), (GLASS.name, GLASS.name)],
        [("air", "air"), None],
        [("air", "gold"), (GLASS.name, "gold")],
    ]


def translated(z: float) -> np.ndarray:
    return np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, z], [0.0, 0.0, 0.0, 1.0]])


def test_tables_hold_running_means() -> None:
    """A mean over any stretch is a difference of two columns, and thick films have as much in all as their mean."""
    scene = one(Dielectric(GLASS, film_nm=5000.0))
    nm = np.linspace(380.0, 780.0, 1025)
    tables = film_tables(scene, nm, False)
    reflected, _ = power(film_stacks(scene)[0][0], 1.0, nm)
    assert tables.rows.shape == (129, 1025)
    expected = np.trapezoid(reflected[256:513], nm[256:513]) / (nm[512] - nm[256])
    assert (tables.rows[-1, 512] - tables.rows[-1, 256]) * 4.0 == pytest.approx(expected, abs=1e-6)
    assert tables.rows[0, -1] == pytest.approx(1.0, abs=1e-3)  # grazing
    assert len(film_curves(scene)) == 6


def read(text: dict[str, object], tmp_path: Path) -> Material:
    return read_material(SceneTable(text, tmp_path / "scene.toml", "materials.one"))


LAYERS = [{"n": 1.38, "nm": 99.6}, {"metal": "silver", "nm": 20.0}, {"glass": "Schott N-BK7", "nm": 50.0}]


@pytest.mark.parametrize(
    "text",
    [
        {"glass": "Schott N-BK7", "coating": "ar"},
        {"glass": "Schott N-BK7", "coating": {"layers": LAYERS}},
        {"glass": "Schott N-BK7", "thin": True, "coating": {"share": 0.3}},
        {"glass": "water", "thin": True, "film_nm": 400.0},
        {"glass": "water", "film_nm": 300.0, "film_index": 1.47},
        {"glass": "Schott N-BK7", "film_nm": 300.0, "coating": "ar"},
        {"kind": "mirror", "metal": "gold", "film_nm": 80.0, "film_index": 2.0},
        {"kind": "mirror", "metal": "copper", "roughness": 0.4},
        {"glass": "water", "thin": True, "film_nm": 900.0, "film_from_nm": 20.0, "film_along": [0.0, -1.0, 0.0]},
        {"n_d": 1.0, "thin": True, "film_nm": 3000.0, "film_along": "radius"},
    ],
)
def test_words_come_back(text: dict[str, object], tmp_path: Path) -> None:
    material = read(text, tmp_path)
    assert material.film is not None
    values = material.values()
    assert read(values, tmp_path) == material
    assert {**values, **text} == values
    assert material.why_no_beams is not None


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ({"glass": "N-BK7", "coating": "art"}, "coating 'art' is unknown, did you mean 'ar'"),
        ({"glass": "N-BK7", "coating": 3}, "coating must be a table"),
        ({"glass": "N-BK7", "coating": {"layers": []}}, "0 layers; give 1 to 1000"),
        ({"glass": "N-BK7", "coating": {"layers": [{"nm": 3.0}]}}, "has no material: give 'n', 'glass' or 'metal'"),
        ({"glass": "N-BK7", "coating": {"layers": [{"n": 1.4, "nm": 0.0}]}}, "nm"),
        ({"glass": "N-BK7", "coating": {"layers": [{"metal": "iron", "nm": 3.0}]}}, "'iron' is no metal"),
        ({"glass": "N-BK7", "coating": {"share": 1.2}}, "share"),
        ({"glass": "N-BK7", "film_nm": 2e5}, "film_nm"),
        ({"kind": "mirror", "metal": "tin"}, "metal: 'tin' is no metal that is known"),
        ({"kind": "mirror", "coating": "ar"}, "coating has no effect on an ideal mirror"),
        ({"kind": "mirror", "metal": "gold", "film_along": "radius"}, "film_along"),
        ({"glass": "water", "film_nm": 9.0, "film_from_nm": 3.0}, "film_from_nm has no effect on an even film: give"),
        ({"glass": "water", "film_nm": 9.0, "film_along": "up"}, "film_along"),
    ],
)
def test_what_cannot_be_is_refused(text: dict[str, object], message: str, tmp_path: Path) -> None:
    with pytest.raises(UserError, match=message) as caught:
        read(text, tmp_path)
    assert "scene.toml" in str(caught.value)


@pytest.mark.parametrize("more", [{"coating": Coating(PRESETS["ar"])}, {"film_from_nm": 3e4}])
def test_a_film_that_varies_is_the_only_one_and_thin(more: dict[str, object]) -> None:
    with pytest.raises(UserError, match=r"scene.toml: object 'oil' has a film whose thickness varies.*make it thinner"):
        Dielectric(GLASS, film_nm=400.0, film_along=RADIUS, **more).check_on(plane(1.0, 1.0), "oil", "scene.toml")


@pytest.mark.parametrize("along", [RADIUS, (0.6, 0.8, 0.0)])
def test_thickness_by_place(along: tuple[float, float, float]) -> None:
    """Of a sheet that is stretched and turned: its corners and its middle, as the reference has them too."""
    turn = np.array([[0.0, -2.0, 0.0, 3.0], [1.5, 0.0, 0.0, 4.0], [0.0, 0.0, 1.0, 5.0], [0.0, 0.0, 0.0, 1.0]])
    film = Dielectric(GLASS, thin=True, film_nm=100.0, film_from_nm=500.0, film_along=along)
    item = SceneObject("film", plane(2.0, 2.0), film, turn)
    places = np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [-1.0, -1.0, 0.0], [1.0, -1.0, 0.0]])
    expected = [500.0, 100.0, 100.0, 100.0] if along == RADIUS else [300.0, 100.0, 500.0, 300.0 + 400.0 / 14.0]
    origin, bend, slope, least = film_thickness(item)
    tables = films_of(Scene("one", Camera((0, 0, 1), (0, 0, 0)), (), (item,)), GRID)
    for place, nm in zip(places @ turn[:3, :3].T + turn[:3, 3], expected, strict=True):
        way = place - origin
        assert 500.0 * (least + slope @ way + bend * way @ way) == pytest.approx(nm)
        assert film_nm(tables, 0, tuple(place)) == pytest.approx(nm)


def test_one_table_holds_every_thickness() -> None:
    """Means over a band, from the table of a film that varies, against the film of that thickness."""
    water = find("water")
    film = Dielectric(water, thin=True, film_nm=900.0, film_along=RADIUS).film
    assert film is not None
    stack, nm = Stack(AIR, film, AIR), np.linspace(780.0, 380.0, 1025)
    row, waves = stack.table(nm, False, False)[128], stack.waves(nm)[0]
    for share in (0.05, 0.4, 1.0):
        low, high = (share * np.interp(x, np.linspace(0.0, 1.0, 1025), waves) for x in (0.5, 0.52))
        at = np.linspace(0.0, 1.0, 1025)
        found = (np.interp(high, at, row) - np.interp(low, at, row)) / (high - low)
        exact, _ = power(Stack(AIR, film.of_thickness(share), AIR), 1.0, np.linspace(580.0, 572.0, 51))
        assert found == pytest.approx(exact.mean(), abs=3e-4)


def test_the_viewer_follows_a_film() -> None:
    bare, oiled, more = (SceneObject("oil", SHEET, Dielectric(GLASS, film_nm=nm)) for nm in (0.0, 300.0, 310.0))
    assert min(_object(bare, oiled), _object(oiled, more)) == DirtyLevel.BUILD


def test_rough_glass_has_no_film() -> None:
    assert Dielectric(GLASS, roughness=0.3, film_nm=300.0).film is None
    assert Mirror().film is None
