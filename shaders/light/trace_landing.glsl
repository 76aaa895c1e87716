// Bands whose wavelengths do not all meet what their anchor meets, for `trace.comp`: over a receiver's border, or over
// the edge of what is in the way. Drawn whole on the anchor's receiver, a band lacks those colours beside the border
// that its neighbour has too many of, on both sides.
// Spacings of the lattice, along the narrower of its steps: of shorter chords no colour shows beside a border.
#define SHORTEST_CUT_CHORD 0.02
// Of either half of the band: so close to its ends a part that was cut there is not asked again.
#define ASIDE_OF_ENDS 0.05
#define BORDER_HALVINGS 4u

// Whether the ends of a ray's band come to lie so far apart that each may meet something else than the anchor has, at
// `hit`, or after nothing.
bool ends_part(Path path, Hit hit, bool met) {
    uint kind = met ? object_at(hit.object).kind : KIND_BLACK;
    bool ends = kind == KIND_DIFFUSE || kind == KIND_BLACK;
    bool is_wide = path.band.z - path.band.x >= p.narrowest_landing;
    if (!ends || !is_wide || path.depth == 0u || path.walk.flags != 0u) return false;
    vec3 column[COLUMNS];
    for (int c = 0; c < COLUMNS; ++c)
        column[c] = met
            ? transfer_column(path.dposition[c], path.ddirection[c], path.direction, hit.normal_g, hit.distance)
            : path.ddirection[c];
    vec3 chord = vec3(0.0);
    for (int g = 0; g < SPECTRAL_GROUPS; ++g)
        chord += variable_step(uint(g), path.band.z, path.band.x) * column[SPATIAL + g];
    float least = SHORTEST_CUT_CHORD * path.walk.footprint_scale;
    return dot(chord, chord) > least * least * min(dot(column[0], column[0]), dot(column[1], column[1]));
}

// The nearest hit of a ray's anchor, or of a part of its band where that meets nothing. `border`: where in its band
// that begins to meet another object, if it may be cut there; else a negative number.
bool meet_with_band(Path path, out Hit hit, out float border) {
    float x = path.band.y, inside = path.band.y, outside = path.band.y;
    bool met = false, found = false;
    // The anchor, then the band's ends, then halvings between what lands with the anchor and what does not.
    uint end = 1u;
    for (uint turn = 0u; turn < end;) {
        vec3 position = path.position, direction = path.direction;
        if (turn > 0u) ray_at(path, x, position, direction);
        Hit seen;
        bool sees = intersect_closest(position, direction, FAR_DISTANCE, path.origin, seen);
        // A start beyond the edge of the facet left may lie in the plane of a neighbour's, which no light has come to.
        bool in_plane = turn > 0u && sees && seen.distance < NEAR_DISTANCE;
        bool together = in_plane || sees == met && (!met || seen.object == hit.object);
        if (turn == 0u || !(together || found)) hit = seen;
        found = found || !together;
        if (turn == 0u) {
            met = sees;
            end = ends_part(path, hit, met) ? 3u : 1u;
            x = mix(path.band.x, path.band.y, ASIDE_OF_ENDS);
            turn = 1u;
        } else if (turn < 3u && together) {
            x = mix(path.band.z, path.band.y, ASIDE_OF_ENDS);
            ++turn;
        } else {
            end = 3u + BORDER_HALVINGS;
            turn = max(turn + 1u, 3u);
            inside = together ? x : inside;
            outside = together ? outside : x;
            x = 0.5 * (inside + outside);
        }
    }
    border = end > 3u ? clear_cut(path, path, x, met ? hit.distance : FAR_DISTANCE) : -1.0;
    return met || border >= 0.0;
}
