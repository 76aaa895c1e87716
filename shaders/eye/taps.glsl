// Where a path ends in something that shines, it looks up along its spectral sweep what is there. A path that was never
// bent by dispersive glass looks once; another as often as its sweep is long, and what lies between two looks is averaged.
#ifndef EYE_TAPS_GLSL
#define EYE_TAPS_GLSL

#ifdef SPECTRAL_SWEEP
// Sweep of the path over the distance ahead, in widths of a pixel: how many looks it needs.
int taps_of(EyePath path, float distance)
{
    vec3 p_lo = path.end_position[0], d_lo = path.end_direction[0], p_hi = path.end_position[1], d_hi = path.end_direction[1];
    float reach = min(distance, 1e4);
    vec3 sweep = (p_hi - p_lo) + reach * (d_hi - d_lo);
    sweep -= dot(sweep, path.direction) * path.direction;
    vec3 side_s = path.dposition[0] + reach * path.ddirection[0], side_t = path.dposition[1] + reach * path.ddirection[1];
    float pixel = sqrt(max(length(cross(side_s, side_t)), 1e-20));
    float pixels = length(sweep) / pixel;
    // A sweep that shows at all has two ends.
    return clamp(int(ceil(pixels * p.taps_per_pixel)), pixels > 0.2 ? 2 : 1, int(p.most_taps));
}
#endif

// Radiance from infinitely far away, as coefficients of the reflectance basis.
vec3 sky_colour(vec3 direction, vec3 ddirection[3])
{
#ifdef HAS_ENVIRONMENT_MAP
    vec3 local = p.sky_x * direction.x + p.sky_y * direction.y + p.sky_z * direction.z;
    vec3 columns[3];
    for (int c = 0; c < 3; ++c) columns[c] = p.sky_x * ddirection[c].x + p.sky_y * ddirection[c].y + p.sky_z * ddirection[c].z;
    // A box of the same covariance, in the plane across the ray.
    vec3 across = normalize(cross(local, abs(local.z) < 0.9 ? vec3(0.0, 0.0, 1.0) : vec3(1.0, 0.0, 0.0)));
    vec3 other = cross(local, across);
    vec2 flat_columns[3];
    for (int c = 0; c < 3; ++c) flat_columns[c] = vec2(dot(columns[c], across), dot(columns[c], other));
    vec2 major, minor;
    box_of_three(flat_columns[0], flat_columns[1], flat_columns[2], major, minor);
    return environment_radiance(local, major.x * across + major.y * other, minor.x * across + minor.y * other);
#else
    return p.background.rgb;
#endif
}

#ifdef LAYER_BEAUTY
void add_sky(EyePath path, Stretch stretch, vec3 direction, vec3 sweep)
{
    vec3 columns[3];
    columns[0] = sample_side(path) * path.ddirection[0];
    columns[1] = sample_side(path) * path.ddirection[1];
    columns[2] = sweep;
    add_colour(path, stretch, uint(WHITE_ROW), sky_colour(direction, columns));
}

#ifdef VISIBLE_LIGHTS
// Diameter of what a sample stands for: where its ray starts (GPU units), and how that grows with distance.
vec2 sample_width(EyePath path)
{
    return sample_side(path) * sqrt(vec2(length(cross(path.dposition[0], path.dposition[1])), length(cross(path.ddirection[0], path.ddirection[1]))));
}

// Lights that can be seen over the distance `far`; edges are as soft as what the ray stands for is wide.
void add_lights(EyePath path, float far)
{
    vec2 width = sample_width(path), sweep = vec2(0.0);
    int taps = 1;
#ifdef SPECTRAL_SWEEP
    if (path.narrowed) {
        vec3 p_lo = path.end_position[0], d_lo = path.end_direction[0], p_hi = path.end_position[1], d_hi = path.end_direction[1];
        sweep = vec2(distance(p_lo, p_hi), distance(d_lo, d_hi));
        taps = taps_of(path, far);
    }
#endif
    // Few rays come near a light: only they look along their sweep.
    bool near = false;
    for (uint i = 0u; i < uint(LIGHT_COUNT); ++i)
        near = near || (lights[i].measure > 0.0 && light_seen(lights[i], path.position, path.direction, far, 2.0 * (width + sweep)) > 0.0);
    float step_x = (path.band.z - path.band.x) / float(taps);
    for (int tap = 0; tap < taps && near; ++tap) {
        vec3 position = path.position, direction = path.direction;
#ifdef SPECTRAL_SWEEP
        if (taps > 1) ray_at(path, path.band.x + (float(tap) + 0.5) * step_x, position, direction);
#endif
        Stretch stretch = stretch_of(path, path.band.x + float(tap) * step_x, path.band.x + float(tap + 1) * step_x);
        for (uint i = 0u; i < uint(LIGHT_COUNT); ++i) {
            float seen = lights[i].measure > 0.0 ? light_seen(lights[i], position, direction, far, width + sweep / float(taps)) : 0.0;
            WHEN(seen > 0.0) add_spectrum(path, stretch, uint(LIGHT_ROW) + i * uint(ROWS_PER_LIGHT), seen);
        }
    }
}
#endif
#endif


