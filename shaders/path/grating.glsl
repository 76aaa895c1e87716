// A path at a grating: one of its orders at a time. The grating equation is the same backwards, and the directions'
// parts in the surface are only moved by it, so that radiance and flux alike are passed on by the order's efficiency.

#include "lib/grating.glsl"
#include "path/event.glsl"

GratingEvent grating_event(Path path, vec3 normal, Hit hit, uint row) {
    GratingEvent met;
    met.grating = grating_at(row);
    met.row = row;
    met.object = hit.object;
    met.medium = current_medium(path.medium);
    met.side = dot(path.direction, hit.normal_g) < 0.0 ? 1.0 : -1.0;
    met.normal = normal;
    met.across = across_lines(met, normal);
    return met;
}

// An order as a path leaves in it, at a place on its line that `number` of a sequence draws.
GratingOrder order_drawn(GratingEvent met, uint order_number, uint number, uint depth, uint key) {
    GratingOrder order = order_at(met.row, order_number);
    if (LINE_WIDTHS) {
        float draw = line_draw(number, depth, hash_combine(key, order_number));
        order.shift_per_um += met.grating.spread_per_um * place_on_line(draw);
    }
    return order;
}

// Share of light at x in an order of a path along `direction`; on a path from the camera it comes back along the order.
float order_share(GratingEvent met, GratingOrder order, uint number, vec3 direction, float x) {
    vec3 outward = met.side * met.normal,
         light = vec3(dot(direction, met.across), dot(direction, cross(outward, met.across)), dot(direction, outward));
    if (CAMERA_SPECULAR) {
        light.x += order_step(met, order, x);
        float cosine = met.side * sqrt(max(1.0 - dot(light.xy, light.xy), 0.0));
        light = vec3(-light.xy, is_reflective(met.grating) ? -cosine : cosine);
    }
    float waves = groove_waves(met.grating, light, medium_index(met.medium, x), medium_index(met.object, x));
    return order.efficiency * profile_share(met.grating, order, number, waves);
}

// Shares of a path's light in an order, over x. `single`: of three wavelengths that are with the anchor.
vec3 order_shares(GratingEvent met, GratingOrder order, uint number, Path path, vec3 x, bool single) {
    vec3 shares = vec3(order.efficiency), low = path.direction, high = path.direction;
    if (GRATING_PROFILES && met.grating.profile != 0u) {
        if (SPECTRAL_GROUPS > 0 && !single) {
            low = direction_at_end(path, 0);
            high = direction_at_end(path, 1);
        }
        shares = vec3(order_share(met, order, number, low, x.x), order_share(met, order, number, path.direction, x.y),
            order_share(met, order, number, high, x.z));
    }
    return shares;
}

bool order_passes(GratingEvent met, GratingOrder order, vec3 direction, float x) {
    return diffracted_cosine2(direction, dot(direction, met.normal), order_step(met, order, x) * met.across) > 0.0;
}

// Where over its band a path is not evanescent in an order.
bvec3 order_passes(GratingEvent met, GratingOrder order, Path path) {
    bvec3 passes = bvec3(order_passes(met, order, path.direction, path.band.y));
    if (SPECTRAL_GROUPS > 0) {
        passes.x = order_passes(met, order, direction_at_end(path, 0), path.band.x);
        passes.z = order_passes(met, order, direction_at_end(path, 1), path.band.z);
    }
    return passes;
}

// The wavelength within the band where an order becomes evanescent, in the half whose ends `passes` tells apart.
float evanescence_in_band(GratingEvent met, GratingOrder order, Path path, bvec3 passes) {
    bool low_side = passes.x != passes.y, passes_a = low_side ? passes.x : passes.y;
    float a = low_side ? path.band.x : path.band.y, b = low_side ? path.band.y : path.band.z;
    for (int i = 0; i < ONSET_HALVINGS; ++i) {
        float x = 0.5 * (a + b);
        vec3 position, direction;
        ray_at(path, x, position, direction);
        bool passes_x = order_passes(met, order, direction, x);
        a = passes_x == passes_a ? x : a;
        b = passes_x == passes_a ? b : x;
    }
    return 0.5 * (a + b);
}

// The path turned into an order. `geometric`: the facet's normal had to judge.
void diffract_path(inout Path path, Event event, GratingEvent met, GratingOrder order, out bool geometric) {
    float step = order_step(met, order, path.band.y), theta, cosine2, omega;
    Deflection turned = diffract_at(met, event.frame, path.direction, step);
    geometric = turned.geometric;
    if (SPECTRAL_SWEEP) {
        for (int end = 0; end < 2; ++end)
            path.end_direction[end] = normalize(diffract_direction(met, path.end_direction[end],
                turned.geometric ? turned.normal : event.end_normal[end],
                order_step(met, order, end == 0 ? path.band.x : path.band.z), theta, cosine2, omega));
    }
    for (int c = 0; c < PATH_COLUMNS; ++c) {
        float dstep = 0.0;
        if (SPECTRAL_GROUPS > 0 && c >= SPATIAL && c < SPATIAL + SPECTRAL_GROUPS)
            dstep = order_step_derivative(met, order, uint(c - SPATIAL), path.band.y);
        path.ddirection[c] =
            diffracted_column(met, turned, path.direction, path.ddirection[c], NORMAL_COLUMN(event, c), step, dstep);
    }
    if (POLARISED)
        path.polarisation =
            behind_grating(path.polarisation, path.direction, turned.direction, is_reflective(met.grating));
    path.direction = turned.direction;
}
