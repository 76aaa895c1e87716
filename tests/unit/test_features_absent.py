"""What a scene does not need is not in the text of its programs, nor in its records; what it needs is.

These tests read the sources as the driver gets them, without a driver. `tests/gpu/test_features_cost.py`
does the same with every program that a rendering builds.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from spectrasplat.base import paths
from spectrasplat.bench.features.static_costs import RecordSizes, static_costs
from spectrasplat.bench.features.symbol_proof import FEATURE_SYMBOLS, occurring, program_texts, prove
from spectrasplat.features.explained import explain
from spectrasplat.features.features import Features
from spectrasplat.gpu import records, shader
from spectrasplat.gpu.limits import BRUSH_STORAGE_BLOCKS, NEEDED
from spectrasplat.gpu.program_use import use_of
from spectrasplat.gpu.scene_records import SCENE_STRUCTS
from spectrasplat.gpu.texture_store import PICTURE
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.scene import Scene
from spectrasplat.model.settings import RenderSettings
from spectrasplat.passes import bounce_light, environment_light, gathered_light
from spectrasplat.passes.camera_records import CAMERA_LIGHT, CAMERA_PARAMETERS
from spectrasplat.passes.environment_places import PLACE
from spectrasplat.passes.footprint import SPLAT
from spectrasplat.passes.haze import HAZE_PARAMETERS
from spectrasplat.passes.variants import direct_defines, footprint_defines, haze_defines, splat_defines

EVERYTHING = Features(
    method="srd",
    spectral_groups=2,
    merged_groups=True,
    spectral_weights=True,
    footprints=True,
    point_spectrum=False,
    random_wavelength=False,
    even_wavelengths=False,
    band_cuts=True,
    landing_cuts=True,
    dielectrics=True,
    mirrors=True,
    gratings=True,
    sheets=True,
    filters=True,
    smooth_normals=True,
    normal_derivatives=True,
    absorption=True,
    tint_levels=16,
    medium_stack=True,
    contacts=True,
    tree=True,
    loose_triangles=True,
    convex_solids=True,
    curved_solids=True,
    charts=True,
    nested_windows=True,
    targets=3,
    local_gain=True,
    light_profiles=True,
    reindexed=True,
    camera_specular=True,
    camera_disperses=True,
    map_tents=8,
    beams=True,
    environment_lights=True,
    bounces=3,
    lens=True,
    contact_lines=True,
    border_images=True,
    coats=True,
    rough_diffuse=True,
    rough=True,
    light_edges=True,
    lamp_columns=True,
    haze=True,
    flights=True,
)
PLAIN_CAMERA = {"camera_disperses": False, "map_tents": 0}
"""What the camera sees disperses nothing: the camera carries the spectrum in the same way as the light pass."""
WITHOUT = {
    "beams": {"beams": False},
    "light profiles": {"light_profiles": False},
    "environment light": {"environment_lights": False},
    "bounces": {"bounces": 0},
    "lens": {"lens": False},
    "coats": {"coats": False},
    "rough diffuse": {"rough_diffuse": False},
    "spectral columns": {
        "spectral_groups": 0,
        "merged_groups": False,
        "band_cuts": False,
        "landing_cuts": False,
        "local_gain": False,
        "reindexed": False,
        **PLAIN_CAMERA,
    },
    "shared spectral variable": {"merged_groups": False},
    "weights over the band": {
        "spectral_weights": False,
        "spectral_groups": 0,
        "merged_groups": False,
        "band_cuts": False,
        "landing_cuts": False,
    },
    "band cuts": {"band_cuts": False, "landing_cuts": False, **PLAIN_CAMERA},
    "landing cuts": {"landing_cuts": False},
    "spatial columns": {
        "footprints": False,
        "lamp_columns": False,
        "light_edges": False,
        "spectral_groups": 0,
        "merged_groups": False,
        "band_cuts": False,
        "landing_cuts": False,
        "normal_derivatives": False,
    },
    "refraction": {
        "dielectrics": False,
        "sheets": False,
        "filters": False,
        "absorption": False,
        "band_cuts": False,
        "landing_cuts": False,
        "spectral_weights": False,
        "spectral_groups": 0,
        "merged_groups": False,
        **PLAIN_CAMERA,
    },
    "polarisation": {"polarised": False},
    "haze": {"haze": False, "flights": False},
    "rough surfaces": {"rough": False},
    "light edges": {"light_edges": False},
    "lamp columns": {"lamp_columns": False},
    "mirrors": {"mirrors": False},
    "gratings": {"gratings": False},
    "thin sheets": {"sheets": False},
    "surface colours": {"filters": False},
    "interpolated normals": {"smooth_normals": False, "normal_derivatives": False},
    "normal derivatives": {"normal_derivatives": False},
    "absorption": {"absorption": False},
    "tint levels": {"tint_levels": 0},
    "medium stack": {"medium_stack": False},
    "contacts": {"contacts": False},
    "triangle tree": {"tree": False},
    "half-space solids": {"convex_solids": False},
    "curved solids": {"curved_solids": False},
    "charts": {"charts": False},
    "nested windows": {"nested_windows": False},
    "contact lines": {"contact_lines": False},
    "border images": {"border_images": False},
    "spectral bins": {"targets": 1, "map_tents": 0},
    "local gain": {"local_gain": False},
    "photons by index": {"reindexed": False},
    "camera refraction": {"camera_specular": False, **PLAIN_CAMERA},
    "camera spectral taps": PLAIN_CAMERA,
    "spectral maps": {"map_tents": 0},
}


def sources(features: Features) -> list[shader.Source]:
    """The light pass's and the camera's sources, with stand-ins for the numbers that only a scene's data give."""
    ray = records.ray_record(
        features.defines()["COLUMNS"],
        polarised=features.polarised,
        flights=features.flights,
        tinted=features.tint_levels > 0,
    )
    photon = records.photon_record(features.spectral_groups)
    structs = (*SCENE_STRUCTS, ray, photon, records.OUTCOME, records.TRACE_PARAMETERS, records.EMIT_PARAMETERS)
    structs += (records.FLIGHT,) if features.flights else ()
    copies = " ".join(
        f"photon.dposition_dvar{g} = ray.dposition[SPATIAL + {g}];" for g in range(features.spectral_groups)
    )
    numbers = {
        "SPECTRAL_COPY": copies,
        "TREE_AT": 0,
        "TREE_STACK": 9,
        "NORMALS_AT": 0,
        "PIECES_AT": 0,
        "INDEX_ROW": 0,
        "SLOPE_ROW": 1,
        "VARIABLE_ROW": 2,
        "BIND_FLIGHTS": 16,
    }
    numbers |= {
        "STACK_SIZE": 1,
        "STACK_OBJECTS": "uint[](0u)",
        "SOLID_COUNT": 1,
        "PLANE_COUNT": 6,
        "PIECE_COUNT": 2,
        "TRIANGLE_COUNT": 9,
    }
    light = features.defines() | numbers
    splat = splat_defines(features) | {"GROUPS": features.spectral_groups}
    made = [
        shader.load_source("light/trace.comp", light, structs),
        shader.load_source("light/emit.comp", light | {"LIGHT_POINT": 1}, structs),
    ]
    made.append(
        shader.load_source(
            "light/footprint.comp",
            footprint_defines(features),
            (photon, records.PLACEMENT, records.RECEIVER, SPLAT, records.GAIN_BOX),
        )
    )
    draws = {"light/splat_small.frag": "SMALL", "light/splat_swept.frag": "SWEPT"} | (
        {"light/splat_cut.frag": "CUT"} if features.band_cuts else {}
    )
    for fragment, kind in draws.items():
        made += [shader.load_source(name, splat | {kind: 1}, (SPLAT,)) for name in ("light/splat.vert", fragment)]
    soft = light | {"MOST_ASKED": 24, "BIND_PLACES": 8, "BIND_ASKED": 9, "BIND_SUMS": 10}
    if features.environment_lights:
        structs = (*SCENE_STRUCTS, PLACE, environment_light.PARAMETERS, environment_light.ASKED, gathered_light.SUM)
        made.append(shader.load_source("light/environment.comp", soft, structs))
    if features.bounces:
        structs = (*SCENE_STRUCTS, PLACE, bounce_light.PARAMETERS, bounce_light.ASKED, gathered_light.SUM)
        made.append(shader.load_source("light/bounce.comp", soft, structs))
    if features.haze:
        structs = (records.FLIGHT, CAMERA_PARAMETERS, HAZE_PARAMETERS)
        made += [shader.load_source(f"camera/haze.{s}", haze_defines(1), structs) for s in ("vert", "frag")]
    return made + camera_sources(features, light)


