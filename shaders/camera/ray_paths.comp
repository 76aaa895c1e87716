// Single paths, one an invocation, each at a wavelength of its own: refracted at every glass surface (totally reflected
// where it must be), mirrored by mirrors, up to the first surface that is neither. For what people point at and look at:
// picking and the ray overlay.
layout(local_size_x = 32) in;

#include "lib/intersect.glsl"
#include "lib/optics.glsl"
#include "lib/surface.glsl"
#ifdef HAS_DIELECTRIC
// All that medium.glsl needs to know of a ray.
struct RayRecord {
    uint inside_mask;
    uint inside_object;
};
#include "lib/medium.glsl"
#endif

layout(std430, binding = BIND_PARAMETERS) readonly restrict buffer Parameters { PathParameters p; };
layout(std430, binding = BIND_STARTS) readonly restrict buffer Starts { PathStart starts[]; };
layout(std430, binding = BIND_PATHS) writeonly restrict buffer Paths { PathEnd paths[]; };
layout(std430, binding = BIND_POINTS) writeonly restrict buffer Points { vec4 points[]; };

void main()
{
    uint id = gl_GlobalInvocationID.x;
    if (id >= p.count) return;
    vec3 position = starts[id].position, direction = starts[id].direction;
    RayOrigin origin = RayOrigin(NONE, NONE, false, p.inside_mask);
#ifdef HAS_DIELECTRIC
    RayRecord medium = RayRecord(p.inside_mask, p.inside_object);
#endif
    PathEnd path;
    path.first_object = NONE;
    path.last_object = NONE;
    path.first_normal = vec3(0.0);
    path.last_normal = vec3(0.0);
    path.points = 1u;
    uint at = id * uint(MAX_POINTS);
    points[at] = vec4(position, 0.0);
    for (uint event = 0u; event < uint(MAX_POINTS) - 1u; ++event) {
        Hit hit;
        bool met = intersect_closest(position, direction, FAR_DISTANCE, origin, hit);
        vec3 there = met ? surface_point(hit, position, direction) : position + p.escape * direction;
        path.points = event + 2u;
        points[at + event + 1u] = vec4(there, 0.0);
        path.last_object = met ? hit.object : NONE;
        path.last_normal = met ? facing_geometric(hit, direction) : vec3(0.0);
        if (event == 0u) {
            path.first_object = path.last_object;
            path.first_normal = path.last_normal;
        }
        uint kind = met ? object_at(hit.object).kind : NONE;
        bool goes_on = false;
        position = there;
#ifdef HAS_MIRROR
        if (kind == KIND_MIRROR) {
            direction = reflected_direction(hit, direction, facing_normal(hit, direction));
            origin = RayOrigin(hit.primitive, hit.object, dot(direction, hit.normal_g) < 0.0, origin.inside_mask);
            goes_on = true;
        }
#endif
#ifdef HAS_DIELECTRIC
        if (kind == KIND_DIELECTRIC) {
            bool entering = dot(direction, hit.normal_g) < 0.0;
            MediumInterface crossing = cross_boundary(medium, hit.object, entering);
            bool total = false;
            if (crossing.changes) {
                float eta_it = medium_index(crossing.before, starts[id].x) / medium_index(crossing.after, starts[id].x);
                direction = refracted_direction(hit, direction, facing_normal(hit, direction), eta_it, total);
            }
            if (!total) medium = RayRecord(crossing.mask_after, crossing.object_after);
            origin = RayOrigin(hit.primitive, hit.object, total ? !entering : entering, medium.inside_mask);
            goes_on = true;
        }
#endif
        if (!goes_on) break;
    }
    paths[id] = path;
}
