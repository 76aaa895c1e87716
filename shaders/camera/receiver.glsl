// What a diffuse surface sends back: direct light, whose shadow rays stop at anything, glass too, and the caustic map,
// which holds all light that came by way of glass or mirrors. Nothing counts twice.
const float INVERSE_PI = 0.31830988618;

// One place on a diffuse surface, as a wavelength interval [lo, hi] of the path sees it.
struct SurfaceInteraction {
    vec3 position;
    vec3 direction;  // of the ray that found it
    vec3 dposition[3];  // what it is averaged over: a sample's two sides, and the way from this interval to the next
    vec3 normal_g;
    uint primitive;
    uint object;
    uint source;  // triangle
    vec3 reflectance;  // coefficients of the reflectance basis
    vec3 coat_normal;  // unit, against the ray: interpolated where the mesh is smooth
};

SurfaceInteraction nothing_seen() {
    SurfaceInteraction seen;
    seen.position = seen.direction = seen.normal_g = seen.reflectance = vec3(0.0);
    for (int c = 0; c < 3; ++c) seen.dposition[c] = vec3(0.0);
    seen.primitive = seen.object = seen.source = NONE;
    if (COATS) seen.coat_normal = vec3(0.0);
    return seen;
}

SurfaceInteraction seen_on(Path path, Hit hit, Triangle facet, vec3 position, vec3 direction) {
    SurfaceInteraction seen;
    seen.position = position;
    seen.direction = direction;
    seen.normal_g = hit.normal_g;
    seen.primitive = hit.primitive;
    seen.object = hit.object;
    seen.source = facet.source;
    for (int c = 0; c < 2; ++c)
        seen.dposition[c] = sample_side(path)
            * transfer_column(path.dposition[c], path.ddirection[c], path.direction, hit.normal_g, hit.distance);
    if (LENS) {
        vec3 by_lens[2];
        for (int c = 0; c < 2; ++c)
            by_lens[c] = sample_side(path)
                * transfer_column(path.dposition[LENS_COLUMNS + c], path.ddirection[LENS_COLUMNS + c], path.direction,
                    hit.normal_g, hit.distance);
        // What is out of focus is averaged over its share of the pixel and of the lens.
        join_sides(hit.normal_g, seen.dposition[0], seen.dposition[1], by_lens[0], by_lens[1]);
    }
    seen.dposition[2] = vec3(0.0);
    seen.reflectance = object_colours[hit.object].rgb;
    if (COATS) seen.coat_normal = shading_frame(hit, facet, seen.position, direction).normal;
    return seen;
}

// How a facet's texture lies on it.
struct Paint {
    uint picture;
    vec3 origin;  // of the gradients, GPU space
    vec2 uv;  // there
    vec3 gradient_u;
    vec3 gradient_v;
};

Paint paint_of(uint picture, uint source, Triangle facet) {
    Paint paint;
    paint.picture = picture;
    paint.origin = facet.vertex;
    Picture worn = pictures[picture];
    hit_uv(worn, source, vec2(0.0), paint.uv);
    uv_gradients(worn, source, facet.edge1, facet.edge2, paint.gradient_u, paint.gradient_v);
    return paint;
}

// Reflectance of a painted place, averaged over what a lookup is averaged over.
vec3 painted(Paint paint, SurfaceInteraction seen) {
    vec3 along = seen.position - paint.origin;
    vec2 columns[3];
    for (int c = 0; c < 3; ++c)
        columns[c] = vec2(dot(paint.gradient_u, seen.dposition[c]), dot(paint.gradient_v, seen.dposition[c]));
    vec2 ds, dt;
    box_of_three(columns[0], columns[1], columns[2], ds, dt);
    Picture worn = pictures[paint.picture];
    return texture_filtered(worn, paint.uv + vec2(dot(paint.gradient_u, along), dot(paint.gradient_v, along)), ds, dt);
}

// Two numbers for a light's extent: a Kronecker sequence over the samples, shifted by pixel and light.
vec2 light_point(uint light, uint pixel_key) {
    if (IN_MOTION) {
        // Its middle: shadows without grain.
        return vec2(0.5);
    }
    uint key = hash_combine(pixel_key, light);
    return vec2(kronecker(DRAW_INDEX, PLASTIC_1, key), kronecker(DRAW_INDEX, PLASTIC_2, hash_pcg(key)));
}