def camera_sources(
    features: Features, light: dict[str, int | float | str], images: dict[str, int] | None = None
) -> list[shader.Source]:
    """The camera's one program, or two where it sees glass or mirrors; `light`: symbols of the scene, `images`: of the
    texture store."""
    single = features.spectral_groups if features.camera_specular and features.camera_disperses else 0
    rows = (
        "WHITE_ROW",
        "LIGHT_ROW",
        "ROWS_PER_LIGHT",
        "BIN_ROW",
        "BIN_SPECTRUM_ROW",
        "REFLECTANCE_ROW",
        "BASIS_ROW",
        "ABSORPTION_ROW",
    )
    camera_pass = (
        light
        | dict.fromkeys(rows, 1)
        | {
            "TARGETS": 1,
            "MAP_TARGETS": features.targets,
            "SPECTRAL_GROUPS": single,
            "ABSORBERS": 1,
            "EMISSION_CELLS": 1023,
            "FINISHES_AT": 1,
        }
    )
    camera_pass |= {
        "BIN_TARGET": 1,
        "BIN_OVERLAP": 0,
        "STACK": 6,
        "MAX_DEPTH": 48,
        "MAX_EVENTS": 160,
        "LIGHT_COUNT": 1,
        "TINT_STEPS": 48,
        "BIN_COUNT": features.map_tents,
    }
    switches = {
        "LAYER_BEAUTY": True,
        "RGB_CHANNELS": True,
        "HAS_RECEIVERS": True,
        "VISIBLE_LIGHTS": True,
        "MAP_BINS": features.map_tents > 0,
        "CAMERA_SPECULAR": features.camera_specular,
        "HAS_DISPERSION": features.camera_disperses,
        "RECEIVER_LIGHT": features.environment_lights or features.bounces > 0,
        "SPECTRAL_SWEEP": single > 0,
        "ABSORPTION": features.absorption and features.camera_specular,
        "NORMAL_DERIVATIVES": features.smooth_normals,
        "LENS": features.lens,
        "POLARISED": features.polarised and features.camera_specular,
        "COATS": features.coats,
        "ROUGH_DIFFUSE": features.rough_diffuse,
        **(images or {}),
    }
    for name in switches:
        camera_pass.pop(name, None)
    camera_pass |= {name: 1 for name, on in switches.items() if on}
    structs = (
        *SCENE_STRUCTS,
        CAMERA_LIGHT,
        CAMERA_PARAMETERS,
        records.RECEIVER,
        records.PLACEMENT,
        *([PICTURE] if images else []),
    )
    programs = [direct_defines(camera_pass), *([camera_pass] if "CAMERA_SPECULAR" in camera_pass else [])]
    return [shader.load_source("camera/camera.comp", defines, structs) for defines in programs]