// A path that has met nothing, or a diffuse surface. Without a sweep that is one look. Of a sweep, both ends look first where they arrive: if it is
// the facet that the path's own wavelength met, so does all between; else every look finds out for itself.
void add_end(EyePath path, bool met, Hit hit, uint pixel_key)
{
    int taps = 1;
#ifdef SPECTRAL_SWEEP
    if (path.narrowed) taps = taps_of(path, met ? hit.distance : FAR_DISTANCE);
#endif
    vec3 dp = vec3(0.0), dd = vec3(0.0);
    float step_x = (path.band.z - path.band.x) / float(taps), direct_from = path.band.x;
    bool alike = true;
    int first = 0, direct_every = 1;
    uint known = 0u, hidden = 0u, hidden_lo = 0u;
#ifdef SPECTRAL_SWEEP
    if (taps > 1) {
        vec3 p_lo = path.end_position[0], d_lo = path.end_direction[0], p_hi = path.end_position[1], d_hi = path.end_direction[1];
        dp = (p_hi - p_lo) / float(taps);
        dd = (d_hi - d_lo) / float(taps);
#ifdef HAS_RECEIVERS
        first = -2;
#endif
    }
#ifndef HAS_ENVIRONMENT_MAP
#ifndef HAS_RECEIVERS
    // The same all round.
    taps = 1;
    step_x = path.band.z - path.band.x;
#endif
#endif
#endif
    for (int i = first; i < taps; ++i) {
        float lo = path.band.x + float(max(i, 0)) * step_x, hi = i + 1 == taps ? path.band.z : lo + step_x;
        vec3 position = path.position, direction = path.direction;
        Hit found = hit;
        bool ends = met, dark = false;
#ifdef SPECTRAL_SWEEP
        if (taps > 1) ray_at(path, i == -2 ? path.band.x : (i == -1 ? path.band.z : 0.5 * (lo + hi)), position, direction);
#ifdef HAS_RECEIVERS
        WHEN(i < 0 || !alike) {
            ends = intersect_closest(position, direction, FAR_DISTANCE, path.origin, found);
            uint kind = ends ? object_at(found.object).kind : NONE;
            alike = alike && ends == met && (!met || found.primitive == hit.primitive);
            dark = kind == KIND_BLACK;
            if (kind == KIND_MIRROR || kind == KIND_DIELECTRIC) {
                // This colour goes on where the middle one ended: it is given what that one sees.
                ends = met;
                found = hit;
            }
        }
#endif
#endif
#ifdef HAS_RECEIVERS
        WHEN(ends && !dark) {
            Triangle facet = triangle_at(found.primitive);
            vec3 at;
            if (taps > 1) {
                if (found.primitive == hit.primitive) found.distance = dot(hit.normal_g, facet.vertex - position) / dot(hit.normal_g, direction);
                at = position + found.distance * direction;
            } else {
#ifdef LAYER_BEAUTY
                at = surface_point(found, position, direction);
#else
                at = position + found.distance * direction;
#endif
            }
            Seen seen = seen_on(path, found, facet, at, direction);
            vec3 sweep = dp + found.distance * dd;
            seen.dposition[2] = sweep - (dot(sweep, found.normal_g) / dot(direction, found.normal_g)) * direction;
            Stretch stretch = stretch_of(path, lo, hi);
            WHEN(i >= 0) {
#ifdef HAS_TEXTURES
                uint texture = object_at(seen.object).texture;
                WHEN(texture != NONE) apply_texture(seen, facet, texture);
#endif
                add_caustic(path, seen, stretch);
            }
#ifdef LAYER_BEAUTY
            // Direct light on a plain surface changes little along a sweep: a look stands for several.
            bool due = i < 0 || (i + 1) % direct_every == 0 || i + 1 == taps;
            WHEN(due) {
                if (direct_every > 1) stretch = stretch_of(path, direct_from, hi);
                add_direct(path, seen, stretch, pixel_key, i < 0 ? 0u : known, hidden, i < 0);
                direct_from = i < 0 ? direct_from : hi;
            }
#endif
        }
#endif
#ifdef LAYER_BEAUTY
        WHEN(!ends && !dark && i >= 0) add_sky(path, stretch_of(path, lo, hi), direction, dd);
#ifdef SPECTRAL_SWEEP
        if (i == -2) hidden_lo = hidden;
        if (i == -1) {
            known = alike && met ? ~(hidden ^ hidden_lo) : 0u;
            if (known == 0xffffffffu && object_at(hit.object).texture == NONE) direct_every = max(1, taps / 3);
#ifndef HAS_ENVIRONMENT_MAP
            // The same all round.
            if (alike && !met) {
                taps = 1;
                step_x = path.band.z - path.band.x;
            }
#endif
        }
#endif
#endif
    }
}

#endif
