// Where a path ends in something that shines, it looks up along its spectral sweep what is there. A path that was never
// bent by dispersive glass looks once; another as often as its sweep is long, and what lies between two lookups is
// averaged. Where the lookup number `tap` of so many begins: each stands for as much of what looks bright, and looks in
// the midst of it.
float tap_border(Path path, vec2 brightness, float tap, int taps) {
    return tap <= 0.0
        ? path.band.x
        : (tap >= float(taps) ? path.band.z : clamp(quantile(brightness, tap / float(taps)), path.band.x, path.band.z));
}

// A sweep shorter than this, in widths of a pixel, does not show.
#define MIN_SWEEP 0.2

// Sweep of the path over the distance ahead, in widths of a pixel.
float sweep_pixels(Path path, float distance) {
    vec3 p_lo = path.end_position[0], d_lo = path.end_direction[0], p_hi = path.end_position[1],
         d_hi = path.end_direction[1];
    float reach = min(distance, 1e4);
    vec3 sweep = (p_hi - p_lo) + reach * (d_hi - d_lo);
    sweep -= dot(sweep, path.direction) * path.direction;
    vec3 side_s = path.dposition[0] + reach * path.ddirection[0],
         side_t = path.dposition[1] + reach * path.ddirection[1];
    float pixel = sqrt(max(length(cross(side_s, side_t)), 1e-20));
    return length(sweep) / pixel;
}

// The same in widths of what has to tell colours apart: a pixel, or of the lobe of a rough surface, which is many
// pixels wide, a sample's share.
float shown_sweep(Path path, float distance) {
    return ROUGH_SURFACES ? (sweep_pixels(path, distance) / (path.walk.ground != 0u ? sample_side(path) : 1.0))
                          : sweep_pixels(path, distance);
}

// Looks that this sweep needs: where it shows at all, one for either half; the fewer, the less of the sample the path
// is.
int taps_of(Path path, float distance) {
    float pixels = shown_sweep(path, distance);
    return clamp(
        int(min(ceil(pixels * p.taps_per_pixel), float(p.max_taps)) * sqrt(min(path.walk.branch_weight, 1.0)) + 0.99),
        pixels > MIN_SWEEP ? 2 : 1, int(p.max_taps));
}

// Radiance from infinitely far away, as coefficients of the reflectance basis.
vec3 sky_colour(vec3 direction, vec3 ddirection[3]) {
    if (HAS_ENVIRONMENT_MAP) {
        vec3 local = p.sky_x * direction.x + p.sky_y * direction.y + p.sky_z * direction.z;
        vec3 columns[3];
        for (int c = 0; c < 3; ++c)
            columns[c] = p.sky_x * ddirection[c].x + p.sky_y * ddirection[c].y + p.sky_z * ddirection[c].z;
        // A box of the same covariance, in the plane across the ray.
        vec3 across = normalize(cross(local, abs(local.z) < 0.9 ? vec3(0.0, 0.0, 1.0) : vec3(1.0, 0.0, 0.0)));
        vec3 other = cross(local, across);
        vec2 flat_columns[3];
        for (int c = 0; c < 3; ++c) flat_columns[c] = vec2(dot(columns[c], across), dot(columns[c], other));
        vec2 major, minor;
        box_of_three(flat_columns[0], flat_columns[1], flat_columns[2], major, minor);
        return environment_radiance(local, major.x * across + major.y * other, minor.x * across + minor.y * other);
    } else {
        return p.background.rgb;
    }
}

void add_sky(Path path, WavelengthInterval interval, vec3 direction, vec3 sweep) {
    vec3 columns[3];
    columns[0] = sample_side(path) * path.ddirection[0];
    columns[1] = sample_side(path) * path.ddirection[1];
    if (LENS)
        join_sides(path.direction, columns[0], columns[1], sample_side(path) * path.ddirection[LENS_COLUMNS],
            sample_side(path) * path.ddirection[LENS_COLUMNS + 1]);
    columns[2] = sweep;
    add_colour(path, interval, uint(WHITE_ROW), sky_colour(direction, columns));
}

// Diameter of what a sample stands for: where its ray starts (GPU units), and how that grows with distance.
vec2 sample_width(Path path) {
    return sample_side(path)
        * sqrt(vec2(length(cross(path.dposition[0], path.dposition[1])),
            length(cross(path.ddirection[0], path.ddirection[1]))));
}

