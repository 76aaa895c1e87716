// What hangs over a place on a receiver, found by a ray straight up.
#include "lib/receiver_light.glsl"

// Whether something hangs over it nearer than `reach`, or holds it: solids may be sunk into a floor. A room that holds
// other things does not count. `origin`: of the side of the receiver, whose unit normal is `normal`.
bool is_covered(sampler2D map, RayOrigin origin, vec3 position, vec3 normal, float reach) {
    Hit hit;
    bool covered = false;
    if (intersect_closest(position, normal, FAR_DISTANCE, origin, hit) && hit.object != origin.object) {
        Object over = object_at(hit.object);
        bool holds = dot(hit.normal_g, normal) > 0.0 && over.medium != NONE && over.kind < KIND_GRATING;
        if (holds && over.kind == KIND_DIFFUSE) holds = receiver_record(map, over.receiver).w < 2.0;
        covered = holds || hit.distance < reach;
    }
    return covered;
}