// The same for a survey's eight looks at a light that nothing hides: symmetric, and of the second moments of a square
// and, by the concentric mapping, of a disc. Their mean is exact up to squares, and the same in every pixel: no grain.
vec2 even_light_point() {
    vec2 corner = (look_index & 4u) == 0u ? vec2(0.70710678, 0.40824829) : vec2(0.40824829, 0.70710678);
    return 0.5
        + 0.5 * vec2((look_index & 1u) == 0u ? corner.x : -corner.x, (look_index & 2u) == 0u ? corner.y : -corner.y);
}

// Irradiance from one point of a light, as a factor on its own quantity, before anything is in the way.
float unshadowed(uint light, SurfaceInteraction seen, vec2 unit, out LightSample s) {
    CameraLight from = lights[light];
    s = sample_light(from, seen.position, unit);
    vec3 normal = dot(seen.direction, seen.normal_g) < 0.0 ? seen.normal_g : -seen.normal_g;
    return s.gain * max(dot(s.toward, normal), 0.0);
}

bool hidden_from(LightSample s, SurfaceInteraction seen) {
    RayOrigin origin = RayOrigin(seen.primitive, seen.object, uint(dot(seen.direction, seen.normal_g) > 0.0), 0u);
    // Up to the light, less a hair so that a surface the light lies on does not hide it.
    return intersect_any(seen.position, s.toward, s.distance * 0.99999, origin);
}

// The normal that its finish goes by.
vec3 finish_normal(SurfaceInteraction seen) {
    return COATS ? seen.coat_normal : dot(seen.direction, seen.normal_g) < 0.0 ? seen.normal_g : -seen.normal_g;
}

// Reflectance of the base, under its coat, for light from all sides: what is only known as irradiance counts as if it
// came so.
vec3 base_albedo(SurfaceInteraction seen, bool is_plain) {
    Finish finish = finish_of(seen.object);
    float cosine = clamp(-dot(seen.direction, finish_normal(seen)), 0.0, 1.0);
    vec3 albedo = is_plain ? seen.reflectance : vec3(1.0);
    if (ROUGH_DIFFUSE && is_plain && finish.roughness > 0.0) albedo = rough_albedo(albedo, finish.roughness, cosine);
    if (COATS) albedo *= share_under(finish, cosine);
    return albedo;
}

// … and for light from the direction `from`.
vec3 base_response(SurfaceInteraction seen, vec3 from, bool is_plain) {
    Finish finish = finish_of(seen.object);
    vec3 normal = finish_normal(seen);
    float cosine = clamp(-dot(seen.direction, normal), 0.0, 1.0), from_cosine = clamp(dot(from, normal), 0.0, 1.0);
    vec3 response = is_plain ? seen.reflectance : vec3(1.0);
    if (ROUGH_DIFFUSE && is_plain && finish.roughness > 0.0)
        response = rough_response(response, finish.roughness, -seen.direction, from, cosine, from_cosine);
    if (COATS) response *= share_under(finish, cosine) * share_from(finish, from_cosine);
    return response;
}

// Lights whose direct light is known all along a sweep, from both of its ends; the first ones, as many as there is room
// for.
#define STEADY_LIGHTS 8
#define STEADY_ROOM (LIGHT_COUNT < STEADY_LIGHTS ? LIGHT_ROOM : STEADY_LIGHTS)
// Deviation from a straight line in the middle, as a share, up to which it is one.
#define STEADY_TOLERANCE 0.01

struct Steady {
    uint lights;  // as bits
    float gains[2 * STEADY_ROOM];  // of both ends
};

// Where `position` lies between both ends of a sweep.
float share_of_sweep(vec3 position, vec3 lo, vec3 hi) {
    vec3 way = hi - lo;
    return clamp(dot(position - lo, way / max(dot(way, way), 1e-20)), 0.0, 1.0);
}

