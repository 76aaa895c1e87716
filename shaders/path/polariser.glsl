// A path through a polariser or a wave plate: a sheet that it passes straight. Its axis is what of it lies across the
// ray; light across that is weaker, or later by `retardance_um`.

#include "path/event.glsl"

// Changes of phase from one place of a band to the next, rad, from which on and up to which an interference that the
// three places cannot tell is given up: what is left is its mean.
#define FRINGE_FADES 1.5
#define FRINGE_GONE 3.0

// The path behind the sheet. Returns what passes of its power, over its band.
vec3 pass_polariser(inout Path path, Crystal sheet) {
    vec3 across = sheet.axis - dot(sheet.axis, path.direction) * path.direction, s[3];
    // Seen along its axis a sheet has none.
    s[0] = s[1] = s[2] = dot(across, across) > UPRIGHT ? normalize(across) : path.polarisation.axis;
    vec3 phase = vec3(0.0);
    if (sheet.retardance_um != 0.0) {
        for (int i = 0; i < 3; ++i)
            phase[i] =
                6.28318530718 * sheet.retardance_um / spectral_row(uint(INDEX_ROW) + sheet.extraordinary, path.band[i]);
    }
    float step = max(abs(phase.x - phase.y), abs(phase.z - phase.y)),
          joint = sqrt(sheet.passed_along * sheet.passed_across) * (1.0 - smoothstep(FRINGE_FADES, FRINGE_GONE, step));
    FresnelPair pair =
        FresnelPair(vec3(sheet.passed_along), vec3(sheet.passed_across), joint * cos(phase), -joint * sin(phase));
    Polarisation seen = in_plane(path.polarisation, path.direction, s);
    vec3 share = polarised_share(seen, pair);
    path.polarisation = out_of_plane(behind_interface(seen, pair), path.direction, s);
    return share;
}
