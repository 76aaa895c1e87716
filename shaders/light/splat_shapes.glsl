// A footprint as the record of a splat to be drawn, for `footprint.comp`: smaller than a texel, or swept along the
// spectrum. What is drawn of a splat, in its own frame; lengths in texels.
struct Blur {
    vec2 e;  // along the sweep
    vec2 m;  // across
    float shear;
    float box;  // across: a box, and a Gaussian of variance s2
    float s2;
    float along2;
    float box_along;  // a cut band's blur along the sweep is a box, so wide; else it is Gaussian, of variance along2
    float sweep;
};

// Fourier transform of the splat at the frequency k, cycles a texel.
float damping(Blur blur, vec2 k) {
    float ke = dot(k, blur.e);
    float km = dot(k, blur.m) + blur.shear * ke;
    return exp(-0.5 * TWO_PI * TWO_PI * (blur.s2 * km * km + blur.along2 * ke * ke)) * sinc_pi(blur.box * km)
        * sinc_pi(blur.box_along * ke) * sinc_pi(blur.sweep * ke);
}

// Sum over texel centres of the splat to be drawn, by Poisson's formula: 1 plus the harmonics that the texel grid sees.
float grid_sum(Blur blur, vec2 centre) {
    float total = 1.0;
    vec2 phase = centre - 0.5;
    for (int i = 0; i < 4; ++i) {
        vec2 k = i == 0 ? vec2(1.0, 0.0) : i == 1 ? vec2(0.0, 1.0) : i == 2 ? vec2(1.0, 1.0) : vec2(1.0, -1.0);
        total += 2.0 * damping(blur, k) * cos(TWO_PI * dot(k, phase));
    }
    return clamp(total, 0.7, 1.4);
}

// By the same formula splats about the points of a lattice add up to 1 and twice their transforms' cosines at the
// lattice's frequencies: a ripple, of 3.7 % at 0.45 spacings. Each splat takes it off, as waves about its own centre:
// then they add up to 1. So at every wavelength, about where that lands: a fragment's light is that of the wavelengths
// that land about `share` of its way along the sweep (as of a Gaussian sweep).
void flatten_lattice(inout SplatRecord splat, Blur blur, Footprint f, uint lattice) {
    splat.waves = vec4(0.0);
    splat.ripple = vec4(0.0);
    float area = f.axis_s.x * f.axis_t.y - f.axis_s.y * f.axis_t.x;
    if (lattice == 0u || abs(area) < 1e-6) return;
    vec2 steps[3];
    lattice_frequencies(float(lattice), steps[0], steps[1]);
    steps[2] = steps[0] + steps[1];
    vec2 along_s = f.per_spacing / area * vec2(f.axis_t.y, -f.axis_t.x),
         along_t = f.per_spacing / area * vec2(-f.axis_s.y, f.axis_s.x);
    float own = blur.along2 + blur.box_along * blur.box_along * TEXEL_VARIANCE,
          swept = blur.sweep * blur.sweep * TEXEL_VARIANCE;
    float share = swept / (own + swept);
    blur.sweep = 0.0;
    vec2 k[3];
    vec3 heights, kept;
    for (int i = 0; i < 3; ++i) {
        k[i] = steps[i].x * along_s + steps[i].y * along_t;
        // A wave as short as a texel is not there: the texel has the mean of it.
        float coarse = max(abs(k[i].x), abs(k[i].y)), along = TWO_PI * dot(k[i], blur.e);
        // As a footprint's own Gaussian damps it, or more; of a needle's width float32 knows nothing, nor of waves
        // across it.
        float own_cycles2 = f.per_spacing * f.per_spacing * dot(steps[i], steps[i]) - f.taken * dot(k[i], k[i]),
              most = 2.0 * exp(-0.5 * TWO_PI * TWO_PI * max(own_cycles2, 0.0));
        heights[i] = clamp(damping(blur, k[i]), 0.0, most) * clamp(5.0 - 5.0 * coarse, 0.0, 1.0);
        kept[i] = 2.0 * exp(-0.5 * along * along * share * own);
    }
    // Each splat's own waves are summed over the lattice too: what that adds at the others' frequencies is second
    // order.
    vec3 taken = heights - 2.0 * heights.yxx * heights.zzy;
    splat.ripple = vec4(taken * kept, 0.0);
    splat.waves = vec4((1.0 - share) * dot(k[0], splat.along), dot(k[0], splat.across),
        (1.0 - share) * dot(k[1], splat.along), dot(k[1], splat.across));
    splat.amplitude /= 1.0 - 2.0 * dot(heights, taken);
}

