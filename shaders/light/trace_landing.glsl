// Bands whose wavelengths do not all meet what their anchor meets, for `trace.comp`: over a receiver's border, or over the edge of what is in the way. Drawn
// whole on the anchor's receiver, a band lacks those colours beside the border that its neighbour has too many of, on both sides.
#ifdef LANDING_CUTS
// Spacings of the lattice, along the narrower of its steps: of shorter chords no colour shows beside a border.
#define SHORTEST_CUT_CHORD 0.02
// Of either half of the band: so close to its ends a part that was cut there is not asked again.
#define ASIDE_OF_ENDS 0.05
#define BORDER_HALVINGS 4u
#define NARROWEST_LANDING 0.0078125

// Whether the ends of a ray's band land so far apart that each may meet something else than the anchor has, at `hit`.
bool lands_broadly(RayRecord ray, Hit hit)
{
    uint kind = object_at(hit.object).kind;
    bool lands = (kind == KIND_DIFFUSE || kind == KIND_BLACK) && ray.depth > 0u;
    if (!lands || ray.x_hi - ray.x_lo < NARROWEST_LANDING || (ray.flags & FLAG_FOOTPRINT_DROPPED) != 0u) return false;
    vec3 column[COLUMNS];
    for (int c = 0; c < COLUMNS; ++c) column[c] = transfer_column(ray.dposition[c].xyz, ray.ddirection[c].xyz, ray.direction, hit.normal_g, hit.distance);
    vec3 chord = vec3(0.0);
    for (int g = 0; g < SPECTRAL_GROUPS; ++g) chord += variable_step(uint(g), ray.x_hi, ray.x_lo) * column[SPATIAL + g];
    float least = SHORTEST_CUT_CHORD * ray.footprint_scale;
    return dot(chord, chord) > least * least * min(dot(column[0], column[0]), dot(column[1], column[1]));
}

// The nearest hit of a ray's anchor. `border`: where in its band that begins to meet another object, if it may be cut there; else a negative number.
bool meet_with_band(RayRecord ray, RayOrigin origin, out Hit hit, out float border)
{
    float x = ray.x_anchor, inside = ray.x_anchor, outside = ray.x_anchor;
    bool met = false;
    // The anchor, then the band's ends, then halvings between what lands with the anchor and what does not.
    uint end = 1u;
    for (uint turn = 0u; turn < end;) {
        vec3 position = ray.position, direction = ray.direction;
        for (int g = 0; g < SPECTRAL_GROUPS; ++g) {
            float change = variable_step(uint(g), x, ray.x_anchor);
            position += change * ray.dposition[SPATIAL + g].xyz;
            direction += change * ray.ddirection[SPATIAL + g].xyz;
        }
        direction = turn == 0u ? ray.direction : normalize(direction);
        Hit seen;
        bool sees = intersect_closest(position, direction, FAR_DISTANCE, origin, seen);
        bool together = sees && seen.object == hit.object;
        if (turn == 0u) {
            hit = seen;
            met = sees;
            end = met && lands_broadly(ray, hit) ? 3u : 1u;
            x = mix(ray.x_lo, ray.x_anchor, ASIDE_OF_ENDS);
            turn = 1u;
        } else if (turn < 3u && together) {
            x = mix(ray.x_hi, ray.x_anchor, ASIDE_OF_ENDS);
            ++turn;
        } else {
            end = 3u + BORDER_HALVINGS;
            turn = max(turn + 1u, 3u);
            inside = together ? x : inside;
            outside = together ? outside : x;
            x = 0.5 * (inside + outside);
        }
    }
    border = end > 3u ? clear_cut(ray, ray, x, hit.distance) : -1.0;
    return met;
}
#endif
