// A path at a grating: one of its orders at a time. The grating equation is the same backwards, and the directions'
// parts in the surface are only moved by it, so that radiance and flux alike are passed on by the order's efficiency.

#include "lib/grating.glsl"
#include "path/event.glsl"

// What a path meets at a grating, for all its orders.
struct GratingEvent {
    Grating grating;
    uint row;
    uint object;
    uint medium;  // that the path is in
    float side;  // 1 where the frame's normal is the outward one, else -1
    vec3 across;  // unit, in the surface across the lines
    vec3 normal;
};

GratingEvent grating_event(Path path, vec3 normal, Hit hit, uint row) {
    GratingEvent met;
    met.grating = grating_at(row);
    met.row = row;
    met.object = hit.object;
    met.medium = current_medium(path.medium);
    met.side = dot(path.direction, hit.normal_g) < 0.0 ? 1.0 : -1.0;
    met.across = across_lines(normal, met.grating.lines, met.side);
    met.normal = normal;
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

// A direction across the lines, along them and along the outward normal.
vec3 in_lines(GratingEvent met, vec3 direction) {
    vec3 outward = met.side * met.normal;
    return vec3(dot(direction, met.across), dot(direction, cross(outward, met.across)), dot(direction, outward));
}

// Share of light that comes in the direction `light`, as of `in_lines`, in an order at x.
float order_share(GratingEvent met, GratingOrder order, uint number, vec3 light, float x) {
    float waves = groove_waves(met.grating, light, medium_index(met.medium, x), medium_index(met.object, x));
    return order.efficiency * profile_share(met.grating, order, number, waves);
}

// Where over its band a path is not evanescent in an order of these steps.
bvec3 order_passes(Path path, Event event, GratingEvent met, vec3 steps) {
    vec3 normal = event.frame.normal;
    bvec3 passes = bvec3(diffracted_cosine2(path.direction, dot(path.direction, normal), steps.y * met.across) > 0.0);
    if (SPECTRAL_GROUPS > 0) {
        vec3 low = direction_at_end(path, 0), high = direction_at_end(path, 1);
        passes.x = diffracted_cosine2(low, dot(low, normal), steps.x * met.across) > 0.0;
        passes.z = diffracted_cosine2(high, dot(high, normal), steps.z * met.across) > 0.0;
    }
    return passes;
}

// The wavelength within the band where an order becomes evanescent, of one that `passes` somewhere and somewhere not.
float evanescence_in_band(Path path, Event event, GratingEvent met, GratingOrder order, bvec3 passes) {
    vec3 columns[SPECTRAL_GROUPS], bends[2] = vec3[](vec3(0.0), vec3(0.0));
    for (int g = 0; g < SPECTRAL_GROUPS; ++g) columns[g] = path.ddirection[SPATIAL + g];
    if (SPECTRAL_SWEEP) {
        for (int end = 0; end < 2; ++end) {
            vec3 position, direction;
            linear_end(path, end, position, direction);
            bends[end] = path.end_direction[end] - direction;
        }
    }
    return evanescence_onset(path.band, path.direction, columns, bends, event.frame.normal, met.grating.lines, met.side,
        order, met.object, met.medium, passes);
}

// The path turned into an order. `geometric`: the facet's normal had to judge.
void diffract_path(inout Path path, Event event, GratingEvent met, GratingOrder order, vec3 steps, out bool geometric) {
    bool reflects = is_reflective(met.grating);
    Deflection turned = diffract_at(event.frame, path.direction, met.grating.lines, met.side, steps.y, reflects);
    geometric = turned.geometric;
    if (SPECTRAL_SWEEP) {
        for (int end = 0; end < 2; ++end) {
            vec3 normal = turned.geometric ? turned.normal : event.end_normal[end], direction = path.end_direction[end];
            vec3 shift = (end == 0 ? steps.x : steps.z) * across_lines(normal, met.grating.lines, met.side);
            float theta = dot(direction, normal), cosine2 = diffracted_cosine2(direction, theta, shift);
            path.end_direction[end] =
                normalize(diffract_direction(direction, normal, theta, shift, sqrt(max(cosine2, 1e-12)), reflects));
        }
    }
    for (int c = 0; c < PATH_COLUMNS; ++c) {
        float dstep = 0.0;
        if (SPECTRAL_GROUPS > 0 && c >= SPATIAL && c < SPATIAL + SPECTRAL_GROUPS)
            dstep = order_step_derivative(order, met.object, met.medium, uint(c - SPATIAL), path.band.y);
        path.ddirection[c] = diffracted_column(turned, path.direction, path.ddirection[c], NORMAL_COLUMN(event, c),
            met.grating.lines, met.side, steps.y, dstep, reflects);
    }
    if (POLARISED) {
        path.polarisation = behind_grating(path.polarisation, path.direction, turned.direction, reflects);
    }
    path.direction = turned.direction;
}
