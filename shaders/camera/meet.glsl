// Which lobes of a surface a camera path follows: of glass, mirrors, gratings and coats.

#include "path/event.glsl"

// A number for a choice at this depth: a Kronecker sequence over a pixel's samples.
float choice(Path path, uint pixel_key) {
    return kronecker(
        p.sample_index, depth_generator(path.depth), hash_combine(pixel_key, path.walk.key + path.depth * 2654435769u));
}

// `absorber`: below 0 for none.
void add_length(inout Path path, int absorber, float length) {
    for (int i = 0; i < ABSORBERS; ++i)
        if (i == absorber) path.walk.lengths[i] += length;
}

// What a surface lets through of what enters is counted as by coloured mirrors.
void filter_path(inout Path path, Hit hit) {
    vec4 passed = object_colours[hit.object];
    add_length(path, int(passed.x), 1.0);
    path.walk.branch_weight *= passed.y;
}

#include "camera/coat.glsl"

// A path at the start of its flight, `whole`, as the band that it stands for by now, `banded`.
Path start_of_band(Path whole, Path banded) {
    Path start = whole;
    start.band = banded.band;
    start.throughput = banded.throughput;
    start.walk.inverse_pdf = banded.walk.inverse_pdf;
    start.end_step = banded.end_step;
    if (POLARISED) start.polarisation = banded.polarisation;
    if (whole.restricted == 0u) gather_ends(start);
    start.restricted = 1u;
    return start;
}

// Whether a path's band may be cut at `at`, from where its flight to the surface ahead started.
bool may_cut_near(Path start, float at, float distance) {
    if (!may_cut_at(start, at)) return false;
    bool near = start.walk.planar_so_far != 0u
        || starts_are_near(start, anchor_of(start, start.band.x, at), anchor_of(start, at, start.band.z), distance);
    if (!near) atomicAdd(fallbacks[FELL_CUT], 1u);
    return near;
}

#include "camera/grating.glsl"

// Leaves a path a lobe's share of its light, and what microfacets do not hide of that. A path that has lost all goes
// nowhere.
void send_on(inout Path path, Event event, vec3 share, vec3 unhidden) {
    path.throughput *= share;
    if (ROUGH_SURFACES) {
        path.throughput *= unhidden;
        if (unhidden.y <= 0.0) path.walk.inverse_pdf = 0.0;
    }
}

// Leaves a path what a film reflects or lets through of each part of the spectrum.
void leave_film_share(inout Path path, Event event, bool reflects) {
    float from = 0.0;
    for (int k = 0; k < FILM_PARTS; k += 2) {
        vec3 ends = vec3(from, spectral_row(uint(PARTS_ROW), float(k + 1) / float(FILM_PARTS)),
            spectral_row(uint(PARTS_ROW), float(k + 2) / float(FILM_PARTS)));
        vec3 middles = 0.5 * (ends + ends.yzz), cosine = band_weights(path.band, event.film.cosine, middles),
             q = vec3(0.0);
        if (POLARISED) q = band_weights(path.band, event.seen.q, middles);
        vec2 left = vec2(film_between(event.film, reflects, cosine.x, q.x, ends.x, ends.y),
            film_between(event.film, reflects, cosine.y, q.y, ends.y, ends.z));
        if (ROUGH_SURFACES) left = reflected_in_all(left.xyy, event.ground.thrown).xy;
        weaken_films(path.walk, left);
        from = ends.z;
    }
}

// Ends a weak path by chance; one that goes on stands for those that have ended.
void play_roulette(inout Path path, uint pixel_key) {
    float likely = path.walk.branch_weight / ROULETTE_WEIGHT;
    uint key = hash_combine(pixel_key, path.walk.key + path.depth * 2654435769u);
    if (likely >= 1.0) return;
    path.walk.inverse_pdf *= unit_float(hash_combine(key, p.sample_index)) < likely ? 1.0 / likely : 0.0;
    path.walk.branch_weight = ROULETTE_WEIGHT;
}

