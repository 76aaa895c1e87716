// What the caustic maps hold of places on receivers, averaged over each, and the colour of the picture that a receiver
// wears there.
layout(local_size_x = 64) in;

#include "lib/intersect.glsl"
#include "lib/lookup.glsl"
#include "light/place.glsl"
#include "lib/textures.glsl"

layout(std140, binding = BIND_PARAMETERS) uniform Parameters { BounceCausticParameters p; };
layout(std430, binding = BIND_PLACES) readonly restrict buffer Places { EnvironmentPlace places[]; };
layout(std430, binding = BIND_SOURCES) restrict buffer Sources { BounceSource sources[]; };

// Lookups in each part of a place along a side at most.
#define MAX_TEXELS 16

// Mean colour of the picture over a place; a ray straight down tells on which facet that lies.
vec3 colour_worn(EnvironmentPlace place, uint worn) {
    float side = sqrt(max(dot(place.span_u, place.span_u), dot(place.span_v, place.span_v)));
    Hit hit;
    bool met = intersect_closest(
        place.position + 0.01 * side * place.normal, -place.normal, 0.02 * side, RayOrigin(NONE, NONE, 0u, 0u), hit);
    Triangle facet = triangle_at(met && hit.object == place.object ? hit.primitive : place.primitive);
    vec3 gradient_u, gradient_v;
    vec2 uv;
    Picture picture = pictures[worn];
    hit_uv(picture, facet.source, vec2(0.0), uv);
    uv_gradients(picture, facet.source, facet.edge1, facet.edge2, gradient_u, gradient_v);
    vec3 along = place.position - facet.vertex;
    uv += vec2(dot(gradient_u, along), dot(gradient_v, along));
    vec2 ds = vec2(dot(gradient_u, place.span_u), dot(gradient_v, place.span_u));
    vec2 dt = vec2(dot(gradient_u, place.span_v), dot(gradient_v, place.span_v));
    return texture_filtered(picture, uv, ds, dt);
}

void main() {
    uint id = gl_GlobalInvocationID.x;
    if (id >= p.count) return;
    EnvironmentPlace place = places[id];
    Object thing = object_at(place.object);
    uint source = triangle_at(place.primitive).source;
    vec3 sum = vec3(0.0);
    for (uint left = place.parts; left != 0u; left &= left - 1u) {
        uint part = uint(findLSB(left));
        vec2 within = (vec2(part % PLACE_PARTS, part / PLACE_PARTS) + 0.5) / float(PLACE_PARTS) - 0.5;
        uint placement;
        vec3 at;
        vec3 position = place.position + within.x * place.span_u + within.y * place.span_v;
        bool covered = find_texel(thing.receiver + place.inside, source, position, placement, at);
        if (covered) {
            Placement window = placements[placement];
            vec2 box = (abs(texels_along(window, at, place.span_u)) + abs(texels_along(window, at, place.span_v)))
                / float(PLACE_PARTS);
            ivec2 lookups = clamp(ivec2(ceil(box)), ivec2(1), ivec2(MAX_TEXELS));
            vec2 step = box / vec2(lookups), corner = at.xy / at.z - 0.5 * (box - step);
            float share = 1.0 / (float(bitCount(place.parts) * lookups.x * lookups.y) * texel_area_at(window, at));
            for (int i = 0; i < lookups.x * lookups.y; ++i) {
                vec4 energy =
                    caustic_energy(caustic_map[0], placement, corner + step * vec2(i % lookups.x, i / lookups.x), step);
                sum += share
                    * (energy.x * p.colours[0].rgb + energy.y * p.colours[1].rgb + energy.z * p.colours[2].rgb
                        + energy.w * p.colours[3].rgb);
            }
        }
    }
    sources[id].caustic += p.scale * sum;
    if (HAS_TEXTURES && thing.texture != NONE) sources[id].paint = colour_worn(place, thing.texture);
}
