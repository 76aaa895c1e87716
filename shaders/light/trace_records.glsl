// What one step of the light pass reads and writes: rays, photons, outcomes.

layout(std140, binding = BIND_PARAMETERS) uniform Parameters { TraceParameters of_lights[LIGHTS]; };
uint of_light = 0u;  // whose ray is followed: its place among these

// `Outcome.what`: where flux went …
#define DEPOSITED (0u << 16)
#define ABSORBED (1u << 16)
#define ESCAPED (2u << 16)
#define DIRECT (3u << 16)
#define LOST_DEPTH (4u << 16)
#define LOST_NUMERIC (5u << 16)
#define LEFT_TO_BEAMS (6u << 16)
// … fall-backs …
#define FELL_FOOTPRINT (1u << 8)
#define FELL_NORMAL (1u << 9)
#define FELL_BAND (1u << 10)
// … and what was stored.
#define LEFT_FIRST 1u
#define LEFT_SECOND 2u
#define LEFT_PHOTON 4u
// In a pool of rays: nothing happened yet.
#define WAITS 16u

#define SPATIAL (2 * FOOTPRINTS)
#define PATH_COLUMNS COLUMNS
// Columns after the spectral ones: how far microfacets of ground surfaces spread light.
#define LOBE (SPATIAL + SPECTRAL_GROUPS)
#define LOBE_WIDTH 1.0
// The last ones: how far the light of an extended lamp's other points lands from this one's.
#define LAMP (COLUMNS - 2)
#define WIDENED_BY_LOBES LOBE_COLUMNS
#define HAS_NORMAL_COLUMNS (NORMAL_DERIVATIVES || LOBE_COLUMNS)

// What a photon's path carries besides is in its record (`ray_record` in app/gpu/records.py); of the flags there,
// FLAG_FOOTPRINT_DROPPED and FLAG_OFF_LATTICE.
#define Walk RayRecord
#include "path/event.glsl"

#define p of_lights[of_light]

#ifdef RAY_POOL
#include "light/trace_pool.glsl"
#else
layout(std430, binding = BIND_RAYS_IN) readonly restrict buffer RaysIn { uvec4 rays_in[]; };
layout(std430, binding = BIND_RAYS_OUT) writeonly restrict buffer RaysOut { uvec4 rays_out[]; };
layout(std430, binding = BIND_OUTCOMES) writeonly restrict buffer Outcomes { uvec4 outcomes[]; };
layout(std430, binding = BIND_PHOTON_SLOTS) writeonly restrict buffer PhotonSlots { uvec4 photon_slots[]; };
layout(std430, binding = BIND_INDICES) readonly restrict buffer Indices { uint indices[]; };
layout(std430, binding = BIND_STATE) readonly restrict buffer StateBlock { QueueState state; };

#define PHOTON_STRIDE PhotonRecord_TEXELS

// Where a ray's children go: two slots of its own.
uint first_place(uint slot, bool both, bool stays) { return 2u * slot; }
uint second_place(uint slot) { return 2u * slot + 1u; }
uint most_depth() { return p.max_depth; }
#endif

// Bits of a record's flags from which on the order of a grating, or the lobe of a crystal, stands that is to be sent on
// next.
#define ORDER_BIT 8

#define STORE_RAY(at, texel) rays_out[at] = texel
#define STORE_PHOTON(at, texel) photon_slots[at] = texel

