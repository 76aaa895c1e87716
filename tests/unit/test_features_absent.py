"""What a scene does not need is not in the text of its programs, nor in its records; what it needs is.

These tests read the sources as the driver gets them, without a driver. `tests/gpu/test_running_programs.py`
does the same with every program that a rendering builds.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from itertools import chain
from types import SimpleNamespace
from typing import Any, cast

import pytest
from spectrasplat.base import paths
from spectrasplat.commands.inspect_features import occurring, prove, static_costs
from spectrasplat.features.facts import Facts
from spectrasplat.features.features import ROWS, Features, all_symbols
from spectrasplat.features.program_switches import Defines, switched
from spectrasplat.gpu import records, shader
from spectrasplat.gpu.device_traits import DeviceTraits
from spectrasplat.gpu.limits import BRUSH_STORAGE_BLOCKS, NEEDED
from spectrasplat.gpu.map_channels import MapChannels
from spectrasplat.gpu.program_use import use_of
from spectrasplat.gpu.scene_records import SCENE_STRUCTS
from spectrasplat.gpu.schema import Struct
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.scene import Scene
from spectrasplat.model.settings import RenderSettings
from spectrasplat.passes import gathered_light
from spectrasplat.passes.camera_programs import camera_defines, direct_defines
from spectrasplat.passes.camera_records import CAMERA_LIGHT, CAMERA_PARAMETERS
from spectrasplat.passes.environment_places import PLACE
from spectrasplat.passes.footprint import SPLAT
from spectrasplat.passes.haze import HAZE_PARAMETERS
from spectrasplat.passes.light_programs import draw_variants, footprint_defines, light_defines
from spectrasplat.passes.picture_channels import Channels

NOT_OF_BANDS = ("point_spectrum", "random_wavelength", "even_wavelengths", "draws_by_power", "hero")
SCENES = paths.assets_dir() / "scenes"
COUNTS = {"spectral_groups": 2, "tint_levels": 16, "map_tents": 8, "bounces": 3, "bins": 0}
EVERYTHING = Features().changed(**{name: True for name in ROWS if name not in NOT_OF_BANDS} | COUNTS)
CAMERA_TOO = dict.fromkeys(("spectral_groups", "band_cuts", "dielectrics"), ("camera_disperses",))
"""Where the camera's own rays use the same names, it must do without as well."""
NUMBERS: Defines = {
    **dict.fromkeys(("TREE_AT", "NORMALS_AT", "PIECES_AT", "INDEX_ROW"), 0),
    **dict.fromkeys(("SLOPE_ROW", "VARIABLE_ROW", "STACK_SIZE", "SOLID_COUNT", "ABSORBERS", "FINISHES_AT"), 1),
    **dict.fromkeys(("WHITE_ROW", "LIGHT_ROW", "ROWS_PER_LIGHT", "BIN_ROW", "BIN_SPECTRUM_ROW", "REFLECTANCE_ROW"), 1),
    **dict.fromkeys(("BASIS_ROW", "ABSORPTION_ROW"), 1),
    "TREE_STACK": 9,
    "STACK_OBJECTS": "uint[](0u)",
    "PLANE_COUNT": 6,
    "PIECE_COUNT": 2,
    "LIGHTS": 1,
    "TRIANGLE_COUNT": 9,
}
"""Stand-ins for what only a scene's data give."""


Program = tuple[str, Defines, tuple[Struct, ...]]
"""Its shader, defines and structs."""


def programs(features: Features) -> Iterator[Program]:
    """The light pass's and the camera's."""
    return chain(light_programs(features), gathered_programs(features), camera_programs(features))


def sources(features: Features, *names: str) -> list[shader.Source]:
    """Of these shaders (none: of all)."""
    return [shader.load_source(*each) for each in programs(features) if not names or each[0] in names]


known_sources = cache(sources)
"""Those of the shaders as they are."""


def light_programs(features: Features) -> Iterator[Program]:
    photon = records.photon_record(features.spectral_groups)
    structs = (*SCENE_STRUCTS, records.ray_record_of(features), photon, records.OUTCOME)
    structs += (records.trace_parameters(), records.EMIT_PARAMETERS, *((records.FLIGHT,) if features.flights else ()))
    light = light_defines(features, DeviceTraits()) | NUMBERS
    yield "light/trace.comp", light, structs
    yield "light/emit.comp", light | switched(LIGHT_POINT=True), structs
    placed = (photon, records.PLACEMENT, records.RECEIVER, SPLAT, records.GAIN_BOX)
    yield "light/footprint.comp", footprint_defines(features), placed
    for fragment, defines in draw_variants(features).values():
        for name in ("light/splat.vert", fragment):
            yield name, defines, (SPLAT,)


