// What a path's power is weakened by; and, of a hero wavelength's path, of the three companions that share it as long
// as it is theirs too [Wilkie et al. 2014]. Without a hero all shares are the path's own.

// Leaves a path this share of its power, over its band, and its companions theirs.
void weaken(inout Path path, vec3 share, vec3 companions) {
    path.walk.flux_w *= share.y;
    path.throughput *= share;
    if (HERO) path.walk.companion_throughput.xyz *= companions;
}

// A spectral table's values for the companions.
vec3 companion_row(Path path, uint row) { return HERO ? spectral_row(row, path.walk.companion_x.xyz) : vec3(1.0); }

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
    vec3 s[3];
    Polarisation seen;
    FresnelPair reflection, transmission;
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

// `kind`: of the surface that the hero's path has met.
Companions companions_at(Path path, Event event, uint kind) {
    Companions companions;
    companions.reflectance = vec3(event.reflectance.y);
    companions.transmittance = transmittance_of(event).yyy;
    companions.stay = true;
    if (HERO) {
        if (POLARISED) {
            companions.s = event.s;
            companions.seen = event.seen = in_plane(companions_of(path), path.direction, event.s);
        }
        Event of = event;
        of.theta = event.theta.yyy;
        share_at(path.walk.companion_x.xyz, true, kind, of);
        if (IS_GLASS(kind) || (HAS_FILM && FILM_MET(event))) {
            companions.reflectance = of.reflectance;
            companions.transmittance = transmittance_of(of);
        }
        if (HAS_DIELECTRIC && IS_GLASS(kind)) {
            bool polished = true;
            if (ROUGH_SURFACES) polished = event.ground.width <= 0.0;
            if (polished && !event.refracted.exists && event.cosine2.y > 0.0) {
                companions.reflectance = vec3(1.0);
                companions.transmittance = vec3(0.0);
            }
            companions.stay = all(lessThan(abs(of.n_i / of.n_t - event.n_i.y / event.n_t.y), vec3(1e-7)));
        }
        if (POLARISED) {
            companions.reflection = of.reflection;
            companions.transmission = of.transmission;
        }
    }
    return companions;
}

// The companions' state behind what has turned the hero.
void polarise_companions(inout Path child, Companions companions, bool refracts) {
    if (HERO && POLARISED)
        keep_companions(child,
            out_of_plane(behind_interface(companions.seen, refracts ? companions.transmission : companions.reflection),
                child.direction, companions.s));
}
