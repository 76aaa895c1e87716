// What happens to a ray and its derivative columns at a surface. Pure functions; the float64
// CPU references live in app/reference. Conventions: `direction` and `normal` are unit vectors, the
// normal is turned so that theta = dot(direction, normal) < 0, eta_it = n_incident / n_transmitted.
// A column is one derivative (dposition, ddirection) of the ray [Igehy 1999]; the spectral ones
// are Elek et al. 2014, here with respect to refractive indices instead of wavelength.
// Two unit vectors across a third.
void frame_across(vec3 normal, out vec3 s, out vec3 t) {
    s = normalize(cross(normal, abs(normal.z) < 0.9 ? vec3(0.0, 0.0, 1.0) : vec3(1.0, 0.0, 0.0)));
    t = cross(normal, s);
}

// Squared cosine of the transmitted angle; <= 0 is total internal reflection. The factored form
// keeps its digits where eta_it is close to 1.
float transmitted_cosine2(float theta, float eta_it) {
    return (1.0 - eta_it) * (1.0 + eta_it) + eta_it * eta_it * theta * theta;
}

vec3 transmitted_cosine2(vec3 theta, vec3 eta_it) {
    return (1.0 - eta_it) * (1.0 + eta_it) + eta_it * eta_it * theta * theta;
}

// mu of d' = eta d - mu n, in the form that stays exact at eta_it = 1 +- 1e-6 (the textbook
// eta theta + omega cancels there).
float refraction_mu(float theta, float eta_it, float omega) {
    return (1.0 - eta_it) * (1.0 + eta_it) / (omega - eta_it * theta);
}

// Refracted direction; omega = sqrt(transmitted_cosine2).
vec3 refract_direction(vec3 direction, vec3 normal, float theta, float eta_it, float omega) {
    return eta_it * direction - refraction_mu(theta, eta_it, omega) * normal;
}

vec3 reflect_direction(vec3 direction, vec3 normal, float theta) { return direction - 2.0 * theta * normal; }

// Derivative of the reflected direction [Igehy 1999]; the law of reflection knows no wavelength,
// so spectral columns use the same line.
vec3 reflect_column(vec3 direction, vec3 ddirection, vec3 normal, vec3 dnormal, float theta) {
    float dtheta = dot(ddirection, normal) + dot(direction, dnormal);
    return ddirection - 2.0 * (dtheta * normal + theta * dnormal);
}

// Derivative of the refracted direction. `deta_it` is the explicit derivative of eta_it along this
// column: 0 for the spatial ones, -eta/n_t or 1/n_t for a refractive index [Elek et al. 2014].
vec3 refract_column(
    vec3 direction, vec3 ddirection, vec3 normal, vec3 dnormal, float theta, float eta_it, float omega, float deta_it) {
    float sine2 = (1.0 - theta) * (1.0 + theta);
    float mu = refraction_mu(theta, eta_it, omega);
    float dtheta = dot(ddirection, normal) + dot(direction, dnormal);
    vec3 tangential = direction - theta * normal;
    return (deta_it / omega) * (omega * tangential + eta_it * sine2 * normal) + eta_it * ddirection
        - (eta_it * mu / omega) * dtheta * normal - mu * dnormal;
}

// Position derivative after travelling `distance` to a surface with geometric normal `normal_g`
// [Igehy 1999]: always the geometric one, the hit lies on the facet.
vec3 transfer_column(vec3 dposition, vec3 ddirection, vec3 direction, vec3 normal_g, float distance) {
    vec3 moved = dposition + distance * ddirection;
    return moved - (dot(moved, normal_g) / dot(direction, normal_g)) * direction;
}

// Derivative of a normalised interpolated normal: `summed` is the unnormalised sum, `dsummed` its
// derivative.
vec3 normalised_derivative(vec3 summed, vec3 dsummed) {
    float inverse_length = inversesqrt(dot(summed, summed));
    vec3 unit = summed * inverse_length;
    return (dsummed - unit * dot(unit, dsummed)) * inverse_length;
}

// edge1 × edge2. Both products are rounded before one is taken from the other, as in a processor: with a GPU's
// multiply-add only one of them is, and a sliver, whose products are alike, gets the normal of that rounding.
vec3 facet_normal(vec3 edge1, vec3 edge2) {
    precise vec3 ahead = edge1.yzx * edge2.zxy;
    precise vec3 back = edge1.zxy * edge2.yzx;
    precise vec3 normal = ahead - back;
    return normal;
}

// Gradients of the barycentric weights of edge1 and edge2 in the triangle's plane.
void barycentric_gradients(vec3 edge1, vec3 edge2, out vec3 gradient_u, out vec3 gradient_v) {
    vec3 normal = facet_normal(edge1, edge2);
    float inverse_area2 = 1.0 / dot(normal, normal);
    gradient_u = cross(edge2, normal) * inverse_area2;
    gradient_v = cross(normal, edge1) * inverse_area2;
}

// Exact unpolarised Fresnel reflectance; cosine2_t <= 0 reflects everything.
float fresnel_reflectance(float theta, float eta_it, float cosine2_t) {
    float ci = -theta, ct = sqrt(max(cosine2_t, 0.0));
    float rs = (eta_it * ci - ct) / (eta_it * ci + ct);
    float rp = (ci - eta_it * ct) / (ci + eta_it * ct);
    return cosine2_t > 0.0 ? 0.5 * (rs * rs + rp * rp) : 1.0;
}

vec3 fresnel_reflectance(vec3 theta, vec3 eta_it, vec3 cosine2_t) {
    vec3 ci = -theta, ct = sqrt(max(cosine2_t, 0.0));
    vec3 rs = (eta_it * ci - ct) / (eta_it * ci + ct);
    vec3 rp = (ci - eta_it * ct) / (ci + eta_it * ct);
    return mix(vec3(1.0), 0.5 * (rs * rs + rp * rp), greaterThan(cosine2_t, vec3(0.0)));
}

// What both faces of a thin sheet send back together, with all that is reflected between them, of what one face does.
vec3 both_faces(vec3 reflectance) { return 2.0 * reflectance / (1.0 + reflectance); }
