"""Mistakes in functions of shaders/lib and in the queue."""

from __future__ import annotations

from tests.gpu.mutants import Mutant

OF_LIBRARY = {
    "pixels upside down": Mutant(
        "lib/camera.glsl",
        "1.0 - 2.0 * unit.y",
        "2.0 * unit.y - 1.0",
        "gpu/test_camera.py::test_lambert_floor_under_a_point_light",
    ),
    "a lamp half as wide": Mutant(
        "lib/lights.glsl",
        "target += on_light.x * light.half_u",
        "target += 0.5 * on_light.x * light.half_u",
        "gpu/test_camera.py::test_area_disc_lights_the_floor_and_is_seen_from_its_front_only",
    ),
    "a square aperture": Mutant(
        "lib/lights.glsl",
        "light.is_disc != 0u ? dot(at, at) <= 1.0",
        "false ? dot(at, at) <= 1.0",
        "gpu/test_camera.py::test_collimated_beam_ends_at_its_aperture",
    ),
    "a straight edge of a spot": Mutant(
        "lib/spot.glsl", "t * t * (3.0 - 2.0 * t)", "t", "gpu/test_camera.py::test_spot_edge_hard_and_soft"
    ),
    "photons of other slots": Mutant(
        "light/queue_scatter.comp",
        "indices[state.ray_capacity + photon_at++] = k;",
        "indices[state.ray_capacity + photon_at++] = k ^ 1u;",
        "gpu/test_power_balance.py::test_all_that_was_emitted_is_drawn_or_accounted_for_where_reflection_is_total[prism]",
    ),
    "a photon too few": Mutant(
        "light/queue_scan.comp",
        "state.photons_new = min(landed, room);",
        "state.photons_new = min(landed - min(landed, 1u), room);",
        "gpu/test_power_balance.py::test_all_that_was_emitted_is_drawn_or_accounted_for_where_reflection_is_total[brilliant]",
    ),
    "pictures blurred by other levels": Mutant(
        "lib/textures.glsl",
        "LEVEL_BIAS = -0.8",
        "LEVEL_BIAS = 0.8",
        "gpu/test_textures_filter.py::test_a_patch_shows_its_mean",
    ),
    "too little of the brighter side": Mutant(
        "lib/highlights.glsl",
        "clamp((own - found.low)",
        "clamp(0.8 * (own - found.low)",
        "gpu/test_display.py::test_highlights_are_antialiased_alike_in_window_files_and_float64",
    ),
    "a rough base loses light": Mutant(
        "lib/rough_diffuse.glsl",
        "rough_multiple_colour(reflectance, roughness) * twice",
        "0.9 * rough_multiple_colour(reflectance, roughness) * twice",
        "gpu/test_finish_gpu.py::test_the_rough_base_agrees_with_float64",
    ),
    "a beam in haze met elsewhere": Mutant(
        "lib/haze.glsl",
        "(along_ray - found.cosine * along_beam) / sine2",
        "(along_ray - found.cosine * along_beam)",
        "gpu/test_haze.py::test_a_beam_is_as_bright_as_its_chord",
    ),
    "images short of the border": Mutant(
        "lib/border.glsl",
        "position - 2.0 * border_distance(border, position)",
        "position - 1.8 * border_distance(border, position)",
        "gpu/test_borders.py::test_mirrored_an_even_grid_is_even_up_to_borders_and_corners",
    ),
    "a grating in glass without its slope": Mutant(
        "lib/grating.glsl",
        "- medium_index(met.object, x) / (n * n)",
        "- 0.0 * medium_index(met.object, x) / (n * n)",
        "gpu/test_grating_gpu.py::test_inside_dispersive_glass_against_the_slow_tracer",
    ),
    "orders along the lines": Mutant(
        "lib/grating.glsl",
        "return met.side * normalize(cross(met.grating.lines, normal))",
        "return met.side * normalize(met.grating.lines)",
        "gpu/test_grating_gpu.py::test_lines_of_mercury",
    ),
    "facets that light meets before the sheet": Mutant(
        "lib/grating.glsl",
        "bool onward = k.z < 0.0;",
        "bool onward = k.z > 0.0;",
        "gpu/test_grating_profiles_gpu.py::test_each_order_carries_its_share[blazed-srd]",
    ),
    "a slit that spreads light to one side": Mutant(
        "lib/grating.glsl",
        "draw < 0.5 ? -place : place",
        "draw < 0.5 ? place : place",
        "gpu/test_line_widths_gpu.py::test_a_slits_minima_and_maxima[srd]",
    ),
    "a camera's own ray taken for the light at a grating": Mutant(
        "path/grating.glsl",
        "light = vec3(-light.xy, is_reflective",
        "light = vec3(light.xy, is_reflective",
        "gpu/test_grating_profiles_gpu.py::test_the_camera_sees_the_shares_of_light_that_comes_back[blazed]",
    ),
    "polarisation without its power": Mutant(
        "lib/band.glsl",
        "weight * state.q",
        "state.q",
        "gpu/test_whole_paths_gpu.py::test_cut_bands_against_exact_paths[polarised]",
    ),
    "microfacets on a diagonal": Mutant(
        "lib/rough_surface.glsl",
        "kronecker(i, across, hash_pcg(own))",
        "kronecker(i, along, own)",
        "statistical/test_rough_glass.py::test_one_surface_reflects_what_its_microfacets_do",
    ),
    "light between the microfacets of a metal is lost": Mutant(
        "lib/rough_energy.glsl",
        "reflected / (1.0 - thrown * reflected)",
        "reflected",
        "gpu/test_rough_metal.py::test_rough_mirrors_in_a_furnace",
    ),
    "a film that varies by the distance, not its square": Mutant(
        "lib/film.glsl",
        "wedge.bend * dot(way, way)",
        "sqrt(wedge.bend) * length(way)",
        "gpu/test_varied_films.py::test_newtons_rings_seen",
    ),
    "glass that is never left": Mutant(
        "lib/medium.glsl",
        "boundary.behind = MediumStack(stack.mask, entering ? object : NONE);",
        "boundary.behind = MediumStack(stack.mask, object);",
        "gpu/test_whole_paths_gpu.py::test_position_and_throughput_at_three_wavelengths[absorption]",
    ),
    "normals of the wrong corner": Mutant(
        "lib/interface.glsl",
        "hit.bary.x * n1 + hit.bary.y * n2",
        "hit.bary.x * n2 + hit.bary.y * n1",
        "gpu/test_known_answers_gpu.py::test_t4_ball_lens[light]",
    ),
    "texels in perspective as flat": Mutant(
        "lib/placement.glsl",
        "place.texel_area * at.z * at.z * at.z",
        "place.texel_area * at.z * at.z",
        "gpu/test_picture_windows.py::test_a_pixel_shows_its_own_texels_only[1]",
    ),
    "the extraordinary wave on the other side of the ordinary one": Mutant(
        "lib/crystal.glsl",
        "step = ellipticity /",
        "step = -ellipticity /",
        "gpu/test_glsl_reference_crystal.py::test_shares_are_those_of_the_continuous_fields[in]",
    ),
    "slopes of throughput swapped": Mutant(
        "lib/swept.glsl",
        "min(aside, 0.0) * throughput.z + max(aside, 0.0) * throughput.w",
        "min(aside, 0.0) * throughput.w + max(aside, 0.0) * throughput.z",
        "gpu/test_splat.py::test_throughput_over_the_band",
    ),
    "columns end before the surface's tilt": Mutant(
        "lib/optics.glsl",
        "(dot(moved, normal_g) / dot(direction, normal_g))",
        "0.0",
        "gpu/test_known_answers_gpu.py::test_t4_ball_lens[light]",
    ),
    "refraction without the index's own derivative": Mutant(
        "lib/optics.glsl",
        "(deta_it / omega)",
        "(0.0 / omega)",
        "gpu/test_known_answers_gpu.py::test_t2_prism_at_minimum_deviation[N-BK7-light]",
    ),
    "a film of air between solids that touch": Mutant(
        "lib/intersect.glsl",
        "(facing > 0.0 ? distance + NEAR_DISTANCE : distance)",
        "distance",
        "gpu/test_known_answers_gpu.py::test_t12_amici_prism_of_three_touching_solids[light]",
    ),
    "a film's shares at a band's ends and anchor alone": Mutant(
        "lib/film.glsl",
        "from = to = x.xyzz;",
        "from = to = x.xyzz;\n    } else {\n        from = to = x.xyzz;",
        "gpu/test_thin_films.py::test_patches_of_sun_behind_films",
    ),
    "orders of a grating to the other side": Mutant(
        "lib/grating.glsl",
        "return met.side * normalize",
        "return -met.side * normalize",
        "gpu/test_grating_gpu.py::test_functions_against_float64",
    ),
    "waves as long in water as in air": Mutant(
        "lib/grating.glsl",
        "medium_index(met.object, x) / medium_index(met.medium, x)",
        "medium_index(met.object, x)",
        "gpu/test_grating_gpu.py::test_water_shortens_waves",
    ),
    "polarisation: planes do not turn": Mutant(
        "lib/polarisation.glsl",
        "state.q = cosine * q + sine * state.u;",
        "state.q = q;",
        "gpu/test_polarised_paths_gpu.py::test_throughput_of_whole_paths[stone]",
    ),
    "polarisation: no retardance": Mutant(
        "lib/polarisation.glsl",
        "mix(2.0 * x * y * per, vec3(0.0), passes)",
        "vec3(0.0)",
        "gpu/test_polarised_paths_gpu.py::test_throughput_of_whole_paths[stone]",
    ),
    "polarisation: circular light keeps its sense": Mutant(
        "lib/polarisation.glsl",
        "vec3(-1.0), vec3(0.0));",
        "vec3(1.0), vec3(0.0));",
        "gpu/test_polarised_paths_gpu.py::test_throughput_of_whole_paths[panes with a mirror between]",
    ),
    "bounces: cosine": Mutant(
        "lib/bounce.glsl",
        "3.14159265359 * both /",
        "3.14159265359 * cosine_there /",
        "gpu/test_bounces.py::test_a_lit_floor_lights_the_wall_by_its_form_factor",
    ),
    "bounces: density": Mutant(
        "lib/bounce.glsl",
        "density * distance2",
        "density * sqrt(distance2)",
        "gpu/test_bounces.py::test_a_lit_floor_lights_the_wall_by_its_form_factor",
    ),
}
