// Where the paths of a band's wavelengths diverge, its band is cut: each part then goes its own way. A band's middle
// decides which surface a path meets, and sees for all of it; so at every surface the rays at the band's ends are asked
// whether they meet the same.

// Cuts of the band of one path.
#define MAX_CUTS 4u
// Sweep, in sides of a sample's share of its pixel, below which nobody sees which colour went where.
#define MIN_CUT_SWEEP 0.5
// Halvings between the middle of a band and an end: a cut is told to 1/256 of the band.
#define CUT_HALVINGS 7
#define EDGE_HALVINGS 10
// Rays that a sample may trace to find out where its paths diverge: bounds what a sample costs.
#define MAX_ASKED 96
// Cosine of two normals, and distance (GPU units) from a plane, up to which two facets are one face.
#define SAME_FACE_COSINE 0.999999
#define SAME_FACE_DISTANCE 1e-5

// The border between cells of the emission table next to `at`: no light is lost in between.
float cell_border(float at) { return float(emission_cell(at)) / float(EMISSION_CELLS); }

bool may_cut_at(Path path, float at) { return min(at - path.band.x, path.band.z - at) > 0.5 / float(EMISSION_CELLS); }

// How much of what looks bright in the band lies below `at`.
float share_below(Path path, float at) {
    vec2 brightness = brightness_of(path.band);
    return clamp((cell_cdf[emission_cell(at)] - brightness.x) / max(brightness.y - brightness.x, 1e-9), 0.05, 0.95);
}

// Both parts of a cut band set out again from the path's last surface (`restrict_to`): `path` is one, the other
// waits. Of weak parts one is chosen by chance.
void cut_band(inout Path path, float at, uint pixel_key) {
    float below = share_below(path, at);
    bool both = path.walk.branch_weight * min(below, 1.0 - below) > CUT_THRESHOLD && stack_size < STACK;
    bool takes_low = true;
    if (!both)
        takes_low =
            unit_float(hash_combine(
                hash_combine(pixel_key, path.walk.key + (path.depth + path.walk.cuts) * 2654435769u), p.sample_index))
            < below;
    path.walk.cuts += 1u;
    Path whole = path;
    // The part that is put on the stack first, then the one that is followed.
    for (int part = both ? 0 : 1; part < 2; ++part) {
        bool low = part == 0 ? !takes_low : takes_low;
        float share = low ? below : 1.0 - below;
        path = whole;
        path.walk.key = hash_combine(whole.walk.key, part == 0 ? 6u : (takes_low ? 5u : 7u));
        if (both)
            path.walk.branch_weight *= share;
        else
            path.walk.inverse_pdf /= share;
        float lo = low ? whole.band.x : at, hi = low ? at : whole.band.z;
        restrict_to(path, vec3(lo, anchor_of(whole, lo, hi), hi));
        if (part == 0) push(path);
    }
}

// Whether the ray at the wavelength x meets what the path's own ray met. `ends`: the path ends there; colours that end
// elsewhere, or in nothing, then go along, for every lookup along the sweep finds out for itself; `same_hit` is made
// false by them.
bool follows_same_path(Path path, float x, bool met, bool ends, Hit hit, inout bool same_hit, out Hit found) {
    asked += 1;
    vec3 position, direction;
    ray_at(path, x, position, direction);
    bool meets = intersect_closest(position, direction, FAR_DISTANCE, path.origin, found);
    bool same = meets == met;
    if (same && met && found.primitive != hit.primitive) {
        vec3 apart = position + found.distance * direction - (path.position + hit.distance * path.direction);
        same = found.object == hit.object && dot(found.normal_g, hit.normal_g) > SAME_FACE_COSINE
            && abs(dot(apart, hit.normal_g)) < SAME_FACE_DISTANCE;
        same_hit = false;
    }
    same_hit = same_hit && same;
    uint kind = meets ? object_at(found.object).kind : NONE;
    return same || (ends && !is_specular(kind));
}

// By how much a ray meets the plane of one hit sooner than that of another.
float sooner(vec3 position, vec3 direction, vec3 normal_a, vec3 on_a, vec3 normal_b, vec3 on_b) {
    return dot(normal_b, on_b - position) / dot(normal_b, direction)
        - dot(normal_a, on_a - position) / dot(normal_a, direction);
}

// Asks both ends; where the way of one of them parts from the middle's, the wavelength where it does, else a negative
// one. `same_hit`: whether all of the band ends on the facet, or in the nothing, that its middle ends in.
float where_paths_diverge(Path path, bool met, bool ends, Hit hit, out bool same_hit) {
    same_hit = true;
    bool parts = false, bisects = true;
    // From the middle to the end that parts; where both do, the other's cut comes next.
    float along = path.band.y, parted = path.band.x;
    Hit other = hit;
    // One place asks for all, for whatever traces rays is long: both ends first, then between the middle and one of
    // them.
    for (int i = 0; i < 2 + CUT_HALVINGS && bisects; ++i) {
        COUNT_ROUNDS(8);
        float x = i == 0 ? path.band.x : (i == 1 ? path.band.z : 0.5 * (along + parted));
        bool here = true;
        Hit found;
        bool goes = follows_same_path(path, x, met, ends, hit, here, found);
        if (i < 2) {
            same_hit = same_hit && here;
            if (!goes && !parts) {
                parted = x;
                other = found;
            }
            parts = parts || !goes;
        } else {
            along = goes ? x : along;
            parted = goes ? parted : x;
        }
        if (i == 1) {
            bisects = parts && path.walk.planar_so_far != 0u && path.walk.cuts < MAX_CUTS;
            if (bisects && met && other.object == hit.object) {
                // Two facets of one solid part in the edge where they meet: where both are as far.
                vec3 position, direction;
                ray_at(path, parted, position, direction);
                vec3 on_a = path.position + hit.distance * path.direction, on_b = position + other.distance * direction;
                float before = sooner(path.position, path.direction, hit.normal_g, on_a, other.normal_g, on_b);
                bool by_edge = before * sooner(position, direction, hit.normal_g, on_a, other.normal_g, on_b) < 0.0;
                for (int k = 0; k < EDGE_HALVINGS && by_edge; ++k) {
                    float x_edge = 0.5 * (along + parted);
                    ray_at(path, x_edge, position, direction);
                    bool same_side =
                        before * sooner(position, direction, hit.normal_g, on_a, other.normal_g, on_b) > 0.0;
                    along = same_side ? x_edge : along;
                    parted = same_side ? parted : x_edge;
                }
                bisects = !by_edge;
            }
        }
    }
    float at = cell_border(0.5 * (along + parted));
    return parts && path.walk.planar_so_far != 0u && path.walk.cuts < MAX_CUTS && may_cut_at(path, at) ? at : -1.0;
}
