// A diffraction grating: parallel lines on a thin sheet with one medium on both sides. Of a unit direction, the part
// that lies in the surface changes by m λ / (Λ n) across the lines, order m, line spacing Λ; the rest follows from its
// length [Loewen, Popov 1997, ch. 2]. Where nothing is left for it the order is evanescent. `side`: 1 where the frame's
// normal is the outward one, else -1, so that the orders have the same sense seen from both sides.
#include "lib/band.glsl"
#include "lib/interface.glsl"
#include "lib/medium.glsl"
#include "lib/random.glsl"

Grating grating_at(uint row) {
    uint at = uint(GRATINGS_AT) + row;
    return Grating_FROM(scene_texel, at);
}

GratingOrder order_at(uint row, uint number) {
    uint at = uint(GRATINGS_AT) + row + uint(Grating_TEXELS) + number;
    return GratingOrder_FROM(scene_texel, at);
}

bool is_reflective(Grating grating) { return grating.index == 0.0; }

// How grooves share light out among orders, by scalar theory (app/model/optics/gratings.py).
#define PROFILE_BLAZED 1u
#define PROFILE_LAMELLAR 2u
#define PROFILE_SINUSOIDAL 3u
#define GROOVE_PI 3.14159265

// What an order's share is a function of: the depth of the grooves in waves; of a sawtooth, the number of the order
// that single facets would send light in. `light`: direction that light comes in, across the lines, along them and
// along the outward normal, in a medium of index n; a wavelength in vacuum.
float groove_waves(Grating grating, vec3 light, float n, float wavelength_um) {
    vec3 k = n * light;
    float inner2 = grating.index * grating.index, inside = sqrt(max(inner2 - dot(k.xy, k.xy), 0.0));
    if (grating.profile != PROFILE_BLAZED)
        return grating.relief * (is_reflective(grating) ? 2.0 * abs(k.z) : inside - abs(k.z)) / wavelength_um;
    vec2 facet = vec2(sin(grating.relief), cos(grating.relief));
    float change = -2.0 * dot(k.xz, facet) * facet.x;
    if (!is_reflective(grating)) {
        // The flat side is the outward one: from there light is in the sheet before it meets facets.
        bool onward = k.z < 0.0;
        float met = -dot(vec2(k.x, onward ? -inside : k.z), facet);
        float turned2 = (onward ? n * n - inner2 : inner2 - n * n) + met * met;
        change = -facet.x * ((onward ? 1.0 : -1.0) * sqrt(max(turned2, 0.0)) - met);
    }
    return change / (grating.lines_per_um * wavelength_um);
}

// An order's share of light whose `groove_waves` are these.
float profile_share(Grating grating, GratingOrder order, uint number, float waves) {
    if (grating.profile == PROFILE_SINUSOIDAL)
        return spectral_row(uint(GRATING_ROW) + grating.row + number, waves / max(grating.most_waves, 1e-9));
    bool blazed = grating.profile == PROFILE_BLAZED;
    float m = order.number, phase = GROOVE_PI * (blazed ? m - waves : waves);
    if (!blazed && m == 0.0) return cos(phase) * cos(phase);
    float across = blazed ? phase : 0.5 * GROOVE_PI * m;
    float share = abs(phase) < 1e-3 && blazed ? 1.0 : sin(phase) / across;
    return blazed || fract(0.5 * m) != 0.0 ? share * share : 0.0;
}

// A number in [0, 1) for the place on a line: Kronecker sequences over paths, of the square roots of primes that no
// other dimension uses. Deeper ones are hashed.
float line_draw(uint i, uint depth, uint key) {
    const uint generators[4] = uint[](3479995859u, 796084093u, 1830299338u, 2336478295u);
    return kronecker(i, depth < 4u ? generators[depth] : hash_pcg(depth + 0x2545f491u) | 1u, hash_combine(key, depth));
}

