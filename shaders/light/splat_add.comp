// Adds splats to sums in a buffer, with atomics: for devices whose rasteriser blends slowly. A work group a splat: the
// lines of texels that cross it are worked out LANES at a time, each one's stretch within the splat from its straight
// sides, and the texels of those stretches are shared out evenly, so that long thin splats cost no more than what they
// cover. What a texel gets is said by splat_texel.glsl, as for the rasteriser.
layout(local_size_x = LANES) in;

#include "lib/finite.glsl"
#include "light/splat_setup.glsl"
#include "light/splat_texel.glsl"
#include "light/splat_sums.glsl"

layout(std430, binding = 3) readonly buffer Commands {
    uint dispatch_words[];
};  // five a kind, the last the number of its splats

const int SIDES = 4;

shared int first_texel[LANES];
shared int texel_count[LANES];
#if SMALL || ONE_COLOUR
shared vec4 splat_colour[TARGETS];
#elif SWEPT
shared vec4 middles[TARGETS];
shared vec4 bends[TARGETS];
#endif

// Nearest to a place that texels can have: what is not a number ends somewhere.
int texel_from(float place, int limit) { return clamp(int(clamp(place, -1.0, float(limit) + 1.0)), 0, limit); }

void main() {
    int lane = int(gl_LocalInvocationID.x);
    uint splat_count = dispatch_words[5 * (KIND - 1) + 4];
    ivec2 size = ivec2(atlas_size);
    for (uint index = gl_WorkGroupID.x; index < splat_count; index += gl_NumWorkGroups.x) {
        SplatRecord splat = splats[lists[FIRST_OF_KIND + index]];
#if CONTACT_LINES
        uint side = side_taken_off(splat);
#endif
        if (SMALL || ONE_COLOUR) {
            for (int g = lane; g < TARGETS; g += LANES) splat_colour[g] = colour_of(splat, uint(g));
        } else if (SWEPT) {
            for (int g = lane; g < TARGETS; g += LANES) {
                middles[g] = channel_middles(splat, uint(g));
                bends[g] = channel_bends(splat, uint(g));
            }
        }
        // Sides in texels about the centre: normals, and how far.
        vec2 normals[SIDES];
        vec4 far;
        vec2 lowest, highest;
#if SMALL
        // The triangle that splat.vert draws.
        vec2 unit = 1.0 / splat.along;
        normals[0] = vec2(-unit.x, 0.0);
        normals[1] = vec2(0.0, -unit.y);
        normals[2] = unit;
        normals[3] = vec2(0.0);
        far = vec4(1.0, 1.0, 2.0, 1.0);
        lowest = -splat.along;
        highest = 3.0 * splat.along;
        bool drawn = all(greaterThan(splat.along, vec2(0.0)));
#else
        float area = splat.along.x * splat.across.y - splat.along.y * splat.across.x;
        bool drawn = is_finite(area) && area != 0.0;
        // Straight (xi, eta) of a place; what fans out is at that over 1 - dot(fan, it).
        vec2 to_xi = vec2(splat.across.y, -splat.across.x) / area, to_eta = vec2(-splat.along.y, splat.along.x) / area;
        vec4 all_of_it = all_of_splat(splat);
        vec2 to_w = vec2(0.0);
        if (FANS) to_w = splat.fan.x * to_xi + splat.fan.y * to_eta;
        normals[0] = -to_xi - all_of_it.x * to_w;
        normals[1] = -to_eta - all_of_it.y * to_w;
        normals[2] = to_xi + all_of_it.z * to_w;
        normals[3] = to_eta + all_of_it.w * to_w;
        far = vec4(-all_of_it.xy, all_of_it.zw);
        lowest = vec2(1e30);
        highest = vec2(-1e30);
        for (int corner = 0; corner < 4; ++corner) {
            vec2 at =
                vec2((corner & 1) == 0 ? all_of_it.x : all_of_it.z, (corner & 2) == 0 ? all_of_it.y : all_of_it.w);
            vec2 place = at.x * splat.along + at.y * splat.across;
            if (FANS) place /= 1.0 + dot(splat.fan, at);
            lowest = min(lowest, place);
            highest = max(highest, place);
        }
#endif
        // Texels whose middles lie in the box about the splat, in its rectangle and in the atlas.
        lowest = max(lowest + splat.centre, splat.rect.xy) - 0.5;
        highest = min(highest + splat.centre, splat.rect.zw) - 0.5;
        ivec2 first = ivec2(texel_from(ceil(lowest.x), size.x), texel_from(ceil(lowest.y), size.y));
        ivec2 last = ivec2(texel_from(floor(highest.x) + 1.0, size.x), texel_from(floor(highest.y) + 1.0, size.y)) - 1;
        // Lines go the way in which there are fewer of them.
        bool columns = last.x - first.x < last.y - first.y;
        ivec2 begin = columns ? first.yx : first, end = columns ? last.yx : last;
        vec2 middle = (columns ? splat.centre.yx : splat.centre) - 0.5;
        int lines = drawn ? max(end.y - begin.y + 1, 0) : 0;
        for (int done = 0; done < lines; done += LANES) {
            int line = begin.y + done + lane;
            float aside = float(line) - middle.y;
            float low = -1e30, high = 1e30;
            for (int s = 0; s < SIDES; ++s) {
                vec2 normal = columns ? normals[s].yx : normals[s];
                float most = far[s] - normal.y * aside;
                // A side along the lines holds all of a line or nothing.
                if (normal.x > 0.0) {
                    high = min(high, most / normal.x);
                } else if (normal.x < 0.0) {
                    low = max(low, most / normal.x);
                } else if (most < 0.0) {
                    high = -1e30;
                }
            }
            int from = max(texel_from(ceil(low + middle.x), end.x + 1), begin.x);
            int to = min(texel_from(floor(high + middle.x) + 1.0, end.x + 1) - 1, end.x);
            barrier();
            first_texel[lane] = from;
            texel_count[lane] = line <= end.y ? max(to - from + 1, 0) : 0;
            barrier();
            int i = 0, t = lane;
            while (true) {
                while (i < LANES && t >= texel_count[i]) {
                    t -= texel_count[i];
                    ++i;
                }
                if (i >= LANES) break;
                ivec2 texel = ivec2(first_texel[i] + t, begin.y + done + i);
                texel = columns ? texel.yx : texel;
                t += LANES;
                vec2 place = vec2(texel) + 0.5;
                vec2 away = place - splat.centre;
#if SMALL
                float share = small_share(away * splat.across, half_texel_of(splat));
#else
                vec2 at = vec2(dot(to_xi, away), dot(to_eta, away));
                float w = 1.0;
                if (FANS) {
                    w = 1.0 / (1.0 - dot(splat.fan, at));
                    at *= w;
                }
                vec3 shape = shape_of(splat), drawn_at = place_at(splat, at);
                float share = swept_share(drawn_at, shape, cycles_at(splat, at), splat.ripple.xyz, w);
                if (EDGE && LIGHT_EDGES) share *= clamp(lit_at(splat, at), 0.0, 1.0);
#endif
                if (CONTACT_LINES) share *= taken_at(place, side);
#if CUT
                vec4 band = band_of(splat);
                vec2 x = window_at(at.x, band);
                share *= throughput_over(vec4(0.5 * (x.x + x.y)), throughput_of(splat)).x / (2.0 * half_box_of(band));
                float curve_row = curve_row_of(splat);
#elif SWEPT && ONE_COLOUR
                share *= share_along(at.x);
#endif
                if (share == 0.0) continue;
                for (int g = 0; g < TARGETS; ++g) {
                    if (SMALL || ONE_COLOUR) {
                        add_to_sums(texel, size, g, share * splat_colour[g]);
                    } else if (CUT) {
                        add_to_sums(texel, size, g, share * window_energy(curve_row, x, g));
                    } else {
                        vec4 throughput =
                            throughput_swept(at.x, throughput_of(splat), band_of(splat), middles[g], bends[g]);
                        add_to_sums(texel, size, g, share * throughput * spectrum_at(drawn_at, shape, g));
                    }
                }
            }
        }
        // Colours stay until all lanes have used them.
        barrier();
    }
}
