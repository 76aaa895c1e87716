// Uniaxial crystals: which waves meet at an interface, where their energy goes, and how much of it. Wave vectors are in
// units of the vacuum's. The ordinary wave's end on a sphere of radius n_o; the extraordinary wave's on an ellipsoid of
// half-axis n_o along the optic axis and n_e across it; energy flows along the surface's normal. An isotropic medium is
// a crystal of n_e = n_o whose axis is the interface's normal: ordinary is s then, and extraordinary p. [Born and Wolf,
// 15.3; amplitudes by the fields that are continuous]

struct Uniaxial {
    vec3 axis;  // unit
    float n_o, n_e;
};

// Squared sine of the angle between wave vector and axis below which both waves are one.
#define ALONG_AXIS 1e-10

// The inverse of the ellipsoid's matrix, and that matrix.
vec3 of_energy(Uniaxial m, vec3 v) {
    float across = m.n_e * m.n_e;
    return across * v + (m.n_o * m.n_o - across) * dot(m.axis, v) * m.axis;
}

vec3 of_wave(Uniaxial m, vec3 v) {
    float across = 1.0 / (m.n_e * m.n_e);
    return across * v + (1.0 / (m.n_o * m.n_o) - across) * dot(m.axis, v) * m.axis;
}

// Wave vector of light whose energy goes along the unit vector `ray`.
vec3 wave_of_ray(Uniaxial m, bool extraordinary, vec3 ray) {
    vec3 wave = of_energy(m, ray);
    return extraordinary ? wave * inversesqrt(dot(wave, ray)) : m.n_o * ray;
}

// Its derivative. `slopes`: of n_o and n_e.
vec3 wave_column(Uniaxial m, vec2 slopes, bool extraordinary, vec3 ray, vec3 dray) {
    if (!extraordinary) return m.n_o * dray + slopes.x * ray;
    float along = dot(m.axis, ray), across = 2.0 * m.n_e * slopes.y;
    vec3 wave = of_energy(m, ray), dmatrix = across * ray + (2.0 * m.n_o * slopes.x - across) * along * m.axis;
    float length2 = dot(wave, ray), dlength2 = 2.0 * dot(wave, dray) + dot(dmatrix, ray);
    return (of_energy(m, dray) + dmatrix - 0.5 * dlength2 / length2 * wave) * inversesqrt(length2);
}

// Where the energy of a wave goes, of any length.
vec3 energy_of_wave(Uniaxial m, bool extraordinary, vec3 wave) { return extraordinary ? of_wave(m, wave) : wave; }

// The part along `way` (unit, the normal on the side that it goes to) of the wave vector that shares the tangential
// part of `wave`, an incident wave of length `n`; `mirrored`: which is one of the same medium and kind. False: it is
// evanescent.
bool normal_part(Uniaxial m, bool extraordinary, bool mirrored, vec3 wave, float n, vec3 way, out float part) {
    float incident = dot(wave, way);
    if (!extraordinary) {
        float left = (m.n_o - n) * (m.n_o + n) + incident * incident;
        part = sqrt(max(left, 1e-12));
        return left > 0.0;
    }
    vec3 tangential = wave - incident * way, turned = of_wave(m, way);
    float a = dot(way, turned), b = dot(tangential, turned), c = dot(tangential, of_wave(m, tangential)) - 1.0;
    float left = mirrored ? dot(wave, turned) * dot(wave, turned) : b * b - a * c;
    part = (sqrt(max(left, 1e-12)) - b) / a;
    return left > 0.0;
}

// Derivatives of the ray that goes on with the wave vector `turned` = `wave` plus something along the normal, by those
// of the incident wave vector and of the normal.
vec3 turned_column(
    Uniaxial m, vec2 slopes, bool extraordinary, vec3 wave, vec3 dwave, vec3 turned, vec3 normal, vec3 dnormal) {
    vec3 energy = energy_of_wave(m, extraordinary, turned), dmatrix = vec3(0.0);
    float surface = m.n_o * slopes.x;
    if (extraordinary) {
        float along = dot(m.axis, turned), across = -2.0 * slopes.y / (m.n_e * m.n_e * m.n_e);
        dmatrix = across * turned + (-2.0 * slopes.x / (m.n_o * m.n_o * m.n_o) - across) * along * m.axis;
        surface = -0.5 * dot(turned, dmatrix);
    }
    float added = dot(turned - wave, normal);
    vec3 dturned = dwave + added * dnormal;
    dturned += (surface - dot(energy, dturned)) / dot(energy, normal) * normal;
    vec3 denergy = energy_of_wave(m, extraordinary, dturned) + dmatrix;
    float per_length = inversesqrt(dot(energy, energy));
    vec3 ray = energy * per_length;
    return (denergy - dot(ray, denergy) * ray) * per_length;
}

