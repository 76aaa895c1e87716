// How far a footprint is believed while its light goes through glass. Columns are derivatives: what they say of a place
// farther away than the surface is large is nothing, for no light of the footprint has met that surface there. Of flat
// facets they say enough. Where paths are long (inside a diamond, a drop) columns grow by a factor with every surface,
// and footprints without bound would spread light over all of a picture, whatever the number of photons.

float longest_side(vec3 s, vec3 t) {
    vec2 axis = longest_axis(vec3(dot(s, s), dot(s, t), dot(t, t)));
    return length(axis.x * s + axis.y * t);
}

// The places of columns `c` and `c + 1`, and their directions with them.
void keep_pair_within(inout Path path, int c, float widest) {
    vec3 first = path.dposition[c], second = path.dposition[c + 1], turn_first = path.ddirection[c],
         turn_second = path.ddirection[c + 1];
    keep_within(widest, first, second, turn_first, turn_second);
    path.dposition[c] = first;
    path.dposition[c + 1] = second;
    path.ddirection[c] = turn_first;
    path.ddirection[c + 1] = turn_second;
}

// Of a ray that has met a surface of an object of this size; `start`: as it set out. A lattice as wide as that stays as
// it is: nothing else is between its points.
void keep_columns_within(inout Path path, Path start, float size, float distance) {
    vec3 own_s = start.dposition[0], own_t = start.dposition[1];
    if (path.depth == 0u) {
        // From a lamp: as wide as it is across the path.
        own_s += distance * start.ddirection[0];
        own_t += distance * start.ddirection[1];
        own_s -= dot(own_s, path.direction) * path.direction;
        own_t -= dot(own_t, path.direction) * path.direction;
    }
    // Both waves of a crystal part at every surface, and lattices that roulette thins grow by as much: without end.
    float scale = max(path.walk.footprint_scale, 1e-30), own = longest_side(own_s, own_t) / (HAS_CRYSTAL ? scale : 1.0);
    float widest = max(p.widest_on_surface * size / scale, own);
    vec3 s = path.dposition[0], t = path.dposition[1], turn_s = path.ddirection[0], turn_t = path.ddirection[1];
    keep_within(widest, s, t, turn_s, turn_t);
    // Made smaller, it no longer says where its neighbours and the edge are.
    if (LIGHT_EDGES && s != path.dposition[0]) path.walk.dposition[0].w = 0.0;
    path.dposition[0] = s;
    path.dposition[1] = t;
    path.ddirection[0] = turn_s;
    path.ddirection[1] = turn_t;
    if (LAMP_COLUMNS) keep_pair_within(path, LAMP, p.widest_on_surface * size);
    if (LOBE_COLUMNS) {
        // Light that comes from anywhere in a disc has half of its radius as standard deviation.
        keep_pair_within(path, LOBE, 0.5 * size);
    }
}

// Of a ray that a surface has turned: where curved surfaces turn it again and again (inside a diamond), directions grow
// by a factor each time too, and what leaves at last would be drawn as if it went everywhere at once. Such light is as
// good as scattered; `widest_turn` is what one photon of so many stands for then.
void keep_directions_within(inout Path path) {
    vec3 s = path.dposition[0], t = path.dposition[1], turn_s = path.ddirection[0], turn_t = path.ddirection[1];
    keep_within(p.widest_turn / max(path.walk.footprint_scale, 1e-30), turn_s, turn_t, s, t);
    if (LIGHT_EDGES && turn_s != path.ddirection[0]) path.walk.dposition[0].w = 0.0;
    path.ddirection[0] = turn_s;
    path.ddirection[1] = turn_t;
}

// Directions that have forgotten all, those of Lambert's law, have this as standard deviation along either axis
// (sines).
#define FORGOTTEN 0.5
// Of a ray's elevation over what it meets.
#define HIGHEST_RISE 0.5
// Whether no columns are wanted as derivatives, whatever is believed of them.
#define ARE_BOUNDED (p.widest_turn < 1e29)

// Of columns `c` and `c + 1` of a ray that meets a surface with this normal: how a lamp's places and microfacets turn
// light grows with every surface, and at grazing exits without bound. And up and down they say no more than half of the
// ray's own elevation, for how far light lands goes as one over that.
void keep_pair_above(inout Path path, int c, vec3 normal) {
    vec3 first = path.dposition[c], second = path.dposition[c + 1], turn_first = path.ddirection[c],
         turn_second = path.ddirection[c + 1];
    keep_within(FORGOTTEN, turn_first, turn_second, first, second);
    float elevation = dot(path.direction, normal);
    vec3 up = normal - elevation * path.direction;
    float slope = length(up);
    up /= max(slope, 1e-6);
    vec2 rise = vec2(dot(turn_first, up), dot(turn_second, up));
    float kept = min(1.0, HIGHEST_RISE * abs(elevation) / max(slope * length(rise), 1e-30));
    path.ddirection[c] = turn_first - (1.0 - kept) * rise.x * up;
    path.ddirection[c + 1] = turn_second - (1.0 - kept) * rise.y * up;
}

// Of the lobe's width and a lamp's own: light of places on a lamp that lie as far from each other as this lies evenly
// behind a rough surface.
#define EVENED_BY_LOBE 16.0

// The columns of a lamp's places are drawn as broad as rough surfaces leave gaps between the light of one and the next:
// photons of all of them meet microfacets of their own.
void narrow_lamp_by_lobe(inout Path path) {
    vec3 first = path.dposition[LAMP], second = path.dposition[LAMP + 1], along = path.dposition[LOBE],
         aside = path.dposition[LOBE + 1];
    float lamp = dot(first, first) + dot(second, second), lobe = dot(along, along) + dot(aside, aside);
    float left = inversesqrt(1.0 + EVENED_BY_LOBE * lobe / max(lamp, 1e-30));
    path.dposition[LAMP] *= left;
    path.dposition[LAMP + 1] *= left;
}

// The footprint of a photon that rough surfaces have turned: its own, and of the lobe as much as one of so many photons
// stands for. Where the lobe is small beside the lattice's spacing, neighbours still land side by side, and the lattice
// covers all. Whether it was widened.
bool widen_by_lobe(Path path, vec3 normal_g, inout vec3 dposition_ds, inout vec3 dposition_dt) {
    vec3 first = path.dposition[LOBE], second = path.dposition[LOBE + 1];
    float own = dot(dposition_ds, dposition_ds) + dot(dposition_dt, dposition_dt),
          lobe = dot(first, first) + dot(second, second);
    if (lobe <= 0.01 * own) return false;
    float part = lobe_part(p.paths / (path.walk.footprint_scale * path.walk.footprint_scale));
    join_sides(normal_g, dposition_ds, dposition_dt, part * first, part * second);
    return true;
}