// Whether the photon has another range than its table's band: a part of it, or what a local gain put there. One of no
// width stands for all of it.
bool is_cut(PhotonRecord photon, vec4 band) {
    return photon.x_hi > photon.x_lo && any(greaterThan(abs(vec2(photon.x_lo, photon.x_hi) - band.xy), vec2(1e-5)));
}

// Throughput averaged over the light of the band. `power_w`: `photon_power`.
float mean_throughput(PhotonRecord photon, float power_w, vec4 band) {
    if (HERO) {
        // Each of the four wavelengths has its own (`carry_companions`).
        return 1.0;
    } else if (POINT_SPECTRUM) {
        return photon.throughput.y;
    } else {
        // By the table that `power_w` is from: it spreads a line at a band's end over both bands.
        float whole_w = 0.0;
        if (band.y > band.x && photon.x_hi > photon.x_lo) {
            for (uint k = 0u; k < 2u * POWER_STEPS; ++k) whole_w += step_w[k];
        }
        return whole_w > 0.0 ? power_w / whole_w : photon.throughput.y;
    }
}

// Weights of the hero and its companions, and where in the tables they look up their energies: two cells a number,
// exact below 2^24.
void carry_companions(inout SplatRecord splat, PhotonRecord photon) {
    splat.throughput = vec4(photon.throughput.y, photon.companion_throughput.xyz);
    vec4 x = vec4(photon.x_anchor, photon.companion_x.xyz);
    vec4 cell = min(floor(x * float(DENSITY_CELLS)), float(DENSITY_CELLS - 1u));
    splat.x_range = cell.xz * float(DENSITY_CELLS) + cell.yw;
}

// Middle of step k of those whose power `step_w` holds, where the band ends at -half and half and its anchor is at
// `anchor`.
float step_place(uint k, float half_band, float anchor) {
    float place = (float(k % POWER_STEPS) + 0.5) / float(POWER_STEPS);
    return k < POWER_STEPS ? mix(-half_band, anchor, place) : mix(anchor, half_band, place);
}

// Where in its band a photon's anchor is, 0 to 1.
float anchor_in_band(PhotonRecord photon) {
    float width = photon.x_hi - photon.x_lo;
    return width > 0.0 ? clamp((photon.x_anchor - photon.x_lo) / width, 0.0, 1.0) : 0.5;
}

// Mean place of the light's power, and its standard deviation.
vec2 spread_of_power(float half_band, float anchor) {
    vec3 moments = vec3(0.0);
    for (uint k = 0u; k < 2u * POWER_STEPS; ++k) {
        float place = step_place(k, half_band, anchor),
              width = (k < POWER_STEPS ? half_band + anchor : half_band - anchor) / float(POWER_STEPS);
        moments += step_w[k] * vec3(1.0, place, place * place + width * width / 12.0);
    }
    vec2 means = moments.yz / max(moments.x, 1e-30);
    return vec2(means.x, sqrt(max(means.y - means.x * means.x, 0.0)));
}

// Throughput over a band that ends at `ends`, as `throughput_over` takes it.
vec4 straight_throughput(PhotonRecord photon, vec2 ends) {
    float width = photon.x_hi - photon.x_lo;
    float anchor = anchor_in_band(photon);
    float at = mix(ends.x, ends.y, anchor);
    return vec4(at, photon.throughput.y,
        anchor > 1e-3 && width > 0.0 ? (photon.throughput.y - photon.throughput.x) / (at - ends.x) : 0.0,
        anchor < 0.999 && width > 0.0 ? (photon.throughput.z - photon.throughput.y) / (ends.y - at) : 0.0);
}