// Adds the direct light of one place; that of `steady` lights as their ends have it.
void add_direct(Path path, SurfaceInteraction seen, WavelengthInterval interval, uint pixel_key, Steady steady) {
    uint reflectance_class = receivers[object_at(seen.object).receiver].reflectance_class;
    float share = SPECTRAL_SWEEP ? share_of_sweep(seen.position, path.end_position[0], path.end_position[1]) : 0.0;
    for (uint i = 0u; i < uint(LIGHT_COUNT); ++i) {
        bool known = i < uint(STEADY_ROOM) && (steady.lights & (1u << (i & 31u))) != 0u;
        float gain = 0.0;
        vec3 toward = vec3(0.0);
        // Where its light comes from counts, too.
        if (COATS || ROUGH_DIFFUSE) known = known && !is_finished(seen.object);
        if (known) gain = mix(steady.gains[2u * i], steady.gains[2u * i + 1u], share);
        if (!known) {
            LightSample s;
            gain = unshadowed(i, seen, light_point(i, pixel_key), s);
            if (IN_MOTION) {
                // A spot that fades over half its cone has no edge there: what tells places apart are its shadows
                // alone.
                bool fades = lights[i].kind == LIGHT_KIND_POINT && lights[i].has_profile == 0u
                    && 2.0 * lights[i].cone.x <= lights[i].cone.y;
                if (fades && gain > 0.0) lights_seen ^= hash_pcg(i + 1u);
            }
            if (gain > 0.0) gain = hidden_from(s, seen) ? 0.0 : gain;
            if (LISTS_SPECULAR && gain > 0.0) {
                lights_seen ^= hash_pcg(i + 1u);
                if (VISIBLE_LIGHTS && p.survey == 1u) gain = unshadowed(i, seen, even_light_point(), s);
            }
            if (COATS || ROUGH_DIFFUSE) toward = s.toward;
        }
        uint row = uint(LIGHT_ROW) + i * uint(ROWS_PER_LIGHT);
        // Other classes than 0 have their reflectance in the light's own row.
        if (COATS || ROUGH_DIFFUSE) {
            if (gain > 0.0)
                add_colour(path, interval, reflectance_class == 0u ? row : row + 3u + reflectance_class,
                    base_response(seen, toward, reflectance_class == 0u) * (INVERSE_PI * gain));
        } else {
            if (gain > 0.0)
                add_colour(path, interval, reflectance_class == 0u ? row : row + 3u + reflectance_class,
                    (reflectance_class == 0u ? seen.reflectance : vec3(1.0)) * (INVERSE_PI * gain));
        }
    }
}

// What a coat reflects of the lights themselves, each by one of its points; `share_of_lobe` weighs what the path that
// goes on sees of them.
void add_coat_lights(Path path, SurfaceInteraction seen, WavelengthInterval interval, uint pixel_key) {
    Finish finish = finish_of(seen.object);
    vec3 first, second;
    axes_across(seen.coat_normal, first, second);
    mat3 to_surface = transpose(mat3(first, second, seen.coat_normal));
    vec3 toward = to_surface * -seen.direction;
    // Chance seldom leads from a rough coat into a smooth one's highlight of a lamp that is a point: that is as wide as
    // few samples can find it [Kaplanyan and Dachsbacher 2013].
    float wide =
        path.walk.coat_pdf > 0.0 ? max(finish.alpha, 0.5 * sqrt(sample_side(path) / path.walk.coat_pdf)) : finish.alpha;
    // A perfectly smooth coat shows lights of some extent only, to the path that goes on.
    for (uint i = 0u; i < uint(LIGHT_COUNT) && finish.alpha > 0.0; ++i) {
        LightSample s;
        float gain = unshadowed(i, seen, light_point(i, pixel_key), s) > 0.0 ? s.gain : 0.0;
        vec3 from = to_surface * s.toward;
        gain *= coat_response(lights[i].measure > 0.0 ? finish.alpha : min(wide, 1.0), finish.index, toward, from);
        if (lights[i].measure > 0.0)
            gain *= share_of_points(coat_direction_density(finish.alpha, toward, normalize(toward + from)),
                lights[i].kind == LIGHT_KIND_AREA ? s.gain : 1.0 / lights[i].measure);
        if (gain > 0.0) gain = hidden_from(s, seen) ? 0.0 : gain;
        if (gain > 0.0) add_spectrum(path, interval, uint(LIGHT_ROW) + i * uint(ROWS_PER_LIGHT), gain);
    }
}

