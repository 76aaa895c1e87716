// How a path goes on from a glossy receiver: reflected by a facet of its coat, which is drawn as it is seen.

// 2^32 times the fractions of the cube roots of 3 and 9, badly approximable together.
#define FACET_1 1899447441u
#define FACET_2 343957400u
// Widest that a direction may stand for, as the tangent of its angle; and how much it overlaps its neighbours, by which
// drawn ones are uneven.
const float WIDEST_LOBE = 1.5, LOBE_OVERLAP = 1.4;

// What a direction of this density stands for, as the side of a square (filtered importance sampling [Krivanek and
// Colbert 2008]): what is looked up along it is averaged over its sample's share of that.
void widen_columns(inout Path path, float density) {
    float width = min(LOBE_OVERLAP * inversesqrt(density), WIDEST_LOBE);
    for (int c = 0; c < 2; ++c) {
        float size = length(path.ddirection[c]);
        vec3 across = size > 1e-9
            ? path.ddirection[c] / size
            : normalize(path.dposition[c] - dot(path.dposition[c], path.direction) * path.direction);
        if (size > 1e-9 || dot(path.dposition[c], path.dposition[c]) > 1e-18)
            path.ddirection[c] = sqrt(size * size + width * width) * across;
    }
}

// The path stands at the surface, and its columns too.
void meet_coat(inout Path path, Hit hit, Triangle facet, uint pixel_key) {
    Finish finish = finish_of(hit.object);
    Event event = event_at(path, hit, facet);
    vec3 first, second, normal = event.frame.normal;
    axes_across(normal, first, second);
    mat3 to_world = mat3(first, second, normal);
    vec3 toward = -path.direction * to_world;
    uint key = hash_combine(hash_combine(pixel_key, path.walk.key), 80u + path.depth);
    vec2 unit = vec2(kronecker(p.sample_index, FACET_1, key), kronecker(p.sample_index, FACET_2, hash_pcg(key)));
    // A pixel's only sample, as in a picture in motion, stands for all of the lobe: no grain.
    bool is_only = p.sample_side >= 1.0, draws = finish.alpha > 0.0 && !is_only;
    vec3 drawn = draws ? visible_microfacet(toward, vec3(0.0, 0.0, 1.0), finish.alpha, unit) : vec3(0.0, 0.0, 1.0);
    float facing = dot(toward, drawn);
    vec3 away = 2.0 * facing * drawn - toward;
    float weight =
        draws ? coat_weight(finish.alpha, finish.index, toward, away, facing) : 1.0 - share_under(finish, facing);
    vec3 turn = to_world * drawn - normal;
    event.frame.normal += turn;
    if (SPECTRAL_SWEEP) {
        for (int end = 0; end < 2; ++end) event.end_normal[end] = normalize(event.end_normal[end] + turn);
    }
    bool geometric,
        leaves = dot(reflect_direction(path.direction, event.frame.normal, -facing), event.frame.normal_g) > 0.0;
    reflect_path(path, event, geometric);
    path.throughput *= weight;
    path.walk.branch_weight *= weight;
    // A weak path goes on by chance.
    float stays = path.depth > 1u ? clamp(path.walk.branch_weight / p.split_threshold, 0.05, 1.0) : 1.0;
    bool goes_on = weight > 0.0 && leaves && facing > 0.0 && (stays >= 1.0 || choice(path, pixel_key) < stays);
    path.walk.inverse_pdf = goes_on ? path.walk.inverse_pdf / stays : 0.0;
    path.walk.branch_weight /= stays;
    path.walk.key = hash_combine(path.walk.key, 5u);
    path.walk.coat_pdf = finish.alpha > 0.0 ? coat_direction_density(finish.alpha, toward, drawn) : 1e30;
    widen_columns(path, path.walk.coat_pdf);
    leave_surface(path, hit, dot(path.direction, hit.normal_g) < 0.0);
    if (POLARISED) path.polarisation = unpolarised(path.direction);
}
