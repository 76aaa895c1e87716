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
#include "path/crystal.glsl"
#include "path/polariser.glsl"

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
        bool entering = dot(path.direction, hit.normal_g) < 0.0, reflects = true, geometric;
        Event event = meet(path, hit, facet, thing, MicrofacetDraw(0u, 0u, 0u));
        bool in_crystal = parts_waves(event, kind);
        if (!in_crystal) weigh(path, kind, event);
        if (HAS_CRYSTAL && in_crystal) {
            // The stronger of both waves that go on, if one does.
            CrystalEvent crystal = crystal_event(path, event);
            uint sent = strongest_lobe(crystal.shares[1] * vec4(1e-9, 1e-9, 1.0, 1.0));
            turn_crystal(path, event, crystal, sent, geometric);
            reflects = (sent & LOBE_ONWARD) == 0u;
        } else if (HAS_POLARISER && kind == KIND_POLARISER) {
            pass_polariser(path, crystal_at(thing.receiver));
            reflects = false;
        } else if (HAS_GRATING && kind == KIND_GRATING) {
            // The strongest order that leaves.
            GratingEvent grating = grating_event(path, event.frame.normal, hit, thing.weight_row);
            Path before = path;
            float strongest = 0.0;
            for (uint k = 0u; k < grating.grating.orders; ++k) {
                GratingOrder order = order_at(thing.weight_row, k);
                float share = order_shares(grating, order, k, before, before.band, true).y;
                if (!order_passes(grating, order, before).y || share <= strongest) continue;
                strongest = share;
                path = before;
                diffract_path(path, event, grating, order, geometric);
            }
            if (strongest <= 0.0) break;
            reflects = is_reflective(grating.grating);
        } else {
            if (HAS_DIELECTRIC && IS_GLASS(kind)) {
                reflects = event.boundary.changes
                    && (!event.refracted.exists
                        || (path.walk.reflections > 0u && !entering && !IS_THIN(event.boundary)));
                if (reflects && !entering) path.walk.reflections -= min(path.walk.reflections, 1u);
                if (!event.boundary.changes)
                    path.medium = event.boundary.behind;
                else if (!reflects)
                    refract_path(path, event);
            }
            if (reflects) reflect_path(path, event, geometric);
        }
        leave_surface(path, hit, reflects != entering);
    }
    paths[id] = end;
}
