"""Mistakes in the shaders, each with the test that is there to notice it.

    python -m pytest -m slow tests/gpu/test_mutants.py

Each runs its test in a process of its own, which must fail in an assertion: a shader that does not compile proves
nothing.
"""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.gpu.mutants import SHADERS_VARIABLE, mutated

ROOT = Path(__file__).parents[2]
_BALANCE = "gpu/test_power_balance.py::test_all_that_was_emitted_is_drawn_or_accounted_for_where_reflection_is_total"
_PATHS = "gpu/test_whole_paths_gpu.py::test_position_and_throughput_at_three_wavelengths"
_CUTS = "gpu/test_whole_paths_gpu.py::test_cut_bands_against_exact_paths"
_SHADOW = "gpu/test_environment_light.py::test_a_balls_shadow_is_one_minus_its_form_factor"


@dataclass(frozen=True)
class Mutant:
    """`old` of a shader became `new`; `killed_by`: a test, from `tests` on."""

    file: str
    old: str
    new: str
    killed_by: str


MUTANTS = {
    "bands that land on several surfaces left whole": Mutant(
        "light/trace_landing.glsl",
        "border = end > 3u ? clear_cut(path, path, x, hit.distance) : -1.0;",
        "border = -1.0;",
        "gpu/test_invariance.py::test_a_floor_may_be_several_objects",
    ),
    "survivor's boost dropped from throughput": Mutant(
        "light/roulette.glsl", "path.throughput *= boost;", "", f"{_BALANCE}[prism]"
    ),
    "unwidened footprints": Mutant(
        "light/roulette.glsl",
        "path.walk.footprint_scale *= sqrt(boost);",
        "",
        "statistical/test_samplers_numbers.py::"
        "test_survivors_of_roulette_have_the_power_and_the_place_of_those_that_died",
    ),
    "survivors of roulette scattered over their lattice": Mutant(
        "light/roulette.glsl",
        "uint along = hash_pcg(key),",
        "uint along = hash_pcg(key ^ place.y),",
        "statistical/test_samplers_numbers.py::test_survivors_of_roulette_are_a_coarser_lattice",
    ),
    "a lattice's ripple left in the splats": Mutant(
        "light/splat_shapes.glsl",
        "splat.ripple = vec4(taken * kept, 0.0);",
        "splat.ripple = vec4(0.0);",
        "gpu/test_emission_lattice.py::test_splats_about_a_lattice_add_up_to_an_even_plane[0]",
    ),
    "what is refracted was reflected as well": Mutant(
        "light/trace_scatter.glsl",
        "send_on(child, event, let_through,",
        "send_on(child, event, vec3(1.0),",
        f"{_BALANCE}[prism]",
    ),
    "power lost on landing": Mutant(
        "light/trace.comp",
        "photon.throughput = path.throughput;",
        "photon.throughput = 0.85 * path.throughput;",
        f"{_BALANCE}[prism]",
    ),
    "power lost in swept splats": Mutant(
        "light/splat_shapes.glsl",
        "splat.amplitude = 1.0 / (reach",
        "splat.amplitude = 0.85 / (reach",
        f"{_BALANCE}[prism]",
    ),
    "throughput blurred with the spectrum": Mutant(
        "light/splat_shapes.glsl",
        "splat.amplitude *= as_drawn",
        "float unused = as_drawn",
        "gpu/test_splat_throughput.py::test_power_is_what_the_photon_carries[broad]",
    ),
    "band ends without direction dispersion": Mutant(
        "path/event.glsl",
        "theta.x += dtheta * variable_step",
        "theta.x += 0.0 * variable_step",
        f"{_PATHS}[steep Fresnel]",
    ),
    "one coefficient of absorption for the band": Mutant(
        "light/trace.comp",
        "weaken(path, kept, companions)",
        "weaken(path, kept.yyy, companions)",
        f"{_PATHS}[absorption]",
    ),
    "grey mirror": Mutant(
        "light/trace_scatter.glsl",
        "send_on(child, event, kept, of_companions",
        "send_on(child, event, kept.yyy, of_companions",
        f"{_PATHS}[coloured mirror]",
    ),
    "sweep centred on the anchor": Mutant(
        "light/footprint.comp",
        "vec3 middle = 0.5 * (to_lo + to_hi);",
        "vec3 middle = vec3(0.0);",
        "gpu/test_splat.py::test_a_sweep_lies_between_its_band_s_ends_whichever_wavelength_is_traced",
    ),
    "cut spectrum reversed": Mutant(
        "light/splat_texel.glsl",
        "return mix(band.xx, band.yy, 0.5 + 0.5 * ends / band.z);",
        "return mix(band.xx, band.yy, 0.5 - 0.5 * ends.yx / band.z);",
        "gpu/test_splat.py::test_cut_bands_add_up_to_the_whole",
    ),
    "slopes of throughput swapped": Mutant(
        "lib/swept.glsl",
        "min(aside, 0.0) * throughput.z + max(aside, 0.0) * throughput.w",
        "min(aside, 0.0) * throughput.w + max(aside, 0.0) * throughput.z",
        "gpu/test_splat.py::test_throughput_over_the_band",
    ),
    "soft edges of a rectangular beam swapped": Mutant(
        "light/emit.comp",
        "mat2(p.spacing.x * vec2(",
        "mat2(p.spacing.y * vec2(",
        "statistical/test_samplers_emission.py::"
        "test_a_rectangular_beam_s_edges_are_as_soft_as_its_lattice_is_wide_across_them",
    ),
    "an edge of a beam forgotten": Mutant(
        "light/beam.frag",
        "        note_crossing(e, covers.x",
        "        if (e == 0) continue;\n        note_crossing(e, covers.x",
        "gpu/test_beam_splat.py::test_energy_at_every_size_and_place",
    ),
    "a beam's sweep reversed": Mutant(
        "light/beam.frag",
        "vec4 start = EDGE_START(e), change = EDGE_CHANGE(e);",
        "vec4 start = EDGE_START(e) + EDGE_CHANGE(e), change = -EDGE_CHANGE(e);",
        "gpu/test_beam_splat.py::test_swept_polygons_match_single_indices",
    ),
    "texels in perspective of one area": Mutant(
        "light/beam.frag",
        "/ (nearness2 * nearness2)",
        "/ nearness2",
        "gpu/test_picture_windows.py::test_swept_polygons_in_perspective",
    ),
    "a pixel's texels averaged over the whole pixel": Mutant(
        "camera/receiver.glsl",
        "box /= share * p.cells;",
        "box /= share;",
        "gpu/test_picture_windows.py::test_a_pixel_shows_its_own_texels_only",
    ),
    "camera absorption by the last chord only": Mutant(
        "camera/meet.glsl",
        "path.walk.lengths[i] += length;",
        "path.walk.lengths[i] = length;",
        "gpu/test_camera_glass.py::test_absorption_follows_beers_law",
    ),
    "camera band ends with the anchor's index": Mutant(
        "path/event.glsl",
        "interface_indices(event.boundary, path.band, event.n_i, event.n_t);",
        "interface_indices(event.boundary, path.band.yyy, event.n_i, event.n_t);",
        "gpu/test_camera_cuts.py::test_parted_colours_go_their_own_ways",
    ),
    "one polarisation": Mutant("lib/optics.glsl", "0.5 * (rs * rs + rp * rp)", "rs * rs", f"{_PATHS}[steep Fresnel]"),
    "power not absorbed": Mutant(
        "light/trace_companions.glsl",
        "path.walk.flux_w *= share.y",
        "path.walk.flux_w *= 1.0",
        f"{_PATHS}[absorption without dispersion]",
    ),
    "absorption of the lower priority": Mutant(
        "lib/medium.glsl",
        "stack_objects[findMSB(mask)]",
        "stack_objects[findLSB(mask)]",
        f"{_PATHS}[nested, the outer decides]",
    ),
    "a covered surface bends light": Mutant(
        "lib/medium.glsl", "boundary.before != boundary.after", "true", f"{_PATHS}[nested, the outer decides]"
    ),
    "a cut part anchored at its end": Mutant(
        "light/trace_bands.glsl", "vec3(lo, 0.5 * (lo + hi), hi)", "vec3(lo, lo, hi)", _CUTS
    ),
    "a cut part starts where the whole did": Mutant(
        "path/path.glsl", "position += change * path.dposition[SPATIAL + g];", "", _CUTS
    ),
    "columns end before the surface's tilt": Mutant(
        "lib/optics.glsl",
        "(dot(moved, normal_g) / dot(direction, normal_g))",
        "0.0",
        "gpu/test_known_answers_gpu.py::test_t4_ball_lens",
    ),
    "refraction without the index's own derivative": Mutant(
        "lib/optics.glsl",
        "(deta_it / omega)",
        "(0.0 / omega)",
        "gpu/test_known_answers_gpu.py::test_t2_prism_at_minimum_deviation",
    ),
    "orders of a grating to the other side": Mutant(
        "lib/grating.glsl",
        "return side * normalize",
        "return -side * normalize",
        "gpu/test_grating_gpu.py::test_functions_against_float64",
    ),
    "waves as long in water as in air": Mutant(
        "lib/grating.glsl",
        "return order.shift_per_um * wavelength_um / n;",
        "return order.shift_per_um * wavelength_um;",
        "gpu/test_grating_gpu.py::test_water_shortens_waves",
    ),
    "a small splat without its height": Mutant(
        "light/splat_texel.glsl",
        "gaussian_box(at.x, half_texel.x) * gaussian_box(at.y, half_texel.y)",
        "gaussian_box(at.x, half_texel.x)",
        "gpu/test_splat.py::test_no_footprint_and_no_sweep_still_deposits_everything",
    ),
    "violet at the chord's high end": Mutant(
        "light/splat_setup.glsl",
        "table_u.x * at.x + table_u.y",
        "table_u.y - table_u.x * at.x",
        "gpu/test_splat.py::test_violet_lies_at_the_low_end_of_the_chord",
    ),
    "light of the environment without its cosine": Mutant(
        "light/environment.comp",
        "max(dot(toward, place.normal), 0.0)",
        "float(dot(toward, place.normal) > 0.0)",
        _SHADOW,
    ),
    "light of the environment through what is in the way": Mutant(
        "light/environment.comp", "reaches = !intersect_any", "reaches = intersect_any", _SHADOW
    ),
}


def test_mutants_are_of_todays_shaders() -> None:
    """Quick, for the mutants themselves are slow: whoever moves or rewords a line hears of it at once."""
    shaders = ROOT / "shaders"
    gone = [name for name, mutant in MUTANTS.items() if mutant.old not in (shaders / mutant.file).read_text("utf-8")]
    assert not gone


@pytest.mark.slow
@pytest.mark.parametrize("name", MUTANTS)
def test_each_mistake_is_noticed(tmp_path: Path, name: str) -> None:
    mutant = MUTANTS[name]
    shaders = mutated(tmp_path, mutant.file, mutant.old, mutant.new)
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-n",
        "0",
        "-x",
        "-q",
        "-m",
        "",
        "-p",
        "no:cacheprovider",
        "-p",
        "tests.gpu.mutants",
    ]
    done = subprocess.run(
        [*command, f"tests/{mutant.killed_by}"],
        cwd=ROOT,
        env=os.environ | {SHADERS_VARIABLE: str(shaders)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1 and "AssertionError" in done.stdout, f"'{name}' lives\n{done.stdout[-2000:]}"