// Of what has one colour: over [-1, 1], such that all of its power counts `mean`.
vec4 throughput_of_colour(PhotonRecord photon, float mean) {
    vec4 throughput = straight_throughput(photon, vec2(-1.0, 1.0));
    vec2 power = spread_of_power(1.0, throughput.x);
    float as_drawn =
        throughput_over(vec4(power.x), throughput).x + mean_bend(vec4(power.x), vec4(power.y), throughput).x;
    bool even = photon.x_hi <= photon.x_lo || as_drawn <= 0.0;
    return even ? vec4(throughput.x, mean, 0.0, 0.0) : vec4(throughput.x, mean / as_drawn * throughput.yzw);
}

SplatRecord small_splat(PhotonRecord photon, float power_w, float mean, Footprint f, vec4 band) {
    SplatRecord splat;
    float cut = 0.0;
    if (BAND_CUTS) cut = is_cut(photon, band) ? 1.0 : 0.0;
    vec2 variance = f.axis_s * f.axis_s + f.axis_t * f.axis_t + f.chord * f.chord * TEXEL_VARIANCE;
    vec2 sigma = sqrt(max(variance, vec2(1e-3)));
    splat.centre = f.centre + f.chord * (cut > 0.0 ? 0.0 : band.z - 0.5);
    splat.along = 0.5 + CUT * sigma;
    splat.across = SQRT_HALF / sigma;
    splat.amplitude = mean;
    splat.table_row = 0.0;
    splat.y_edge = 0.0;
    splat.y_box = 0.0;
    if (POINT_SPECTRUM) {
        splat.throughput = vec4(photon.x_anchor, photon.throughput.y, 0.0, 0.0);
    } else {
        splat.throughput = cut > 0.0 ? vec4(0.0, 1.0, 0.0, 0.0) : throughput_of_colour(photon, 1.0);
    }
    splat.x_range = vec2(photon.x_lo, photon.x_hi);
    splat.xi_half = cut;
    splat.inverse_sigma_xi = 0.0;
    splat.waves = vec4(0.0);
    splat.ripple = vec4(0.0);
    splat.fan = vec2(0.0);
    splat.kind = 1u;
    return splat;
}

// Share of a box of width `box`, blurred by `s`, within `edge` of its middle.
float kept_by_cut(float edge, float box, float s) {
    return 1.0 - 2.0 * s / box * (normal_excess((edge - 0.5 * box) / s) - normal_excess((edge + 0.5 * box) / s));
}

// Power that fragments (splat_swept.frag) add up to: each wavelength is blurred over places of other throughput, which
// is straight between the low end of the band, the anchor and the high end, and even beyond. Blurred, a kink is its
// size times a normal variable's mean excess.
float power_of_fragments(float xi_half, float inverse_sigma_xi, vec4 throughput) {
    float lowest = throughput.y - throughput.z * (xi_half + throughput.x), power = 0.0;
    vec3 kinks = vec3(-xi_half, throughput.x, xi_half),
         bends = vec3(throughput.z, throughput.w - throughput.z, -throughput.w);
    float part = sweeps_part(xi_half, inverse_sigma_xi), sigma = max(part * SQRT_HALF / inverse_sigma_xi, 1e-6);
    vec2 spread = spread_of_power(xi_half, throughput.x);
    float bend = (1.0 - part) * mean_bend(vec4(spread.x), vec4(spread.y), throughput).x;
    for (uint k = 0u; k < 2u * POWER_STEPS; ++k) {
        vec3 z = (kinks - mix(spread.x, step_place(k, xi_half, throughput.x), part)) / sigma;
        power += step_w[k]
            * (lowest + bend + sigma * dot(bends, vec3(normal_excess(z.x), normal_excess(z.y), normal_excess(z.z))));
    }
    return power;
}

