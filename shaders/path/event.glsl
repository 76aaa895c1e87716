// What a surface does to a path that has met it: `interact` finds the normals, media and shares of its lobes;
// `reflect_path`, `refract_path` and `diffract_path` turn the path into one of them, with its columns, its band's ends
// and its polarisation. Nothing is stored and nothing chosen here: which lobes are followed, and by what chance, is for
// the walk.

#include "path/path.glsl"
#include "path/microfacet.glsl"
#include "lib/film.glsl"

struct Event {
    ShadingFrame frame;
    vec3 end_normal[2];  // where the rays at the ends of the band arrive
    vec3 normal_columns[COLUMNS_HELD];  // derivatives of the shading normal
    Ground ground;
    MediumInterface boundary;  // of glass
    vec3 n_i, n_t;  // before and behind it, at the three places of the band
    vec3 cosine2;  // squared cosines of the transmitted angles there
    Deflection refracted;
    vec3 theta;  // cosines of incidence there, below 0
    vec3 reflectance;
    Film film;
    vec3 transmittance;  // of a film
    vec3 s[3];  // of the planes of incidence there
    Polarisation seen;  // the path's state, counted from these
    FresnelPair reflection;
    FresnelPair transmission;
};

#define NORMAL_COLUMN(event, c) (HAS_NORMAL_COLUMNS ? event.normal_columns[c] : vec3(0.0))

// Derivative of the cosine of incidence by group g's variable.
float incidence_column(Path path, Event event, int g) {
    return dot(path.ddirection[SPATIAL + g], event.frame.normal)
        + dot(path.direction, NORMAL_COLUMN(event, SPATIAL + g));
}

// Cosines of incidence at the three places of the band: by the rays at its ends where they are carried, else by the
// columns.
vec3 incidence_over_band(Path path, Event event) {
    vec3 theta = vec3(dot(path.direction, event.frame.normal));
    if (SPECTRAL_GROUPS > 0 && path.restricted != 0u) {
        if (SPECTRAL_SWEEP) {
            theta.x = dot(path.end_direction[0], event.end_normal[0]);
            theta.z = dot(path.end_direction[1], event.end_normal[1]);
        } else {
            for (int g = 0; g < SPECTRAL_GROUPS; ++g)
                theta.xz += incidence_column(path, event, g) * steps_to_ends(path, g);
        }
        theta.xz = clamp(theta.xz, -1.0, -1e-6);
    }
    return theta;
}

// The normal, of any length, where light of an end of the band arrives (0: lowest, 1: highest wavelength).
vec3 normal_at_end(Path path, Event event, int end) {
    if (SPECTRAL_SWEEP) return event.end_normal[end];
    vec3 normal = event.frame.normal;
    for (int g = 0; g < SPECTRAL_GROUPS; ++g) normal += steps_to_ends(path, g)[end] * NORMAL_COLUMN(event, SPATIAL + g);
    return normal;
}

// s of the planes of incidence over the band.
void planes_of_incidence(Path path, Event event, out vec3 s[3]) {
    s[1] = incidence_axis(path.direction, event.frame.normal, path.polarisation.axis);
    s[0] = s[2] = s[1];
    if (SPECTRAL_GROUPS > 0 && path.restricted != 0u) {
        s[0] = incidence_axis(direction_at_end(path, 0), normal_at_end(path, event, 0), s[1]);
        s[2] = incidence_axis(direction_at_end(path, 1), normal_at_end(path, event, 1), s[1]);
    }
}

// The normals that a path meets. `facet`: of the hit.
Event event_at(Path path, Hit hit, Triangle facet) {
    Event event;
    event.frame = shading_frame(hit, facet, path.position, path.direction);
    event.reflectance = vec3(1.0);
    if (SPECTRAL_SWEEP) {
        for (int end = 0; end < 2; ++end)
            event.end_normal[end] =
                normal_beside(event.frame, path.restricted != 0u ? path.end_position[end] - path.position : vec3(0.0));
    }
    if (HAS_NORMAL_COLUMNS) {
        for (int c = 0; c < PATH_COLUMNS; ++c) event.normal_columns[c] = normal_column(event.frame, path.dposition[c]);
    }
    if (ROUGH_SURFACES) {
        event.ground.width = event.ground.table = event.ground.thrown = 0.0;
        event.ground.normal = event.frame.normal;
        event.ground.regained = vec3(1.0);
        if (SPECTRAL_SWEEP) event.ground.end_normal = event.end_normal;
    }
    return event;
}

