// A ray in flight at a rough surface, for `trace.comp`: it meets one microfacet, the same at all wavelengths of its band (which all meet it as probably
// as the anchor does), and goes on as from a polished surface that lies as this one does. Its neighbours on the lattice meet other ones, so what a
// photon stands for is told by two columns of their own: how far the light of other microfacets lands beside it.
#ifdef ROUGH_SURFACES
#include "lib/rough_energy.glsl"

// What a rough surface makes of a ray.
struct RoughPlace {
    float width;    // GGX's, of the surface that is met; 0: it is polished
    vec3 normal;    // the surface's own, against the ray
    vec3 regained;  // factor for what its microfacets send on after all
};

// The microfacet takes the place of the frame's normal, and turns with it.
RoughPlace meet_microfacet(RayRecord ray, inout ShadingFrame frame)
{
    RoughPlace place = RoughPlace(surface_width, frame.normal, vec3(1.0));
    if (place.width <= 0.0) return place;
    uint sub = ray.photon_id % p.lattices, i = ray.photon_id / p.lattices;
    // Parts of a band that was cut here meet it again, and find the same microfacet.
    uint key = hash_combine(p.lattice_bits != 0u ? p.surface_key : ray.branch_key, sub);
    vec3 microfacet = visible_microfacet(-ray.direction, frame.normal, place.width, microfacet_numbers(i, ray.depth, key));
#ifdef NORMAL_DERIVATIVES
    for (int c = 0; c < COLUMNS; ++c) normal_columns[c] = turned_with(microfacet, frame.normal, normal_columns[c]);
#endif
#ifdef LOBE_COLUMNS
    // To what an earlier rough surface has spread this one adds a quarter turn aside, to the left or to the right: two columns hold the sum of both
    // variances, exactly where the lobes are round, and else over many photons.
    vec3 first, second;
    lobe_axes(microfacet, frame.normal, place.width, first, second);
    float turn = dot(ray.dposition[LOBE].xyz, ray.dposition[LOBE].xyz) <= 0.0 ? 0.0 : (hash_combine(i, key) & 1u) != 0u ? 1.0 : -1.0;
    normal_columns[LOBE] += turn == 0.0 ? first : turn * second;
    normal_columns[LOBE + 1] += turn == 0.0 ? second : -turn * first;
#endif
    frame.normal = microfacet;
    return place;
}

// Change of a share over half a band, of itself: where derivatives tell more they are steep (deep paths, grazing exits), and know nothing of a band's ends.
#define MOST_CHANGE 0.3

// Leaves a ray that a microfacet has turned what other microfacets do not hide of it or send on, at three places of its band, and nothing where it does not
// leave the surface. `side`: 1 where it is reflected, -1 where it is refracted; `share`: of the power, by which roulette asks.
void shadow(RoughPlace place, inout RayRecord child, Deflection turned, float side, inout float share, inout Outcome outcome)
{
    if (place.width <= 0.0) return;
    float cosine = dot(turned.direction, place.normal);
    bool leaves = side * cosine > 0.0 && !turned.geometric;
    vec3 kept = leaves ? place.regained * smith_share(vec3(side * cosine), place.width) : vec3(0.0);
#if SPECTRAL_GROUPS > 0
    vec2 turn = vec2(0.0);
    for (int g = 0; g < SPECTRAL_GROUPS; ++g) {
        float along = dot(child.ddirection[SPATIAL + g].xyz, place.normal);
        turn += along * vec2(variable_step(uint(g), child.x_lo, child.x_anchor), variable_step(uint(g), child.x_hi, child.x_anchor));
    }
    vec2 change = leaves ? side * smith_slope(side * cosine, place.width) * turn : vec2(0.0);
    float steepness = max(abs(change.x), abs(change.y)) / MOST_CHANGE;
    kept.xz *= 1.0 + change / max(steepness * steepness, 1.0);
#endif
    child.flux_w *= kept.y;
    child.throughput *= kept;
#ifdef HERO
    child.companion_throughput.xyz *= kept.y;
#endif
    share *= kept.y;
    outcome.absorbed_w -= carried_w(child);
}

#ifdef LOBE_COLUMNS
#ifdef LAMP_COLUMNS
// Of the lobe's width and a lamp's own: light of places on a lamp that lie as far from each other as this lies evenly behind a rough surface.
#define EVENED_BY_LOBE 16.0

// The columns of a lamp's places are drawn as broad as rough surfaces leave gaps between the light of one and the next: photons of all of them meet
// microfacets of their own.
void narrow_lamp_by_lobe(inout RayRecord ray)
{
    vec3 first = ray.dposition[LAMP].xyz, second = ray.dposition[LAMP + 1].xyz, along = ray.dposition[LOBE].xyz, aside = ray.dposition[LOBE + 1].xyz;
    float lamp = dot(first, first) + dot(second, second), lobe = dot(along, along) + dot(aside, aside);
    float left = inversesqrt(1.0 + EVENED_BY_LOBE * lobe / max(lamp, 1e-30));
    ray.dposition[LAMP].xyz *= left;
    ray.dposition[LAMP + 1].xyz *= left;
}
#endif

// The footprint of a photon that rough surfaces have turned: its own, and of the lobe as much as one of so many photons stands for. Where the lobe
// is small beside the lattice's spacing, neighbours still land side by side, and the lattice covers all. Whether it was widened.
bool widen_by_lobe(RayRecord ray, vec3 normal_g, inout vec3 dposition_ds, inout vec3 dposition_dt)
{
    vec3 first = ray.dposition[LOBE].xyz, second = ray.dposition[LOBE + 1].xyz;
    float own = dot(dposition_ds, dposition_ds) + dot(dposition_dt, dposition_dt), lobe = dot(first, first) + dot(second, second);
    if (lobe <= 0.01 * own) return false;
    float part = lobe_part(p.paths / (ray.footprint_scale * ray.footprint_scale));
    join_sides(normal_g, dposition_ds, dposition_dt, part * first, part * second);
    return true;
}
#endif
#endif
