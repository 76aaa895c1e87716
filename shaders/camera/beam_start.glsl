// Camera paths that carry on what beams hand over, for `camera.comp`.
#ifndef BEAM_START_GLSL
#define BEAM_START_GLSL

// The path that a beam has brought so far. It is of one cell of the table; a band's border may lie within, but how often its wavelengths are drawn
// is told by whole cells.
CameraPath started_path(BeamStart start)
{
    CameraPath path = camera_path(uvec2(0u), THE_SAMPLE, 1.0);
    path.position = start.position;
    path.direction = start.direction;
    path.origin = RayOrigin(start.last_primitive, start.last_object, uint(start.is_inside != 0u), start.inside_mask);
    path.medium = MediumStack(start.inside_mask, start.inside_object);
    path.dposition[0] = start.dposition_x;
    path.dposition[1] = start.dposition_y;
    path.ddirection[0] = start.ddirection_x;
    path.ddirection[1] = start.ddirection_y;
#ifdef POLARISED
    path.polarisation = Polarisation(start.axis, vec3(start.stokes_q), vec3(start.stokes_u), vec3(start.stokes_v));
#endif
    path.inverse_pdf = start.weight;
    path.branch_weight = p.start_share;
    path.key = start.key;
    path.depth = int(start.depth);
#ifdef HAS_DISPERSION
    uint cell = min(uint(start.x * float(EMISSION_CELLS)), uint(EMISSION_CELLS - 1));
    path.band = vec3(float(cell), start.x * float(EMISSION_CELLS), float(cell + 1u)) / float(EMISSION_CELLS);
    path.inverse_pdf /= max(cell_cdf[cell + 1u] - cell_cdf[cell], 1e-9);
    path.restricted = 1u;
#endif
    return path;
}

#endif
