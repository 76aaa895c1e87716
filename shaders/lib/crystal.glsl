// Uniaxial crystals: which waves meet at an interface, where their energy goes, and how much of it. Wave vectors are in
// units of the vacuum's. The ordinary wave's end on a sphere of radius n_o; the extraordinary wave's on an ellipsoid of
// half-axis n_o along the optic axis and n_e across it; energy flows along the surface's normal. An isotropic medium is
// a crystal of n_e = n_o whose axis is the interface's normal: ordinary is s then, and extraordinary p. [Born and Wolf,
// 15.3; amplitudes by the fields that are continuous]

struct Uniaxial {
    vec3 axis;  // unit
    vec2 n;  // n_o, n_e
};

// Squared sine of the angle between wave vector and axis below which both waves are one.
#define ALONG_AXIS 1e-10

// Both indices, or their derivatives, as half-axes of one kind of wave's surface.
vec2 of_kind(vec2 both, bool extraordinary) { return extraordinary ? both : both.xx; }

Uniaxial of_kind(Uniaxial m, bool extraordinary) { return Uniaxial(m.axis, of_kind(m.n, extraordinary)); }

// `by.x` times as long along the axis, `by.y` times across it.
vec3 stretched(Uniaxial m, vec2 by, vec3 v) { return by.y * v + (by.x - by.y) * dot(m.axis, v) * m.axis; }

// Wave vector of light whose energy goes along the unit vector `ray`. Here and below `m` is `of_kind`.
vec3 wave_of_ray(Uniaxial m, vec3 ray) {
    vec3 wave = stretched(m, m.n * m.n, ray);
    return wave * inversesqrt(dot(wave, ray));
}

// Its derivative. `slopes`: of the indices.
vec3 wave_column(Uniaxial m, vec2 slopes, vec3 ray, vec3 dray) {
    vec3 wave = stretched(m, m.n * m.n, ray), dmatrix = stretched(m, 2.0 * m.n * slopes, ray);
    float length2 = dot(wave, ray), dlength2 = 2.0 * dot(wave, dray) + dot(dmatrix, ray);
    return (stretched(m, m.n * m.n, dray) + dmatrix - 0.5 * dlength2 / length2 * wave) * inversesqrt(length2);
}

// Where the energy of a wave goes, of any length.
vec3 energy_of_wave(Uniaxial m, vec3 wave) { return stretched(m, 1.0 / (m.n * m.n), wave); }

// The part along `way` (unit, the normal on the side that it goes to) of the wave vector that shares the tangential
// part of `wave`, an incident wave of length `n`; `mirrored`: which is one of the same medium and kind. Complex: it is
// evanescent where it is not real.
vec2 forward_part(Uniaxial m, bool mirrored, vec3 wave, float n, vec3 way) {
    float incident = dot(wave, way), across = 1.0 / (m.n.y * m.n.y), ellipticity = 1.0 / (m.n.x * m.n.x) - across,
          of_way = dot(m.axis, way), of_tangential = dot(m.axis, wave - incident * way);
    float a = across + ellipticity * of_way * of_way, b = ellipticity * of_way * of_tangential,
          c = across * ((n - m.n.y) * (n + m.n.y) - incident * incident) + ellipticity * of_tangential * of_tangential;
    float own = a * incident + b, left = mirrored ? own * own : b * b - a * c, root = sqrt(max(abs(left), 1e-12));
    return (left > 0.0 ? vec2(root - b, 0.0) : vec2(-b, root)) / a;
}

// Derivatives of the ray that goes on with the wave vector `turned` = `wave` plus something along the normal, by those
// of the incident wave vector and of the normal.
vec3 turned_column(Uniaxial m, vec2 slopes, vec3 wave, vec3 dwave, vec3 turned, vec3 normal, vec3 dnormal) {
    vec3 energy = energy_of_wave(m, turned), dmatrix = stretched(m, -2.0 * slopes / (m.n * m.n * m.n), turned);
    vec3 dturned = dwave + dot(turned - wave, normal) * dnormal;
    dturned -= (0.5 * dot(turned, dmatrix) + dot(energy, dturned)) / dot(energy, normal) * normal;
    vec3 denergy = energy_of_wave(m, dturned) + dmatrix;
    float per_length = inversesqrt(dot(energy, energy));
    vec3 ray = energy * per_length;
    return (denergy - dot(ray, denergy) * ray) * per_length;
}

// The fields of a wave in the interface, complex: electric along the tangential part of the wave vector and along s,
// then magnetic along s and against that part, so that what carries energy forwards are the products of both halves. Of
// unit power where the wave carries energy away; else it is evanescent.
struct Wave {
    mat2x4 field;  // real, imaginary part
    bool passes;
};

vec2 times(vec2 a, vec2 b) { return vec2(a.x * b.x - a.y * b.y, a.x * b.y + a.y * b.x); }

vec2 conjugate(vec2 a) { return vec2(a.x, -a.y); }

Wave unit_wave(mat4x2 fields, bool passes) {
    mat2x4 field = transpose(fields);
    float size = passes ? 2.0 * abs(dot(field[0].xy, field[0].zw)) : dot(field[0], field[0]) + dot(field[1], field[1]);
    return Wave(inversesqrt(max(size, 1e-30)) * field, passes);
}

