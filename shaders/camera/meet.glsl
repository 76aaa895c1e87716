// What surfaces that throw a path on do to it: glass, mirrors, gratings and coats.
#ifndef CAMERA_MEET_GLSL
#define CAMERA_MEET_GLSL

#if defined(HAS_DIELECTRIC) || defined(HAS_GRATING) || defined(COATS)
// A number for a choice at this depth: a Kronecker sequence over a pixel's samples.
float choice(CameraPath path, uint pixel_key)
{
    return kronecker(p.sample_index, depth_generator(uint(path.depth)), hash_combine(pixel_key, path.key + uint(path.depth) * 2654435769u));
}

#endif

#ifdef ABSORPTION
// `absorber`: below 0 for none.
void add_length(inout CameraPath path, int absorber, float length)
{
    for (int i = 0; i < ABSORBERS; ++i)
        if (i == absorber) path.lengths[i] += length;
}
#endif

#ifdef HAS_GRATING
#include "camera/grating.glsl"
#endif

#ifdef COATS
#include "camera/coat.glsl"
#endif

#ifdef HAS_DIELECTRIC
// One glass surface: `path` goes on, the other part is put on the stack or, if weak, one of them is chosen.
void cross_glass(inout CameraPath path, CameraPath whole, Hit hit, Triangle facet, uint pixel_key)
{
    bool entering = dot(whole.direction, hit.normal_g) < 0.0;
    MediumInterface boundary = cross_boundary(path.medium, hit.object, entering);
    RayOrigin origin_beyond = RayOrigin(hit.primitive, hit.object, uint(entering), boundary.behind.mask);
    RayOrigin origin_back = RayOrigin(hit.primitive, hit.object, uint(!entering), path.medium.mask);
    if (!boundary.changes) {
        path.medium = boundary.behind;
        path.origin = origin_beyond;
        return;
    }
    PathFrame frame = path_frame(path, hit, facet);
#ifdef ROUGH_SURFACES
    RoughPlace rough = meet_microfacet(path, frame, hit.object, pixel_key);
#endif
    CameraPath mirrored = path;
    vec3 n_i, n_t, theta3, cosine2, reflectance, mirror_weight;
#ifdef POLARISED
    PolarisedEvent event, mirror_event;
#endif
    bool begins = false;
    for (int round = 0; round < 2; ++round) {
        interface_indices(boundary, path.band, n_i, n_t);
        theta3 = incidence_over_band(path, frame);
        cosine2 = transmitted_cosine2(theta3, n_i / n_t);
#ifdef POLARISED
        FresnelPair reflection = fresnel_reflection(theta3, n_i / n_t, cosine2);
        event = polarised_event(path, frame, OF_SHEET(boundary, reflection));
        reflectance = polarised_share(event.seen, event.reflection);
        if (!begins) mirror_event = event;
#else
        reflectance = fresnel_reflectance(theta3, n_i / n_t, cosine2);
        reflectance = OF_SHEET(boundary, reflectance);
#endif
        GO_STRAIGHT(boundary, theta3, n_i, n_t, cosine2)
        mirror_weight = begins ? mirror_weight : reflectance;
#ifdef HAS_DISPERSION
        // What is reflected off the outside of glass knows no wavelength but in its strength: it stays whole. What goes on is one band.
        if (round == 1 || path.restricted != 0u || (n_i.x == n_i.z && n_t.x == n_t.z)) break;
        begins = all(greaterThan(cosine2, vec3(0.0)));
        restrict_to_band(path, pixel_key);
        if (!begins) mirrored = path;
#else
        break;
#endif
    }
#ifdef SPECTRAL_SWEEP
    bvec3 passes = greaterThan(cosine2, vec3(0.0));
    bool may_cut = path.restricted != 0u && any(passes) && !all(passes) && path.recut == 0u;
    bool cut = false;
    if (may_cut) {
        float at = cell_border(onset_of(path, theta3, boundary, passes));
        cut = may_cut_at(path, at);
        bool near = cut && (whole.planar_so_far != 0u || cut_is_near(whole, at, hit.distance));
        if (cut && !near) atomicAdd(fallbacks[FELL_CUT], 1u);
        cut = near;
        if (cut) {
            // Both parts meet this surface again, each from its own start.
            path = whole;
            path.recut = 1u;
            cut_at = at;
        }
    }
    if (cut) return;
#endif
    path.recut = mirrored.recut = 0u;
#ifdef ROUGH_SURFACES
    bool is_rough = rough.width > 0.0;
    if (is_rough) rough.regained = regained(rough.table, -dot(path.direction, rough.surface.shading.normal), n_i / n_t);
#endif
    Deflection refracted = refract_at(frame.shading, path.direction, n_i.y / n_t.y);
    bool total = !refracted.exists;
#ifdef ROUGH_SURFACES
    // A microfacet's share is its own, also where what it lets through does not leave the surface.
    if (is_rough) total = cosine2.y <= 0.0;
#endif
    bool reflects = total;
    float likely = total ? 1.0 : dot(reflectance, vec3(0.25, 0.5, 0.25));
    bool strong = !total && (begins || path.depth <= 1 || min(path.branch_weight * likely, path.branch_weight * (1.0 - likely)) > p.split_threshold);
    bool splits = strong && stack_size < STACK;
    if (strong && !splits) atomicAdd(fallbacks[FELL_STACK], 1u);
    if (splits && mirror_weight.y > 0.0) {
        mirrored.weight *= mirror_weight;
        mirrored.branch_weight *= likely;
        mirrored.origin = origin_back;
        mirrored.key = hash_combine(mirrored.key, 1u);
#ifdef ROUGH_SURFACES
        bool into_facet = reflect_at(frame.shading, mirrored.direction).geometric;
#endif
        reflect_path(mirrored, frame);
#ifdef POLARISED
        polarise_path(mirrored, mirror_event, true);
#endif
        pushes_path = true;
#ifdef ROUGH_SURFACES
        if (is_rough) shadow(mirrored, leaving_share(rough, mirrored, into_facet, 1.0));
        pushes_path = mirrored.inverse_pdf > 0.0;
#endif
        pending_path = mirrored;
    }
    if (!total && !splits) {
        reflects = choice(path, pixel_key) < likely;
        path.weight *= (reflects ? reflectance : 1.0 - reflectance) / (reflects ? likely : 1.0 - likely);
        path.key = hash_combine(path.key, reflects ? 3u : 4u);
    } else {
        path.weight *= total ? vec3(1.0) : 1.0 - reflectance;
        path.branch_weight *= total ? 1.0 : 1.0 - likely;
    }
    if (!reflects) {
        refract_path(path, refracted, frame, boundary, n_i, n_t);
        path.medium = boundary.behind;
#ifdef SURFACE_FILTERS
        // What the surface lets through of what enters is counted as by coloured mirrors.
        vec4 passed = object_colours[hit.object];
        add_length(path, int(passed.x), 1.0);
        path.branch_weight *= passed.y;
#endif
    }
    path.origin = reflects ? origin_back : origin_beyond;
#ifdef ROUGH_SURFACES
    bool wrong_side = reflects ? reflect_at(frame.shading, path.direction).geometric : refracted.geometric;
#endif
    if (reflects) reflect_path(path, frame);
#ifdef POLARISED
    polarise_path(path, event, reflects);
#endif
#ifdef ROUGH_SURFACES
    if (is_rough) shadow(path, leaving_share(rough, path, wrong_side, reflects ? 1.0 : -1.0));
#endif
}
#endif