// Where on a line light leaves, in parts λ / W of a direction's sine off its middle: distributed as sinc², as behind an
// opening as wide as what light covers (`line_quantiles` of app/model/optics/gratings.py).
float place_on_line(float draw) {
    float share = abs(2.0 * draw - 1.0), beyond = (1.0 - share) * GROOVE_PI * GROOVE_PI;
    float place = beyond < 0.125 ? 1.0 / max(beyond, 1e-6) : spectral_row(uint(GRATING_ROW), share);
    return draw < 0.5 ? -place : place;
}

// What a path meets at a grating, for all its orders.
struct GratingEvent {
    Grating grating;
    uint row;
    uint object;
    uint medium;  // that the path is in
    float side;
    vec3 normal, across;  // of the frame; unit, in the surface across the lines
};

// The step m λ / (Λ n) of an order, in the medium that the ray is in.
float order_step(GratingEvent met, GratingOrder order, float x) {
    return order.shift_per_um * medium_index(met.object, x) / medium_index(met.medium, x);
}

// d(step) / d(variable of group g): of the wavelength, and of the index of the medium.
float order_step_derivative(GratingEvent met, GratingOrder order, uint g, float x) {
    float n = medium_index(met.medium, x);
    return order.shift_per_um
        * (index_slope(met.object, g, x) / n - medium_index(met.object, x) / (n * n) * index_slope(met.medium, g, x));
}

// Unit vector in the surface across the lines: positive orders lean towards lines × outward normal.
vec3 across_lines(GratingEvent met, vec3 normal) { return met.side * normalize(cross(met.grating.lines, normal)); }

// Squared cosine of the angle that an order leaves at; <= 0: it is evanescent. `shift` lies in the surface.
float diffracted_cosine2(vec3 direction, float theta, vec3 shift) {
    return theta * theta - dot(shift, 2.0 * direction + shift);
}

// Diffracted by a normal; `omega`: the cosine of the angle that it leaves at.
vec3 diffract_direction(
    GratingEvent met, vec3 direction, vec3 normal, float step, out float theta, out float cosine2, out float omega) {
    vec3 shift = step * across_lines(met, normal);
    theta = dot(direction, normal);
    cosine2 = diffracted_cosine2(direction, theta, shift);
    omega = sqrt(max(cosine2, 1e-12));
    return direction + shift + ((is_reflective(met.grating) ? omega : -omega) - theta) * normal;
}

// Diffracted by the shading normal, or by the facet's where that would lead to the wrong side.
Deflection diffract_at(GratingEvent met, ShadingFrame frame, vec3 direction, float step) {
    Deflection turned;
    turned.normal = frame.normal;
    turned.geometric = false;
    float cosine2;
    for (int i = 0; i < 2; ++i) {
        vec3 sent = diffract_direction(met, direction, turned.normal, step, turned.theta, cosine2, turned.omega);
        turned.direction = normalize(sent);
        bool wrong = dot(sent, frame.normal_g) * (is_reflective(met.grating) ? 1.0 : -1.0) <= 0.0;
        if (frame.interpolated == 0u || !wrong || turned.geometric) break;
        turned.geometric = true;
        turned.normal = frame.normal_g;
    }
    turned.exists = cosine2 > 0.0;
    return turned;
}

// Derivative of the diffracted direction by one column of the incident ray: the tangential part's changes are handed
// on, the normal part follows by differentiation. `dnormal`: of the frame; `dstep`: explicit derivative of the step
// along this column.
vec3 diffracted_column(
    GratingEvent met, Deflection turned, vec3 direction, vec3 ddirection, vec3 dnormal, float step, float dstep) {
    if (turned.geometric) dnormal = vec3(0.0);
    vec3 across = across_lines(met, turned.normal), shift = step * across, dshift = dstep * across;
    if (NORMAL_DERIVATIVES)
        dshift += step * met.side
            * normalised_derivative(cross(met.grating.lines, turned.normal), cross(met.grating.lines, dnormal));
    float dtheta = dot(ddirection, turned.normal) + dot(direction, dnormal);
    float domega = (turned.theta * dtheta - dot(dshift, direction + shift) - dot(shift, ddirection)) / turned.omega;
    float sense = is_reflective(met.grating) ? 1.0 : -1.0;
    return ddirection + dshift + (sense * domega - dtheta) * turned.normal
        + (sense * turned.omega - turned.theta) * dnormal;
}
