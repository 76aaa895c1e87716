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

// Electric and magnetic fields of the ordinary and the extraordinary wave in the interface: along the tangential part
// of the wave vector and along s, the magnetic ones turned there by a right angle. They are complex: x + iy is the
// matrix mat2(x, y, -y, x), so that products are products and conjugates are transposed.
struct Waves {
    mat4 electric, magnetic;  // two columns a wave
    vec2 pass;  // 1: a wave carries energy away, of unit power then; 0: it is evanescent
};

// Those that go forwards (`side` 1) or backwards (-1) with the tangential part of `wave`, which is in the interface's
// axes as the optic axis is: the tangential part, s and forwards; its length is `n`.
Waves waves(Uniaxial m, vec3 wave, float n, float side) {
    Waves found;
    bool along_axis = false;
    float tangential = wave.x, ellipticity = 1.0 / (m.n.x * m.n.x) - 1.0 / (m.n.y * m.n.y);
    // Wave vector times axis: across both.
    mat2 forward = mat2(0.0), w_t = mat2(0.0), w_s = mat2(-tangential * m.axis.z), w_n = mat2(tangential * m.axis.y),
         length2;
    for (int e = 0; e < 2; ++e) {
        vec2 part = side * forward_part(of_kind(m, e == 1), false, wave, n, vec3(0.0, 0.0, side));
        mat2 step = mat2(part, -part.y, part.x) - forward;
        // How far the extraordinary wave is from the ordinary one: exact where they are almost the same.
        if (e == 1 && part.y == 0.0 && forward[0].y == 0.0)
            step = mat2(
                ellipticity * length2[0].x / energy_of_wave(m, vec3(2.0 * tangential, 0.0, part.x + forward[0].x)).z);
        forward += step;
        w_t -= m.axis.y * step;
        w_s += m.axis.x * step;
        length2 = w_t * w_t + w_s * w_s + w_n * w_n;
        along_axis = along_axis || (part.y == 0.0 && length2[0].x < ALONG_AXIS * m.n.x * m.n.x);
        if (along_axis) {
            w_t = w_n = length2 = mat2(0.0);
            w_s = mat2(1.0);
        }
        mat2 e_t = w_t, e_s = w_s, h_t = -forward * w_s, h_s = forward * w_t - tangential * w_n;
        if (e == 1) {
            mat2 square = forward * forward + mat2(tangential * tangential);
            e_t = h_t + ellipticity * tangential * (mat2(tangential * m.axis.x) + m.axis.z * forward) * length2;
            e_s = h_s;
            h_t = -square * w_t;
            h_s = -square * w_s;
        }
        vec4 electric = vec4(e_t[0], e_s[0]), magnetic = vec4(h_s[0], -h_t[0]);
        found.pass[e] = float(part.y == 0.0);
        float size =
            part.y == 0.0 ? 2.0 * abs(dot(electric, magnetic)) : dot(electric, electric) + dot(magnetic, magnetic);
        mat4 unit =
            inversesqrt(max(size, 1e-30)) * mat4(electric, vec4(e_t[1], e_s[1]), magnetic, vec4(h_s[1], -h_t[1]));
        found.electric[2 * e] = unit[0];
        found.electric[2 * e + 1] = unit[1];
        found.magnetic[2 * e] = unit[2];
        found.magnetic[2 * e + 1] = unit[3];
    }
    return found;
}

// Power that goes forwards by the interference of one's waves with the other's.
mat4 power_between(Waves a, Waves b) { return transpose(a.electric) * b.magnetic + transpose(a.magnetic) * b.electric; }

// The inverse of a complex matrix: by its own determinant, which rounding leaves more of than of the real matrix's.
mat4 complex_inverse(mat4 m) {
    mat2 a = mat2(m[0].xy, m[1].xy), b = mat2(m[2].xy, m[3].xy), c = mat2(m[0].zw, m[1].zw), d = mat2(m[2].zw, m[3].zw),
         determinants = a * d - b * c, per = transpose(determinants) / max(determinant(determinants), 1e-30);
    return mat4(vec4(per * d[0], -per * c[0]), vec4(per * d[1], -per * c[1]), vec4(-per * b[0], per * a[0]),
        vec4(-per * b[1], per * a[1]));
}

// What two waves of such amplitudes make of coherent light: its powers in both waves, and real and imaginary part of
// the first's field times the conjugate of the second's.
vec4 coherency_after(vec4 light, mat4 amplitudes, vec2 pass) {
    mat4 after = amplitudes
        * mat4(light.x, 0.0, light.z, -light.w, 0.0, light.x, light.w, light.z, light.z, light.w, light.y, 0.0,
            -light.w, light.z, 0.0, light.y)
        * transpose(amplitudes);
    return vec4(after[0].x, after[2].z, after[2].xy) * vec4(pass, pass.xx * pass.y);
}

// What an interface makes of light: of power 1, as in `coherency_after` by ordinary and extraordinary wave. `before`,
// `behind`, `wave`, `n`: as of `waves`.
void cross_interface(
    Uniaxial before, Uniaxial behind, vec3 wave, float n, vec4 light, out vec4 reflected, out vec4 transmitted) {
    Waves incident = waves(before, wave, n, 1.0), back = waves(before, wave, n, -1.0),
          onward = waves(behind, wave, n, 1.0);
    // The fields behind, taken apart into waves before: what comes in, of which an evanescent wave has none.
    for (int c = 0; c < 4; ++c) {
        bool passes = incident.pass[c / 2] > 0.0;
        incident.electric[c] = passes ? incident.electric[c] : back.electric[c];
        incident.magnetic[c] = passes ? incident.magnetic[c] : back.magnetic[c];
    }
    mat4 through = complex_inverse(power_between(incident, onward));
    reflected = coherency_after(light, -power_between(back, onward) * through, back.pass);
    transmitted = coherency_after(light, through, onward.pass);
}