// The same of lights infinitely far away, where a place on the lens is but a direction.
vec2 far_width(Path path, vec2 width) {
    float by_lens = sample_side(path) * sample_side(path)
        * length(cross(path.ddirection[LENS_COLUMNS], path.ddirection[LENS_COLUMNS + 1]));
    return vec2(width.x, sqrt(width.y * width.y + by_lens));
}
#define WIDTH_OF(light) (LENS && light.kind == LIGHT_KIND_DIRECTIONAL ? far_width(path, width) : width)

// Lights that can be seen over the distance `far`; edges are as soft as what the ray stands for is wide.
void add_lights(Path path, float far) {
    vec2 width = sample_width(path), sweep = vec2(0.0), brightness;
    int taps = 1;
    if (SPECTRAL_SWEEP) {
        brightness = brightness_of(path.band);
        if (path.restricted != 0u) {
            vec3 p_lo = path.end_position[0], d_lo = path.end_direction[0], p_hi = path.end_position[1],
                 d_hi = path.end_direction[1];
            sweep = vec2(distance(p_lo, p_hi), distance(d_lo, d_hi));
            taps = taps_of(path, far);
        }
    }
    // Few rays come near a light: only they look along their sweep.
    bool near = false;
    for (uint i = 0u; i < uint(LIGHT_COUNT); ++i) {
        CameraLight light = lights[i];
        near = near
            || (light.measure > 0.0
                && light_seen(light, path.position, path.direction, far, 2.0 * (WIDTH_OF(light) + sweep)) > 0.0);
    }
    if (LISTS_SPECULAR) saw_light = saw_light || near;
    for (int tap = 0; tap < taps && near; ++tap) {
        vec3 position = path.position, direction = path.direction;
        float lo = path.band.x, hi = path.band.z, part = 1.0;
        if (SPECTRAL_SWEEP && taps > 1) {
            lo = tap_border(path, brightness, float(tap), taps);
            hi = tap_border(path, brightness, float(tap + 1), taps);
            part = (hi - lo) / (path.band.z - path.band.x);
            ray_at(path, tap_border(path, brightness, float(tap) + 0.5, taps), position, direction);
        }
        WavelengthInterval interval = wavelength_interval(path, lo, hi);
        for (uint i = 0u; i < uint(LIGHT_COUNT); ++i) {
            CameraLight light = lights[i];
            float seen =
                light.measure > 0.0 ? light_seen(light, position, direction, far, WIDTH_OF(light) + sweep * part) : 0.0;
            if (COATS) seen *= share_of_lobe(path, light, position, direction);
            if (seen > 0.0) add_spectrum(path, interval, uint(LIGHT_ROW) + i * uint(ROWS_PER_LIGHT), seen);
        }
    }
}

// Moves a path, its spectral columns and its band's ends along their flights to the facet that it has met; its sides
// and directions stay as they are.
void arrive(inout Path path, Hit hit) {
    vec3 middle = path.position + hit.distance * path.direction;
    for (int end = 0; end < 2; ++end)
        path.end_position[end] += dot(hit.normal_g, middle - path.end_position[end])
            / dot(hit.normal_g, path.end_direction[end]) * path.end_direction[end];
    for (int g = 0; g < SPECTRAL_GROUPS; ++g)
        path.dposition[SPATIAL + g] = transfer_column(
            path.dposition[SPATIAL + g], path.ddirection[SPATIAL + g], path.direction, hit.normal_g, hit.distance);
    path.position = middle;
}

// Where a path that has arrived does so at the wavelength x: on a parabola with the columns' slope, through both ends.
vec3 arrival_at(Path path, float x) {
    bool below = x < path.band.y;
    float reach = (x - path.band.y) / max(abs((below ? path.band.x : path.band.z) - path.band.y), 1e-9);
    vec3 bend = (below ? path.end_position[0] : path.end_position[1]) - path.position;
    for (int g = 0; g < SPECTRAL_GROUPS; ++g)
        bend -= (below ? path.end_step[g].x : path.end_step[g].y) * path.dposition[SPATIAL + g];
    vec3 at = path.position + reach * reach * bend;
    for (int g = 0; g < SPECTRAL_GROUPS; ++g)
        at += variable_step(uint(g), x, path.band.y) * path.dposition[SPATIAL + g];
    return at;
}

