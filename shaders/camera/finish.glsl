// How a receiver's surface is finished (app/model/materials/diffuse.py): the coat over its base, and how rough that is.

struct Finish {
    float alpha;  // of the coat's lobe; 0: perfectly smooth; below 0: there is no coat
    float index;  // of the coat
    uint row;  // of its tables
    float roughness;  // of the base
};

Finish finish_of(uint object) {
    vec4 told = object_colours[uint(FINISHES_AT) + object];
    return Finish(told.x, told.y, uint(told.z), told.w);
}

bool is_finished(uint object) {
    Finish finish = finish_of(object);
    return finish.alpha >= 0.0 || finish.roughness > 0.0;
}

// Outside of any condition: a file is put where it is first asked for, and rough glass needs this one where nothing is
// coated.
#include "lib/microfacet.glsl"

#include "lib/coat.glsl"

bool is_coated(uint object) { return object_colours[uint(FINISHES_AT) + object].x >= 0.0; }

// Share of light from all sides that the base under a coat gets and sends out at this cosine.
float share_under(Finish finish, float cosine) {
    return finish.alpha < 0.0 ? 1.0 : 1.0 - spectral_row(finish.row, cosine);
}

// Factor on that for light that comes at this cosine: its mean over all of it is one.
float share_from(Finish finish, float cosine) {
    return finish.alpha < 0.0 ? 1.0 : spectral_row(finish.row + 1u, cosine);
}

// Of the two ways to find a light of some extent, its own points and the lobe's directions, each counts by its density
// (balance heuristic [Veach and Guibas 1995]). `extent`: one over the density of the light's points, per steradian; 0:
// only its own points find it.
float share_of_points(float lobe_density, float extent) { return 1.0 / (1.0 + lobe_density * extent); }

float share_of_lobe(Path path, CameraLight light, vec3 position, vec3 direction) {
    float extent = 1.0 / max(light.measure, 1e-30);
    if (light.kind == LIGHT_KIND_AREA) {
        float cosine = -dot(direction, light.axis),
              distance = dot(position - light.position, light.axis) / max(cosine, 1e-6);
        extent = light.measure * cosine / max(distance * distance, 1e-20);
    }
    return path.walk.coat_pdf > 0.0 ? 1.0 - share_of_points(path.walk.coat_pdf, extent) : 1.0;
}

#include "lib/rough_diffuse.glsl"
