"""Camera, lights and caustic maps as the camera reads them: shaders/lib against the CPU references in app/reference."""

from __future__ import annotations

import numpy as np
import pytest
from reference import camera, lights, maps
from spectrasplat.gpu.records import NONE, PLACEMENT, RECEIVER
from spectrasplat.passes.camera_records import CAMERA_LIGHT
from spectrasplat.reference.optics import unit
from spectrasplat.stress.rigs.glsl_function import as_f32, evaluate

COVERS = {
    "camera.glsl": ("camera_ray", "picture_point"),
    "lights.glsl": ("sample_light", "light_seen", "softened", "disc_seen", "stretch_seen"),
    "lookup.glsl": ("find_texel", "caustic_energy"),
    "placement.glsl": ("homogeneous_texel", "texels_along", "texel_area_at", "texels_per_length"),
}
COUNT = 2048


def test_camera_rays_go_through_their_pixels(gl) -> None:
    rng = np.random.default_rng(1)
    size = rng.integers(1, 4097, (COUNT, 2), dtype=np.uint32)
    pixel = (rng.random((COUNT, 2)) * size).astype(np.uint32)
    within = as_f32(rng.random((COUNT, 2)))
    vectors = {name: as_f32(rng.normal(size=(COUNT, 3))) for name in ("camera", "half_right", "half_up")}
    forward = as_f32(unit(rng.normal(size=(COUNT, 3))))
    parallel = rng.integers(0, 2, COUNT, dtype=np.uint32)
    body = """
    p = picture_point(pixel, within, size);
    CameraRay ray = camera_ray(camera, forward, half_right, half_up, parallel != 0u, p);
    start = ray.position; d = ray.direction;
    """
    inputs = {"pixel": pixel, "within": within, "size": size, "forward": forward, "parallel": parallel, **vectors}
    got = evaluate(gl.ctx, ["lib/camera.glsl"], body, inputs, {"p": "vec2", "start": "vec3", "d": "vec3"})
    point = camera.picture_point(pixel, within, size)
    assert np.abs(got["p"] - point).max() < 3e-7
    start, direction = camera.camera_ray(
        vectors["camera"], forward, vectors["half_right"], vectors["half_up"], parallel, as_f32(got["p"])
    )
    assert np.abs(got["start"] - start).max() < 2e-6
    assert np.abs(got["d"] - direction).max() < 1e-6


def random_lights(kind: int, rng: np.random.Generator) -> np.ndarray:
    """Lights of a kind as `CameraPass` packs them: the half extents lie across the axis."""
    records = CAMERA_LIGHT.zeros(COUNT)
    axis = unit(rng.normal(size=(COUNT, 3)))
    first = unit(np.cross(axis, rng.normal(size=(COUNT, 3))))
    half = rng.uniform(
        0.01 if kind == lights.DIRECTIONAL else 0.1, 0.05 if kind == lights.DIRECTIONAL else 1.0, (COUNT, 2)
    )
    disc = rng.integers(0, 2, COUNT) if kind in (lights.COLLIMATED, lights.AREA) else np.full(COUNT, 1)
    half[disc == 1, 1] = half[disc == 1, 0]
    records["kind"], records["axis"], records["is_disc"] = kind, axis, disc
    records["position"] = rng.uniform(-1, 1, (COUNT, 3))
    records["half_u"], records["half_v"] = first * half[:, :1], np.cross(axis, first) * half[:, 1:]
    records["measure"] = rng.uniform(0.5, 2.0, COUNT) if kind in (lights.DIRECTIONAL, lights.AREA) else 0.0
    inner = rng.uniform(0.1, 0.8, COUNT)
    records["cone"] = np.column_stack([inner, inner + rng.uniform(0.05, 0.8, COUNT)])
    records["cone"][:200] = 4.0
    return records


