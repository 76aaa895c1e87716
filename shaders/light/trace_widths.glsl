// How far a footprint is believed while its light goes through glass. Columns are derivatives: what they say of a place farther away than the surface is
// large is nothing, for no light of the footprint has met that surface there. Where paths are long (inside a diamond, a drop) columns grow by a factor with every
// surface, and footprints without bound would spread light over all of a picture, whatever the number of photons.
#ifndef TRACE_WIDTHS_GLSL
#define TRACE_WIDTHS_GLSL

// Of an object's size (half of its bounds' diagonal): the longest side of a footprint on it, and of what a lamp's other points add. Of 0.03, 0.06, 0.12 and no bound it is
// the best one in scenes of chance (docs/agreement.md), in shipped ones all are alike.
const float WIDEST_ON_SURFACE = 0.06;

void keep_columns_within(inout RayRecord ray, float size)
{
    float widest = WIDEST_ON_SURFACE * size / max(ray.footprint_scale, 1e-30);
    vec3 s = ray.dposition[0].xyz, t = ray.dposition[1].xyz, turn_s = ray.ddirection[0].xyz, turn_t = ray.ddirection[1].xyz;
    keep_within(widest, s, t, turn_s, turn_t);
    ray.dposition[0].xyz = s;
    ray.dposition[1].xyz = t;
    ray.ddirection[0].xyz = turn_s;
    ray.ddirection[1].xyz = turn_t;
#ifdef LAMP_COLUMNS
    s = ray.dposition[LAMP].xyz;
    t = ray.dposition[LAMP + 1].xyz;
    turn_s = ray.ddirection[LAMP].xyz;
    turn_t = ray.ddirection[LAMP + 1].xyz;
    keep_within(WIDEST_ON_SURFACE * size, s, t, turn_s, turn_t);
    ray.dposition[LAMP].xyz = s;
    ray.dposition[LAMP + 1].xyz = t;
    ray.ddirection[LAMP].xyz = turn_s;
    ray.ddirection[LAMP + 1].xyz = turn_t;
#endif
}

#endif
