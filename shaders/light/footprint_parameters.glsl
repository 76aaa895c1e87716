// What `FootprintParameters` tells: of footprints, and of which photons these are.
layout(std140, binding = 0) uniform Parameters {
    uint first_photon;
    uint photon_count;
    uint classes;
    uint bands;
    uint var_samples;
    uint table_rows;
    float smoothing;
    float extent_limit;
    uint traced_row;
    float x_reference;
    uint stride;
    uint first_power;
    float y_scale;
    float y_offset;
    float narrowed;
    uint records;
};

// Photons of the group: as many as it may have, or as the buffer holds.
uint photons_there() {
    return min(photon_count, first_photon < records ? (records - first_photon - 1u) / stride + 1u : 0u);
}
