// The camera pass: one camera sample a pixel and dispatch, added to the sums. A ray runs through glass and over mirrors
// with the columns of its pixel (Igehy 1999) and of its spectrum (Elek et al. 2014) to the first diffuse surface, light
// or environment, and looks up along its spectral sweep what is there. Where glass splits it, both parts are followed
// while they are strong; of the weak rest one is chosen by chance.
//
// This is a program for what is seen directly (LISTS_SPECULAR). Where the scene shows glass or mirrors it lists the
// pixels that meet something specular first (FOLLOWED), and another is for those (CAMERA_SPECULAR), which holds all
// that is expensive. NVIDIA unrolls whatever it can count, with all that it has inlined: two minutes for a scene's
// programs.
#pragma optionNV(unroll none)
#if CAMERA_SPECULAR
layout(local_size_x = PATHS_GROUP) in;
#else
layout(local_size_x = 8, local_size_y = 8) in;
#endif

#include "camera/globals.glsl"
#include "camera/start.glsl"

#include "camera/listed.glsl"
layout(rgba32f, binding = 0) uniform image2D picture[TARGETS];

// Where this event cuts the path's band; negative: nowhere.
float cut_at;

#include "camera/waiting.glsl"

#include "camera/cuts.glsl"
#include "camera/survey.glsl"
#include "camera/meet.glsl"

// 2^32 times the fractions of the cube roots of 2 and 4: badly approximable together, and of no other field than the
// plastic number's, by which places on lights are drawn.
#define LENS_1 1116352409u
#define LENS_2 2522868307u

vec2 primary_sample_place(uint primary_sample) {
    if (primary_sample == THE_SAMPLE) return p.within_pixel;
    vec4 two = p.looks[primary_sample >> 1u];
    return (primary_sample & 1u) == 0u ? two.xy : two.zw;
}

Path camera_path(uvec2 pixel, uint primary_sample, float gain) {
    look_place = primary_sample_place(primary_sample);
    if (LENS) {
        // Looks are shared out over the lens as over the pixel, by a sequence any part of which is even too: samples of
        // one band, every so many of them, see through all of the lens.
        uint look = p.sample_index * p.primary_samples + (primary_sample == THE_SAMPLE ? 0u : primary_sample);
        uint key = hash_combine(hash_combine(hash_combine(p.seed, pixel.x), pixel.y), 79u);
        lens_place = vec2(kronecker(look, LENS_1, key), kronecker(look, LENS_2, hash_pcg(key)));
    }
    return path_from(pixel, look_place, gain);
}

void begin_sample(uvec2 pixel) {
    turn = RGB_CHANNELS && p.counts_turns != 0u ? uint(imageLoad(picture[0], ivec2(pixel)).w) : p.sample_index;
    for (int t = 0; t < TARGETS; ++t) radiance[t] = vec4(0.0);
}

void add_to_picture(uvec2 pixel) {
    if (RGB_CHANNELS) radiance[0].w = took_turn ? 1.0 : 0.0;
    for (int t = 0; t < TARGETS; ++t) {
        vec4 sum = imageLoad(picture[t], ivec2(pixel));
        imageStore(picture[t], ivec2(pixel), sum + radiance[t]);
    }
}

// What is seen directly in a pixel; it is listed where something specular is seen.
void see_pixel() {
    uvec2 pixel = gl_GlobalInvocationID.xy + uvec2(0u, p.first_row);
    if (p.survey == SURVEY_KEPT) {
        uint at = (gl_WorkGroupID.y * UNEVEN_ROW + gl_WorkGroupID.x) * 64u + gl_LocalInvocationIndex;
        if (at >= uneven_count) return;
        uint number = listed[uneven_place(at)];
        pixel = uvec2(number % p.size.x, number / p.size.x);
    }
    if (pixel.x >= p.size.x || pixel.y >= p.size.y) return;
    uint pixel_key = hash_combine(hash_combine(p.seed, pixel.x), pixel.y);
    begin_sample(pixel);
    uint number = pixel.y * p.size.x + pixel.x;
    Survey survey = Survey(0u, vec3(0.0));
    uint specular_samples = 0u, chosen = THE_SAMPLE, draw = hash_combine(pixel_key, p.sample_index);
    for (uint k = 0u; k < p.primary_samples; ++k) {
        look_index = p.sample_index * p.primary_samples + k;
        lights_seen = 0u;
        saw_light = skipped_texels = false;
        Path path = camera_path(pixel, p.primary_samples == 1u ? THE_SAMPLE : k, 1.0 / float(p.primary_samples));
        Hit hit;
        bool met = intersect_closest(path.position, path.direction, FAR_DISTANCE, path.origin, hit);
        uint kind = met ? object_at(hit.object).kind : NONE;
        uint sees = is_specular(kind) ? SEES_SPECULAR : SEES_DIRECTLY;
        // The base of a coat is seen directly; a path goes on from the coat.
        if (COATS && FOLLOWED && kind == KIND_DIFFUSE && is_coated(hit.object)) sees = SEES_COATED;
        if (FOLLOWED && sees != SEES_DIRECTLY) {
            specular_samples += 1u;
            // Each of them as likely: the newest of c with 1 / c.
            draw = hash_pcg(draw);
            if (unit_float(draw) * float(specular_samples) < 1.0) chosen = k;
        }
        if (LAYER_BEAUTY && VISIBLE_LIGHTS && !is_specular(kind)) add_lights(path, met ? hit.distance : FAR_DISTANCE);
        if (!met || kind == KIND_DIFFUSE) add_end(path, met, hit, true, pixel_key);
        if (p.survey == SURVEY_TAKES) survey_look(survey, k, sees, met, hit, lights_seen);
    }
    if (p.survey == SURVEY_TAKES) {
        keep_survey(number, survey.key, p.survey_gain * radiance[0].rgb);
        return;
    }
    if (FOLLOWED && specular_samples > 0u) {
        // A place in the pixel belongs to one on the lens: another pair may meet no glass.
        bool is_any = LENS ? p.primary_samples == 1u : specular_samples == p.primary_samples;
        list_entry(listed_entry(number, is_any ? THE_SAMPLE : chosen, specular_samples));
    }
    add_to_picture(pixel);
}