def scene_features(name: str) -> Features:
    return Features.of(load_scene(paths.assets_dir() / "scenes" / f"{name}.toml"), RenderSettings())


@pytest.mark.parametrize("feature", FEATURE_SYMBOLS)
def test_symbols_come_and_go_with_their_feature(feature: str) -> None:
    """Every symbol listed is in some program with the feature in, and in none with it out."""
    symbols = tuple(s for s in FEATURE_SYMBOLS[feature] if "1[0-9]" not in s)
    # Polarised light has no mean reflectance of its own.
    everything = replace(EVERYTHING, polarised=feature == "polarisation")
    present = {s for source in sources(everything) for s in occurring(source.text, symbols)}
    assert present == set(symbols)
    for source in sources(replace(everything, **WITHOUT[feature])):
        assert occurring(source.text, symbols) == (), source.name


SHIPPED = {
    "ball_plain": (
        "camera spectral taps",
        "spectral maps",
        "spectral columns",
        "weights over the band",
        "band cuts",
        "landing cuts",
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
    scene = load_scene(paths.assets_dir() / "scenes" / f"{name}.toml")
    features = Features.of(scene, RenderSettings())
    included = {feature: inside for feature, inside, _ in explain(scene, features)}
    assert not any(included[feature] for feature in SHIPPED[name])
    proofs = prove(program_texts(sources(features)), included)
    assert [p.feature for p in proofs if not p.holds] == []


def test_a_scene_without_dispersion_has_no_spectral_code_nor_columns() -> None:
    features = scene_features("ball_plain")
    for source in sources(features):
        for word in ("dposition_dvar", "variable_step", "spectral_variable", "is_cut", "texture("):
            assert word not in source.text, (source.name, word)
    forced = replace(features, spectral_groups=1, spectral_weights=True, band_cuts=True)
    plain, carrying = RecordSizes.of(features), RecordSizes.of(forced)
    assert (carrying.ray - plain.ray, carrying.photon - plain.photon) == (32, 16)
    assert (plain.columns, carrying.columns) == (4, 5), "two of the lattice, two of the lamp"


def _reasons(scene: Scene) -> dict[str, str]:
    return {name: reason for name, _, reason in explain(scene, Features.of(scene, RenderSettings()))}


def test_states_of_polarisation_cost_nothing_where_they_are_not_asked_for() -> None:
    scene = load_scene(paths.assets_dir() / "scenes" / "prism.toml")
    asked = replace(scene, render=replace(scene.render, polarisation=True))
    plain, polarised = (Features.of(each, RenderSettings()) for each in (scene, asked))
    assert not plain.polarised and replace(polarised, polarised=False) == plain
    assert RecordSizes.of(polarised).ray - RecordSizes.of(plain).ray == 48
    assert static_costs(asked, polarised)["polarisation"] == "48 B a ray"
    assert "asks for it" in _reasons(asked)["polarisation"]
    without = replace(asked, objects=tuple(o for o in asked.objects if not o.material.transmits))
    assert not Features.of(without, RenderSettings()).polarised
    assert "no glass" in _reasons(without)["polarisation"]


def test_what_surfaces_give_each_other_costs_nothing_where_it_is_not_asked_for() -> None:
    scene = load_scene(paths.assets_dir() / "scenes" / "prism.toml")
    asked = replace(scene, render=replace(scene.render, bounces=2))
    plain, bounces = (Features.of(each, RenderSettings()) for each in (scene, asked))
    assert plain.bounces == 0 and bounces.bounces == 2 and replace(bounces, bounces=0) == plain
    assert all(occurring(source.text, ("receiver_light", "add_receiver_light")) == () for source in sources(plain))
    assert any(occurring(source.text, ("add_receiver_light",)) for source in sources(bounces))
    assert _reasons(scene)["bounces"] == "[render] bounces is 0" and "2 time(s)" in _reasons(asked)["bounces"]
    # Nothing is left for a plane to see itself in.
    alone = replace(asked, objects=tuple(o for o in asked.objects if o.material.receives))
    assert not Features.of(alone, RenderSettings()).bounces and "in one plane" in _reasons(alone)["bounces"]


IMAGES = {"HAS_IMAGES": 1, "TEXTURE_COUNT": 1, "BIND_PICTURES": 13, "UNIT_PICTURES": 11, "UNIT_CORNERS": 12}
PICTURED = {
    "HAS_TEXTURES": ("painted", "texture_filtered", "uv_gradients", "pictures"),
    "HAS_ENVIRONMENT_MAP": ("environment_radiance", "pictures", "box_of_three"),
}


def test_pictures_are_looked_up_only_where_there_are_any() -> None:
    light = EVERYTHING.defines() | {
        "TREE_AT": 0,
        "TREE_STACK": 9,
        "NORMALS_AT": 0,
        "INDEX_ROW": 0,
        "SLOPE_ROW": 1,
        "VARIABLE_ROW": 2,
        "STACK_SIZE": 1,
    }
    light |= {"STACK_OBJECTS": "uint[](0u)", "SOLID_COUNT": 1, "PLANE_COUNT": 6, "TRIANGLE_COUNT": 9}
    names = {name for symbols in PICTURED.values() for name in symbols}
    assert all(occurring(source.text, sorted(names)) == () for source in camera_sources(EVERYTHING, light))
    for kind, symbols in PICTURED.items():
        for source in camera_sources(EVERYTHING, light, IMAGES | {kind: 1}):
            assert set(symbols) <= set(occurring(source.text, symbols)), (kind, source.text.splitlines()[0])
            others = names - set(symbols) - {"box_of_three"}
            assert occurring(source.text, sorted(others)) == (), kind


def test_what_is_in_tells_its_bytes_and_what_is_out_tells_none() -> None:
    scene = load_scene(paths.assets_dir() / "scenes" / "brilliant.toml")
    features = Features.of(scene, RenderSettings())
    costs = static_costs(scene, features)
    assert set(costs) == {name for name, included, _ in explain(scene, features) if included} - {"blockers"}
    assert costs["spectral columns"] == "32 B a ray, 16 B a photon"


def test_the_proof_fails_where_a_program_carries_what_it_should_not(monkeypatch: pytest.MonkeyPatch) -> None:
    features = scene_features("prism")
    included = dict.fromkeys(FEATURE_SYMBOLS, False)
    # Comments and guarded code left in, as in a text whose conditions only the driver resolves.
    monkeypatch.setattr(shader, "stripped", lambda lines, switches: lines)
    monkeypatch.setattr(shader, "_kept", {})  # nor a text that an earlier test had made
    told = {p.feature: p.holds for p in prove(program_texts(sources(features)), included)}
    assert not told["triangle tree"] and not told["normal derivatives"] and not told["medium stack"]


def test_a_guard_forgotten_in_a_shader_is_noticed(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    mutant = tmp_path / "shaders"
    for file in paths.shaders_dir().rglob("*"):
        if file.is_file():
            copy = mutant / file.relative_to(paths.shaders_dir())
            copy.parent.mkdir(parents=True, exist_ok=True)
            copy.write_bytes(file.read_bytes())
    text = (mutant / "lib" / "intersect.glsl").read_text()
    (mutant / "lib" / "intersect.glsl").write_text(text.replace("#ifdef HAS_TREE", "#if 1"))
    monkeypatch.setattr(paths, "shaders_dir", lambda: mutant)
    proofs = prove(program_texts(sources(scene_features("prism"))), dict.fromkeys(FEATURE_SYMBOLS, False))
    assert not next(p for p in proofs if p.feature == "triangle tree").holds


@pytest.mark.parametrize("anchored", [False, True])
@pytest.mark.parametrize("scene", ["prism", "brilliant", "spectrometer"])
def test_without_beams_photons_need_what_they_always_did(scene: str, anchored: bool) -> None:
    loaded = load_scene(paths.assets_dir() / "scenes" / f"{scene}.toml")
    alone, found = (
        Features.of(loaded, RenderSettings(method=method, anchor_weights=anchored)) for method in ("srd", "srd-photons")
    )
    # Nothing is left to photons that would have to know how broad a lamp is, or where a beam ends.
    known = {"lamp_columns": found.lamp_columns, "light_edges": found.light_edges}
    assert replace(alone, beams=False, **known) == replace(found, method="srd")
    assert scene != "prism" or alone.reindexed == anchored


def test_storage_blocks_are_as_many_as_the_doctor_asks_for() -> None:
    """Of the footprint's program, which has most: with the brush and without."""
    brushed, plain = (
        next(len(use_of(s).storage) for s in sources(features) if s.name == "light/footprint.comp")
        for features in (EVERYTHING, replace(EVERYTHING, local_gain=False))
    )
    assert brushed == BRUSH_STORAGE_BLOCKS
    assert plain == NEEDED.storage_blocks