// A ground surface: the microfacet that the path meets takes the place of the normals, and turns with them.
void meet_microfacet(Path path, Object thing, MicrofacetDraw draw, inout Event event) {
    event.ground.width = thing.colour.x;
    event.ground.table = thing.colour.w;
    if (event.ground.width <= 0.0) return;
    vec3 normal = event.frame.normal;
    if (HAS_MIRROR && thing.kind == KIND_MIRROR)
        event.ground.thrown =
            1.0 - spectral_row(uint(ROUGH_ROW) + uint(event.ground.table), -dot(path.direction, normal));
    vec3 microfacet = visible_microfacet(
        -path.direction, normal, event.ground.width, microfacet_numbers(draw.number, draw.depth, draw.key));
    if (NORMAL_DERIVATIVES) {
        for (int c = 0; c < PATH_COLUMNS; ++c)
            event.normal_columns[c] = turned_with(microfacet, normal, event.normal_columns[c]);
    }
    if (WIDENED_BY_LOBES) {
        // To what an earlier ground surface has spread this one adds a quarter turn aside, to the left or to the right:
        // two columns hold the sum of both variances, exactly where the lobes are round, and else over many paths.
        vec3 first, second;
        lobe_axes(microfacet, normal, LOBE_WIDTH * event.ground.width, first, second);
        float turn = dot(path.dposition[LOBE], path.dposition[LOBE]) <= 0.0 ? 0.0
            : (hash_combine(draw.number, draw.key) & 1u) != 0u              ? 1.0
                                                                            : -1.0;
        event.normal_columns[LOBE] += turn == 0.0 ? first : turn * second;
        event.normal_columns[LOBE + 1] += turn == 0.0 ? second : -turn * first;
    }
    if (SPECTRAL_SWEEP) {
        for (int end = 0; end < 2; ++end)
            event.end_normal[end] =
                normalize(microfacet + turned_with(microfacet, normal, event.end_normal[end] - normal));
    }
    event.frame.normal = microfacet;
}

// The path's state as the surface meets it, and what a mirror makes of that.
void see_polarised(Path path, inout Event event) {
    planes_of_incidence(path, event, event.s);
    event.seen = in_plane(path.polarisation, path.direction, event.s);
    event.reflection = mirror_reflection();
    event.transmission = event.reflection;
}

#define FILM_MET(event) (event.film.row != 0u)

const uint film_slots[] = FILM_SLOTS;

// The film that light meets, if any, as it is in the medium outside of it. `boundary`: of glass.
Film film_met(Path path, Hit hit, Object thing, MediumInterface boundary) {
    bool glass = HAS_DIELECTRIC && IS_GLASS(thing.kind), back = glass && dot(path.direction, hit.normal_g) > 0.0;
    uint row = uint(thing.colour.y);
    if (FILM_MEDIUM_ROWS > 0 && row != 0u) {
        uint outside = back && !IS_THIN(boundary) ? boundary.after
            : glass                               ? boundary.before
                                                  : current_medium(path.medium);
        if (outside != NONE) row += uint(FILM_MEDIUM_ROWS) * film_slots[object_at(outside).medium];
    }
    Film film;
    film.row = row;
    film.back = back ? FILM_BACK : FILM_FRONT;
    film.cosine = vec3(1.0);
    if (FILM_VARIES) film.thickness = -1.0;
    if (FILM_VARIES && thing.colour.x < 0.0) {
        film.thickness = film_share_of_thickest(uint(-1.0 - thing.colour.x), path.position);
        film.waves = uint(FILM_ROW) + uint(thing.colour.y) - 2u;
    }
    return film;
}

