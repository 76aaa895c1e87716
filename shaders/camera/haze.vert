// Quads about beams of light in haze: six corners each, as wide at either end as the beam is there.
#include "lib/haze.glsl"

layout(std140, binding = BIND_PARAMETERS) uniform Parameters { CameraParameters p; };
layout(std140, binding = BIND_HAZE) uniform HazeBlock { HazeParameters haze; };
layout(std430, binding = BIND_FLIGHTS) readonly restrict buffer Flights { uvec4 flights[]; };
layout(std430, binding = BIND_HAZE_COLOURS) readonly restrict buffer Colours { vec4 colours[]; };

flat out vec4 beam_start;  // seen from the camera (orthographic: from its film's middle); w: length
flat out vec4 beam_direction;  // w: way before it through haze
flat out vec3 beam_first;  // unit, across the beam
flat out vec3 spread[3];  // covariance across the beam (xx, xy, yy) by powers of the way along it
flat out vec4 beam_flux[TARGETS];

Flight flight_at(uint index) {
    uvec4 texels[Flight_TEXELS];
    for (uint i = 0u; i < uint(Flight_TEXELS); ++i) texels[i] = flights[index * uint(Flight_TEXELS) + i];
    return Flight_of(texels);
}

// Adds what a column, by which the beam moves and turns, spreads it by.
void add_column(vec3 moves, vec3 turns, float deviation, vec3 first, vec3 second, inout vec3 by_power[3]) {
    vec2 m = deviation * vec2(dot(moves, first), dot(moves, second)),
         t = deviation * vec2(dot(turns, first), dot(turns, second));
    by_power[0] += vec3(m.x * m.x, m.x * m.y, m.y * m.y);
    by_power[1] += vec3(2.0 * m.x * t.x, m.x * t.y + m.y * t.x, 2.0 * m.y * t.y);
    by_power[2] += vec3(t.x * t.x, t.x * t.y, t.y * t.y);
}

void main() {
    Flight flight = flight_at(uint(gl_VertexID) / 6u);
    uint corner = uint(gl_VertexID) % 6u;
    bool at_end = corner == 1u || corner == 3u || corner == 4u, is_left = corner == 2u || corner == 4u || corner == 5u;
    vec3 start = flight.position - p.position, d = flight.direction;

    vec3 first = normalize(cross(d, abs(d.x) < 0.7 ? vec3(1.0, 0.0, 0.0) : vec3(0.0, 1.0, 0.0))),
         second = cross(d, first);
    vec3 by_power[3] = vec3[3](vec3(0.0), vec3(0.0), vec3(0.0));
    add_column(flight.dposition_ds, flight.ddirection_ds, haze.smoothing, first, second, by_power);
    add_column(flight.dposition_dt, flight.ddirection_dt, haze.smoothing, first, second, by_power);
    add_column(flight.dposition_dband, flight.ddirection_dband, haze.band_blur, first, second, by_power);

    beam_start = vec4(start, flight.distance);
    beam_direction = vec4(d, flight.flown);
    beam_first = first;
    for (int i = 0; i < 3; ++i) spread[i] = by_power[i];
    for (int t = 0; t < TARGETS; ++t)
        beam_flux[t] = flight.flux_w * colours[flight.light_and_source * uint(TARGETS) + uint(t)];

    // All points of the beam's axis have one direction across it and the view.
    vec3 normal = cross(d, p.orthographic != 0u ? p.forward : start);
    vec3 across = dot(normal, normal) > 0.0 ? normalize(normal) : first;
    float along = at_end ? flight.distance : 0.0;
    vec3 place = start + along * d;
    vec2 u = vec2(dot(across, first), dot(across, second));
    vec3 covariance = by_power[0] + along * (by_power[1] + along * by_power[2]);
    float depth = dot(place, p.forward);
    float pixel = haze.pixel * (p.orthographic != 0u ? 1.0 : length(place));
    float deviation = sqrt(
        max(u.x * u.x * covariance.x + 2.0 * u.x * u.y * covariance.y + u.y * u.y * covariance.z, 0.0) + pixel * pixel);
    place += (is_left ? -1.05 : 1.05) * BLUR_REACH * deviation * across;
    depth = dot(place, p.forward);
    vec2 seen = vec2(
        dot(place, p.half_right) / dot(p.half_right, p.half_right), dot(place, p.half_up) / dot(p.half_up, p.half_up));
    // Only what lies behind the camera is cut off. Row 0 is the picture's top.
    gl_Position = p.orthographic != 0u ? vec4(seen.x, -seen.y, 0.0, 1.0) : vec4(seen.x, -seen.y, depth - 2e-4, depth);
}
