// How much of a pixel, or of a part of it, a screen polygon covers at each place of its band: edges that move with the wavelength let an interval
// through at each of the pixel's points; here they are as a histogram of eight bins over the band, whose mean over any interval is exact.
#ifndef CAMERA_BEAM_COVER_GLSL
#define CAMERA_BEAM_COVER_GLSL

struct BandCover {
    vec4 low;       // bins of the lower half of the band
    vec4 high;
    float x_lo;
    float per_x;    // one over the width of the band
    bool varies;
};
BandCover cover;

const vec4 COVER_BINS = vec4(0.0, 1.0, 2.0, 3.0);

// What an interval [lo, hi] of t adds to the bins, from 0 to 1 each.
void add_cover(float lo, float hi)
{
    cover.low += clamp(8.0 * hi - COVER_BINS, 0.0, 1.0) - clamp(8.0 * lo - COVER_BINS, 0.0, 1.0);
    cover.high += clamp(8.0 * hi - 4.0 - COVER_BINS, 0.0, 1.0) - clamp(8.0 * lo - 4.0 - COVER_BINS, 0.0, 1.0);
}

// Integral of the cover from t = 0 on, in bins.
float cover_until(float t)
{
    return dot(cover.low, clamp(8.0 * t - COVER_BINS, 0.0, 1.0)) + dot(cover.high, clamp(8.0 * t - 4.0 - COVER_BINS, 0.0, 1.0));
}

// Mean cover over the wavelengths [lo, hi].
float mean_cover(float lo, float hi)
{
    float t_lo = (lo - cover.x_lo) * cover.per_x, t_hi = (hi - cover.x_lo) * cover.per_x;
    return cover.varies ? (cover_until(t_hi) - cover_until(t_lo)) / max(8.0 * (t_hi - t_lo), 1e-6) : cover.low.x;
}

// The interval of t at which a point is on the inner side of an edge that is `at_lo` away at t = 0 and `at_hi` at t = 1, within [lo, hi].
void cut_interval(float at_lo, float at_hi, inout float lo, inout float hi)
{
    float crossing = at_lo / (at_lo - at_hi);
    lo = at_lo < 0.0 ? (at_hi < 0.0 ? 2.0 : max(lo, crossing)) : lo;
    hi = at_hi < 0.0 ? (at_lo < 0.0 ? -1.0 : min(hi, crossing)) : hi;
}

#endif
