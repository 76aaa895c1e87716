// Where a path ends in something that shines, it looks up along its spectral sweep what is there. A path that was never
// bent by dispersive glass looks once; another as often as its sweep is long, and what lies between two looks is averaged.
#ifndef EYE_TAPS_GLSL
#define EYE_TAPS_GLSL

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
    columns[0] = p.sample_side * path.ddirection[0];
    columns[1] = p.sample_side * path.ddirection[1];
    columns[2] = sweep;
    add_colour(path, stretch, uint(WHITE_ROW), sky_colour(direction, columns));
}

#ifdef VISIBLE_LIGHTS
// Lights that can be seen over the distance `far`; edges are as soft as what the ray stands for is wide.
void add_lights(EyePath path, float lo, float hi, vec3 position, vec3 direction, float far, vec2 width)
{
    for (uint i = 0u; i < uint(LIGHT_COUNT); ++i) {
        float seen = lights[i].measure > 0.0 ? light_seen(lights[i], position, direction, far, width) : 0.0;
        WHEN(seen > 0.0) add_colour(path, stretch_of(path, lo, hi), uint(LIGHT_ROW) + i * uint(ROWS_PER_LIGHT), vec3(seen));
    }
}

// Diameter of what a sample stands for: where its ray starts (GPU units), and how that grows with distance.
vec2 sample_width(EyePath path)
{
    return p.sample_side * sqrt(vec2(length(cross(path.dposition[0], path.dposition[1])), length(cross(path.ddirection[0], path.ddirection[1]))));
}
#endif
#endif

#ifdef SPECTRAL_SWEEP
// Sweep of the path over the distance ahead, in widths of a pixel: how many looks it needs.
int taps_of(EyePath path, float distance)
{
    vec3 p_lo, d_lo, p_hi, d_hi;
    ray_at(path, path.band.x, p_lo, d_lo);
    ray_at(path, path.band.z, p_hi, d_hi);
    float reach = min(distance, 1e4);
    vec3 sweep = (p_hi - p_lo) + reach * (d_hi - d_lo);
    sweep -= dot(sweep, path.direction) * path.direction;
    vec3 side_s = path.dposition[0] + reach * path.ddirection[0], side_t = path.dposition[1] + reach * path.ddirection[1];
    float pixel = sqrt(max(length(cross(side_s, side_t)), 1e-20));
    return clamp(int(ceil(length(sweep) / pixel * TAPS_PER_PIXEL)), 1, int(p.most_taps));
}
#endif

// A path that has met nothing, or a diffuse surface, seen at its own wavelength: all of its band at once.
void add_end(EyePath path, bool met, Hit hit, uint pixel_key)
{
    Stretch stretch = stretch_of(path, path.band.x, path.band.z);
#ifdef LAYER_BEAUTY
    WHEN(!met) add_sky(path, stretch, path.direction, vec3(0.0));
#endif
#ifdef HAS_RECEIVERS
    WHEN(met) {
        Triangle facet = triangle_at(hit.primitive);
#ifdef LAYER_BEAUTY
        vec3 position = surface_point(hit, path.position, path.direction);
#else
        vec3 position = path.position + hit.distance * path.direction;
#endif
        Seen seen = seen_on(path, hit, facet, position, path.direction);
#ifdef HAS_TEXTURES
        apply_texture(seen, facet);
#endif
        add_caustic(path, seen, stretch);
#ifdef LAYER_BEAUTY
        add_direct(path, seen, stretch, pixel_key, 0u, 0u);
#endif
    }
#endif
}

#ifdef SPECTRAL_SWEEP
#ifdef HAS_RECEIVERS
// A place on `facet` that a colour of the path sees.
Seen swept_place(EyePath path, Hit hit, Triangle facet, vec3 position, vec3 direction, vec3 dp, vec3 dd)
{
    vec3 at = position + hit.distance * direction;
    Seen seen = seen_on(path, hit, facet, at, direction);
    vec3 sweep = dp + hit.distance * dd;
    seen.dposition[2] = sweep - (dot(sweep, hit.normal_g) / dot(direction, hit.normal_g)) * direction;
#ifdef HAS_TEXTURES
    apply_texture(seen, facet);
#endif
    return seen;
}
#endif

