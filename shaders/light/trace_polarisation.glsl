// A ray's state of polarisation in flight, for `trace.comp`.
#ifndef TRACE_POLARISATION_GLSL
#define TRACE_POLARISATION_GLSL

Polarisation polarisation_of(RayRecord ray)
{
    return Polarisation(vec3(ray.axis_x, ray.axis_y, ray.axis_z), ray.stokes_q, ray.stokes_u, ray.stokes_v);
}

void keep_polarisation(inout RayRecord ray, Polarisation state)
{
    ray.stokes_q = state.q;
    ray.stokes_u = state.u;
    ray.stokes_v = state.v;
    ray.axis_x = state.axis.x;
    ray.axis_y = state.axis.y;
    ray.axis_z = state.axis.z;
}

// s of the planes of incidence at the three places of the band.
void planes_of_incidence(RayRecord ray, ShadingFrame frame, out vec3 s[3])
{
    s[1] = incidence_axis(ray.direction, frame.normal, vec3(ray.axis_x, ray.axis_y, ray.axis_z));
    s[0] = s[2] = s[1];
#if SPECTRAL_GROUPS > 0
    vec3 directions[2] = vec3[](ray.direction, ray.direction), normals[2] = vec3[](frame.normal, frame.normal);
    for (int g = 0; g < SPECTRAL_GROUPS; ++g) {
        vec2 change = vec2(variable_step(uint(g), ray.x_lo, ray.x_anchor), variable_step(uint(g), ray.x_hi, ray.x_anchor));
        for (int end = 0; end < 2; ++end) {
            directions[end] += change[end] * ray.ddirection[SPATIAL + g].xyz;
            normals[end] += change[end] * NORMAL_COLUMN(SPATIAL + g);
        }
    }
    s[0] = incidence_axis(directions[0], normals[0], s[1]);
    s[2] = incidence_axis(directions[1], normals[1], s[1]);
#endif
}

Polarisation met_in_plane(RayRecord ray, vec3 s[3])
{
    return in_plane(polarisation_of(ray), ray.direction, s);
}

// The state of a ray that an event has turned; `seen`: before, in its plane of incidence.
void polarise(inout RayRecord child, Polarisation seen, FresnelPair pair, vec3 s[3])
{
    keep_polarisation(child, out_of_plane(behind_interface(seen, pair), child.direction, s));
}

#ifdef HERO
// The same of the three wavelengths that share the path, whose states count from the same axis.
Polarisation companions_in_plane(RayRecord ray, vec3 s[3])
{
    Polarisation state = polarisation_of(ray);
    return in_plane(Polarisation(state.axis, ray.companion_q.xyz, ray.companion_u.xyz, ray.companion_v.xyz), ray.direction, s);
}

void polarise_companions(inout RayRecord child, Polarisation seen, FresnelPair pair, vec3 s[3])
{
    Polarisation state = out_of_plane(behind_interface(seen, pair), child.direction, s);
    child.companion_q.xyz = state.q;
    child.companion_u.xyz = state.u;
    child.companion_v.xyz = state.v;
}
#endif

#ifdef HAS_GRATING
// Behind an order of a grating.
void polarise_order(inout RayRecord child, RayRecord ray, bool reflects)
{
    keep_polarisation(child, behind_grating(polarisation_of(ray), ray.direction, child.direction, reflects));
#ifdef HERO
    Polarisation companions = polarisation_of(ray);
    companions = Polarisation(companions.axis, ray.companion_q.xyz, ray.companion_u.xyz, ray.companion_v.xyz);
    companions = behind_grating(companions, ray.direction, child.direction, reflects);
    child.companion_q.xyz = companions.q;
    child.companion_u.xyz = companions.u;
    child.companion_v.xyz = companions.v;
#endif
}
#endif

#ifdef BAND_CUTS
// The state of part `band` of a ray that still has its whole band, and of its own direction.
Polarisation polarisation_of_part(RayRecord ray, vec3 band)
{
    return band_polarisation(polarisation_of(ray), band_of(ray), ray.throughput, band);
}

// That of a part that was turned to where its own wavelength goes.
void keep_polarisation_of_part(inout RayRecord part, Polarisation state)
{
    state.axis = normalize(state.axis - dot(state.axis, part.direction) * part.direction);
    keep_polarisation(part, state);
}
#endif

#endif
