// A placement as a map of space to texels: the same everywhere along a plane's own axes, a camera's perspective where
// texels are pixels. Texel of a place, times the weight W in z; only places of positive weight lie in a map.
vec3 homogeneous_texel(Placement place, vec3 position) {
    vec4 at = vec4(position, 1.0);
    return vec3(dot(place.row_u, at), dot(place.row_v, at), dot(place.row_w, at));
}

// How far a texel moves with a step of its place, `at` from `homogeneous_texel`.
vec2 texels_along(Placement place, vec3 at, vec3 direction) {
    vec2 texel = at.xy / at.z;
    return (vec2(dot(place.row_u.xyz, direction), dot(place.row_v.xyz, direction))
               - dot(place.row_w.xyz, direction) * texel)
        / at.z;
}

// Scene unit² of the texel there.
float texel_area_at(Placement place, vec3 at) { return place.texel_area * at.z * at.z * at.z; }

// Texels that a unit of GPU space is long there, about the longest.
float texels_per_length(Placement place, vec3 at) {
    vec2 texel = at.xy / at.z;
    vec3 u = place.row_u.xyz - texel.x * place.row_w.xyz, v = place.row_v.xyz - texel.y * place.row_w.xyz;
    return sqrt(max(dot(u, u), dot(v, v))) / at.z;
}
