// What a path's power is weakened by; and, of a hero wavelength's path, of the three companions that share it as long
// as it is theirs too [Wilkie et al. 2014]. Without a hero all shares are the path's own.

// Leaves a path this share of its power, over its band, and its companions theirs.
void weaken(inout Path path, vec3 share, vec3 companions) {
    path.walk.flux_w *= share.y;
    path.throughput *= share;
    if (HERO) path.walk.companion_throughput.xyz *= companions;
}

// A spectral table's values for the companions.
vec3 companion_row(Path path, uint row) {
    if (HERO) {
        return spectral_row(row, path.walk.companion_x.xyz);
    } else {
        return vec3(1.0);
    }
}

// The share of the hero and its companions together, by which roulette judges: whoever of them leads, the odds are the
// same.
float common_share(Path path, float own, vec3 companions) {
    if (HERO && path.walk.companion_x.w > 0.0) return 0.25 * (own + dot(companions, vec3(1.0)));
    return own;
}

// From here on the hero's path is not that of its companions: none of them would have led to it, and it has all of its
// weight.
void leave_companions(inout Path path) {
    if (HERO) {
        path.throughput *= path.walk.companion_x.w > 0.0 ? 4.0 : 1.0;
        path.walk.companion_x.w = 0.0;
        path.walk.companion_throughput = vec4(0.0);
    }
}

// What glass makes of the companions.
struct Companions {
    vec3 reflectance, transmittance;
    bool stay;  // with the hero where it is refracted: nothing disperses
#if defined(HERO) && defined(POLARISED)
    vec3 s[3];
    Polarisation seen;
    FresnelPair reflection, transmission;
#endif
};

// Their state counts from the hero's axis.
Polarisation companions_of(Path path) {
    return Polarisation(
        path.polarisation.axis, path.walk.companion_q.xyz, path.walk.companion_u.xyz, path.walk.companion_v.xyz);
}

void keep_companions(inout Path path, Polarisation state) {
    path.walk.companion_q.xyz = state.q;
    path.walk.companion_u.xyz = state.u;
    path.walk.companion_v.xyz = state.v;
}

// A film's shares of theirs.
void companions_by_film(Path path, Event event, inout Companions companions) {
#if defined(HERO) && HAS_FILM
    if (!FILM_MET(event)) return;
#ifdef POLARISED
    event.seen = companions.seen;
#endif
    event.film.cosine = event.film.cosine.yyy;
    share_by_film(path.walk.companion_x.xyz, true, event);
    companions.reflectance = event.reflectance;
    companions.transmittance = event.transmittance;
#ifdef POLARISED
    companions.reflection = event.reflection;
    companions.transmission = event.transmission;
#endif
#endif
}

// `is_glass`: it has met glass; else what turns the hero turns them.
Companions companions_at(Path path, Event event, bool is_glass) {
    Companions companions;
    companions.reflectance = vec3(event.reflectance.y);
    companions.transmittance = transmittance_of(event).yyy;
    companions.stay = true;
#ifdef HERO
    if (POLARISED) {
        companions.s = event.s;
        companions.seen = in_plane(companions_of(path), path.direction, event.s);
        companions.reflection = companions.transmission = event.reflection;
    }
#ifdef HAS_DIELECTRIC
    if (!is_glass) {
        companions_by_film(path, event, companions);
        return companions;
    }
    vec3 n_i, n_t;
    interface_indices(event.boundary, path.walk.companion_x.xyz, n_i, n_t);
    vec3 eta_it = n_i / n_t, theta = vec3(event.theta.y), cosine2 = transmitted_cosine2(theta, eta_it);
    if (POLARISED) {
        companions.reflection = fresnel_reflection(theta, eta_it, cosine2);
        companions.reflection = OF_SHEET(event.boundary, companions.reflection);
        companions.transmission = fresnel_transmission(companions.reflection);
        companions.reflectance = polarised_share(companions.seen, companions.reflection);
    } else {
        companions.reflectance = fresnel_reflectance(theta, eta_it, cosine2);
        companions.reflectance = OF_SHEET(event.boundary, companions.reflectance);
    }
    bool polished = true;
    if (ROUGH_SURFACES) polished = event.ground.width <= 0.0;
    if (polished && !event.refracted.exists && event.cosine2.y > 0.0) companions.reflectance = vec3(1.0);
    companions.transmittance = 1.0 - companions.reflectance;
    companions.stay = IS_THIN(event.boundary) || all(lessThan(abs(eta_it - event.n_i.y / event.n_t.y), vec3(1e-7)));
    if (!event.refracted.exists && event.cosine2.y > 0.0) return companions;
#endif
    companions_by_film(path, event, companions);
#endif
    return companions;
}

// The companions' state behind what has turned the hero.
void polarise_companions(inout Path child, Companions companions, bool refracts) {
    if (HERO && POLARISED) {
        keep_companions(child,
            out_of_plane(behind_interface(companions.seen, refracts ? companions.transmission : companions.reflection),
                child.direction, companions.s));
    }
}