// One glass surface: `path` goes on, the other part is put on the stack or, if weak, one of them is chosen.
void cross_glass(inout Path path, Path whole, Hit hit, uint kind, Event event, uint pixel_key) {
    bool entering = dot(whole.direction, hit.normal_g) < 0.0, geometric;
    if (!event.boundary.changes) {
        path.medium = event.boundary.behind;
        leave_surface(path, hit, entering);
        return;
    }
    Path mirrored = path;
    Event mirror = event;
    // What is reflected off the outside of glass knows no wavelength but in its strength: it stays whole. What goes
    // on is one band.
    bool disperses =
        HAS_DISPERSION && path.restricted == 0u && (event.n_i.x != event.n_i.z || event.n_t.x != event.n_t.z);
    bool begins = disperses && all(greaterThan(event.cosine2, vec3(0.0)));
    if (HAS_DISPERSION && disperses) {
        restrict_to_band(path, pixel_key);
        share_out(path, kind, event);
    }
    if (SPECTRAL_SWEEP && !begins) {
        float onset = path.restricted != 0u && path.recut == 0u ? total_reflection_in_band(path, event) : -1.0;
        if (onset >= 0.0) {
            onset = cell_border(onset);
            Path start = start_of_band(whole, path);
            if (may_cut_near(start, onset, hit.distance)) {
                // Both parts meet this surface again, each from its own start.
                path = start;
                path.recut = 1u;
                cut_at = onset;
                return;
            }
        }
    }
    // Only now: while a cut is sought little is held.
    share_out(path, kind, event);
    if (begins) {
        share_out(mirrored, kind, mirror);
    } else {
        mirrored = path;
        mirror = event;
    }
    // A microfacet's share is its own, also where what it lets through does not leave the surface.
    bool total = !event.refracted.exists;
    if (ROUGH_SURFACES && event.ground.width > 0.0) {
        total = event.cosine2.y <= 0.0;
        path.walk.ground = mirrored.walk.ground = 1u;
    }
    bool reflects = total;
    float likely = total ? 1.0 : dot(event.reflectance, OVER_BAND);
    vec3 let_through = transmittance_of(event);
    if (HAS_FILM && FILM_MET(event) && !total) {
        // What absorbs leaves less than all to both.
        float onward = dot(let_through, OVER_BAND);
        likely = clamp(likely / max(likely + onward, 1e-9), 0.05, 0.95);
    }
    bool strong = !total
        && (begins || path.depth <= 1u || path.walk.branch_weight * min(likely, 1.0 - likely) > p.split_threshold);
    bool splits = strong && stack_size < STACK;
    if (strong && !splits) atomicAdd(fallbacks[FELL_STACK], 1u);
    if (splits && ((HAS_FILM && FILM_MET(event)) || mirror.reflectance.y > 0.0)) {
        mirrored.walk.branch_weight *= likely;
        mirrored.walk.key = hash_combine(mirrored.walk.key, 1u);
        leave_surface(mirrored, hit, !entering);
        vec3 unhidden = reflect_path(mirrored, mirror, geometric);
        if (HAS_FILM && FILM_MET(event)) {
            leave_film_share(mirrored, mirror, true);
            mirror.reflectance = vec3(1.0);
        }
        send_on(mirrored, mirror, mirror.reflectance, unhidden);
        if (RANDOM_WAVELENGTH) play_roulette(mirrored, pixel_key);
        if (mirrored.walk.inverse_pdf > 0.0) push(mirrored);
    }
    vec3 share = total ? vec3(1.0) : let_through, reflected = event.reflectance;
    if (HAS_FILM && FILM_MET(event)) share = reflected = vec3(1.0);
    if (!total && !splits) {
        reflects = choice(path, pixel_key) < likely;
        share = (reflects ? reflected : share) / (reflects ? likely : 1.0 - likely);
        path.walk.key = hash_combine(path.walk.key, reflects ? 3u : 4u);
    } else
        path.walk.branch_weight *= total ? 1.0 : 1.0 - likely;
    // Where only the facet's normal forbids it to go on, all of it is reflected.
    if (HAS_FILM && FILM_MET(event) && (!total || event.cosine2.y <= 0.0)) leave_film_share(path, event, reflects);
    vec3 unhidden;
    if (reflects)
        unhidden = reflect_path(path, event, geometric);
    else {
        unhidden = refract_path(path, event);
        if (SURFACE_FILTERS) filter_path(path, hit);
    }
    send_on(path, event, share, unhidden);
    if (RANDOM_WAVELENGTH) play_roulette(path, pixel_key);
    leave_surface(path, hit, reflects != entering);
}

#include "camera/crystal.glsl"

// A specular surface, or a coat.
void meet_surface(inout Path path, Hit hit, uint kind, uint pixel_key) {
    Path whole = path;
    if (ABSORPTION) {
        uint filling = current_medium(path.medium);
        int absorber = filling == NONE ? -1 : int(object_colours[filling].w);
        add_length(path, absorber, hit.distance);
    }
    transfer_columns(path, hit.normal_g, hit.distance);
    if (!columns_hold(path)) atomicAdd(fallbacks[FELL_COLUMNS], 1u);
    Triangle facet = hit_triangle(hit);
    path.position = surface_point(hit, facet, whole.position, whole.direction);
    if (SPECTRAL_SWEEP) {
        if (NORMAL_DERIVATIVES) path.walk.planar_so_far = uint(path.walk.planar_so_far != 0u && is_planar(hit, facet));
        if (path.restricted != 0u) transfer_ends(path, hit.normal_g);
    }
    path.depth += 1u;
    if (COATS) {
        path.walk.coat_pdf = 0.0;
        if (kind == KIND_DIFFUSE) {
            meet_coat(path, hit, facet, pixel_key);
            return;
        }
    }
    Event event = meet(path, hit, facet, object_at(hit.object),
        MicrofacetDraw(p.sample_index, path.depth, hash_combine(pixel_key, 80u)));
    if (HAS_CRYSTAL && parts_waves(event, kind)) {
        cross_crystal(path, hit, event, pixel_key);
        return;
    }
    weigh(path, kind, event);
    if (HAS_MIRROR && kind == KIND_MIRROR) {
        bool geometric;
        if (HAS_FILM && FILM_MET(event)) leave_film_share(path, event, true);
        vec3 unhidden = reflect_path(path, event, geometric);
        if (ROUGH_SURFACES) {
            send_on(path, event, HAS_FILM && FILM_MET(event) ? vec3(1.0) : event.reflectance, unhidden);
            if (event.ground.width > 0.0) path.walk.ground = 1u;
        }
        leave_surface(path, hit, dot(path.direction, hit.normal_g) < 0.0);
        vec3 colour = object_colours[hit.object].rgb;
        if (ABSORPTION) {
            // A coloured mirror lets through like a glass of its own, once a reflection.
            int mirror = int(object_colours[hit.object].w);
            add_length(path, mirror, 1.0);
            if (mirror < 0) path.throughput *= colour.g;
        } else {
            path.throughput *= colour.g;
        }
        path.walk.branch_weight *= max(colour.r, max(colour.g, colour.b));
    }
    if (HAS_DIELECTRIC && IS_GLASS(kind)) cross_glass(path, whole, hit, kind, event, pixel_key);
    if (HAS_POLARISER && kind == KIND_POLARISER) cross_polariser(path, hit, object_at(hit.object).receiver, pixel_key);
    if (HAS_GRATING && kind == KIND_GRATING) meet_grating(path, whole, hit, event, pixel_key);
}
