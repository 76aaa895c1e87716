"""Where the camera sees things through glass, wavelength by wavelength: prism, slab and lens against
`reference.camera_answers`.

The scenes are an edge of white and black paper behind the glass, lit past it. In each spectral bin the edge is
somewhere else; its place is measured to a fraction of a pixel by the area of white above it, which is exact for a mean
over the bin however soft the edge is.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from reference import camera_answers
from reference.known_answers import SLABS
from spectrasplat.gpu.context import Context
from spectrasplat.gpu.map_channels import MapChannels
from spectrasplat.model.geometry import primitives
from spectrasplat.model.geometry.primitives_lens import lens
from spectrasplat.model.lights import DirectionalLight
from spectrasplat.model.optics.spectrum import illuminant
from spectrasplat.model.scene import Camera, Diffuse, Light, SceneObject
from spectrasplat.passes.sample_spread import TAPS_PER_PIXEL
from spectrasplat.passes.spectrum_choice import Spectrum
from spectrasplat.reference import glasses
from spectrasplat.reference.glasses import C_NM, D_NM, F_NM
from spectrasplat.stress.rigs.gpu_paths import extruded, glass

from tests.gpu.camera_rig import at, opened_camera_pass, quad, released

FLAT = illuminant("E").scaled_to_luminous(1000.0)
BINS_NM = tuple(np.arange(400.0, 701.0, 25.0).tolist())
LINES_NM = tuple(nm + step for nm in (F_NM, D_NM, C_NM) for step in (-1.0, 1.0))
"""Every other bin is two nanometres about a line."""
SIZE = (4, 192)
LOOK_PX = 0.5 / TAPS_PER_PIXEL + 0.1
"""Half the way between two looks along a sweep, which is as near as a single wavelength's place is known, and what 8
samples leave of an edge."""
BIN_PX = 0.4
"""The same for a bin that spans many looks."""
MANY_TAPS = 256
"""So that looks along the whole spectrum lie that close: the pictures here magnify it to some 100 pixels."""


def wavelengths(edges_nm: tuple[float, ...]) -> np.ndarray:
    """(bins, 32) evenly spread over each bin."""
    low, high = np.array(edges_nm[:-1])[:, None], np.array(edges_nm[1:])[:, None]
    return low + (high - low) * (np.arange(32) + 0.5) / 32


def seen_edges(
    gl: Context, objects: list[SceneObject], light: Light, camera: Camera, edges_nm: tuple[float, ...], bands: int
) -> np.ndarray:
    """Height of the edge between white above and black below in each bin, in half pictures: +1 is the upper border."""
    camera_pass = opened_camera_pass(gl, objects, [light], camera=camera, channels=MapChannels(edges_nm))
    camera_pass.spectrum, camera_pass.max_taps = Spectrum(bands), MANY_TAPS
    camera_pass.run(camera, *SIZE, 8)
    rows = camera_pass.read_spectral().astype(float).mean(axis=1)
    # llvmpipe ends an invocation's loops after 65,535 rounds, which so many looks may come near: about a sample in a
    # thousand, counted as depth.
    assert (
        camera_pass.fallbacks["columns_dropped"] == 0
        and camera_pass.fallbacks["depth_reached"] <= 1e-2 * 8 * SIZE[0] * SIZE[1]
    )
    released(camera_pass)
    white, black = rows[:6].mean(axis=0), rows[-6:].mean(axis=0)
    assert (white > 20.0 * black).all() and (white > 0.0).all()
    return 1.0 - 2.0 * ((rows - black) / (white - black)).sum(axis=0) / SIZE[1]


def paper(z: float, edge: float, above: float) -> list[SceneObject]:
    """Across z: white from `edge` to `above`, black below."""
    white = quad([[-3, edge, z], [3, edge, z], [3, above, z], [-3, above, z]], Diffuse((1, 1, 1)), "white")
    black = quad([[-3, edge - 3, z], [3, edge - 3, z], [3, edge, z], [-3, edge, z]], Diffuse((0, 0, 0)), "black")
    return [white, black]


def linear_error(place: Callable[[float], float], index: np.ndarray, bands: int) -> float:
    """Bound of what a path linear in the index misses: ½ |∂²place/∂n²| (Δn/2)², Δn that of one of the bands, which vary
    n alike."""
    n, step = float(index.mean()), 1e-3
    second = (place(n + step) - 2.0 * place(n) + place(n - step)) / step**2
    return 0.5 * abs(second) * (np.ptp(index) / (2.0 * bands)) ** 2


# ---- a prism -----------------------------------------------------------------------------------

APEX, PRISM_Z, THICK, BEHIND = np.radians(10.0), 5.0, 1.0, 10.0
FIELD = 0.6
"""Half the picture's field, degrees."""