// -- amplitudes ------------------------------------------------------------------------------------------------------

vec2 times(vec2 a, vec2 b) { return vec2(a.x * b.x - a.y * b.y, a.x * b.y + a.y * b.x); }

vec2 conjugate(vec2 a) { return vec2(a.x, -a.y); }

// Electric and magnetic field of a wave in the interface, complex: along the tangential part of the wave vector, and
// along s.
struct Tangential {
    vec4 real, imaginary;  // electric, magnetic
    bool passes;  // it carries energy away: of unit power then; else it is evanescent
};

struct WavePair {
    Tangential ordinary, extraordinary;
};

// Power that goes forwards by the interference of two waves.
vec2 power_between(Tangential a, Tangential b) {
    vec4 real = vec4(a.real.w, -a.real.z, -a.real.y, a.real.x),
         imaginary = vec4(a.imaginary.w, -a.imaginary.z, -a.imaginary.y, a.imaginary.x);
    return vec2(dot(real, b.real) + dot(imaginary, b.imaginary), dot(real, b.imaginary) - dot(imaginary, b.real));
}

// From a complex vector `w` across wave and axis, whose parts are along the tangential part of the wave vector, s and
// forwards: electric field, and the wave vector's product with it.
Tangential unit_wave(
    vec2 w[3], float tangential, vec2 forward, vec2 along, float ellipticity, bool extraordinary, bool passes) {
    vec2 product_t = -times(forward, w[1]), product_s = times(forward, w[0]) - tangential * w[2];
    vec2 e_t = w[0], e_s = w[1], h_t = product_t, h_s = product_s;
    if (extraordinary) {
        vec2 length2 = times(w[0], w[0]) + times(w[1], w[1]) + times(w[2], w[2]);
        vec2 square = times(forward, forward) + vec2(tangential * tangential, 0.0);
        e_t = product_t + ellipticity * tangential * times(along, length2);
        e_s = product_s;
        h_t = -times(square, w[0]);
        h_s = -times(square, w[1]);
    }
    Tangential wave = Tangential(vec4(e_t.x, e_s.x, h_t.x, h_s.x), vec4(e_t.y, e_s.y, h_t.y, h_s.y), passes);
    float size =
        passes ? abs(power_between(wave, wave).x) : dot(wave.real, wave.real) + dot(wave.imaginary, wave.imaginary);
    float per_size = inversesqrt(max(size, 1e-30));
    wave.real *= per_size;
    wave.imaginary *= per_size;
    return wave;
}

// Both waves that go forwards (`side` 1) or backwards (-1) with a tangential part of their wave vectors. The axis is
// along that, s and forwards; `left`: squared forward part of the ordinary one.
WavePair waves(Uniaxial m, float tangential, float left, float side) {
    vec3 axis = m.axis;
    float across = 1.0 / (m.n_e * m.n_e), ellipticity = 1.0 / (m.n_o * m.n_o) - across;
    float a = across + ellipticity * axis.z * axis.z, b = ellipticity * tangential * axis.x * axis.z;
    vec2 forward = side * (left > 0.0 ? vec2(sqrt(left), 0.0) : vec2(0.0, sqrt(-left)));
    vec2 w[3] =
        vec2[](-axis.y * forward, axis.x * forward - vec2(tangential * axis.z, 0.0), vec2(tangential * axis.y, 0.0));
    vec2 w_e[3], forward_e;
    bool passes_e;
    if (left > 0.0) {
        float length2 = w[0].x * w[0].x + w[1].x * w[1].x + w[2].x * w[2].x;
        if (length2 < ALONG_AXIS * m.n_o * m.n_o) {
            w[0] = w[2] = vec2(0.0);
            w[1] = vec2(sqrt(ALONG_AXIS) * m.n_o, 0.0);
            length2 = 0.0;
        }
        // How far the extraordinary wave is from the ordinary one: exact where they are almost the same.
        b += a * forward.x;
        float c = -length2 * ellipticity, root2 = b * b - a * c, root = side * sqrt(abs(root2));
        passes_e = root2 > 0.0;
        vec2 apart = vec2(side * b > 0.0 ? -c / (b + root) : (root - b) / a, 0.0);
        if (!passes_e) apart = vec2(-b, root) / a;
        forward_e = forward + apart;
        w_e = vec2[](w[0] - axis.y * apart, w[1] + axis.x * apart, w[2]);
    } else {
        float c = tangential * tangential * (across + ellipticity * axis.x * axis.x) - 1.0;
        float root2 = b * b - a * c, root = side * sqrt(abs(root2));
        passes_e = root2 > 0.0;
        forward_e = passes_e ? vec2((root - b) / a, 0.0) : vec2(-b, root) / a;
        w_e = vec2[](-axis.y * forward_e, axis.x * forward_e - vec2(tangential * axis.z, 0.0), w[2]);
    }
    vec2 along = vec2(tangential * axis.x, 0.0) + axis.z * forward_e;
    return WavePair(unit_wave(w, tangential, forward, along, 0.0, false, left > 0.0),
        unit_wave(w_e, tangential, forward_e, along, ellipticity, true, passes_e));
}