// What a surface makes of light at three wavelengths `x` that meets it at the cosines event.theta, in the state
// event.seen: over a band, or `single`, each by itself. `kind`: of the surface.
void share_at(vec3 x, bool single, uint kind, inout Event event) {
    if (HAS_DIELECTRIC && IS_GLASS(kind)) {
        interface_indices(event.boundary, x, event.n_i, event.n_t);
        vec3 eta_it = event.n_i / event.n_t;
        event.cosine2 = transmitted_cosine2(event.theta, eta_it);
        if (POLARISED) {
            event.reflection = fresnel_reflection(event.theta, eta_it, event.cosine2);
            event.reflection = OF_SHEET(event.boundary, event.reflection);
            event.transmission = fresnel_transmission(event.reflection);
            event.reflectance = polarised_share(event.seen, event.reflection);
        } else {
            event.reflectance = fresnel_reflectance(event.theta, eta_it, event.cosine2);
            event.reflectance = OF_SHEET(event.boundary, event.reflectance);
        }
    }
    if (HAS_FILM) event.transmittance = 1.0 - event.reflectance;
    if (HAS_FILM && FILM_MET(event)) {
        // A film's shares take the place of Fresnel's.
        bool solid = HAS_DIELECTRIC && IS_GLASS(kind) && !IS_THIN(event.boundary);
        event.film.cosine = -event.theta;
        if (solid && event.film.back == FILM_BACK) {
            event.film.cosine = sqrt(max(event.cosine2, 0.0));
            if (FILM_BELOW > 0)
                event.film.cosine -= event.n_t
                    * sqrt(max(-event.cosine2, 0.0) / max(event.n_i * event.n_i - event.n_t * event.n_t, 1e-6));
        }
        if (POLARISED) {
            event.reflection = film_pair(event.film, event.film.back, x, single);
            event.transmission = film_pair(event.film, FILM_PASSED, x, single);
            event.reflectance = polarised_share(event.seen, event.reflection);
            event.transmittance = polarised_share(event.seen, event.transmission);
        } else {
            event.reflectance = film_share(event.film, event.film.back, x, single);
            if (FILM_TABLES == 1 && solid) event.reflectance = max(event.reflectance, step(event.cosine2, vec3(0.0)));
            event.transmittance =
                FILM_TABLES == 1 ? 1.0 - event.reflectance : film_share(event.film, FILM_PASSED, x, single);
        }
        if (ROUGH_SURFACES) event.reflectance = reflected_in_all(event.reflectance, event.ground.thrown);
    }
    if (HAS_DIELECTRIC && IS_GLASS(kind)) {
        GO_STRAIGHT(event.boundary, event.theta, event.n_i, event.n_t, event.cosine2)
    }
}

// What a surface of glass lets through.
#define transmittance_of(event) (HAS_FILM ? event.transmittance : 1.0 - event.reflectance)

// The share of a lobe by which it is followed or not: its anchor's; in a film's ripples, of all the band.
float share_of_lobe(Event event, vec3 share) { return HAS_FILM && FILM_MET(event) ? dot(share, OVER_BAND) : share.y; }

// What glass reflects of a path over its band, and where the rest goes.
void share_out(Path path, uint kind, inout Event event) {
    event.theta = incidence_over_band(path, event);
    if (POLARISED) see_polarised(path, event);
    share_at(path.band, false, kind, event);
    bool polished = !ROUGH_SURFACES || event.ground.width <= 0.0;
    if (ROUGH_SURFACES && !polished)
        event.ground.regained =
            regained(event.ground.table, -dot(path.direction, event.ground.normal), event.n_i / event.n_t);
    event.refracted = refract_at(event.frame, path.direction, event.n_i.y / event.n_t.y);
    // Where only the facet's normal forbids it, nothing is transmitted at any wavelength; at total reflection each has
    // its own share. A microfacet's share is its own, also where the light that it lets through does not leave the
    // surface.
    if (polished && !event.refracted.exists && event.cosine2.y > 0.0) {
        event.reflectance = vec3(1.0);
        if (HAS_FILM) event.transmittance = vec3(0.0);
    }
}