def prism_scene(name: str) -> tuple[list[SceneObject], Camera, tuple]:
    """A thin prism, its apex up, and paper 10 units behind it whose edge is seen straight ahead in yellow light."""
    stripped = np.tan(APEX / 2)
    section = [
        [-2, PRISM_Z + 2 * -stripped],
        [-2, PRISM_Z + THICK + 2 * stripped],
        [2, PRISM_Z + THICK - 2 * stripped],
        [2, PRISM_Z + 2 * stripped],
    ]
    mesh = extruded("prism", np.array(section)[::-1], 1.0)  # drawn in (y, z), drawn out along what becomes x
    turned = np.eye(4)
    turned[:3, :3] = [[0, 0, 1], [1, 0, 0], [0, 1, 0]]
    faces = camera_answers.prism_faces(APEX, PRISM_Z, THICK)
    n_d = float(glasses.index(name, D_NM))
    edge = camera_answers.height_on_screen(faces, (n_d, 1.0), 0.0, PRISM_Z + THICK + BEHIND)
    camera = Camera((0, 0, 0), (0, 0, 1), up=(0, 1, 0), vertical_fov_deg=2 * FIELD)
    objects = [SceneObject("prism", mesh, glass(name), turned), *paper(PRISM_Z + THICK + BEHIND, edge, edge + 1.5)]
    return objects, camera, faces


LOW = DirectionalLight("low", FLAT, direction=(np.sin(1.1), 0.0, np.cos(1.1)))
"""Falls on the paper past the glass."""


@pytest.mark.parametrize(("name", "bands"), [("N-SF11", 1), ("N-SF11", 8), ("N-BK7", 1)])
def test_fringe_of_an_edge_behind_a_thin_prism(gl, name: str, bands: int) -> None:
    """Where each bin sees the edge, by the exact trace in the principal plane; and the fringe's width, by (n_F − n_C) A
    L."""
    objects, camera, faces = prism_scene(name)
    screen = PRISM_Z + THICK + BEHIND
    edge = float(objects[1].mesh.vertices[:, 1].min())

    def place(n: float) -> float:
        return np.tan(camera_answers.viewing_angle(faces, (n, 1.0), screen, edge, -0.03, 0.03)) / np.tan(
            np.radians(FIELD)
        )

    got = seen_edges(gl, objects, LOW, camera, BINS_NM, bands)
    nm = wavelengths(BINS_NM)
    expected = np.vectorize(place)(glasses.index(name, nm)).mean(axis=1)
    room = linear_error(place, glasses.index(name, np.array([380.0, 780.0])), bands)
    pixel = 2.0 / SIZE[1]
    assert np.abs(got - expected).max() < BIN_PX * pixel + room, (got - expected) / pixel
    assert np.ptp(expected) > 15 * pixel and room < 0.2 * pixel
    assert abs((got - expected).mean()) < 0.1 * pixel
    # The thin prism's formula is good to A² / 2 and to what lies between paper and prism.
    lines = np.vectorize(place)(glasses.index(name, np.array([F_NM, C_NM])))
    width = (
        camera_answers.thin_prism_fringe(*glasses.index(name, np.array([F_NM, C_NM])), APEX, BEHIND)
        / screen
        / np.tan(np.radians(FIELD))
    )
    assert lines[0] - lines[1] == pytest.approx(width, rel=0.07)
    of_bins = np.polyfit(glasses.index(name, nm).mean(axis=1), got, 1)[0] * float(
        np.diff(glasses.index(name, np.array([C_NM, F_NM])))[0]
    )
    assert of_bins == pytest.approx(lines[0] - lines[1], rel=0.02)


# ---- a slab ------------------------------------------------------------------------------------


