// What one step of the light pass reads and writes: rays, photons, outcomes.
#ifndef TRACE_RECORDS_GLSL
#define TRACE_RECORDS_GLSL

layout(std140, binding = BIND_PARAMETERS) uniform Parameters { TraceParameters p; };
layout(std430, binding = BIND_RAYS_IN) readonly restrict buffer RaysIn { uvec4 rays_in[]; };
layout(std430, binding = BIND_RAYS_OUT) writeonly restrict buffer RaysOut { uvec4 rays_out[]; };
layout(std430, binding = BIND_OUTCOMES) writeonly restrict buffer Outcomes { uvec4 outcomes[]; };
layout(std430, binding = BIND_PHOTON_SLOTS) writeonly restrict buffer PhotonSlots { uvec4 photon_slots[]; };
layout(std430, binding = BIND_INDICES) readonly restrict buffer Indices { uint indices[]; };
layout(std430, binding = BIND_STATE) readonly restrict buffer StateBlock { QueueState state; };

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

#ifdef FOOTPRINTS
#define SPATIAL 2
#else
#define SPATIAL 0
#endif
// Columns after the spectral ones: how far microfacets of rough surfaces spread light.
#define LOBE (SPATIAL + SPECTRAL_GROUPS)
// The last ones: how far an extended light spreads what it throws.
#define LAMP (COLUMNS - 2)

RayRecord load_ray(uint slot)
{
    uvec4 texels[RayRecord_TEXELS];
    for (uint i = 0u; i < uint(RayRecord_TEXELS); ++i) texels[i] = rays_in[slot * uint(RayRecord_TEXELS) + i];
    return RayRecord_of(texels);
}

void store_ray(uint slot, RayRecord ray)
{
    uvec4 texels[RayRecord_TEXELS];
    to_texels(ray, texels);
    for (uint i = 0u; i < uint(RayRecord_TEXELS); ++i) rays_out[slot * uint(RayRecord_TEXELS) + i] = texels[i];
}

void store_photon(uint slot, PhotonRecord photon)
{
    uvec4 texels[PhotonRecord_TEXELS];
    to_texels(photon, texels);
    for (uint i = 0u; i < uint(PhotonRecord_TEXELS); ++i) photon_slots[slot * uint(PhotonRecord_TEXELS) + i] = texels[i];
}

#ifdef FLIGHTS
layout(std430, binding = BIND_FLIGHTS) writeonly restrict buffer Flights { uvec4 flights[]; };

void store_flight(uint slot, Flight flight)
{
    uvec4 texels[Flight_TEXELS];
    to_texels(flight, texels);
    if ((slot + 1u) * uint(Flight_TEXELS) > uint(flights.length())) return;  // told by their number
    for (uint i = 0u; i < uint(Flight_TEXELS); ++i) flights[slot * uint(Flight_TEXELS) + i] = texels[i];
}
#endif

void store_outcome(uint slot, Outcome outcome)
{
    uvec4 texels[Outcome_TEXELS];
    to_texels(outcome, texels);
    outcomes[slot] = texels[0];
}

MediumStack medium_stack(RayRecord ray)
{
    return MediumStack(ray.inside_mask, ray.inside_object);
}

// Lowest wavelength of a ray's band, its own, the highest one: as x.
vec3 band_of(RayRecord ray)
{
    return vec3(ray.x_lo, ray.x_anchor, ray.x_hi);
}

// Values of a spectral table at the three places of a band.
vec3 spectral_row(uint row, vec3 x)
{
    return vec3(spectral_row(row, x.x), spectral_row(row, x.y), spectral_row(row, x.z));
}

#endif