// A listed pixel: its path through glass and over mirrors, and all that it splits into. `resumes`: its sample has
// halted.
void follow(uint entry, bool resumes) {
    uint number = bitfieldExtract(entry, 0, int(LISTED_BITS)),
         primary_sample = bitfieldExtract(entry, int(LISTED_BITS), 3);
    float gain = float((entry >> (LISTED_BITS + 3u)) + 1u) / float(p.primary_samples);
    uvec2 pixel = uvec2(number % p.size.x, number / p.size.x);
    uint pixel_key = hash_combine(hash_combine(p.seed, pixel.x), pixel.y);
    Path first = camera_path(pixel, primary_sample, gain);
    begin_sample(pixel);
    stack_size = asked = 0;
    took_turn = false;
    int events = 0;
    if (HALTS && resumes) {
        resume(events);
    } else {
        push(first);
    }
    bool halts = false;
    while (stack_size > 0 && !halts) {
        int found = 0;
        bool goes_on = true;
        Path path = pop();
        for (; (goes_on || stack_size > 0) && found < ENDS_HELD && !halts; ++events) {
            COUNT_ROUNDS(12);
            if (!goes_on) path = pop();
            goes_on = true;
            Hit hit;
            bool met = intersect_closest(path.position, path.direction, FAR_DISTANCE, path.origin, hit);
            uint kind = met ? object_at(hit.object).kind : NONE;
            bool ends = !met || kind == KIND_DIFFUSE, same_hit = true, parts = false,
                 event_limit_reached = events >= MAX_EVENTS;
            bool coated = COATS && met && kind == KIND_DIFFUSE && is_coated(hit.object);
            if (SPECTRAL_SWEEP) {
                cut_at = -1.0;
                bool asks = path.restricted != 0u && !event_limit_reached
                    && (ends || (path.walk.planar_so_far != 0u && kind != KIND_BLACK && asked < MAX_ASKED));
                float ahead = met ? hit.distance : FAR_DISTANCE;
                if (asks)
                    asks = ends ? shown_sweep(path, ahead) > MIN_SWEEP
                                : sweep_pixels(path, ahead) > MIN_CUT_SWEEP * sample_side(path);
                if (asks) cut_at = where_paths_diverge(path, met, ends, hit, same_hit);
                parts = cut_at >= 0.0;
            }
            if (!parts) {
                // Before a coat that is seen first, the program for what is seen directly has added lights.
                bool met_before =
                    path.recut != 0u || (HAS_GRATING && path.order != 0u) || (COATS && coated && path.depth == 0u);
                if (LAYER_BEAUTY && VISIBLE_LIGHTS && !met_before) add_lights(path, met ? hit.distance : FAR_DISTANCE);
                // Light that would still be caught inside is as if it left here.
                bool specular = !ends && kind != KIND_BLACK,
                     leaves = specular && (event_limit_reached || path.depth >= uint(MAX_DEPTH));
                if (leaves) atomicAdd(fallbacks[FELL_DEPTH], 1u);
                if (HAS_GRATING && leaves && kind == KIND_GRATING) path.throughput *= shares_left(path, hit);
                if (ends || leaves) ENDED(found++) = PathEnd(path, hit, uint(met && ends), uint(same_hit || leaves));
                goes_on = specular && !leaves;
                if (COATS) goes_on = goes_on || (coated && !event_limit_reached && path.depth < uint(MAX_DEPTH));
                if (goes_on) meet_surface(path, hit, kind, pixel_key);
                goes_on = goes_on && path.walk.inverse_pdf > 0.0;
            }
            if (SPECTRAL_SWEEP && cut_at >= 0.0) cut_band(path, cut_at, pixel_key);
            if (HALTS) halts = rounds >= uint(RANDOM_WAVELENGTH ? HALT_ROUNDS / 3 : HALT_ROUNDS);
        }
        if (goes_on) push(path);
        for (int e = 0; e < found; ++e) {
            PathEnd end = ENDED(e);  // NVIDIA's compiler hands no part of a `restrict` block to a function
            add_end(end.path, end.met != 0u, end.hit, end.same_hit != 0u, pixel_key);
        }
    }
    if (HALTS) {
        if (!loops_run()) atomicAdd(fallbacks[FELL_LOOPS], 1u);
        if (stack_size > 0) {
            halt(entry, events);
            return;
        }
    }
    add_to_picture(pixel);
}

void follow_portion() {
    uint at = shared_out(gl_WorkGroupID.x, gl_NumWorkGroups.x) * gl_WorkGroupSize.x + gl_LocalInvocationID.x;
    uint at_listed = p.first_listed + at;
    if (at_listed >= p.end_listed) return;
    bool resumes = p.first_place == NONE;
    place = resumes ? waiting[at_listed].queued[1u - p.queue] : p.first_place + at;
    follow(resumes ? waiting[place].entry : listed[at_listed], resumes);
}

void follow_all() {
    place = gl_GlobalInvocationID.x;
    for (uint at = place; at < listed_count; at = PLACES + atomicAdd(taken_count, 1u)) follow(listed[at], false);
}

void main() {
    if (!CAMERA_SPECULAR) {
        see_pixel();
    } else if (HALTS) {
        follow_portion();
    } else {
        follow_all();
    }
}