@pytest.mark.core
@pytest.mark.parametrize("name", SLABS)
@pytest.mark.parametrize("height", [1.0, 3.0])
def test_shift_of_an_edge_behind_a_slab_at_45_degrees(gl, name: str, height: float) -> None:
    """T3: a ray advances by t s / √(n² − s²) inside the slab, and leaves it as it came: the height above the paper does
    not matter."""
    slab = SceneObject("slab", primitives.box((14, 4, 1.0)), glass(name), at(0, 0, height))
    white = quad([[0, -2, 0], [2, -2, 0], [2, 2, 0], [0, 2, 0]], Diffuse((1, 1, 1)), "white")
    black = quad([[-4, -2, 0], [0, -2, 0], [0, 2, 0], [-4, 2, 0]], Diffuse((0, 0, 0)), "black")
    grazing = np.radians(5.0)
    low = DirectionalLight("low", FLAT, direction=(0.0, np.cos(grazing), -np.sin(grazing)))
    # Aimed at where yellow light sees the edge.
    shift_d = float(camera_answers.slab_lateral_shift(glasses.index(name, D_NM), 1.0, np.pi / 4))
    across = shift_d * np.array([1.0, 0.0, 1.0]) / np.sqrt(2.0)
    middle = across + (height + 2.0) * np.array([-1.0, 0.0, 1.0])
    index = glasses.index(name, np.array([F_NM, D_NM, C_NM]))
    expected = camera_answers.slab_lateral_shift(index, 1.0, np.pi / 4)
    extent = 4.0 * float(np.ptp(expected))
    camera = Camera(
        tuple(middle), tuple(middle + (1, 0, -1)), up=(0, 0, 1), kind="orthographic", vertical_extent=extent
    )
    got = shift_d + seen_edges(gl, [slab, white, black], low, camera, LINES_NM, 1)[::2] * extent / 2
    room = linear_error(
        lambda n: float(camera_answers.slab_lateral_shift(n, 1.0, np.pi / 4)),
        glasses.index(name, np.array([380.0, 780.0])),
        1,
    )
    pixel = extent / SIZE[1]
    assert np.abs(got - expected).max() < LOOK_PX * pixel + room, (got - expected) / pixel
    assert room < 0.1 * np.ptp(expected)
    # The advance inside at the d line.
    assert 1.0 - got[1] * np.sqrt(2.0) == pytest.approx(SLABS[name][0], abs=np.sqrt(2.0) * (LOOK_PX * pixel + room))


# ---- a lens ------------------------------------------------------------------------------------

RADIUS, LENS_Z, LENS_THICK, OBJECT_GAP, HEIGHT = 1.0, 3.0, 0.15, 0.6, 0.15


@pytest.mark.slow
@pytest.mark.parametrize("bands", [1, 8])
def test_image_scale_of_a_plano_convex_lens(gl, bands: int) -> None:
    """Lateral colour: a mark off the axis, seen through a magnifying lens, stands higher in blue light, by the
    meridional trace."""
    screen = LENS_Z + LENS_THICK + OBJECT_GAP
    mesh = lens(RADIUS, np.inf, LENS_THICK, 0.8, 20_000)
    objects = [
        SceneObject("lens", mesh, glass("N-SF11"), at(0, 0, LENS_Z + LENS_THICK / 2)),
        *paper(screen, HEIGHT, HEIGHT + 0.4),
    ]
    faces = camera_answers.plano_convex_faces(RADIUS, LENS_Z, LENS_THICK)

    def angle(n: float) -> float:
        return camera_answers.viewing_angle(faces, (n, 1.0), screen, HEIGHT, 0.0, 0.1)

    aim = angle(float(glasses.index("N-SF11", D_NM)))
    camera = Camera((0, 0, 0), (0, np.sin(aim), np.cos(aim)), up=(0, 1, 0), vertical_fov_deg=0.6)
    half = np.tan(np.radians(0.3))
    light = replace(LOW, direction=(np.sin(1.3), 0.0, np.cos(1.3)))
    got = aim + np.arctan(seen_edges(gl, objects, light, camera, BINS_NM, bands) * half)
    expected = np.vectorize(angle)(glasses.index("N-SF11", wavelengths(BINS_NM))).mean(axis=1)
    room = linear_error(angle, glasses.index("N-SF11", np.array([380.0, 780.0])), bands)
    pixel = 2.0 * half / SIZE[1]
    # Flat facets with smooth normals: 40 rings over 0.8 leave 1e-5 of sag, 1e-5 rad.
    assert np.abs(got - expected).max() < BIN_PX * pixel + room + 1e-5, (got - expected) / pixel
    assert np.ptp(expected) > 20 * pixel
    # Thick paraxial optics is near: what it leaves out is the lens's own aberration.
    paraxial = [
        camera_answers.thick_seen_tangent(float(n), RADIUS, LENS_THICK, LENS_Z, OBJECT_GAP, HEIGHT)
        for n in glasses.index("N-SF11", np.array([F_NM, C_NM]))
    ]
    exact = [angle(float(n)) for n in glasses.index("N-SF11", np.array([F_NM, C_NM]))]
    assert exact[0] - exact[1] == pytest.approx(paraxial[0] - paraxial[1], rel=0.15)