Path load_path(uint slot) {
    uvec4 texels[RayRecord_TEXELS];
    for (uint i = 0u; i < uint(RayRecord_TEXELS); ++i) texels[i] = rays_in[slot * uint(RayRecord_TEXELS) + i];
    RayRecord ray = RayRecord_of(texels);
    if (LIGHTS > 1u) of_light = (ray.light_and_source & 0xffu) % LIGHTS;
    Path path;
    path.walk = ray;
    path.walk.flags &= FLAG_FOOTPRINT_DROPPED | (LINE_WIDTHS ? FLAG_OFF_LATTICE : 0u);
    path.position = ray.position;
    path.direction = ray.direction;
    path.medium = MediumStack(ray.inside_mask, ray.inside_object);
    path.origin =
        RayOrigin(ray.last_primitive, ray.last_object, uint((ray.flags & FLAG_INSIDE) != 0u), ray.inside_mask);
    path.band = vec3(ray.x_lo, ray.x_anchor, ray.x_hi);
    path.throughput = ray.throughput;
    path.depth = ray.depth;
    path.restricted = 1u;
    path.recut = uint((ray.flags & FLAG_BAND_FINAL) != 0u);
    if (COLUMNS > 0) {
        for (int c = 0; c < COLUMNS; ++c) {
            path.dposition[c] = ray.dposition[c].xyz;
            path.ddirection[c] = ray.ddirection[c].xyz;
        }
    }
    if (HAS_GRATING || HAS_CRYSTAL) path.order = ray.flags >> ORDER_BIT;
    if (HAS_CRYSTAL) path.extraordinary = uint((ray.flags & FLAG_EXTRAORDINARY) != 0u);
    if (POLARISED)
        path.polarisation =
            Polarisation(vec3(ray.axis_x, ray.axis_y, ray.axis_z), ray.stokes_q, ray.stokes_u, ray.stokes_v);
    return path;
}

void store_path(uint slot, Path path) {
    RayRecord ray = path.walk;
    ray.position = path.position;
    ray.direction = path.direction;
    ray.inside_mask = path.medium.mask;
    ray.inside_object = path.medium.object;
    ray.last_primitive = path.origin.primitive;
    ray.last_object = path.origin.object;
    ray.x_lo = path.band.x;
    ray.x_anchor = path.band.y;
    ray.x_hi = path.band.z;
    ray.throughput = path.throughput;
    ray.depth = path.depth;
    ray.flags |= (path.origin.inside != 0u ? FLAG_INSIDE : 0u) | (path.recut != 0u ? FLAG_BAND_FINAL : 0u);
    if (COLUMNS > 0) {
        for (int c = 0; c < COLUMNS; ++c) {
            ray.dposition[c].xyz = path.dposition[c];
            ray.ddirection[c].xyz = path.ddirection[c];
        }
    }
    if (HAS_GRATING || HAS_CRYSTAL) ray.flags |= path.order << ORDER_BIT;
    if (HAS_CRYSTAL) ray.flags |= path.extraordinary * FLAG_EXTRAORDINARY;
    if (POLARISED) {
        ray.axis_x = path.polarisation.axis.x;
        ray.axis_y = path.polarisation.axis.y;
        ray.axis_z = path.polarisation.axis.z;
        ray.stokes_q = path.polarisation.q;
        ray.stokes_u = path.polarisation.u;
        ray.stokes_v = path.polarisation.v;
    }
    RayRecord_TO(STORE_RAY, slot * uint(RayRecord_TEXELS), ray)
}

void store_photon(uint slot, PhotonRecord photon) { PhotonRecord_TO(STORE_PHOTON, slot * uint(PHOTON_STRIDE), photon); }

layout(std430, binding = BIND_FLIGHTS) writeonly restrict buffer Flights { uvec4 flights[]; };

void store_flight(uint slot, Flight flight) {
    uvec4 texels[Flight_TEXELS];
    to_texels(flight, texels);
    if ((slot + 1u) * uint(Flight_TEXELS) > uint(flights.length())) return;  // told by their number
    for (uint i = 0u; i < uint(Flight_TEXELS); ++i) flights[slot * uint(Flight_TEXELS) + i] = texels[i];
}

#ifndef RAY_POOL
void store_outcome(uint slot, Outcome outcome) {
    uvec4 texels[Outcome_TEXELS];
    to_texels(outcome, texels);
    outcomes[slot] = texels[0];
}
#endif

// Values of a spectral table at the three places of a band.
vec3 spectral_row(uint row, vec3 x) {
    return vec3(spectral_row(row, x.x), spectral_row(row, x.y), spectral_row(row, x.z));
}