// A path that has met nothing, or a diffuse surface. Without a sweep that is one lookup. Where all of a sweep ends on
// the facet that the path's own wavelength met (`same_hit`), its lookups are of that; else every lookup finds out for
// itself.
void add_end(Path path, bool met, Hit hit, bool same_hit, uint pixel_key) {
    int taps = 1;
    vec2 brightness;
    float per_x, hi = path.band.x;
    if (SPECTRAL_SWEEP) {
        if (path.restricted != 0u) taps = taps_of(path, met ? hit.distance : FAR_DISTANCE);
        // Without a map the environment is the same all round.
        if (!HAS_ENVIRONMENT_MAP && same_hit && !met) taps = 1;
        brightness = brightness_of(path.band);
        per_x = 1.0 / (path.band.z - path.band.x);
    }
#if HAS_RECEIVERS
    SurfaceInteraction seen = nothing_seen();
    Triangle facet;
#if HAS_TEXTURES
    uint texture = NONE;
    Paint paint;
#endif
    if (met) {
        facet = triangle_at(hit.primitive);
        vec3 at = LAYER_BEAUTY ? surface_point(hit, facet, path.position, path.direction)
                               : path.position + hit.distance * path.direction;
        seen = seen_on(path, hit, facet, at, path.direction);
        if (HAS_TEXTURES) {
            texture = object_at(hit.object).texture;
            if (texture != NONE) paint = paint_of(texture, facet.source, facet);
        }
    }
    Steady steady = no_steady_lights();
    bool traced = SPECTRAL_SWEEP && taps > 1 && same_hit && met;
    if (SPECTRAL_SWEEP && traced) {
        arrive(path, hit);
        if (LAYER_BEAUTY) steady = steady_lights(seen, path.end_position[0], path.end_position[1], pixel_key);
    }
#endif
    for (int i = 0; i < taps; ++i) {
        COUNT_ROUNDS(16 + 8 * LIGHT_COUNT);
        float lo = hi, part = 1.0;
        vec3 direction = path.direction;
        bool ends = met;
        hi = path.band.z;
        if (SPECTRAL_SWEEP) {
            vec3 position = path.position;
            float x = path.band.y;
            if (taps > 1) {
                x = tap_border(path, brightness, float(i) + 0.5, taps);
                hi = tap_border(path, brightness, float(i + 1), taps);
                part = (hi - lo) * per_x;
            }
            if (HAS_RECEIVERS && traced) {
                seen.position = arrival_at(path, x);
                seen.dposition[2] = part * (path.end_position[1] - path.end_position[0]);
            }
            if (taps > 1 && !(same_hit && met)) {
                ray_at(path, x, position, direction);
                if (HAS_RECEIVERS && !same_hit) {
                    Hit found;
                    ends = intersect_closest(position, direction, FAR_DISTANCE, path.origin, found);
                    uint kind = ends ? object_at(found.object).kind : NONE;
                    if (is_specular(kind)) {
                        // This colour goes on where the middle one ended: it is given what that one sees.
                        ends = met;
                        found = hit;
                        if (met)
                            found.distance = dot(hit.normal_g, path.position + hit.distance * path.direction - position)
                                / dot(hit.normal_g, direction);
                    }
                    if (ends) {
                        facet = triangle_at(found.primitive);
                        seen = seen_on(path, found, facet, position + found.distance * direction, direction);
                        vec3 sweep = part
                            * (path.end_position[1] - path.end_position[0]
                                + found.distance * (path.end_direction[1] - path.end_direction[0]));
                        seen.dposition[2] =
                            sweep - (dot(sweep, found.normal_g) / dot(direction, found.normal_g)) * direction;
                        if (HAS_TEXTURES) {
                            texture = object_at(found.object).texture;
                            if (texture != NONE) paint = paint_of(texture, facet.source, facet);
                        }
                    }
                }
            }
        }
        WavelengthInterval interval = wavelength_interval(path, lo, hi);
        if (HAS_RECEIVERS && ends && object_at(seen.object).kind == KIND_DIFFUSE) {
            if (HAS_TEXTURES && texture != NONE)
                seen.reflectance = object_colours[seen.object].rgb * painted(paint, seen);
            bool coated = COATS && CAMERA_SPECULAR && is_coated(seen.object);
            if (COATS && CAMERA_SPECULAR && coated) add_coat_lights(path, seen, interval, pixel_key);
            // The base of what is seen first is left to the program for what is seen directly.
            if (!(COATS && CAMERA_SPECULAR) || !coated || path.depth > 0u) {
                add_caustic(path, seen, interval);
                if (LAYER_BEAUTY) {
                    add_direct(path, seen, interval, pixel_key, steady);
                    if (RECEIVER_LIGHT) add_receiver_light(path, seen, interval);
                }
            }
        }
        if (LAYER_BEAUTY) {
            vec3 direction_change = SPECTRAL_SWEEP ? part * (path.end_direction[1] - path.end_direction[0]) : vec3(0.0);
            if (!ends) add_sky(path, interval, direction, direction_change);
        }
    }
}
