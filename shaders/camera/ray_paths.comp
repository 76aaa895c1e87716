// Single paths, one an invocation, each at a wavelength of its own: refracted at every glass surface (reflected within
// it where it must be, or as often as is asked for), mirrored by mirrors, up to the first surface that is neither. For
// the ray overlay.
layout(local_size_x = 32) in;

struct Walk {
    uint reflections;  // within glass, still to come
};
#define SPATIAL 0
#define PATH_COLUMNS 0
#include "path/event.glsl"
#include "path/grating.glsl"
#if HAS_CRYSTAL
#include "path/crystal.glsl"
#endif
#if HAS_POLARISER
#include "path/polariser.glsl"
#endif

layout(std430, binding = BIND_PARAMETERS) readonly restrict buffer Parameters { PathParameters p; };
layout(std430, binding = BIND_STARTS) readonly restrict buffer Starts { PathStart starts[]; };
layout(std430, binding = BIND_PATHS) writeonly restrict buffer Paths { PathEnd paths[]; };
layout(std430, binding = BIND_POINTS) writeonly restrict buffer Points { vec4 points[]; };

void main() {
    uint id = gl_GlobalInvocationID.x;
    if (id >= p.count) return;
    RayOrigin origin = RayOrigin(NONE, NONE, 0u, p.inside_mask);
    Path path = path_at(
        starts[id].position, starts[id].direction, origin, MediumStack(p.inside_mask, p.inside_object), starts[id].x);
    path.walk.reflections = p.reflections;
    PathEnd end;
    end.points = 1u;
    uint at = id * uint(MAX_POINTS);
    points[at] = vec4(path.position, 0.0);
    for (uint number = 0u; number < uint(MAX_POINTS) - 1u; ++number) {
        Hit hit;
        bool met = intersect_closest(path.position, path.direction, FAR_DISTANCE, path.origin, hit);
        Triangle facet = hit_triangle(hit);
        Object thing = object_at(met ? hit.object : 0u);
        uint kind = met ? thing.kind : NONE;
        path.position =
            met ? surface_point(hit, facet, path.position, path.direction) : path.position + p.escape * path.direction;
        end.points = number + 2u;
        points[at + number + 1u] = vec4(path.position, 0.0);
        if (!is_specular(kind)) break;
        bool entering = dot(path.direction, hit.normal_g) < 0.0, reflects = true, goes_on = true, geometric;
        Event event = interact(path, hit, facet, thing, MicrofacetDraw(0u, 0u, 0u));
        bool parts_waves = HAS_CRYSTAL && IS_GLASS(kind) && meets_crystal(event.boundary);
#if HAS_CRYSTAL
        if (parts_waves) {
            // The stronger of both waves that go on, if one does.
            CrystalEvent met_crystal = crystal_event(path, event);
            uint sent = 0u;
            float strongest = 0.0;
            for (uint turn = 0u; turn < MOST_LOBES; ++turn) {
                uint lobe = turn ^ LOBE_ONWARD;
                float share = lobe_share(met_crystal, lobe).y;
                if (share <= strongest || (turn >= LOBE_ONWARD && (sent & LOBE_ONWARD) != 0u)) continue;
                sent = lobe;
                strongest = share;
            }
            turn_crystal(path, event, met_crystal, sent, geometric);
            reflects = (sent & LOBE_ONWARD) == 0u;
        }
#endif
#if HAS_POLARISER
        if (kind == KIND_POLARISER) {
            pass_polariser(path, crystal_at(thing.receiver));
            reflects = false;
        }
#endif
        if (HAS_DIELECTRIC && IS_GLASS(kind) && !parts_waves) {
            reflects = event.boundary.changes
                && (!event.refracted.exists || (path.walk.reflections > 0u && !entering && !IS_THIN(event.boundary)));
            if (reflects && !entering) path.walk.reflections -= min(path.walk.reflections, 1u);
            if (!event.boundary.changes)
                path.medium = event.boundary.behind;
            else if (!reflects)
                refract_path(path, event);
        }
        if (HAS_GRATING) {
            if (kind == KIND_GRATING) {
                // The strongest order that leaves.
                GratingEvent met_grating = grating_event(path, event.frame.normal, hit, thing.weight_row);
                Path sent = path;
                float strongest = 0.0;
                for (uint order_number = 0u; order_number < met_grating.grating.orders; ++order_number) {
                    GratingOrder order = order_at(thing.weight_row, order_number);
                    vec3 steps = order_steps(order, hit.object, met_grating.medium, path.band);
                    float share = order.efficiency;
                    if (GRATING_PROFILES && met_grating.grating.profile != 0u)
                        share = order_share(
                            met_grating, order, order_number, in_lines(met_grating, path.direction), path.band.y);
                    if (!order_passes(path, event, met_grating, steps).y || share <= strongest) continue;
                    strongest = share;
                    sent = path;
                    diffract_path(sent, event, met_grating, order, steps, geometric);
                }
                reflects = false;
                goes_on = strongest > 0.0;
                path = sent;
                leave_surface(path, hit, dot(path.direction, hit.normal_g) < 0.0);
            } else
        }
        {
            if (reflects && !parts_waves) reflect_path(path, event, geometric);
            leave_surface(path, hit, reflects != entering);
        }
        if (!goes_on) break;
    }
    paths[id] = end;
}