Steady no_steady_lights() {
    Steady steady;
    steady.lights = 0u;
    return steady;
}

// What both ends of a sweep over one facet, and its middle `seen`, tell of the direct light between them.
Steady steady_lights(SurfaceInteraction seen, vec3 lo, vec3 hi, uint pixel_key) {
    Steady steady = no_steady_lights();
    vec3 middle = seen.position;
    float share = share_of_sweep(middle, lo, hi);
    for (uint i = 0u; i < uint(min(LIGHT_COUNT, STEADY_LIGHTS)); ++i) {
        LightSample s;
        float gain_middle = unshadowed(i, seen, light_point(i, pixel_key), s);
        vec2 gains;
        bvec2 hidden;
        for (uint end = 0u; end < 2u; ++end) {  // which no compiler should write out: tracing rays is long
            seen.position = end == 0u ? lo : hi;
            float gain = unshadowed(i, seen, light_point(i, pixel_key), s);
            bool hides = gain > 0.0 && hidden_from(s, seen);
            gains = vec2(end == 0u ? gain : gains.x, gain);
            hidden = bvec2(end == 0u ? hides : hidden.x, hides);
        }
        seen.position = middle;
        bool straight = abs(gain_middle - mix(gains.x, gains.y, share)) <= STEADY_TOLERANCE * max(gains.x, gains.y);
        if (hidden.x == hidden.y && (straight || hidden.x)) steady.lights |= 1u << i;
        steady.gains[2u * i] = hidden.x ? 0.0 : gains.x;
        steady.gains[2u * i + 1u] = hidden.y ? 0.0 : gains.y;
    }
    return steady;
}

// A map's channels are XYZ (lm) where the picture's are linear Rec.709, else the same bins.
vec4 map_to_channels(vec4 texel) {
    return RGB_CHANNELS ? vec4(dot(p.red_of_xyz.xyz, texel.xyz), dot(p.green_of_xyz.xyz, texel.xyz),
                              dot(p.blue_of_xyz.xyz, texel.xyz), 0.0)
                        : texel;
}

// Texels that a lookup in a map averages along one side at most, and in all; what it covers beyond is met by the
// pixel's other samples.
#define MAX_TEXELS 16
#define MAX_LOOKUPS 64
// Of a pixel's area, that of a texel that passes for one, whatever rounding does.
#define WHOLE_PIXEL 0.99

// Irradiance, per scene unit², of the map's targets `first` to `last`: their mean over a box of this many texels.
// `place` is of `find_texel`.
void caustic_values(
    uint placement, vec3 place, vec2 box, out vec4 values[MAP_TARGETS], const int first, const int last) {
    vec2 texel = place.xy / place.z;
    ivec2 lookups = clamp(ivec2(ceil(box)), ivec2(1), ivec2(MAX_TEXELS));
    lookups = min(lookups, max(ivec2(8), MAX_LOOKUPS / lookups.yx));
    vec2 part = box / vec2(lookups), corner = texel - 0.5 * (box - part);
    if (LISTS_SPECULAR) skipped_texels = skipped_texels || any(greaterThan(part, vec2(1.001)));
    COUNT_ROUNDS(lookups.x * lookups.y);
    Placement window = placements[placement];
    float share = 1.0 / (float(lookups.x * lookups.y) * texel_area_at(window, place));
    for (int t = 0; t < MAP_TARGETS; ++t) values[t] = vec4(0.0);
    for (int i = 0; i < lookups.x * lookups.y; ++i) {
        vec2 at = corner + part * vec2(i % lookups.x, i / lookups.x);
        if (MAP_TARGETS > 0 && 0 >= first && 0 <= last)
            values[0] += share * caustic_energy(caustic_map[0], placement, at, part);
        if (MAP_TARGETS > 1 && 1 >= first && 1 <= last)
            values[1] += share * caustic_energy(caustic_map[1], placement, at, part);
        if (MAP_TARGETS > 2 && 2 >= first && 2 <= last)
            values[2] += share * caustic_energy(caustic_map[2], placement, at, part);
        if (MAP_TARGETS > 3 && 3 >= first && 3 <= last)
            values[3] += share * caustic_energy(caustic_map[3], placement, at, part);
        if (MAP_TARGETS > 4 && 4 >= first && 4 <= last)
            values[4] += share * caustic_energy(caustic_map[4], placement, at, part);
        if (MAP_TARGETS > 5 && 5 >= first && 5 <= last)
            values[5] += share * caustic_energy(caustic_map[5], placement, at, part);
        if (MAP_TARGETS > 6 && 6 >= first && 6 <= last)
            values[6] += share * caustic_energy(caustic_map[6], placement, at, part);
        if (MAP_TARGETS > 7 && 7 >= first && 7 <= last)
            values[7] += share * caustic_energy(caustic_map[7], placement, at, part);
        if (MAP_TARGETS > 8 && 8 >= first && 8 <= last)
            values[8] += share * caustic_energy(caustic_map[8], placement, at, part);
    }
}

