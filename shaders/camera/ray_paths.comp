// Single paths, one an invocation, each at a wavelength of its own: refracted at every glass surface (reflected within it
// where it must be, or as often as is asked for), mirrored by mirrors, up to the first surface that is neither. For the
// ray overlay.
layout(local_size_x = 32) in;

#include "lib/medium.glsl"
#include "lib/interface.glsl"
#ifdef HAS_GRATING
#include "lib/grating.glsl"
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
    RayOrigin origin = RayOrigin(NONE, NONE, 0u, p.inside_mask);
    MediumStack medium = MediumStack(p.inside_mask, p.inside_object);
    PathEnd path;
    path.points = 1u;
    uint reflections = p.reflections;
    uint at = id * uint(MAX_POINTS);
    points[at] = vec4(position, 0.0);
    for (uint event = 0u; event < uint(MAX_POINTS) - 1u; ++event) {
        Hit hit;
        bool met = intersect_closest(position, direction, FAR_DISTANCE, origin, hit);
        Triangle facet = hit_triangle(hit);
        vec3 there = met ? surface_point(hit, facet, position, direction) : position + p.escape * direction;
        ShadingFrame frame = shading_frame(hit, facet, there, direction);
        path.points = event + 2u;
        points[at + event + 1u] = vec4(there, 0.0);
        uint kind = met ? object_at(hit.object).kind : NONE;
        bool goes_on = false;
        position = there;
        Deflection turned = reflect_at(frame, direction);
        bool entering = dot(direction, hit.normal_g) < 0.0;
#ifdef HAS_MIRROR
        if (kind == KIND_MIRROR) {
            direction = turned.direction;
            origin = RayOrigin(hit.primitive, hit.object, uint(!entering), origin.inside_mask);
            goes_on = true;
        }
#endif
#ifdef HAS_DIELECTRIC
        if (IS_GLASS(kind)) {
            MediumInterface boundary = cross_boundary(medium, hit.object, entering);
            bool reflects = false;
            if (boundary.changes) {
                float eta_it = medium_index(boundary.before, starts[id].x) / medium_index(boundary.after, starts[id].x);
                Deflection refracted = refract_at(frame, direction, IS_THIN(boundary) ? 1.0 : eta_it);
                reflects = !refracted.exists || (reflections > 0u && !entering && !IS_THIN(boundary));
                direction = reflects ? turned.direction : refracted.direction;
            }
            if (reflects && !entering) reflections -= min(reflections, 1u);
            if (!reflects) medium = boundary.behind;
            origin = RayOrigin(hit.primitive, hit.object, uint(reflects ? !entering : entering), medium.mask);
            goes_on = true;
        }
#endif
#ifdef HAS_GRATING
        if (kind == KIND_GRATING) {
            // The strongest order that leaves.
            uint row = object_at(hit.object).weight_row;
            Grating grating = grating_at(row);
            float strongest = 0.0;
            vec3 incident = direction;
            for (uint number = 0u; number < grating.orders; ++number) {
                GratingOrder order = order_at(row, number);
                float step = order_steps(order, hit.object, current_medium(medium), vec3(starts[id].x)).x;
                Deflection sent = diffract_at(frame, incident, grating.lines, entering ? 1.0 : -1.0, step, order.reflects != 0u);
                if (!sent.exists || order.efficiency <= strongest) continue;
                strongest = order.efficiency;
                direction = sent.direction;
                origin = RayOrigin(hit.primitive, hit.object, uint(dot(direction, hit.normal_g) < 0.0), origin.inside_mask);
                goes_on = true;
            }
        }
#endif
        if (!goes_on) break;
    }
    paths[id] = path;
}
