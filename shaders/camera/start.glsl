// How a camera path begins: at a place in its pixel, with the columns of the pixel's two sides, standing for the whole
// spectrum.

// Where on the lens the next path begins, in the unit square.
vec2 lens_place;

// Side of a square as large as a disc of radius 1.
const float DISC_SIDE = 1.7724538509;

// From the middle of the lens, a pinhole, to a place on it: a thin lens sends what comes from one point of the plane of
// focus, wherever it passes, to one point of the film [Cook, Porter and Carpenter 1984].
void begin_on_lens(inout Path path) {
    vec3 across[2] = vec3[](normalize(p.half_right), normalize(p.half_up));
    vec2 at = p.lens_radius * concentric_disc(lens_place);
    vec3 offset = at.x * across[0] + at.y * across[1];
    float reach = p.focus_distance / dot(path.direction, p.forward);
    vec3 way = reach * path.direction - offset;
    float way_length = length(way);
    vec3 direction = way / way_length;
    for (int c = 0; c < 2; ++c) {
        // The point in focus moves, of an orthographic camera the lens with it.
        vec3 moves = transfer_column(path.dposition[c], path.ddirection[c], path.direction, p.forward, reach)
            - path.dposition[c];
        vec3 side = DISC_SIDE * p.lens_radius * across[c];
        path.ddirection[c] = (moves - dot(moves, direction) * direction) / way_length;
        path.dposition[LENS_COLUMNS + c] = side;
        path.ddirection[LENS_COLUMNS + c] = (dot(side, direction) * direction - side) / way_length;
    }
    path.position += offset;
    path.direction = direction;
}

Path path_from(uvec2 pixel, vec2 within_pixel, float gain) {
    vec2 place = picture_point(pixel, within_pixel, p.size);
    CameraRay ray = camera_ray(p.position, p.forward, p.half_right, p.half_up, p.orthographic != 0u, place);
    Path path = path_at(ray.position, ray.direction, RayOrigin(NONE, NONE, 0u, p.inside_mask),
        MediumStack(p.inside_mask, p.inside_object), 0.5);
    vec3 right = p.half_right * (2.0 * p.pixel_width / float(p.size.x)),
         up = p.half_up * (2.0 * p.pixel_height / float(p.size.y));
    if (p.orthographic != 0u) {
        path.dposition[0] = right;
        path.dposition[1] = up;
    } else {
        // Derivative of the normalised direction.
        float scale = inversesqrt(dot(p.forward + place.x * p.half_right + place.y * p.half_up,
            p.forward + place.x * p.half_right + place.y * p.half_up));
        path.ddirection[0] = scale * (right - dot(right, ray.direction) * ray.direction);
        path.ddirection[1] = scale * (up - dot(up, ray.direction) * ray.direction);
    }
    if (LENS) begin_on_lens(path);
    if (POLARISED) path.polarisation = unpolarised(path.direction);
    if (SPECTRAL_SWEEP) gather_ends(path);
    path.band = vec3(0.0, 0.5, 1.0);
    path.walk.inverse_pdf = gain;
    path.walk.branch_weight = 1.0;
    path.walk.key = path.walk.cuts = 0u;
    path.walk.planar_so_far = 1u;
    if (ROUGH_SURFACES) path.walk.ground = 0u;
    if (COATS) path.walk.coat_pdf = 0.0;
    if (HAS_FILM) begin_films(path.walk);
    if (ABSORPTION) {
        for (int i = 0; i < ABSORBERS; ++i) path.walk.lengths[i] = 0.0;
    }
    return path;
}