// What two waves of complex amplitudes make of coherent light: its powers in both waves, and real and imaginary part of
// the first's field times the conjugate of the second's. `rows`: amplitudes of the first, of the second wave.
vec4 coherency_after(vec4 light, vec2 rows[4]) {
    vec2 both = light.zw;
    return vec4(dot(rows[0], rows[0]) * light.x + dot(rows[1], rows[1]) * light.y
            + 2.0 * times(times(rows[0], conjugate(rows[1])), both).x,
        dot(rows[2], rows[2]) * light.x + dot(rows[3], rows[3]) * light.y
            + 2.0 * times(times(rows[2], conjugate(rows[3])), both).x,
        times(rows[0], conjugate(rows[2])) * light.x + times(rows[1], conjugate(rows[3])) * light.y
            + times(times(rows[0], conjugate(rows[3])), both)
            + times(times(rows[1], conjugate(rows[2])), conjugate(both)));
}

// What an interface makes of light: of power 1, as in `coherency_after` by ordinary and extraordinary wave. `before`,
// `behind`: with axes as in `waves`; `left`: squared forward parts of ordinary waves before and behind.
void cross_interface(Uniaxial before, Uniaxial behind, float tangential, vec2 left, vec4 light, out vec4 reflected,
    out vec4 transmitted) {
    WavePair incident = waves(before, tangential, left.x, 1.0), back = waves(before, tangential, left.x, -1.0),
             onward = waves(behind, tangential, left.y, 1.0);
    // The fields behind, taken apart into waves before: what comes in, of which an evanescent wave has none.
    Tangential first = back.ordinary, second = back.extraordinary;
    if (incident.ordinary.passes) first = incident.ordinary;
    if (incident.extraordinary.passes) second = incident.extraordinary;
    vec2 in_oo = power_between(first, onward.ordinary), in_oe = power_between(first, onward.extraordinary),
         in_eo = power_between(second, onward.ordinary), in_ee = power_between(second, onward.extraordinary);
    vec2 determinant = times(in_oo, in_ee) - times(in_oe, in_eo);
    vec2 inverse = conjugate(determinant) / max(dot(determinant, determinant), 1e-30);
    vec2 through[4] =
        vec2[](times(in_ee, inverse), -times(in_oe, inverse), -times(in_eo, inverse), times(in_oo, inverse));
    vec2 out_oo = -power_between(back.ordinary, onward.ordinary),
         out_oe = -power_between(back.ordinary, onward.extraordinary),
         out_eo = -power_between(back.extraordinary, onward.ordinary),
         out_ee = -power_between(back.extraordinary, onward.extraordinary);
    vec2 sent[4] = vec2[](times(out_oo, through[0]) + times(out_oe, through[2]),
        times(out_oo, through[1]) + times(out_oe, through[3]), times(out_eo, through[0]) + times(out_ee, through[2]),
        times(out_eo, through[1]) + times(out_ee, through[3]));
    reflected = coherency_after(light, sent);
    transmitted = coherency_after(light, through);
    if (!back.ordinary.passes) reflected.xzw = vec3(0.0);
    if (!back.extraordinary.passes) reflected.yzw = vec3(0.0);
    if (!onward.ordinary.passes) transmitted.xzw = vec3(0.0);
    if (!onward.extraordinary.passes) transmitted.yzw = vec3(0.0);
}