@pytest.mark.parametrize(
    "kind",
    [lights.POINT, lights.DIRECTIONAL, lights.COLLIMATED, lights.AREA],
    ids=["point", "directional", "collimated", "area"],
)
def test_lights_as_a_point_and_as_a_ray_see_them(gl, kind: int) -> None:
    rng = np.random.default_rng(10 + kind)
    records = random_lights(kind, rng)
    # Half the points lie before the light, about its axis, so that every branch is taken.
    position = rng.uniform(-2, 2, (COUNT, 3))
    spread = rng.normal(0, 0.6, (COUNT, 3))
    position[::2] = (records["position"] + rng.uniform(-0.5, 2.0, (COUNT, 1)) * records["axis"] + spread)[::2]
    position = as_f32(position)
    uniform = as_f32(rng.random((COUNT, 2)))
    # Rays towards the light's middle, off by up to twice its size.
    aim = (
        records["position"]
        + rng.uniform(-2, 2, (COUNT, 1)) * records["half_u"]
        + rng.uniform(-2, 2, (COUNT, 1)) * records["half_v"]
        - position
    )
    if kind == lights.DIRECTIONAL:
        aim = (
            rng.uniform(-1.5, 1.5, (COUNT, 1)) * records["half_u"]
            + rng.uniform(-1.5, 1.5, (COUNT, 1)) * records["half_v"]
            - records["axis"]
        )
    direction = as_f32(unit(aim.astype(float)))
    far = as_f32(np.where(rng.random(COUNT) < 0.7, 1e30, rng.uniform(0, 3, COUNT)))
    # A third of the rays are sharp; the others' widths reach from a hair to more than the light.
    size = np.linalg.norm(records["half_u"], axis=1)
    width = rng.choice([0.0, 1.0, 1.0], (COUNT, 1)) * 10.0 ** rng.uniform(-3, 0.7, (COUNT, 2)) * size[:, None]
    width = as_f32(np.where(size[:, None] > 0.0, width, 0.0))
    body = """
    LightSample s = sample_light(lights[row], position, unit);
    toward = s.toward; distance = s.distance; gain = s.gain;
    seen = light_seen(lights[row], position, direction, far, width);
    """
    declared = "layout(std430, binding = 8) readonly buffer Lights { CameraLight lights[]; };"
    inputs = {"position": position, "unit": uniform, "direction": direction, "far": far, "width": width}
    outputs = {"toward": "vec3", "distance": "float", "gain": "float", "seen": "float"}
    got = evaluate(
        gl.ctx,
        ["lib/lights.glsl"],
        body,
        inputs,
        outputs,
        structs=[CAMERA_LIGHT],
        buffers={8: records},
        declarations=declared,
    )
    toward, distance, gain = lights.sample_light(records, position, uniform)
    seen = lights.light_seen(records, position, direction, far, width)
    near = distance > 0.05
    assert near.mean() > 0.3
    assert np.abs(got["toward"] - toward)[near].max() < 3e-5
    assert (np.abs(got["distance"] - distance)[near] / distance[near]).max() < 2e-6 * (
        20 if kind == lights.COLLIMATED else 1
    )
    # An edge within rounding may fall either way: at most a few rows of 2048.
    wrong = np.abs(got["gain"] - gain)[near] > 1e-4 * np.maximum(gain[near], 1.0)
    assert wrong.mean() < 3e-3
    assert (np.abs(got["seen"] - seen) > 1e-5 * np.maximum(seen, 1.0)).mean() < 3e-3
    assert (gain > 0).mean() > 0.05
    if kind in (lights.DIRECTIONAL, lights.AREA):
        assert 0.02 < (seen > 0).mean() < 0.9
    else:
        assert not got["seen"].any()


def soft_amounts(gl, body: str, offset: np.ndarray, blur: float) -> np.ndarray:
    """What a soft look at the offsets sees, by the shader."""
    inputs = {"offset": offset, "blur": np.full(len(offset), blur)}
    declared = "layout(std430, binding = 8) readonly buffer Lights { CameraLight lights[]; };"
    got = evaluate(
        gl.ctx,
        ["lib/lights.glsl"],
        body,
        inputs,
        {"seen": "float"},
        structs=[CAMERA_LIGHT],
        buffers={8: CAMERA_LIGHT.zeros(1)},
        declarations=declared,
    )
    return got["seen"]