// The event as three other wavelengths of the path see it, by the columns.
Event event_for(Path path, Event event, uint kind, vec3 x) {
    event.theta = vec3(dot(path.direction, event.frame.normal));
    if (SPECTRAL_GROUPS > 0 && path.restricted != 0u) {
        for (int g = 0; g < SPECTRAL_GROUPS; ++g)
            event.theta += incidence_column(path, event, g)
                * vec3(variable_step(uint(g), x.x, path.band.y), variable_step(uint(g), x.y, path.band.y),
                    variable_step(uint(g), x.z, path.band.y));
        event.theta = clamp(event.theta, -1.0, -1e-6);
    }
    if (POLARISED) event.seen = band_polarisation(event.seen, path.band, path.throughput, x);
    share_at(x, true, kind, event);
    return event;
}

// Whether an event's glass refracts the ends of the band differently.
bool parts_wavelengths(Event event) { return event.n_i.x * event.n_t.z != event.n_i.z * event.n_t.x; }

// What a path meets but for its shares: normals and media. `draw`: which microfacet of a ground surface it meets.
Event meet(Path path, Hit hit, Triangle facet, Object thing, MicrofacetDraw draw) {
    Event event = event_at(path, hit, facet);
    if (ROUGH_SURFACES && (thing.kind == KIND_DIELECTRIC || thing.kind == KIND_MIRROR))
        meet_microfacet(path, thing, draw, event);
    if (HAS_DIELECTRIC && IS_GLASS(thing.kind))
        event.boundary = cross_boundary(path.medium, hit.object, dot(path.direction, hit.normal_g) < 0.0);
    if (HAS_FILM) event.film = film_met(path, hit, thing, event.boundary);
    return event;
}

// Whether a crystal is on either side of it: its waves have shares of their own (`crystal_event`).
bool parts_waves(Event event, uint kind) { return HAS_CRYSTAL && IS_GLASS(kind) && meets_crystal(event.boundary); }

// Shares of all else.
void weigh(Path path, uint kind, inout Event event) {
    if (HAS_DIELECTRIC && IS_GLASS(kind)) {
        share_out(path, kind, event);
        return;
    }
    if (POLARISED) see_polarised(path, event);
    if (HAS_FILM && FILM_MET(event)) {
        event.theta = incidence_over_band(path, event);
        share_at(path.band, false, kind, event);
    } else if (ROUGH_SURFACES)
        event.reflectance = reflected_in_all(vec3(1.0), event.ground.thrown);
}

// Share of a path that a microfacet has turned which others do not hide or send on, over its band; nothing where it
// does not leave the surface. `side`: 1 where it was reflected, -1 where it was refracted.
vec3 leaving_share(Event event, Path path, bool geometric, float side) {
    Ground ground = event.ground;
    if (ground.width <= 0.0) return vec3(1.0);
    vec3 cosine = vec3(side * dot(path.direction, ground.normal));
    bool leaves = !geometric && cosine.y > 0.0;
    if (SPECTRAL_SWEEP && path.restricted != 0u) {
        cosine.x = side * dot(path.end_direction[0], ground.end_normal[0]);
        cosine.z = side * dot(path.end_direction[1], ground.end_normal[1]);
    }
    vec3 kept = leaves ? ground.regained * smith_share(cosine, ground.width) : vec3(0.0);
    if (SPECTRAL_GROUPS > 0 && !SPECTRAL_SWEEP) {
        vec2 turn = vec2(0.0);
        for (int g = 0; g < SPECTRAL_GROUPS; ++g) {
            float along = dot(path.ddirection[SPATIAL + g], ground.normal);
            turn += along * steps_to_ends(path, g);
        }
        vec2 change = leaves ? side * smith_slope(cosine.y, ground.width) * turn : vec2(0.0);
        float steepness = max(abs(change.x), abs(change.y)) / MOST_CHANGE;
        kept.xz *= 1.0 + change / max(steepness * steepness, 1.0);
    }
    return kept;
}