// The ordinary and the extraordinary wave that go forwards (`side` 1) or backwards (-1) with the tangential part of
// `wave`, which is in the interface's axes as the optic axis c is: the tangential part q, s and forwards; its length is
// `n`. With k = (q, 0, z) and z^2 = n_o^2 - q^2 of the ordinary wave, whose electric field is k x c as the other's
// magnetic one is, all fields are linear in z.
void waves(Uniaxial m, vec3 wave, float n, float side, out Wave ordinary, out Wave extraordinary) {
    vec3 c = m.axis, way = vec3(0.0, 0.0, side);
    float q = wave.x, n2 = m.n.x * m.n.x, ellipticity = 1.0 / n2 - 1.0 / (m.n.y * m.n.y);
    vec2 o = side * forward_part(of_kind(m, false), false, wave, n, way),
         e = side * forward_part(m, false, wave, n, way), across = c.x * o - vec2(q * c.z, 0.0);
    // How far the extraordinary wave is from the ordinary one: exact where they are almost the same.
    vec2 length2 = times(across, across) + vec2(n2 * c.y * c.y, 0.0),
         both =
             vec2(energy_of_wave(m, vec3(2.0 * q, 0.0, o.x + e.x)).z, energy_of_wave(m, vec3(0.0, 0.0, o.y + e.y)).z),
         step = ellipticity / max(dot(both, both), 1e-20) * times(length2, conjugate(both));
    if (o.y == 0.0 && length2.x < ALONG_AXIS * n2) {
        across = vec2(1.0, 0.0);
        c.y = 0.0;
        step = vec2(0.0);
    }
    vec2 aside = times(o, across), upright = vec2(n2 * c.y, 0.0);
    ordinary = unit_wave(mat4x2(-c.y * o, across, -upright, aside), o.y == 0.0);
    extraordinary = unit_wave(
        mat4x2(q * c.z * step - aside, -upright, -n2 * (across + c.x * step), -n2 * c.y * (o + step)), e.y == 0.0);
}

// Power that goes forwards by the interference of one wave with another.
vec2 power_between(mat2x4 a, mat2x4 b) {
    return vec2(dot(a[0], b[0].zwxy) + dot(a[1], b[1].zwxy), dot(a[0], b[1].zwxy) - dot(a[1], b[0].zwxy));
}

vec4 powers_between(Wave a, Wave b[2]) {
    return vec4(power_between(a.field, b[0].field), power_between(a.field, b[1].field));
}

// What of a coherency two waves carry away.
vec4 passing(Wave w[2]) {
    vec2 pass = vec2(w[0].passes, w[1].passes);
    return vec4(pass, pass.xx * pass.y);
}

// Powers of two waves, and real and imaginary part of the first's field times the conjugate of the second's.
vec4 coherency(vec2 first, vec2 second) {
    return vec4(dot(first, first), dot(second, second), times(first, conjugate(second)));
}

// What an interface makes of light: of power 1, as in `coherency` by ordinary and extraordinary wave. `before`,
// `behind`, `wave`, `n`: as of `waves`.
void cross_interface(
    Uniaxial before, Uniaxial behind, vec3 wave, float n, vec4 light, out vec4 reflected, out vec4 transmitted) {
    Wave onward[2], back[2], incident[2];
    vec4 goes_back[2], comes_in[2];
    // The fields behind, taken apart into waves before: what is reflected, and what comes in, of which an evanescent
    // wave has none.
    waves(behind, wave, n, 1.0, onward[0], onward[1]);
    waves(before, wave, n, -1.0, back[0], back[1]);
    for (int e = 0; e < 2; ++e) goes_back[e] = powers_between(back[e], onward);
    waves(before, wave, n, 1.0, incident[0], incident[1]);
    for (int e = 0; e < 2; ++e) comes_in[e] = incident[e].passes ? powers_between(incident[e], onward) : goes_back[e];
    vec2 determinant = times(comes_in[0].xy, comes_in[1].zw) - times(comes_in[0].zw, comes_in[1].xy),
         per = conjugate(determinant) / max(dot(determinant, determinant), 1e-30);
    // The light is two wholly polarised states that do not interfere.
    float root = sqrt(max(light.x, 1e-20));
    mat4x2 states = mat4x2(root, 0.0, light.z / root, -light.w / root, 0.0, 0.0,
        sqrt(max(light.y - dot(light.zw, light.zw) / (root * root), 0.0)), 0.0);
    reflected = transmitted = vec4(0.0);
    for (int k = 0; k < 2; ++k) {
        vec2 first = states[2 * k], second = states[2 * k + 1],
             o = times(per, times(comes_in[1].zw, first) - times(comes_in[0].zw, second)),
             e = times(per, times(comes_in[0].xy, second) - times(comes_in[1].xy, first));
        transmitted += coherency(o, e);
        reflected += coherency(times(goes_back[0].xy, o) + times(goes_back[0].zw, e),
            times(goes_back[1].xy, o) + times(goes_back[1].zw, e));
    }
    transmitted *= passing(onward);
    reflected *= passing(back);
}
