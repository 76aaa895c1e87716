// How far a footprint is believed while its light goes through glass. Columns are derivatives: what they say of a place farther away than the surface is
// large is nothing, for no light of the footprint has met that surface there. Of flat facets they say enough. Where paths are long (inside a diamond, a drop) columns grow by a factor with every
// surface, and footprints without bound would spread light over all of a picture, whatever the number of photons.
#ifndef TRACE_WIDTHS_GLSL
#define TRACE_WIDTHS_GLSL

float longest_side(vec3 s, vec3 t)
{
    vec2 axis = longest_axis(vec3(dot(s, s), dot(s, t), dot(t, t)));
    return length(axis.x * s + axis.y * t);
}

#if defined(LAMP_COLUMNS) || defined(LOBE_COLUMNS)
// The places of columns `c` and `c + 1`, and their directions with them.
void keep_pair_within(inout RayRecord ray, int c, float widest)
{
    vec3 first = ray.dposition[c].xyz, second = ray.dposition[c + 1].xyz, turn_first = ray.ddirection[c].xyz, turn_second = ray.ddirection[c + 1].xyz;
    keep_within(widest, first, second, turn_first, turn_second);
    ray.dposition[c].xyz = first;
    ray.dposition[c + 1].xyz = second;
    ray.ddirection[c].xyz = turn_first;
    ray.ddirection[c + 1].xyz = turn_second;
}
#endif

// Of a ray that has met a surface of an object of this size; `start`: as it set out. A lattice as wide as that stays as it is: nothing else is between its points.
void keep_columns_within(inout RayRecord ray, RayRecord start, float size, float distance)
{
    vec3 own_s = start.dposition[0].xyz, own_t = start.dposition[1].xyz;
    if (ray.depth == 0u) {
        // From a lamp: as wide as it is across the ray.
        own_s += distance * start.ddirection[0].xyz;
        own_t += distance * start.ddirection[1].xyz;
        own_s -= dot(own_s, ray.direction) * ray.direction;
        own_t -= dot(own_t, ray.direction) * ray.direction;
    }
    float widest = max(p.widest_on_surface * size / max(ray.footprint_scale, 1e-30), longest_side(own_s, own_t));
    vec3 s = ray.dposition[0].xyz, t = ray.dposition[1].xyz, turn_s = ray.ddirection[0].xyz, turn_t = ray.ddirection[1].xyz;
    keep_within(widest, s, t, turn_s, turn_t);
#ifdef LIGHT_EDGES
    // Made smaller, it no longer says where its neighbours and the edge are.
    if (s != ray.dposition[0].xyz) ray.dposition[0].w = 0.0;
#endif
    ray.dposition[0].xyz = s;
    ray.dposition[1].xyz = t;
    ray.ddirection[0].xyz = turn_s;
    ray.ddirection[1].xyz = turn_t;
#ifdef LAMP_COLUMNS
    keep_pair_within(ray, LAMP, p.widest_on_surface * size);
#endif
#ifdef LOBE_COLUMNS
    // Light that comes from anywhere in a disc has half of its radius as standard deviation.
    keep_pair_within(ray, LOBE, 0.5 * size);
#endif
}

// Of a ray that a surface has turned: where curved surfaces turn it again and again (inside a diamond), directions grow by a factor each time too, and what leaves at last would be drawn as if it
// went everywhere at once. Such light is as good as scattered; `widest_turn` is what one photon of so many stands for then.
void keep_directions_within(inout RayRecord ray)
{
    vec3 s = ray.dposition[0].xyz, t = ray.dposition[1].xyz, turn_s = ray.ddirection[0].xyz, turn_t = ray.ddirection[1].xyz;
    keep_within(p.widest_turn / max(ray.footprint_scale, 1e-30), turn_s, turn_t, s, t);
#ifdef LIGHT_EDGES
    if (turn_s != ray.ddirection[0].xyz) ray.dposition[0].w = 0.0;
#endif
    ray.ddirection[0].xyz = turn_s;
    ray.ddirection[1].xyz = turn_t;
}

#if defined(LAMP_COLUMNS) || defined(LOBE_COLUMNS)
// Directions that have forgotten all, those of Lambert's law, have this as standard deviation along either axis (sines).
#define FORGOTTEN 0.5
// Of a ray's elevation over what it meets.
#define HIGHEST_RISE 0.5

// Of columns `c` and `c + 1` of a ray that meets a surface with this normal: how a lamp's places and microfacets turn light grows with every surface, and
// at grazing exits without bound. And up and down they say no more than half of the ray's own elevation, for how far light lands goes as one over that.
void keep_pair_above(inout RayRecord ray, int c, vec3 normal)
{
    vec3 first = ray.dposition[c].xyz, second = ray.dposition[c + 1].xyz, turn_first = ray.ddirection[c].xyz, turn_second = ray.ddirection[c + 1].xyz;
    keep_within(FORGOTTEN, turn_first, turn_second, first, second);
    float elevation = dot(ray.direction, normal);
    vec3 up = normal - elevation * ray.direction;
    float slope = length(up);
    up /= max(slope, 1e-6);
    vec2 rise = vec2(dot(turn_first, up), dot(turn_second, up));
    float kept = min(1.0, HIGHEST_RISE * abs(elevation) / max(slope * length(rise), 1e-30));
    ray.ddirection[c].xyz = turn_first - (1.0 - kept) * rise.x * up;
    ray.ddirection[c + 1].xyz = turn_second - (1.0 - kept) * rise.y * up;
}
#endif

#endif