@pytest.mark.parametrize("blur", [0.0, 0.01, 0.3, 0.99, 1.0, 1.01, 3.0, 40.0])
def test_a_soft_look_keeps_what_the_light_sends(gl, blur: float) -> None:
    """Summed over all offsets it is the disc's area, or the stretch's length, however wide the look: no light is lost
    in small far lamps."""
    edge = max(1.0, blur) + blur
    offset = as_f32((np.arange(COUNT) + 0.5) / COUNT * 1.05 * edge)
    step = 1.05 * edge / COUNT
    disc = soft_amounts(gl, "seen = disc_seen(offset, blur);", offset, blur)
    stretch = soft_amounts(gl, "seen = stretch_seen(offset, 0.7, 0.7 * blur);", 0.7 * offset, blur)
    # A sharp edge falls between two of 2048 places; the trapezoids themselves are summed up exactly enough.
    room = 2.0 * step if blur == 0.0 else 1e-3
    assert 2.0 * np.pi * (disc * offset).sum() * step == pytest.approx(np.pi, rel=room)
    assert 2.0 * stretch.sum() * 0.7 * step == pytest.approx(1.4, rel=room)
    assert (np.diff(disc) <= 1e-7).all() and (np.diff(stretch) <= 1e-7).all()
    assert disc[-1] == stretch[-1] == 0.0


@pytest.mark.parametrize("radius", [0.02, 0.3, 0.5, 1.0])
def test_where_a_small_light_lies_between_looks_hardly_matters(gl, radius: float) -> None:
    """Looks a unit apart, each as wide: their sum over a light's places is its area to some per cent of it."""
    rng = np.random.default_rng(7)
    middle, grid = rng.random((64, 1, 2)), np.stack(np.meshgrid(*[np.arange(-6.0, 7.0)] * 2), axis=-1).reshape(-1, 2)
    offset = as_f32(np.linalg.norm(grid - middle, axis=-1).ravel() / radius)
    seen = soft_amounts(gl, "seen = disc_seen(offset, softened(blur));", offset, 0.5 / radius).reshape(64, -1)
    assert np.abs(seen.sum(axis=1) / (np.pi * radius**2) - 1.0).max() < 0.05


LOOKUP = {
    "MAP_TARGETS": 1,
    "CHARTS": 1,
    "NESTED_WINDOWS": 1,
    "BIND_RECEIVERS": 8,
    "BIND_PLACEMENTS": 9,
    "NONE": f"{NONE}u",
}


def test_the_finest_window_that_holds_a_place_is_found(gl) -> None:
    rng = np.random.default_rng(20)
    placements = PLACEMENT.zeros(8)
    placements["next"] = placements["blurred"] = NONE
    placements["row_w"][:, 3] = 1.0
    placements["row_w"][0, :3] = 0.5, -0.4, 0.3  # seen by a camera that some places lie behind
    # Placements 0 ⊂ 1 ⊂ 2 are nested windows; 4 to 6 are charts of three triangles.
    for index, half in ((0, 0.3), (1, 0.8), (2, 2.0)):
        scale = 32.0 / half
        turned = unit(np.array([[0.8, 0.1, -0.2], [-0.1, 0.9, 0.3]]))
        placements["row_u"][index] = [*(turned[0] * scale), 40.0 * index + 33.0]
        placements["row_v"][index] = [*(turned[1] * scale), 50.0]
        placements["rect"][index] = [40.0 * index + 1.0, 18.0, 40.0 * index + 65.0, 82.0]
    placements["next"][:2] = 1, 2
    for index in (4, 5, 6):
        placements["row_u"][index, :3], placements["row_v"][index, :3] = rng.normal(size=(2, 3)) * 8.0
        placements["rect"][index] = [-8.0, -6.0, 7.0, 9.0]
        placements["kind"][index] = 1
    receivers = RECEIVER.zeros(3)
    receivers["placement"] = 0, 4, NONE
    receivers["kind"] = 0, 1, 0
    receivers["first_triangle"] = 0, 100, 0
    receiver = rng.integers(0, 3, COUNT, dtype=np.uint32)
    source = np.where(receiver == 1, rng.integers(100, 103, COUNT), 0).astype(np.uint32)
    position = as_f32(rng.uniform(-1.5, 1.5, (COUNT, 3)) * rng.uniform(0.05, 1, (COUNT, 1)))
    body = (
        "uint place; vec3 at; found = find_texel(receiver, source, position, place, at) ? 1u : 0u; placement = "
        "place; texel = at.xy / at.z;"
    )
    outputs = {"found": "uint", "placement": "uint", "texel": "vec2"}
    inputs = {"receiver": receiver, "source": source, "position": position}
    got = evaluate(
        gl.ctx, ["lib/lookup.glsl"], body, inputs, outputs, LOOKUP, [RECEIVER, PLACEMENT], {8: receivers, 9: placements}
    )
    want = [
        maps.find_texel(receivers, placements, r, s, p)
        for r, s, p in zip(receiver.tolist(), source.tolist(), position, strict=True)
    ]
    found, placement = np.array([w[0] for w in want]), np.array([w[1] for w in want])
    texel = np.array([w[2] for w in want])
    agrees = (got["found"] == found) & (~found | (got["placement"] == placement))
    assert agrees.mean() > 0.998  # a place within rounding of a border may fall to either side
    both = agrees & found
    assert (np.abs(got["texel"] - texel).max(axis=1) / (1.0 + np.abs(texel).max(axis=1)))[both].max() < 3e-6
    assert set(placement[both]) == {0, 1, 2, 4, 5, 6}
    assert not got["found"][receiver == 2].any()


