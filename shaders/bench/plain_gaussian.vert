// The yardstick of `spectrasplat.bench.splat_speed`: one colourless Gaussian a photon, drawn as plainly as can be.
layout(location = 0) uniform vec2 atlas_size;
layout(std430, binding = 0) readonly buffer Photons { PhotonRecord photons[]; };
noperspective out vec2 at;
flat out float amplitude;

void main() {
    vec2 corner = vec2(float(gl_VertexID & 1), float((gl_VertexID >> 1) & 1)) * 2.0 - 1.0;
    uint i = uint(gl_VertexID) >> 2;
    vec2 s = photons[i].dposition_ds.xy;
    vec2 t = photons[i].dposition_dt.xy;
    vec2 position = photons[i].position.xy + 3.0 * (corner.x * s + corner.y * t);
    at = 2.1213203 * corner;
    amplitude = photons[i].flux_w / (6.2831853 * abs(s.x * t.y - s.y * t.x));
    gl_Position = vec4(position / atlas_size * 2.0 - 1.0, 0.0, 1.0);
}
