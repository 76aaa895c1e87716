// Edges of what is overexposed, without steps: app/base/highlights.py tells why and how. Pure functions.
#include "lib/tone.glsl"

const float STEP_WHITE = 1.0;
const float STEP_STEEPNESS = 4.0;

// A step within a pixel: the colours and norms on its two sides, and by how much they are seen to differ; no step: 0.
struct PixelStep {
    vec3 bright;
    vec3 dark;
    float high;
    float low;
    float contrast;
};

// Of a grey its value; else at most the largest channel.
float exposed_norm(vec3 exposed) { return p_norm(max(exposed, 0.0)) * pow(3.0, -0.2); }

// Its fifth power, which is 1 where that is.
float exposed_fifths(vec3 exposed) { return fifth_powers(max(exposed, 0.0)) / 3.0; }

// A norm about as a display shows it, 0 to 1.
float seen_norm(float norm) { return norm / (1.0 + norm); }

// 1 where the slope beyond a pixel's neighbour is nothing beside the way `within` from the pixel to it.
float step_flatness(float beyond, float within) {
    return 1.0 - clamp(STEP_STEEPNESS * max(beyond, 0.0) / max(within, 1e-20), 0.0, 1.0);
}

// Takes the step of `pixel` between two pixels before it and two after it on a line, where that is more than the one
// found so far.
void find_step(inout PixelStep found, vec3 pixel, vec3 before2, vec3 before, vec3 after, vec3 after2) {
    float own = exposed_norm(pixel), n_before = exposed_norm(before), n_after = exposed_norm(after);
    bool rises = n_after > n_before;
    vec3 a = rises ? after : before, b = rises ? before : after;
    float n_a = max(n_after, n_before), n_b = min(n_after, n_before);
    float n_a2 = exposed_norm(rises ? after2 : before2), n_b2 = exposed_norm(rises ? before2 : after2);
    // Of the bright side what is seen of its slope counts.
    float flat_a = step_flatness(seen_norm(n_a2) - seen_norm(n_a), seen_norm(n_a) - seen_norm(own));
    float flat_b = step_flatness(n_b - n_b2, own - n_b);
    float high = mix(own, n_a, flat_a), low = mix(own, n_b, flat_b);
    float contrast = n_a > own && own > n_b ? seen_norm(high) - seen_norm(low) : 0.0;
    if (contrast <= found.contrast) return;
    found = PixelStep(mix(pixel, a, flat_a), mix(pixel, b, flat_b), high, low, contrast);
}

// Share of the pixel that the brighter side covers.
float step_share(PixelStep found, float own) {
    return clamp((own - found.low) / max(found.high - found.low, 1e-20), 0.0, 1.0);
}

// How far the brighter side is overexposed, 0 to 1.
float step_weight(PixelStep found) {
    return found.contrast > 0.0 ? clamp(found.high / STEP_WHITE - 1.0, 0.0, 1.0) : 0.0;
}

// Factor on a pixel's shown colour: from a bent tone curve to a straight one between what is shown of both sides and of
// their mixture.
vec3 step_factor(vec3 bright, vec3 dark, vec3 mixture, float share, float weight) {
    vec3 straight = mix(dark, bright, share);
    return 1.0 + weight * (min(straight / max(mixture, 1e-6), 1.0) - 1.0);
}

// The greater norm, or power of one, at the ends of a run of no more than three overexposed pixels in a line. `ahead`,
// `back`: the least norms among one, two and three pixels to either side of one of them.
float end_of_run(vec3 ahead, vec3 back) {
    vec3 ends = max(ahead, back.zyx);
    return min(ends.x, min(ends.y, ends.z));
}

// What a pixel shows of one beside it in a small group that is overexposed: `around` is the greatest norm at the ends
// of its runs, along rows, columns and diagonals, and the pixel's own. A Gaussian of half a pixel.
float glint_share(float norm, float around) {
    return 0.135 * clamp(norm / STEP_WHITE - 1.0, 0.0, 1.0) * clamp(2.0 - 2.0 * around / STEP_WHITE, 0.0, 1.0);
}