// The path reflected. Returns the share of it that leaves the surface: all, but of what microfacets hide. `geometric`:
// the facet's normal had to judge.
vec3 reflect_path(inout Path path, Event event, out bool geometric) {
    Deflection turned = reflect_at(event.frame, path.direction);
    geometric = turned.geometric;
    for (int c = 0; c < PATH_COLUMNS; ++c)
        path.ddirection[c] = reflected_column(turned, path.direction, path.ddirection[c], NORMAL_COLUMN(event, c));
    path.direction = turned.direction;
    if (SPECTRAL_SWEEP) {
        for (int end = 0; end < 2; ++end) {
            vec3 normal = turned.geometric ? turned.normal : event.end_normal[end], direction = path.end_direction[end];
            path.end_direction[end] = normalize(reflect_direction(direction, normal, dot(direction, normal)));
        }
    }
    if (POLARISED)
        path.polarisation = out_of_plane(behind_interface(event.seen, event.reflection), path.direction, event.s);
    return ROUGH_SURFACES ? leaving_share(event, path, geometric, 1.0) : vec3(1.0);
}

// The path refracted, in the medium behind; see `reflect_path`.
vec3 refract_path(inout Path path, Event event) {
    Deflection turned = event.refracted;
    float eta_it = event.n_i.y / event.n_t.y;
    for (int c = 0; c < PATH_COLUMNS; ++c) {
        float deta_it = 0.0;
        if (SPECTRAL_GROUPS > 0 && c >= SPATIAL && c < SPATIAL + SPECTRAL_GROUPS)
            deta_it = index_ratio_derivative(event.boundary, uint(c - SPATIAL), path.band.y, event.n_i.y, event.n_t.y);
        path.ddirection[c] =
            refracted_column(turned, path.direction, path.ddirection[c], NORMAL_COLUMN(event, c), eta_it, deta_it);
    }
    path.direction = turned.direction;
    path.medium = event.boundary.behind;
    if (SPECTRAL_SWEEP) {
        for (int end = 0; end < 2; ++end) {
            vec3 normal = turned.geometric ? turned.normal : event.end_normal[end], direction = path.end_direction[end];
            float eta_end = (end == 0 ? event.n_i.x : event.n_i.z) / (end == 0 ? event.n_t.x : event.n_t.z),
                  theta = dot(direction, normal);
            float cosine2 = transmitted_cosine2(theta, eta_end);
            vec3 position_l, direction_l;
            linear_end(path, end, position_l, direction_l);
            path.end_direction[end] = cosine2 > 0.0 && theta < 0.0
                ? normalize(refract_direction(direction, normal, theta, eta_end, sqrt(cosine2)))
                : direction_l;
        }
    }
    if (POLARISED)
        path.polarisation = out_of_plane(behind_interface(event.seen, event.transmission), path.direction, event.s);
    return ROUGH_SURFACES ? leaving_share(event, path, turned.geometric, -1.0) : vec3(1.0);
}

// The wavelength within the band where total internal reflection sets in, for an event that reflects some of it totally
// and some not; else a negative number. Where ends are carried the cosine is straight between the three that are known
// exactly, else it follows the columns.
float total_reflection_in_band(Path path, Event event) {
    bvec3 passes = greaterThan(event.cosine2, vec3(0.0));
    if (!any(passes) || all(passes)) return -1.0;
    float dtheta[SPECTRAL_GROUPS];
    vec2 straight = vec2(0.0);
    if (SPECTRAL_SWEEP) {
        for (int g = 0; g < SPECTRAL_GROUPS; ++g) dtheta[g] = 0.0;
        straight = event.theta.xz - event.theta.y;
    } else {
        for (int g = 0; g < SPECTRAL_GROUPS; ++g) dtheta[g] = incidence_column(path, event, g);
    }
    return total_reflection_onset(path.band, event.theta.y, dtheta, straight, event.boundary, passes);
}