// A surface that throws the path on.
void meet_surface(inout CameraPath path, Hit hit, uint kind, uint pixel_key)
{
    CameraPath whole = path;
#ifdef ABSORPTION
    uint filling = current_medium(path.medium);
    int absorber = filling == NONE ? -1 : int(object_colours[filling].w);
    add_length(path, absorber, hit.distance);
#endif
    transfer_columns(path, hit.normal_g, hit.distance);
    if (!columns_hold(path)) atomicAdd(fallbacks[FELL_COLUMNS], 1u);
    Triangle facet = hit_triangle(hit);
    path.position = surface_point(hit, facet, whole.position, whole.direction);
#ifdef SPECTRAL_SWEEP
#ifdef NORMAL_DERIVATIVES
    path.planar_so_far = uint(path.planar_so_far != 0u && is_planar(hit, facet));
#endif
    if (path.restricted != 0u) transfer_ends(path, hit.normal_g);
#endif
    path.depth += 1;
#ifdef COATS
    path.coat_pdf = 0.0;
    if (kind == KIND_DIFFUSE) meet_coat(path, hit, facet, pixel_key);
#endif
#ifdef HAS_MIRROR
    if (kind == KIND_MIRROR) {
        PathFrame frame = path_frame(path, hit, facet);
#ifdef POLARISED
        PolarisedEvent event = polarised_event(path, frame, mirror_reflection());
#endif
        reflect_path(path, frame);
#ifdef POLARISED
        polarise_path(path, event, true);
#endif
        path.origin = RayOrigin(hit.primitive, hit.object, uint(dot(path.direction, hit.normal_g) < 0.0), path.origin.inside_mask);
        path.recut = 0u;
        vec3 colour = object_colours[hit.object].rgb;
#ifdef ABSORPTION
        // A coloured mirror lets through like a glass of its own, once a reflection.
        int mirror = int(object_colours[hit.object].w);
        add_length(path, mirror, 1.0);
        if (mirror < 0) path.weight *= colour.g;
#else
        path.weight *= colour.g;
#endif
        path.branch_weight *= max(colour.r, max(colour.g, colour.b));
    }
#endif
#ifdef HAS_DIELECTRIC
    if (IS_GLASS(kind)) cross_glass(path, whole, hit, facet, pixel_key);
#endif
#ifdef HAS_GRATING
    if (kind == KIND_GRATING) meet_grating(path, whole, hit, facet, pixel_key);
#endif
}

#endif