const int WINDOWS = 8;

// Mean throughput of what fragments (splat_cut.frag) add up to: each has the light of a window on the band, `reach` to
// both sides as a share of the sweep, times the throughput in the window's middle. Over that of the light itself it is
// what they draw too much.
float throughput_of_windows(PhotonRecord photon, float reach, vec4 throughput, uint light_and_class) {
    vec2 sums = vec2(0.0);
    for (int i = 0; i < WINDOWS; ++i) {
        float middle = (0.5 + reach) * (2.0 * (float(i) + 0.5) / float(WINDOWS) - 1.0);
        vec2 x = mix(vec2(photon.x_lo), vec2(photon.x_hi), 0.5 + clamp(middle + vec2(-reach, reach), -0.5, 0.5));
        float power = power_until(light_and_class, x.y) - power_until(light_and_class, x.x);
        sums += power * vec2(1.0, throughput_over(vec4(0.5 * (x.x + x.y)), throughput).x);
    }
    return sums.x > 0.0 ? sums.y / sums.x : 0.0;
}

// Change of W per unit of xi and of eta: what the splat's half extents are divided by at its ends. Along one of both,
// and so little over the spectrum that none of that is left out.
vec2 fan_of_splat(Footprint f, vec2 along, vec2 across, float xi_half) {
    float longer = sqrt(max(dot(f.axis_s, f.axis_s), dot(f.axis_t, f.axis_t))), change = length(f.fan) * longer;
    if (change < LEAST_FAN || longer < LEAST_FANNED) return vec2(0.0);
    vec2 fan = min(1.0, MOST_FAN / change) * vec2(dot(f.fan, along), dot(f.fan, across));
    if (abs(fan.x) * xi_half > 0.8) fan *= 0.8 / (abs(fan.x) * xi_half);
    if (abs(fan.x) > abs(fan.y)) {
        fan.y = clamp(fan.y, -FAN_ASIDE, FAN_ASIDE);
    } else {
        fan.x = clamp(fan.x, -FAN_ASIDE, FAN_ASIDE);
    }
    return fan;
}

// Smaller principal variance of the footprint, texels².
float thin_variance(Footprint f) {
    float trace = f.axis_s.x * f.axis_s.x + f.axis_t.x * f.axis_t.x + f.axis_s.y * f.axis_s.y + f.axis_t.y * f.axis_t.y;
    float area = f.axis_s.x * f.axis_t.y - f.axis_s.y * f.axis_t.x;
    float root = sqrt(max(0.25 * trace * trace - area * area, 0.0));
    return 0.5 * trace - root;
}

// Product of the standard deviations of a footprint swept along a quarter of its chord, texels²: what only its sweep
// makes long shows other wavelengths within a texel.
float area_of_all(Footprint f) {
    vec2 e = 0.25 * sqrt(TEXEL_VARIANCE) * f.chord;
    vec3 areas = vec3(f.axis_s.x * f.axis_t.y - f.axis_s.y * f.axis_t.x, f.axis_s.x * e.y - f.axis_s.y * e.x,
        f.axis_t.x * e.y - f.axis_t.y * e.x);
    return length(areas);
}

vec2 half_extent(SplatRecord splat) {
    if (splat.kind == 1u) return splat.along;
    vec4 part = part_that_fans(splat.fan);
    vec2 extent = vec2(0.0);
    for (int i = 0; i < 4; ++i) {
        vec2 corner = vec2((i & 1) == 0 ? part.x : part.z, (i & 2) == 0 ? part.y : part.w);
        extent = max(extent, abs(corner.x * splat.along + corner.y * splat.across) / (1.0 + dot(splat.fan, corner)));
    }
    return extent;
}

#include "light/splat_lines.glsl"