def gathered_programs(features: Features) -> Iterator[Program]:
    defines = features.defines() | NUMBERS | {"MOST_ASKED": 24, "BIND_PLACES": 8, "BIND_ASKED": 9, "BIND_SUMS": 10}
    structs: tuple[Struct, ...] = (*SCENE_STRUCTS, PLACE, gathered_light.PARAMETERS, gathered_light.DIRECTION)
    for of_receivers, on in ((False, features.environment_lights), (True, features.bounces)):
        if on:
            disperses = features.environment_spectrum and not of_receivers
            chosen = defines | switched(OF_RECEIVERS=of_receivers, FOLLOWS_SPECULAR=True, GATHERED_SPECTRUM=disperses)
            chosen |= {"GATHER_TAPS": gathered_light.TAPS}
            yield "light/gather.comp", chosen, (*structs, gathered_light.SUM)
    if features.haze:
        structs = (records.FLIGHT, CAMERA_PARAMETERS, HAZE_PARAMETERS)
        for stage in ("vert", "frag"):
            yield f"camera/haze.{stage}", {"TARGETS": 1}, structs


def camera_programs(features: Features) -> list[Program]:
    """The camera's one program, or two where it sees glass or mirrors."""
    buffers = SimpleNamespace(scene=SimpleNamespace(lights=()), features=features, defines=NUMBERS)
    maps = MapChannels(tents_nm=(550.0,) * features.map_tents)
    shown = camera_defines(cast(Any, buffers), Channels(), "beauty", maps)
    shown |= NUMBERS | switched(VISIBLE_LIGHTS=True)
    shown |= switched(LENS=features.lens)
    structs = (*SCENE_STRUCTS, CAMERA_LIGHT, CAMERA_PARAMETERS, records.RECEIVER, records.PLACEMENT)
    variants = [direct_defines(shown), *([shown] if features.camera_specular else [])]
    return [("camera/camera.comp", defines, structs) for defines in variants]


def scene_features(name: str) -> Features:
    return Features.of(load_scene(SCENES / f"{name}.toml"), RenderSettings())


@pytest.mark.parametrize("field", [field for field, row in ROWS.items() if row.names])
def test_names_come_and_go_with_their_feature(field: str) -> None:
    """Every name of a row is in some program with the feature in, and in none with it out."""
    names = ROWS[field].names
    # Polarised light has no mean reflectance of its own.
    everything = replace(EVERYTHING, polarised=field == "polarised")
    found = [(source.name, name) for source in known_sources(everything) for name in occurring(source, names)]
    assert {name for _, name in found} == set(names)
    holders = {shader_name for shader_name, _ in found}
    for source in sources(without(everything, field, *CAMERA_TOO.get(field, ())), *holders):
        assert occurring(source, names) == (), source.name


def without(features: Features, *names: str) -> Features:
    """The same with features left out, and all whose code needs theirs."""
    left_out = set(names)
    while more := {name for name, row in ROWS.items() if left_out & {*row.requires}} - left_out:
        left_out |= more
    return features.changed(**{name: ROWS[name].off for name in left_out})


def test_rows_name_features_and_symbols_once() -> None:
    assert all(name in ROWS for row in ROWS.values() for name in row.requires)
    for column in ("name", "symbol"):
        given = [value for row in ROWS.values() if (value := getattr(row, column))]
        assert len(given) == len(set(given))
    assert all(row.why and row.why_not for row in ROWS.values() if row.name)
    with pytest.raises(KeyError, match="IN_MOTOIN"):
        switched(IN_MOTOIN=True)


COUNTED = re.compile(r"SPECTRAL_GROUPS|TARGETS|GROUPS|(?:PATH_)?COLUMNS|SLOTS|EDGES|ROWS|TAPS|\w+_(?:GLSL|TARGETS?)")
"""Numbers, and guards of included files."""


def test_every_switch_that_shaders_test_is_listed() -> None:
    own = {"COUNT_ROUNDS"}
    tested: set[str] = set()
    for file in paths.shaders_dir().rglob("*"):
        if file.suffix in (".comp", ".vert", ".frag", ".glsl"):
            text = re.sub(r"//.*", "", file.read_text())
            for condition in re.findall(r"#\s*(?:el)?if(?:n?def)?\b(.*)", text):
                tested |= set(re.findall(r"[A-Z][A-Z_]+", condition))
    unknown = {name for name in tested if not COUNTED.fullmatch(name)} - {*all_symbols()} - own
    assert not unknown, f"neither a row of the table of features nor in program_switches.py: {sorted(unknown)}"