// Mean over each bin of a reflectance given by its coefficients.
vec4 bin_reflectance(vec3 colour, int target) {
    return colour.r * emission_until(uint(REFLECTANCE_ROW), target, EMISSION_CELLS)
        + colour.g * emission_until(uint(REFLECTANCE_ROW + 1), target, EMISSION_CELLS)
        + colour.b * emission_until(uint(REFLECTANCE_ROW + 2), target, EMISSION_CELLS);
}

// Share of a map's spectrum that an interval has, by luminance: the part's of the whole's. Splats that take a ripple
// off may leave texels less light than none in some channels; these can cancel, and their quotient may be anything.
// There the share is white light's: over the whole spectrum both add up to one.
float spectrum_share(WavelengthInterval interval, bool positive, float part, float whole) {
    const vec3 LUMINANCE = vec3(0.2126, 0.7152, 0.0722);
    if (positive && whole > 0.0) return part / whole;
    vec4 white =
        emission_until(uint(WHITE_ROW), 0, interval.cell_hi) - emission_until(uint(WHITE_ROW), 0, interval.cell_lo);
    return dot(white.rgb, LUMINANCE) / dot(emission_until(uint(WHITE_ROW), 0, EMISSION_CELLS).rgb, LUMINANCE);
}

// Irradiance by what glass and mirrors threw at a place of a map.
void add_caustic_at(
    Path path, SurfaceInteraction seen, WavelengthInterval interval, uint receiver, uint placement, vec3 texel) {
    // Texels larger than pixels are interpolated, smaller ones, and pixels themselves, weighed by their share of the
    // sample.
    Placement window = placements[placement];
    vec2 box = vec2(0.0);
    for (int c = 0; c < 3; ++c) {
        vec2 side = texels_along(window, texel, seen.dposition[c]);
        box += side * side;
    }
    box = sqrt(box);
    float side = sample_side(path);
    if (!CAMERA_SPECULAR && (p.cells.x > 1.0 || (p.cells.x > 0.0 && window.kind == PLACED_PICTURE))) {
        // Each look stands for its cell of the pixel. Cells fill it, so texels that fill it too are read once.
        vec2 share = side * vec2(p.pixel_width, p.pixel_height),
             aside = (floor(look_place * p.cells) + 0.5) / p.cells - look_place;
        texel.xy += texel.z
            * texels_along(
                window, texel, (aside.x / share.x) * seen.dposition[0] - (aside.y / share.y) * seen.dposition[1]);
        box /= share * p.cells;
    }
    if (box.x * box.y < WHOLE_PIXEL * side * side) box = vec2(1.0);
    bool plain = receivers[receiver].reflectance_class == 0u;
    float scale = p.map_scale * INVERSE_PI;
    if (COATS || ROUGH_DIFFUSE) {
        seen.reflectance = base_albedo(seen, plain);
        // Of one number where the map holds the colour.
        if (!plain) scale *= seen.reflectance.r;
    }
    // The caustic's own dispersion meets the camera's: every spectral channel that the interval touches is read by
    // itself.
    if (MAP_BINS && path.restricted != 0u) {
        float x = 0.5 * (interval.lo + interval.hi);
        float first = spectral_row(uint(BIN_ROW), interval.lo), last = spectral_row(uint(BIN_ROW), interval.hi);
        int from = int(floor(first)), to = max(from, int(ceil(last)) - BIN_OVERLAP);
        float factor = scale
            * (plain ? dot(seen.reflectance,
                           vec3(spectral_row(uint(BASIS_ROW), x), spectral_row(uint(BASIS_ROW + 1), x),
                               spectral_row(uint(BASIS_ROW + 2), x)))
                     : 1.0);
        vec4 watts[MAP_TARGETS];
        caustic_values(placement, texel, box, watts, 0, BIN_TARGET > 0 ? 0 : MAP_TARGETS - 1);
        bool lit = BIN_TARGET == 0 || any(notEqual(watts[0], vec4(0.0)));
        // Where XYZ are dark, so is every channel.
        if (BIN_TARGET > 0 && lit) {
            vec4 rest[MAP_TARGETS];
            caustic_values(placement, texel, box, rest, 1, MAP_TARGETS - 1);
            for (int t = 1; t < MAP_TARGETS; ++t) watts[t] = rest[t];
        }
        // Coarse spectra make a pure colour duller. What they lack of the map's own XYZ, or have too much, is shared
        // out over the spectrum as they are: where nothing is swept all of it is there again.
        vec4 whole[TARGETS];
        float whole_sum = 0.0, part_sum = 0.0;
        bool positive = true;
        for (int t = 0; t < TARGETS; ++t) whole[t] = vec4(0.0);
        for (int k = 0; k < BIN_COUNT && lit; ++k) {
            float watt = watts[BIN_TARGET + (k >> 2)][k & 3];
            uint row = uint(BIN_SPECTRUM_ROW + k);
            bool within = k >= from && k <= to;
            positive = positive && watt >= 0.0;
            for (int t = 0; t < TARGETS; ++t) {
                vec4 all = emission_until(row, t, EMISSION_CELLS);
                vec4 part = within ? emission_until(row, t, interval.cell_hi) - emission_until(row, t, interval.cell_lo)
                                   : vec4(0.0);
                whole[t] += watt * all;
                if (RGB_CHANNELS) {
                    // Luminance, which no wavelength has less than none of.
                    whole_sum += watt * dot(all.rgb, vec3(0.2126, 0.7152, 0.0722));
                    part_sum += watt * dot(part.rgb, vec3(0.2126, 0.7152, 0.0722));
                }
            }
            if (within && watt != 0.0) add_spectrum(path, interval, row, factor * watt);
        }
        if (RGB_CHANNELS && lit) {
            vec4 lacking = map_to_channels(watts[0]) - whole[0];
            radiance[0] +=
                factor * interval.through * spectrum_share(interval, positive, part_sum, whole_sum) * lacking;
        }
    } else {
        vec4 factors[TARGETS], values[MAP_TARGETS];
        channel_factors(path, interval, factors);
        caustic_values(placement, texel, box, values, 0, TARGETS - 1);
        for (int t = 0; t < TARGETS; ++t) {
            vec4 reflectance = vec4(1.0);
            if (RGB_CHANNELS) {
                if (plain) reflectance.rgb = seen.reflectance;
            } else {
                if (plain) reflectance = bin_reflectance(seen.reflectance, t);
            }
            radiance[t] += factors[t] * scale * reflectance * map_to_channels(values[t]);
        }
    }
}

// Irradiance by what glass and mirrors threw here, where a map covers it.
void add_caustic(Path path, SurfaceInteraction seen, WavelengthInterval interval) {
    uint placement;
    vec3 texel;
    uint receiver = side_met(object_at(seen.object), seen.direction, seen.normal_g);
    bool covered = find_texel(receiver, seen.source, seen.position, placement, texel);
    if (covered) add_caustic_at(path, seen, interval, receiver, placement, texel);
}