def test_texels_of_a_placement_seen_by_a_camera(gl) -> None:
    rng = np.random.default_rng(21)
    placements = PLACEMENT.zeros(COUNT)
    for name in ("row_u", "row_v"):
        placements[name] = rng.normal(size=(COUNT, 4)) * 20.0
    placements["row_w"] = rng.normal(size=(COUNT, 4)) * (0.2, 0.2, 0.2, 0.0) + (0.0, 0.0, 0.0, 1.0)
    placements["texel_area"] = rng.uniform(0.1, 10.0, COUNT)
    position, direction = as_f32(rng.uniform(-0.6, 0.6, (COUNT, 3))), as_f32(rng.normal(size=(COUNT, 3)))
    body = (
        "vec3 at = homogeneous_texel(placements[row], position); along = texels_along(placements[row], at, direction); "
        "area = texel_area_at(placements[row], at); length = texels_per_length(placements[row], at);"
    )
    got = evaluate(
        gl.ctx,
        ["lib/lookup.glsl"],
        body,
        {"position": position, "direction": direction},
        {"along": "vec2", "area": "float", "length": "float"},
        LOOKUP,
        [RECEIVER, PLACEMENT],
        {8: RECEIVER.zeros(1), 9: placements},
    )
    rows = list(zip(placements, position.astype(float), direction.astype(float), strict=True))
    along = np.array([maps.texels_along(p, at, d) for p, at, d in rows])
    assert np.abs(got["along"] - along).max(axis=1) == pytest.approx(0.0, abs=3e-5 * np.abs(along).max())
    assert got["area"] == pytest.approx(np.array([maps.texel_area_of(p, at) for p, at, _ in rows]), rel=2e-5)
    steps = [[maps.texels_along(p, at, axis) for axis in np.eye(3)] for p, at, _ in rows]
    longest = np.linalg.norm(np.array(steps), axis=1).max(axis=1)
    assert got["length"] == pytest.approx(longest, rel=1e-3)


def test_a_look_up_is_the_mean_over_its_box(gl) -> None:
    rng = np.random.default_rng(22)
    texels = rng.random((20, 24, 4)).astype(np.float32)
    placements = PLACEMENT.zeros(COUNT)
    placements["rect"] = [3.0, 2.0, 19.0, 17.0]
    placements["rect"][::3] = [2.6, 2.2, 18.4, 16.7]
    texel = as_f32(rng.uniform([2.0, 1.0], [20.0, 18.0], (COUNT, 2)))
    box = as_f32(rng.uniform(0.01, 1.5, (COUNT, 2)))
    texture = gl.ctx.texture((24, 20), 4, texels, dtype="f4")
    outputs = {"value": "vec4"}
    body = "value = caustic_energy(caustic_map[0], row, texel, box);"
    got = evaluate(
        gl.ctx,
        ["lib/lookup.glsl"],
        body,
        {"texel": texel, "box": box},
        outputs,
        LOOKUP,
        [RECEIVER, PLACEMENT],
        {8: RECEIVER.zeros(1), 9: placements},
        [lambda: texture.use(0)],
    )
    texture.release()
    want = np.array(
        [maps.caustic_energy(texels.astype(float), p, t, b) for p, t, b in zip(placements, texel, box, strict=True)]
    )
    # The box's ends are known to an eps of the atlas coordinate, a larger share of a narrow box.
    room = 3e-6 * (1.0 + 1.0 / box.min(axis=1))
    assert (np.abs(got["value"] - want).max(axis=1) / room).max() < 1.0
    mutant = np.array(
        [
            maps.caustic_energy(texels.astype(float), p, t + 0.01, b)
            for p, t, b in zip(placements, texel, box, strict=True)
        ]
    )
    assert (np.abs(got["value"] - mutant).max(axis=1) / room).max() > 10.0
