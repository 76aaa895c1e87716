"""Mistakes in the shaders, each with the test that is there to notice it.

    python -m pytest -m slow tests/gpu/test_mutants.py

Each runs its test in a process of its own, which must fail in an assertion: a shader that does not compile proves
nothing.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.gpu.mutants import SHADERS_VARIABLE, Mutant, mutated
from tests.gpu.mutants_of_library import OF_LIBRARY

ROOT = Path(__file__).parents[2]
_COLUMNS = "gpu/test_columns_gpu.py::test_columns_against_central_differences"
_BALANCE = "gpu/test_power_balance.py::test_all_that_was_emitted_is_drawn_or_accounted_for_where_reflection_is_total"
_PATHS = "gpu/test_whole_paths_gpu.py::test_position_and_throughput_at_three_wavelengths"
_CUTS = "gpu/test_whole_paths_gpu.py::test_cut_bands_against_exact_paths"
_SLAB = "gpu/test_known_answers_gpu.py::test_t3_slab_leaves_direction_without_dispersion"
_SHADOW = "gpu/test_environment_light.py::test_a_balls_shadow_is_one_minus_its_form_factor"


MUTANTS = {
    "bands that land on several surfaces left whole": Mutant(
        "light/trace_landing.glsl",
        "border = end > 3u ? clear_cut(path, path, x, met ? hit.distance : FAR_DISTANCE) : -1.0;",
        "border = -1.0;",
        "gpu/test_invariance.py::test_a_floor_may_end",
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
    "an extraordinary wave that forgets what it is": Mutant(
        "path/crystal.glsl",
        "path.extraordinary = uint(in_crystal && extraordinary);",
        "path.extraordinary = 0u;",
        "gpu/test_crystals.py::test_a_rhomb_doubles_an_image",
    ),
    "a wave plate that is late along its axis": Mutant(
        "path/polariser.glsl",
        "joint * cos(phase), -joint * sin(phase)",
        "joint * sin(phase), -joint * cos(phase)",
        "gpu/test_crystals.py::test_a_wave_plate_between_polarisers[147.25-45.0]",
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
        "theta.xz += incidence_column",
        "theta.xz += 0.0 * incidence_column",
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
    "an edited interval of the index keeps the weights of its ends": Mutant(
        "light/footprint.comp",
        "photon.throughput.xz = max(mix(photon.throughput.yy, photon.throughput.xz, reach), 0.0);",
        "",
        "gpu/test_live_light.py::test_edited_dispersion_equals_a_fresh_trace_at_the_same_indices[rod-1.2]",
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
    "soft edges of a rectangular beam swapped": Mutant(
        "light/emit.comp",
        "mat2(p.spacing.x * vec2(",
        "mat2(p.spacing.y * vec2(",
        "statistical/test_samplers_emission.py::"
        "test_a_rectangular_beam_s_edges_are_as_soft_as_its_lattice_is_wide_across_them",
    ),
    "an edge of a beam forgotten": Mutant(
        "light/beam.frag",
        "            note_crossing(\n                e, covers.x",
        "            if (e == 0) continue;\n            note_crossing(\n                e, covers.x",
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
        "interface_indices(event.boundary, x, event.n_i, event.n_t);",
        "interface_indices(event.boundary, x.yyy, event.n_i, event.n_t);",
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
    "the sign of leaving glass at both faces": Mutant(
        "lib/medium.glsl", "/ n_t - n_i", "/ n_t + n_i", f"{_SLAB}[N-BK7-light]"
    ),
    "the sign of entering glass at both faces": Mutant(
        "lib/medium.glsl", "return index_slope(", "return -index_slope(", f"{_SLAB}[N-BK7-light]"
    ),
    "a camera's films not left out of what they pass": Mutant(
        "camera/path.glsl",
        "unpackHalf2x16(walk.films_a.x) * shares",
        "shares",
        "gpu/test_thin_films.py::test_films_as_the_reference_sees_them[False]",
    ),
    "films in air, whatever they touch": Mutant(
        "path/event.glsl",
        "row += uint(FILM_MEDIUM_ROWS)",
        "row += 0u * uint(FILM_MEDIUM_ROWS)",
        "gpu/test_thin_films.py::test_gold_behind_glass_is_paler_than_in_air[False]",
    ),
    "a small splat without its height": Mutant(
        "light/splat_texel.glsl",
        "gaussian_box(at.x, half_texel.x) * gaussian_box(at.y, half_texel.y)",
        "gaussian_box(at.x, half_texel.x)",
        "gpu/test_stress_cases.py::test_case_keeps_its_promises[collapse]",
    ),
    "violet at the chord's high end": Mutant(
        "light/splat_setup.glsl",
        "table_u.x * at.x + table_u.y",
        "table_u.y - table_u.x * at.x",
        "gpu/test_splat.py::test_violet_lies_at_the_low_end_of_the_chord",
    ),
    "light of the environment without its cosine": Mutant(
        "light/gather.comp",
        "max(dot(toward, place.normal), 0.0)",
        "float(dot(toward, place.normal) > 0.0)",
        _SHADOW,
    ),
    "light of the environment through what is in the way": Mutant(
        "light/gather.comp", "reaches = !intersect_any", "reaches = intersect_any", _SHADOW
    ),
    "light of the environment lands as its anchor does": Mutant(
        "light/gather.comp",
        "ray_at(path, path.walk.x[tap / 3][tap % 3], position, direction);",
        "ray_at(path, path.band.y, position, direction);",
        "gpu/test_environment_spectrum.py::test_a_window_lands_behind_a_prism_where_snells_law_has_it",
    ),
    "wavelengths beside the anchor's count as if all were refracted": Mutant(
        "light/followed.glsl",
        "(per_passing / (1.0 - chance))",
        "(1.0 / (1.0 - chance))",
        "gpu/test_environment_spectrum.py::test_dispersive_glass_takes_no_light_out_of_a_furnace[mesh1]",
    ),
    "columns: another glass's slope": Mutant(
        "lib/medium.glsl", "object_at(object).group != g", "false", f"{_COLUMNS}[doublet]"
    ),
    "columns: no slope of the medium": Mutant(
        "lib/medium.glsl",
        "spectral_row(uint(SLOPE_ROW) + object_at(object).medium, x) : 1.0",
        "1.0 : 1.0",
        f"{_COLUMNS}[by wavelength]",
    ),
    "columns: flat normals": Mutant(
        "lib/interface.glsl",
        "return (frame.interpolated | frame.refused) != 0u ? dnormal : vec3(0.0);",
        "return vec3(0.0);",
        f"{_COLUMNS}[inner reflections]",
    ),
    "columns: normal not turned inside": Mutant(
        "lib/interface.glsl",
        "return (frame.interpolated | frame.refused) != 0u ? dnormal",
        "return (frame.interpolated | frame.refused) != 0u ? sign(dot(frame.summed, vec3(1.0))) * dnormal",
        f"{_COLUMNS}[beam]",
    ),
    "columns: mirror forgets the normal": Mutant(
        "lib/optics.glsl", "(dtheta * normal + theta * dnormal)", "(dtheta * normal)", f"{_COLUMNS}[mirror ball]"
    ),
    "columns: position follows the shading normal": Mutant(
        "light/trace.comp",
        "transfer_columns(path, hit.normal_g, hit.distance)",
        "transfer_columns(path, shading_frame(hit, facet, path.position, path.direction).normal, hit.distance)",
        f"{_COLUMNS}[sun]",
    ),
    "columns: axes swapped": Mutant(
        "light/emit.comp",
        "ddirection_ds = p.spacing.x * to_world(dx)",
        "ddirection_ds = p.spacing.x * to_world(dy)",
        f"{_COLUMNS}[spot]",
    ),
    "columns: flat map": Mutant("lib/emission.glsl", "k - q.x * q.x / (4.0 * k)", "k", f"{_COLUMNS}[disc]"),
    "columns: tilted sun's plane": Mutant(
        "light/emit.comp",
        "dposition_ds = p.spacing.x * p.tangent",
        "dposition_ds = 1.01 * p.spacing.x * p.tangent",
        f"{_COLUMNS}[sun]",
    ),
    "polarisation: unpolarised again": Mutant(
        "light/trace_records.glsl",
        "ray.stokes_q = path.polarisation.q;",
        "ray.stokes_q = vec3(0.0);",
        "gpu/test_polarised_paths_gpu.py::test_throughput_of_whole_paths[stone]",
    ),
    "added splats: clipped by no rectangle": Mutant(
        "light/splat_add.comp",
        "max(sides.lowest + splat.centre, splat.rect.xy)",
        "(sides.lowest + splat.centre)",
        "gpu/test_splat_add.py::test_every_kind_is_added_as_it_is_drawn[compare and swap-small]",
    ),
    "added splats: as bright where it fans out": Mutant(
        "light/splat_add.comp",
        "splat.ripple.xyz, w);",
        "splat.ripple.xyz, 1.0);",
        "gpu/test_splat_add.py::test_every_kind_is_added_as_it_is_drawn[compare and swap-fanning]",
    ),
    "added splats: lines beside their places": Mutant(
        "light/splat_add.comp",
        "float(begin.y + line) - middle.y",
        "float(begin.y + line) - middle.x",
        "gpu/test_splat_add.py::test_every_kind_is_added_as_it_is_drawn[compare and swap-swept]",
    ),
    "added splats: half of the team's texels": Mutant(
        "light/splat_add.comp",
        "t += TEAM;",
        "t += 2 * TEAM;",
        "gpu/test_splat_add.py::test_every_kind_is_added_as_it_is_drawn[compare and swap-swept]",
    ),
    "added splats: sums that overlap": Mutant(
        "light/splat_sums.glsl",
        "at.y / 2u",
        "at.y / 3u",
        "gpu/test_splat_add.py::test_every_kind_is_added_as_it_is_drawn[compare and swap-swept]",
    ),
    "bounces: back": Mutant(
        "light/gather.comp",
        "dot(direction, hit.normal_g) > 0.0",
        "dot(direction, hit.normal_g) < 0.0",
        "gpu/test_bounces.py::test_a_lit_floor_lights_the_wall_by_its_form_factor",
    ),
    "light of the environment without 1/π": Mutant(
        "camera/receiver_light.glsl",
        "seen.reflectance * INVERSE_PI",
        "seen.reflectance",
        "gpu/test_environment_light.py::test_a_white_thing_vanishes_in_a_white_furnace",
    ),
    "a cut band stays where it was directed": Mutant(
        "path/path.glsl",
        "direction += change * path.ddirection[SPATIAL + g];",
        "",
        "gpu/test_whole_paths_gpu.py::test_cut_bands_against_exact_paths[unpolarised]",
    ),
    "a share of each event lost": Mutant(
        "light/trace_companions.glsl",
        "path.throughput *= share;",
        "path.throughput *= 0.85 * share;",
        "gpu/test_power_balance.py::test_all_that_was_emitted_is_drawn_or_accounted_for_where_reflection_is_total[prism]",
    ),
    "waves of a cut band turned round": Mutant(
        "light/splat_shapes.glsl",
        "clamp(damping(blur, k[i]), 0.0, most)",
        "min(damping(blur, k[i]), most)",
        "gpu/test_power_balance.py::test_bands_cut_at_total_reflection_give_back_what_their_waves_take",
    ),
    "all channels of a splat with one weight": Mutant(
        "light/splat_setup.glsl",
        "return 2.0 * band_integral[3u * (splat.layer + g) + 1u] - 1.0;",
        "return vec4(0.0);",
        "gpu/test_splat_throughput.py::test_channels_have_what_their_wavelengths_have[broad-throughput0]",
    ),
    "footprints without images beyond a border": Mutant(
        "light/footprint_images.glsl",
        "left = uint(MOST_IMAGES)",
        "left = 0u",
        "gpu/test_borders.py::test_an_evenly_lit_table_is_even_up_to_its_borders[17.0]",
    ),
    "images of glows a step beyond the border": Mutant(
        "light/footprint_images.glsl",
        "MOST_FANNED = 0.5",
        "MOST_FANNED = 1e9",
        "statistical/test_glows.py::test_a_glow_keeps_its_light_beside_the_tables_border",
    ),
    "lobes wider without bound": Mutant(
        "light/trace_widths.glsl",
        "FORGOTTEN 0.5",
        "FORGOTTEN 1e9",
        "statistical/test_glows.py::test_light_of_a_ground_diamond_stays_where_it_lands",
    ),
    "lobes that rise without bound": Mutant(
        "light/trace_widths.glsl",
        "HIGHEST_RISE 0.5",
        "HIGHEST_RISE 1e9",
        "statistical/test_glows.py::test_light_of_a_ground_diamond_stays_where_it_lands",
    ),
    "footprints wider than the surface": Mutant(
        "light/trace_widths.glsl",
        "p.widest_on_surface * size",
        "1e9 * size",
        "statistical/test_wide_footprints.py::test_light_stays_where_it_lands",
    ),
    "microfacets that hide nothing": Mutant(
        "path/event.glsl",
        "ground.regained * smith_share(cosine, ground.width)",
        "vec3(1.0)",
        "statistical/test_rough_glass.py::test_one_surface_reflects_what_its_microfacets_do[70.0-0.6]",
    ),
    "shares of microfacets as far off as derivatives say": Mutant(
        "path/microfacet.glsl",
        "#define MOST_CHANGE 0.3",
        "#define MOST_CHANGE 1e6",
        "statistical/test_rough_glass.py::test_steep_derivatives_by_wavelength_take_no_light",
    ),
    "camera: two per cent lost at each surface": Mutant(
        "camera/meet.glsl",
        "vec3 let_through = transmittance_of(event);",
        "vec3 let_through = transmittance_of(event) - 0.02;",
        "gpu/test_camera_furnace.py::test_clear_glass_vanishes_in_a_closed_white_room[background]",
    ),
    "camera: an undispersed path cut as the whole spectrum": Mutant(
        "camera/meet.glsl",
        "start_of_band(whole, path)",
        "whole",
        "gpu/test_camera_furnace.py::test_nothing_is_counted_twice_from_under_water",
    ),
    "camera: wavelengths as a sequence of their own": Mutant(
        "camera/path.glsl",
        "radical_inverse(p.sample_index, hash",
        "kronecker(p.sample_index, depth_generator(0u), hash",
        "gpu/test_camera_furnace.py::test_single_wavelengths_hardly_colour_a_pixel",
    ),
    "camera: the base under a coat gets all": Mutant(
        "camera/finish.glsl",
        "1.0 - spectral_row(finish.row, cosine)",
        "1.0",
        "gpu/test_finish_gpu.py::test_a_white_finished_table_vanishes_in_a_white_room[varnish-low]",
    ),
    "camera: the sign of entering glass at both faces": Mutant(
        "path/event.glsl",
        "deta_it = index_ratio_derivative(",
        "deta_it = abs(1.0) * -index_ratio_derivative(",
        "gpu/test_camera_known_answers.py::test_fringe_of_an_edge_behind_a_thin_prism[N-SF11-1]",
    ),
}

MUTANTS |= OF_LIBRARY


def test_mutants_are_of_todays_shaders_and_tests() -> None:
    """Quick, for the mutants themselves are slow: whoever moves or rewords a line, or a test, hears of it at once."""
    shaders = ROOT / "shaders"
    gone = [name for name, mutant in MUTANTS.items() if mutant.old not in (shaders / mutant.file).read_text("utf-8")]
    assert not gone
    for mutant in MUTANTS.values():
        file, _, test = mutant.killed_by.partition("::")
        assert f"def {test.partition('[')[0]}(" in (ROOT / "tests" / file).read_text("utf-8"), mutant.killed_by


@pytest.mark.slow
@pytest.mark.parametrize("name", MUTANTS)
def test_each_mistake_is_noticed(tmp_path: Path, name: str) -> None:
    mutant = MUTANTS[name]
    shaders = mutated(tmp_path, mutant.file, mutant.old, mutant.new)
    options = ["-n", "0", "-x", "-q", "-m", "", "-p", "no:cacheprovider", "-p", "tests.gpu.mutants"]
    done = subprocess.run(
        [sys.executable, "-m", "pytest", *options, f"tests/{mutant.killed_by}"],
        cwd=ROOT,
        env=os.environ | {SHADERS_VARIABLE: str(shaders)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1 and "AssertionError" in done.stdout, f"'{name}' lives\n{done.stdout[-2000:]}"