SHIPPED = {
    "ball_plain": (
        "camera spectral taps",
        "spectral maps",
        "spectral columns",
        "band cuts",
        "absorption",
        "medium stack",
        "spectral bins",
        "mirrors",
        "charts",
    ),
    "prism": (
        "interpolated normals",
        "normal derivatives",
        "triangle tree",
        "absorption",
        "medium stack",
        "mirrors",
        "charts",
    ),
    "brilliant": ("interpolated normals", "normal derivatives", "triangle tree", "absorption", "medium stack"),
}


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_scenes_leave_out_what_they_do_not_need(name: str) -> None:
    scene = load_scene(SCENES / f"{name}.toml")
    features = Features.of(scene, RenderSettings())
    included = {feature: inside for feature, inside, _ in explained(scene)}
    assert not any(included[feature] for feature in SHIPPED[name])
    proofs = prove(sources(features), features)
    assert [p.feature for p in proofs if not p.holds] == []


def explained(scene: Scene) -> list[tuple[str, bool, str]]:
    return Features.of(scene, RenderSettings()).explain(Facts(scene, RenderSettings()))


def _reasons(scene: Scene) -> dict[str, str]:
    return {name: reason for name, _, reason in explained(scene)}


def costs_of(scene: Scene, features: Features) -> dict[str, str]:
    return static_costs(Facts(scene, RenderSettings()), features)


def test_states_of_polarisation_cost_nothing_where_they_are_not_asked_for() -> None:
    scene = load_scene(SCENES / "prism.toml")
    asked = replace(scene, render=replace(scene.render, polarisation=True))
    plain, polarised = (Features.of(each, RenderSettings()) for each in (scene, asked))
    assert not plain.polarised and replace(polarised, polarised=False) == plain
    assert costs_of(asked, polarised)["polarisation"] == "48 B a ray"
    assert "asks for it" in _reasons(asked)["polarisation"]
    without = replace(asked, objects=tuple(o for o in asked.objects if not o.material.transmits))
    assert not Features.of(without, RenderSettings()).polarised
    assert "no glass" in _reasons(without)["polarisation"]


def test_what_surfaces_give_each_other_costs_nothing_where_it_is_not_asked_for() -> None:
    scene = load_scene(SCENES / "prism.toml")
    asked = replace(scene, render=replace(scene.render, bounces=2))
    plain, bounces = (Features.of(each, RenderSettings()) for each in (scene, asked))
    assert plain.bounces == 0 and bounces.bounces == 2 and replace(bounces, bounces=0) == plain
    assert all(occurring(source, ("receiver_light", "add_receiver_light")) == () for source in sources(plain))
    assert any(occurring(source, ("add_receiver_light",)) for source in sources(bounces))
    assert _reasons(scene)["bounces"] == "[render] bounces is 0" and "2 time(s)" in _reasons(asked)["bounces"]
    # Nothing is left for a plane to see itself in.
    alone = replace(asked, objects=tuple(o for o in asked.objects if o.material.receives))
    assert not Features.of(alone, RenderSettings()).bounces and "in one plane" in _reasons(alone)["bounces"]


def test_what_is_in_tells_its_bytes_and_what_is_out_tells_none() -> None:
    scene = load_scene(SCENES / "brilliant.toml")
    features = Features.of(scene, RenderSettings())
    costs = costs_of(scene, features)
    assert all(costs.values()) and set(costs) == {name for name, included, _ in explained(scene) if included}
    assert costs["spectral columns"] == "32 B a ray, 16 B a photon"


def test_the_proof_fails_where_a_program_carries_what_it_should_not(monkeypatch: pytest.MonkeyPatch) -> None:
    features = scene_features("prism")
    # Comments and guarded code left in, as in a text whose conditions only the driver resolves.
    monkeypatch.setattr(shader, "stripped", lambda lines, switches: lines)
    monkeypatch.setattr(shader, "_kept", {})  # nor a text that an earlier test had made
    told = {p.feature: p.holds for p in prove(sources(features), Features())}
    assert not told["triangle tree"] and not told["normal derivatives"] and not told["medium stack"]


@pytest.mark.parametrize("editable", [False, True])
@pytest.mark.parametrize("scene", ["prism", "brilliant", "spectrometer"])
def test_without_beams_photons_need_what_they_always_did(scene: str, editable: bool) -> None:
    loaded = load_scene(SCENES / f"{scene}.toml")
    alone, found = (
        Features.of(loaded, RenderSettings(method=method, editable=editable)) for method in ("srd", "srd-photons")
    )
    # Nothing is left to photons that would have to know how broad a lamp is, or where a beam ends.
    known = {"lamp_columns": found.lamp_columns, "light_edges": found.light_edges}
    assert replace(alone, beams=False, **known) == replace(found, method="srd")
    assert scene != "prism" or alone.reindexed == editable


def test_storage_blocks_are_as_many_as_the_doctor_asks_for() -> None:
    """Of the footprint's program, which has most: with the brush and without."""
    brushed, plain = (
        next(len(use_of(s).storage) for s in sources(features) if s.name == "light/footprint.comp")
        for features in (EVERYTHING, replace(EVERYTHING, local_gain=False))
    )
    assert brushed == BRUSH_STORAGE_BLOCKS
    assert plain == NEEDED.storage_blocks
