"""Every program is GLSL by the book, asks for no more than drivers promise, and is small on a GPU: drivers take steeply
longer for large ones, and a GPU hides its waiting for memory behind as many invocations as its registers have room
for."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from spectrasplat.base.paths import assets_dir, shaders_dir
from spectrasplat.bench import viewer_speed
from spectrasplat.bench.programs import compiled_programs, unique
from spectrasplat.gpu import shader, strict_compilers
from spectrasplat.gpu.context import Context, create_context
from spectrasplat.gpu.device_traits import DeviceTraits, assumed
from spectrasplat.gpu.limits import NEEDED
from spectrasplat.gpu.program_use import use_of, uses
from spectrasplat.gpu.shader import Built, Source
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.settings import METHODS, RenderSettings

SCENES = sorted((assets_dir() / "scenes").glob("*.toml"), key=lambda path: path.stem)
PRISM = assets_dir() / "scenes" / "prism.toml"
needs_tools = pytest.mark.skipif(bool(strict_compilers.missing()), reason=strict_compilers.missing() or "all there")
MOST_LIVE, MOST_ARRAY_WORDS, MOST_BYTES, MOST_SCENE_BYTES = 220, 64, 75_000, 500_000
LARGE = {"camera/camera.comp": (246, 76, 99_000), "light/trace.comp": (226, MOST_ARRAY_WORDS, 88_000)}
"""Programs that follow paths: more live words, array words or text than is wanted of any, which is not met since
27 November 2026. Live in the camera's at the most: a path, its event and a film's shares of both polarisations."""
OF_CRYSTALS = {"camera/camera.comp": (314, 76, 107_000), "light/trace.comp": (269, MOST_ARRAY_WORDS, 97_000)}
"""Likewise where there are crystals, since 28 November 2026: a polarised path, which glass takes 269 for by itself, and
before the camera what meets a crystal with waves of eight words each."""
_accepted: set[tuple[str, ...]] = set()
"""Texts that were looked at: scenes share most of their programs."""
_small: set[tuple[str, ...]] = set()
"""Texts whose size was."""


@pytest.fixture(
    scope="module",
    params=[pytest.param("as here", marks=pytest.mark.slow), "as on a GPU", "as on one without a rasteriser"],
)
def device(request: pytest.FixtureRequest) -> Iterator[Context]:
    """The driver that is there, given its own programs or those that a GPU gets. Float atomics are NVIDIA's and not of
    the book: compute shaders that add splats compare and swap."""
    if request.param == "as here":
        traits = create_context().traits
    else:
        traits = DeviceTraits(splats_by_compute=request.param == "as on one without a rasteriser")
    with assumed(traits), create_context() as context:
        shader.keep_programs(context.ctx)
        yield context
        shader.forget_programs(context.ctx)


def check(programs: list[Built]) -> None:
    assert programs
    for built in programs:
        if built.texts in _accepted:
            continue
        assert [sentence for use in uses(built) for sentence in use.over(NEEDED)] == []
        assert strict_compilers.complaints(built) == []
        ours = {name for use in uses(built) for name in (*use.storage, *use.uniform)}
        assert ours == strict_compilers.blocks(built), built.name
        _accepted.add(built.texts)


def check_sizes(programs: list[Built]) -> None:
    assert sum(len(text) for built in programs for text in built.texts) <= MOST_SCENE_BYTES
    for built in programs:
        if built.texts in _small:
            continue
        _small.add(built.texts)
        large = OF_CRYSTALS if "cross_interface(" in built.texts[0] else LARGE
        most_live, most_array_words, most_bytes = large.get(built.name, (MOST_LIVE, MOST_ARRAY_WORDS, MOST_BYTES))
        assert max(map(len, built.texts)) <= most_bytes, built.name
        for state in strict_compilers.live_states(built):
            assert state.registers <= most_live, (built.name, state)
            assert state.scratch <= most_array_words, (built.name, state)


def settings(**more: object) -> RenderSettings:
    return replace(RenderSettings(max_depth=16), **more)


@needs_tools
def test_a_scenes_programs_are_strict(device: Context) -> None:
    programs = compiled_programs(device, load_scene(PRISM), settings())
    check(programs)
    if device.traits.splats_by_compute:  # those that are drawn are among the slow ones
        check_sizes(programs)


@needs_tools
@pytest.mark.slow
@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
def test_every_scenes_programs_are_strict(device: Context, path: Path) -> None:
    scene = load_scene(path)
    programs = compiled_programs(device, scene, settings(max_depth=scene.render.max_depth))
    check(programs)
    if not device.is_software:
        check_sizes(programs)


@needs_tools
@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
def test_every_methods_programs_are_strict(device: Context, method: str) -> None:
    check(compiled_programs(device, load_scene(PRISM), settings(method=method)))
    check(compiled_programs(device, load_scene(PRISM), settings(method=method, bins=16)))


@needs_tools
@pytest.mark.slow
def test_the_viewers_programs_are_strict(device: Context) -> None:
    with shader.recorded() as programs:
        for _ in viewer_speed.run(device, PRISM, (320, 180), 0.5):
            pass
    check(unique(programs))


def built_of(name: str, *lines: str) -> Built:
    text = "\n".join(("#version 430 core", *lines)) + "\n"
    return Built((Source(name, text, tuple((name, n) for n in range(1, len(lines) + 2))),), 0.0)


@needs_tools
def test_strict_compilers_refuse_what_drivers_let_pass() -> None:
    """The file and line are named; so are stages that do not fit."""
    bad = built_of("bad.comp", "layout(local_size_x = 1) in;", "void main() {", "int n = 1u;", "}")
    assert len(strict_compilers.complaints(bad)) >= 1
    assert strict_compilers.complaints(bad)[0].startswith("bad.comp:4: error:")
    ends = [
        built_of("a.vert", "out vec3 x;", "void main() { x = vec3(1); gl_Position = vec4(1); }").stages[0],
        built_of("a.frag", "in vec4 x;", "out vec4 o;", "void main() { o = x; }").stages[0],
    ]
    assert "Types must match" in " ".join(strict_compilers.complaints(Built(tuple(ends), 0.0)))


@needs_tools
def test_what_nvidia_refuses_is_found() -> None:
    """Records of a qualified block as arguments, and an unsized array that a loop alone indexes otherwise; not what is
    copied before, or has a size."""
    lines = (
        "layout(local_size_x = 1) in;",
        "struct Pair { float a; float b; };",
        "layout(std430, binding = 0) restrict buffer Pairs { Pair pairs[]; };",
        "layout(std430, binding = 1) buffer Sums { float sums[]; };",
        "float sum(Pair of) { return of.a + of.b; }",
        "void main() {",
        "uint at = gl_GlobalInvocationID.x;",
        "for (uint i = 1u; i < 4u; ++i) sums[0] += sums[i];",
        "sums[at] += sum(pairs[at]);",
        "}",
    )
    said = strict_compilers.complaints(built_of("bad.comp", *lines))
    assert [sentence.partition(": error")[0] for sentence in said] == ["bad.comp:9", "bad.comp:10"]
    mended = [line.replace("sums[];", "sums[4];").replace("sum(pairs[at])", "pairs[at].a") for line in lines]
    assert strict_compilers.complaints(built_of("good.comp", *mended)) == []


def test_flags_that_lie_in_memory_are_no_bools() -> None:
    """See shaders/README.md: structs that are held in arrays, and arrays."""
    texts = [
        path.read_text() for path in shaders_dir().rglob("*") if path.suffix in (".glsl", ".comp", ".frag", ".vert")
    ]
    assert [found for text in texts for found in re.findall(r"\bbool\s+\w+\s*\[.*", text)] == []
    bodies = {name: body for text in texts for name, body in re.findall(r"struct (\w+) \{(.*?)\n\};", text, re.DOTALL)}
    for name in ("Path", "Walk", "RayOrigin", "ShadingFrame", "PathEnd", "Hit"):
        assert not re.search(r"^\s*bool\b", bodies[name], re.MULTILINE), name


def test_what_a_program_uses_is_read_from_its_text() -> None:
    use = use_of(
        built_of(
            "some.comp",
            "#define ROOM 3",
            "#define BIND_A 6",
            "const uint KINDS = 4u;",
            "layout(local_size_x = 64) in;",
            "layout(std430, binding = BIND_A) readonly restrict buffer Ones { float ones[]; };",
            "layout(std430, binding = 9) buffer Unused { float never[]; };",
            "layout(std140, binding = 0) uniform Parameters {",
            "    uint count;",
            "    vec4 where[ROOM];",
            "};",
            "layout(binding = 0) uniform sampler2D maps[ROOM];",
            "layout(rgba32f, binding = 1) uniform restrict image2D sums;",
            "uniform uint offset;",
            "shared vec4 held[64 * KINDS];",
            "void main() { held[0] = texture(maps[1], vec2(ones[count + offset])) + imageLoad(sums, ivec2(0)); }",
        ).stages[0]
    )
    assert (use.stage, use.storage, use.uniform) == ("compute", ("Ones",), ("Parameters",))
    assert (use.textures, use.images, use.shared_bytes, use.storage_bindings) == (3, 1, 64 * 4 * 16, 7)
    assert use.over(NEEDED) == []
    short = replace(NEEDED, storage_blocks=0, storage_bindings=6, compute_textures=2)
    assert use.over(short) == [
        "some.comp needs 1 storage blocks and has 0",
        "some.comp needs 7 binding points of storage blocks and has 6",
        "some.comp needs 3 texture units and has 2",
    ]