// A path whose colours end in different places. Where both ends of the sweep meet the same facet as its middle, so does what
// lies between; else every look finds out for itself.
void add_swept_end(EyePath path, bool met, Hit hit, uint pixel_key, int taps)
{
    vec3 p_lo, d_lo, p_hi, d_hi;
    ray_at(path, path.band.x, p_lo, d_lo);
    ray_at(path, path.band.z, p_hi, d_hi);
    bool alike = true;
    int direct_every = 1;
#ifdef HAS_RECEIVERS
    Hit hit_lo, hit_hi;
    bool met_lo = intersect_closest(p_lo, d_lo, FAR_DISTANCE, path.origin, hit_lo), met_hi = intersect_closest(p_hi, d_hi, FAR_DISTANCE, path.origin, hit_hi);
    alike = met_lo == met && met_hi == met && (!met || (hit_lo.primitive == hit.primitive && hit_hi.primitive == hit.primitive));
    uint known = 0u, hidden = 0u;
    Triangle facet = triangle_at(met ? hit.primitive : 0u);
#ifdef LAYER_BEAUTY
    WHEN(alike && met) {
        uint hidden_lo = shadows_at(seen_on(path, hit, facet, p_lo + hit_lo.distance * d_lo, d_lo), pixel_key);
        hidden = shadows_at(seen_on(path, hit, facet, p_hi + hit_hi.distance * d_hi, d_hi), pixel_key);
        known = ~(hidden ^ hidden_lo);
        // Direct light on a plain surface changes little along a sweep.
        if (known == 0xffffffffu && object_at(hit.object).texture == NONE) direct_every = max(1, taps / 3);
    }
#endif
#endif
#ifndef HAS_ENVIRONMENT_MAP
    // The same all round.
    if (!met && alike) taps = 1;
#endif
    vec3 dp = (p_hi - p_lo) / float(taps), dd = (d_hi - d_lo) / float(taps);
    float step_x = (path.band.z - path.band.x) / float(taps), direct_from = path.band.x;
    for (int i = 0; i < taps; ++i) {
        float lo = path.band.x + float(i) * step_x, hi = i + 1 == taps ? path.band.z : lo + step_x;
        vec3 position, direction;
        ray_at(path, 0.5 * (lo + hi), position, direction);
        Stretch stretch = stretch_of(path, lo, hi);
        bool ends = met, dark = false;
#ifdef HAS_RECEIVERS
        Hit found = hit;
        WHEN(!alike) {
            ends = intersect_closest(position, direction, FAR_DISTANCE, path.origin, found);
            uint kind = ends ? object_at(found.object).kind : NONE;
            dark = kind == KIND_BLACK;
            if (kind == KIND_MIRROR || kind == KIND_DIELECTRIC) {
                // This colour goes on where the middle one ended: it is given what that one sees.
                ends = met;
                found = hit;
            }
            if (ends) facet = triangle_at(found.primitive);
        }
        WHEN(ends && !dark) {
            if (found.primitive == hit.primitive) found.distance = dot(hit.normal_g, facet.vertex - position) / dot(hit.normal_g, direction);
            Seen seen = swept_place(path, found, facet, position, direction, dp, dd);
            add_caustic(path, seen, stretch);
#ifdef LAYER_BEAUTY
            WHEN((i + 1) % direct_every == 0 || i + 1 == taps) {
                if (direct_every > 1) stretch = stretch_of(path, direct_from, hi);
                add_direct(path, seen, stretch, pixel_key, alike ? known : 0u, hidden);
                direct_from = hi;
            }
#endif
        }
#endif
#ifdef LAYER_BEAUTY
        WHEN(!ends && !dark) add_sky(path, stretch, direction, dd);
#endif
    }
}
#endif

#endif