SplatRecord swept_splat(PhotonRecord photon, float power_w, float mean, Footprint f, uint light_and_class, vec4 band) {
    SplatRecord splat;
    vec3 cov =
        vec3(f.axis_s.x * f.axis_s.x + f.axis_t.x * f.axis_t.x, f.axis_s.x * f.axis_s.y + f.axis_t.x * f.axis_t.y,
            f.axis_s.y * f.axis_s.y + f.axis_t.y * f.axis_t.y);  // xx, xy, yy

    // The frame: along the chord. But a thin footprint must have its thin side across, where the texel's box is exact:
    // along its long axis then, if the chord leaves that by less than half a texel (blurred, its colours as one).
    float sweep = length(f.chord);
    float difference = 0.5 * (cov.x - cov.z);
    float radius = sqrt(difference * difference + cov.y * cov.y);
    vec2 e = difference >= 0.0 ? vec2(radius + difference, cov.y) : vec2(cov.y, radius - difference);
    e = dot(e, e) > 0.0 ? normalize(e) : vec2(1.0, 0.0);
    e *= dot(e, f.chord) < 0.0 ? -1.0 : 1.0;
    float aside = abs(e.x * f.chord.y - e.y * f.chord.x);
    float thin = 0.5 * (cov.x + cov.z) - radius;
    float blur = 0.0;
    if (sweep < 1e-4 || (thin < THIN_VARIANCE && aside < 0.5 && radius > aside * aside * TEXEL_VARIANCE)) {
        sweep = dot(e, f.chord);
        blur = aside * aside * TEXEL_VARIANCE;
    } else {
        e = f.chord / sweep;
    }
    vec2 m = vec2(-e.y, e.x);
    // From the axes, not from the covariance: of what is long and thin that has no digits left for the thin side.
    vec2 s_along = vec2(dot(f.axis_s, e), dot(f.axis_s, m)), t_along = vec2(dot(f.axis_t, e), dot(f.axis_t, m));
    float a = s_along.x * s_along.x + t_along.x * t_along.x;
    float b = s_along.x * s_along.y + t_along.x * t_along.y;
    float c = s_along.y * s_along.y + t_along.y * t_along.y;
    float area = s_along.x * t_along.y - s_along.y * t_along.x;
    float determinant = area * area - f.taken * (a + c - f.taken);
    a -= f.taken;
    c -= f.taken;

    // A texel seen along its m direction is a trapezoid: a box as wide as its longer side and, for the shorter, a
    // Gaussian of the same variance. The box is kept exactly (no ripple over the grid), the rest is Gaussian.
    vec2 side = abs(m);
    float box = max(side.x, side.y);
    float narrow = min(side.x, side.y);
    float s2 = max(c + blur, ACROSS_FLOOR * ACROSS_FLOOR) + narrow * narrow * TEXEL_VARIANCE;
    float c_total = s2 + box * box * TEXEL_VARIANCE;
    float shear = b / c_total;
    // a - b²/c_total, without a difference of what may be alike.
    float along2 = TEXEL_VARIANCE + (a * (c_total - c) + determinant) / c_total,
          sampled = SAMPLED_VARIANCE * (1.0 + shear * shear);
    bool cut = false;
    if (BAND_CUTS) {
        // Of what is thinner along the sweep than sampling allows, the texel's average is taken as of a cut band: no
        // light reaches beyond its texels.
        cut = is_cut(photon, band) || (along2 < sampled && photon.x_hi > photon.x_lo);
    }
    // There it is a box that texels side by side in their rows, or along their diagonals, share out.
    along2 = max(along2, cut ? TEXEL_VARIANCE / (box * box) : sampled);
    float sigma = max(sqrt(along2), sweep * MIN_SIGMA_TO_SWEEP);
    float row = 0.0;
    if (cut) {
        sweep = max(sweep, 0.05 * sigma);
    } else {
        // To the nearest row of the table, by changing what the picture depends on least: a blur that is small in the
        // sweep, or a sweep that is small in the blur. Rows: 4 an octave from 2^-8, 8 an octave from 2^-4.
        float octave = log2(clamp(sigma / max(sweep, 1e-6), MIN_SIGMA_TO_SWEEP, MAX_SIGMA_TO_SWEEP));
        row = octave < -4.0 ? round(4.0 * (octave + 8.0)) : 16.0 + round(8.0 * (octave + 4.0));
        float ratio = exp2(row < 16.0 ? 0.25 * row - 8.0 : 0.125 * (row - 16.0) - 4.0);
        if (ratio > 0.3) {
            sweep = sigma / ratio;
        } else {
            sigma = ratio * sweep;
        }
    }
    float reach = 0.5 * sweep + CUT * sigma;
    float xi_half = 0.5 * sweep / reach;

    float s = sqrt(s2);
    float y_edge = CUT * sqrt(c_total);
    float kept = kept_by_cut(y_edge, box, s);
    Blur drawn = Blur(e, m, shear, box, s2, cut ? 0.0 : sigma * sigma, cut ? sqrt(12.0) * sigma : 0.0, sweep);

    splat.centre = f.centre;
    splat.along = e * reach;
    splat.across = (m + shear * e) * y_edge;
    splat.amplitude = 1.0 / (reach * box * kept * grid_sum(drawn, f.centre));
    splat.table_row = (row + 0.5) / float(table_rows);
    splat.y_edge = y_edge * SQRT_HALF / s;
    splat.y_box = 0.5 * box * SQRT_HALF / s;
    if (POINT_SPECTRUM) {
        splat.throughput = vec4(photon.x_anchor, mean, 0.0, 0.0);
    } else if (ONE_COLOUR) {
        splat.throughput = throughput_of_colour(photon, mean);
    } else {
        // Slopes by xi, or by x for a cut band.
        splat.throughput = straight_throughput(photon, cut ? vec2(photon.x_lo, photon.x_hi) : vec2(-xi_half, xi_half));
        if (!cut && photon.x_hi > photon.x_lo && any(notEqual(photon.throughput.xz, photon.throughput.yy))) {
            float as_drawn = power_of_fragments(xi_half, SQRT_HALF * reach / sigma, splat.throughput);
            splat.amplitude *= as_drawn > 0.0 ? clamp(power_w / as_drawn, 0.5, 2.0) : 1.0;
        }
        if (BAND_CUTS && cut && any(notEqual(photon.throughput.xz, photon.throughput.yy))) {
            float as_drawn =
                throughput_of_windows(photon, sqrt(3.0) * sigma / sweep, splat.throughput, light_and_class);
            splat.amplitude *= as_drawn > 0.0 ? clamp(mean / as_drawn, 0.5, 2.0) : 1.0;
        }
    }
    splat.x_range = vec2(photon.x_lo, photon.x_hi);
    splat.xi_half = xi_half;
    splat.inverse_sigma_xi = SQRT_HALF * reach / sigma;
    splat.fan = cut ? vec2(0.0) : fan_of_splat(f, splat.along, splat.across, xi_half);
    if (splat.fan != vec2(0.0)) {
        // What is not drawn the rest has.
        vec4 part = part_that_fans(splat.fan);
        vec2 end = min(-part.xy, part.zw);
        float whole = kept_by_cut(reach, max(sweep, 0.1 * sigma), sigma);
        splat.amplitude *= 2.0 * whole / (whole + kept_by_cut(end.x * reach, max(sweep, 0.1 * sigma), sigma));
        splat.amplitude *= 2.0 * kept / (kept + kept_by_cut(end.y * y_edge, box, s));
    }
    splat.kind = cut ? 3u : 2u;
    if (LIGHT_EDGES) {
        splat.x_range = cut ? splat.x_range : vec2(0.0);
        splat.lit = 1.0;
        // A software renderer runs the body of an `if` for all photons, but that of a loop only where one of them goes
        // in.
        for (uint edge = cut ? 0u : photon.depth >> EDGE_BIT; edge != 0u; edge = 0u) cut_at_edge(splat, drawn, f, edge);
    }
    flatten_lattice(splat, drawn, f, lattice_of(photon));
    return splat;
}
