// Polarised light: what its state is, and what an interface makes of it. Stokes parameters over the intensity, at the
// three places of a band
// (`lib/band.glsl`), and an axis that they count from; the references carry electric fields instead
// (app/reference/polarised.py).

// Squared sine of the angle of incidence below which s is any direction: both polarisations then fare alike.
#define UPRIGHT 1e-10

struct Polarisation {
    vec3 axis;  // unit, across the ray
    vec3 q, u, v;  // of 1: along the axis; halfway from it to cross(direction, axis); circular
};

// What an interface does to s and p, at three places of a band. [Born and Wolf, 1.5]
struct FresnelPair {
    vec3 s, p;  // shares of the power
    vec3 real, imaginary;  // of the amplitude of s times the conjugate of that of p
};

// A unit vector across a direction.
vec3 across_direction(vec3 direction) {
    return normalize(
        abs(direction.x) < 0.5 ? vec3(0.0, -direction.z, direction.y) : vec3(direction.z, 0.0, -direction.x));
}

Polarisation unpolarised(vec3 direction) {
    return Polarisation(across_direction(direction), vec3(0.0), vec3(0.0), vec3(0.0));
}

// Unit vector of s; a ray along the normal keeps `axis`.
vec3 incidence_axis(vec3 direction, vec3 normal, vec3 axis) {
    vec3 s = cross(direction, normal);
    float length2 = dot(s, s);
    return length2 > UPRIGHT ? s * inversesqrt(length2) : axis;
}

// Counted from another axis, whose part along the old one and across it these are: of any length, but one.
Polarisation counted_from(Polarisation state, vec3 along, vec3 across) {
    vec3 length2 = along * along + across * across;
    bvec3 known = greaterThan(length2, vec3(1e-20));
    vec3 per_length2 = 1.0 / max(length2, 1e-20);
    vec3 cosine = mix(vec3(1.0), (along * along - across * across) * per_length2, known);
    vec3 sine = mix(vec3(0.0), 2.0 * along * across * per_length2, known);
    vec3 q = state.q;
    state.q = cosine * q + sine * state.u;
    state.u = cosine * state.u - sine * q;
    return state;
}

// Counted from s of a plane of incidence, which differs over the band: `s` at its three places.
Polarisation in_plane(Polarisation state, vec3 direction, vec3 s[3]) {
    vec3 other = cross(direction, state.axis);
    vec3 along = vec3(dot(state.axis, s[0]), dot(state.axis, s[1]), dot(state.axis, s[2]));
    state = counted_from(state, along, vec3(dot(other, s[0]), dot(other, s[1]), dot(other, s[2])));
    state.axis = s[1];
    return state;
}

// The way back for a ray that goes on along `direction`: counted from the anchor's s all over the band.
Polarisation out_of_plane(Polarisation state, vec3 direction, vec3 s[3]) {
    // Where an interpolated normal gave way to the facet's, s is not across the new direction yet.
    state.axis = normalize(s[1] - dot(s[1], direction) * direction);
    vec3 other = cross(s[1], direction);
    return counted_from(
        state, vec3(dot(s[0], s[1]), 1.0, dot(s[2], s[1])), vec3(dot(s[0], other), 0.0, dot(s[2], other)));
}

// Reflection by glass. `theta`, `eta_it`, `cosine2_t` as of `fresnel_reflectance`; p turns with the ray, so that
// upright r_p = -r_s.
FresnelPair fresnel_reflection(vec3 theta, vec3 eta_it, vec3 cosine2_t) {
    vec3 ci = -theta, ct = sqrt(max(cosine2_t, 0.0));
    vec3 rs = (eta_it * ci - ct) / (eta_it * ci + ct);
    vec3 rp = (ci - eta_it * ct) / (ci + eta_it * ct);
    // Total reflection: r_s r_p* = z² / |z|² with z = (eta ci - i k)(ci + i eta k), k² = -cosine2_t.
    vec3 k2 = max(-cosine2_t, 0.0), x = eta_it * (ci * ci + k2), y = sqrt(k2) * ci * (eta_it * eta_it - 1.0);
    vec3 per = 1.0 / max(x * x + y * y, 1e-30);
    bvec3 passes = greaterThan(cosine2_t, vec3(0.0));
    return FresnelPair(mix(vec3(1.0), rs * rs, passes), mix(vec3(1.0), rp * rp, passes),
        mix((x * x - y * y) * per, rs * rp, passes), mix(2.0 * x * y * per, vec3(0.0), passes));
}

FresnelPair both_faces(FresnelPair one) {
    vec3 s = both_faces(one.s), p = both_faces(one.p);
    return FresnelPair(s, p, sign(one.real) * sqrt(s * p), vec3(0.0));
}

// What is not reflected: both amplitudes are real and positive then.
FresnelPair fresnel_transmission(FresnelPair reflection) {
    vec3 s = 1.0 - reflection.s, p = 1.0 - reflection.p;
    return FresnelPair(s, p, sqrt(s * p), vec3(0.0));
}

// A mirror's, but for its reflectance: a perfect conductor.
FresnelPair mirror_reflection() { return FresnelPair(vec3(1.0), vec3(1.0), vec3(-1.0), vec3(0.0)); }

// Share of the power of light whose state counts from s.
vec3 polarised_share(Polarisation state, FresnelPair pair) {
    return 0.5 * (pair.s + pair.p + (pair.s - pair.p) * state.q);
}

// The state that this leaves it in.
Polarisation behind_interface(Polarisation state, FresnelPair pair) {
    vec3 per_share = 1.0 / max(polarised_share(state, pair), 1e-20);
    vec3 q = 0.5 * (pair.s - pair.p + (pair.s + pair.p) * state.q) * per_share;
    vec3 u = (pair.real * state.u - pair.imaginary * state.v) * per_share;
    vec3 v = (pair.imaginary * state.u + pair.real * state.v) * per_share;
    // No more than wholly polarised: rounding, above all of next to nothing.
    vec3 per_degree = inversesqrt(max(q * q + u * u + v * v, 1.0));
    return Polarisation(state.axis, q * per_degree, u * per_degree, v * per_degree);
}

// What an order of a grating leaves a ray in that it turns from one direction to another: both polarisations fare
// alike.
Polarisation behind_grating(Polarisation state, vec3 direction, vec3 turned, bool reflects) {
    vec3 axis = incidence_axis(direction, turned, state.axis);
    vec3 s[3] = vec3[](axis, axis, axis);
    FresnelPair pair = mirror_reflection();
    pair.real = vec3(reflects ? -1.0 : 1.0);
    return out_of_plane(behind_interface(in_plane(state, direction, s), pair), turned, s);
}
