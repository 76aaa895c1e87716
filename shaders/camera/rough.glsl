// A camera path at a rough surface: it meets one microfacet, the same all over its band (which all meets it as probably as its anchor
// does), and is turned as by a polished surface that lies as this one does. By reciprocity it loses what light that came along it would.
#ifdef ROUGH_SURFACES
#include "lib/rough_surface.glsl"
#include "lib/rough_energy.glsl"

// What a rough surface makes of a path.
struct RoughPlace {
    float width;          // GGX's, of the surface that is met; 0: it is polished
    PathFrame surface;    // its own normals, before the microfacet's took their place
    float table;          // of what it sends on
    vec3 regained;        // factor for what its microfacets send on after all
};

// The microfacet takes the place of the frame's normals, and turns with them. Samples of a pixel share out the microfacets between them as they do the
// pixel, and each looks up the light of its share of the lobe [Krivanek, Colbert 2008]: lamps and windows seen through ground glass would be specks.
RoughPlace meet_microfacet(inout CameraPath path, inout PathFrame frame, uint object, uint pixel_key)
{
    vec4 told = object_at(object).colour;
    RoughPlace place = RoughPlace(told.x, frame, told.y, vec3(1.0));
    if (place.width <= 0.0) return place;
    path.ground = 1u;
    // Parts of a band that was cut here meet it again, and find the same microfacet.
    uint key = hash_combine(pixel_key, 80u), depth = uint(path.depth);
    vec3 normal = frame.shading.normal;
    vec3 microfacet = visible_microfacet(-path.direction, normal, place.width, microfacet_numbers(p.sample_index, depth, key));
    for (int c = 0; c < COLUMNS_HELD; ++c) frame.columns[c] = turned_with(microfacet, normal, frame.columns[c]);
    // A box of these sides is as broad as the lobe. A second surface adds its axes a quarter turn aside, to the left or to the right, which adds
    // variances in the mean.
    vec3 first, second;
    lobe_axes(microfacet, normal, sqrt(12.0) * place.width, first, second);
    float turn = depth == 0u ? 0.0 : (hash_combine(p.sample_index, key) & 1u) != 0u ? 1.0 : -1.0;
    frame.columns[0] += turn == 0.0 ? first : turn * second;
    frame.columns[1] += turn == 0.0 ? second : -turn * first;
#ifdef SPECTRAL_SWEEP
    for (int end = 0; end < 2; ++end) frame.end_normal[end] = normalize(microfacet + turned_with(microfacet, normal, frame.end_normal[end] - normal));
#endif
    frame.shading.normal = microfacet;
    return place;
}

// What is left of a path that a microfacet has turned, at three places of its band: what others do not hide or send on; nothing, where it does not leave the
// surface. `side`: 1 where it was reflected, -1 where it was refracted.
vec3 leaving_share(RoughPlace place, CameraPath path, bool geometric, float side)
{
    vec3 cosine = vec3(dot(path.direction, place.surface.shading.normal));
#ifdef SPECTRAL_SWEEP
    if (path.restricted != 0u) {
        cosine.x = dot(path.end_direction[0], place.surface.end_normal[0]);
        cosine.z = dot(path.end_direction[1], place.surface.end_normal[1]);
    }
#endif
    return geometric || side * cosine.y <= 0.0 ? vec3(0.0) : place.regained * smith_share(side * cosine, place.width);
}

// A path that has lost all goes nowhere.
void shadow(inout CameraPath path, vec3 left)
{
    path.weight *= left;
    if (left.y <= 0.0) path.inverse_pdf = 0.0;
}
#endif
