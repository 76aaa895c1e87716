// Adds splats to sums in a buffer, with atomics: for devices whose rasteriser blends slowly. A team of invocations a
// piece of a splat (splat_pieces.glsl): each line of texels that crosses it is worked out, its stretch within the splat
// from its straight sides, and the texels of those stretches are shared out evenly, so that long thin splats cost no
// more than what they cover. What a texel gets is said by splat_texel.glsl, as for the rasteriser.
layout(local_size_x = LANES) in;

#include "lib/finite.glsl"
#include "light/splat_setup.glsl"
#include "light/splat_texel.glsl"
#include "light/splat_sums.glsl"
#include "light/splat_sides.glsl"
#include "light/splat_pieces.glsl"

layout(std430, binding = 3) readonly buffer Commands { uint kind_words[KIND_WORDS * KINDS]; };
layout(std430, binding = 8) readonly buffer Entries { uvec2 entries[]; };  // slot, piece (splat_list_any.comp)
uniform uint entries_room;
#include "light/splat_entries.glsl"

shared int first_texel[TEAMS * LINES_ROOM];
shared int texel_count[TEAMS * LINES_ROOM];
#if SMALL || ONE_COLOUR
shared vec4 splat_colour[TEAMS * TARGETS];
#elif SWEPT
shared vec4 middles[TEAMS * TARGETS];
shared vec4 bends[TEAMS * TARGETS];
#endif

// Nearest to a place that texels can have: what is not a number ends somewhere.
int texel_from(float place, int limit) { return clamp(int(clamp(place, -1.0, float(limit) + 1.0)), 0, limit); }

void main() {
    int lane = int(gl_LocalInvocationID.x) % TEAM, team = int(gl_LocalInvocationID.x) / TEAM;
    int own_lines = team * LINES_ROOM, own_colours = team * TARGETS;
    uint count = kind_words[KIND_WORDS * uint(KIND - 1) + ENTRIES_AT];
    uint at_once = pieces_an_entry(), first_of_kind = first_entry(uint(KIND - 1), at_once);
    ivec2 size = ivec2(atlas_size);
    for (uint done = gl_WorkGroupID.x * uint(TEAMS); done < count; done += gl_NumWorkGroups.x * uint(TEAMS)) {
        uint index = done + uint(team);
        uvec2 entry = entries[first_of_kind + min(index, count - 1u)];
        SplatRecord splat = splat_at(entry.x);
        int pieces = max(int(splat.kind >> PIECES_BIT), 1);
#if CONTACT_LINES
        uint side = side_taken_off(splat);
#endif
        // Colours stay until all have used them.
        barrier();
        if (SMALL || ONE_COLOUR) {
            for (int g = lane; g < TARGETS; g += TEAM) splat_colour[own_colours + g] = colour_of(splat, uint(g));
        } else if (SWEPT) {
            for (int g = lane; g < TARGETS; g += TEAM) {
                middles[own_colours + g] = channel_middles(splat, uint(g));
                bends[own_colours + g] = channel_bends(splat, uint(g));
            }
        }
#if SMALL
        bool drawn = all(greaterThan(splat.along, vec2(0.0)));
        Sides sides = small_sides(splat);
#else
        if (!FANS) splat.fan = vec2(0.0);
        bool drawn = has_area(splat);
        Sides sides = swept_sides(splat, all_of_splat(splat));
        vec2 to_xi, to_eta;
        frame_of(splat, to_xi, to_eta);
#endif
        // Texels whose middles lie in the box about the splat, in its rectangle and in the atlas.
        vec2 lowest = max(sides.lowest + splat.centre, splat.rect.xy) - 0.5;
        vec2 highest = min(sides.highest + splat.centre, splat.rect.zw) - 0.5;
        ivec2 first = ivec2(texel_from(ceil(lowest.x), size.x), texel_from(ceil(lowest.y), size.y));
        ivec2 last = ivec2(texel_from(floor(highest.x) + 1.0, size.x), texel_from(floor(highest.y) + 1.0, size.y)) - 1;
        bool columns = (splat.kind >> COLUMNS_BIT & 1u) != 0u;
        ivec2 begin = columns ? first.yx : first, end = columns ? last.yx : last;
        vec2 middle = (columns ? splat.centre.yx : splat.centre) - 0.5;
        int lines = drawn && index < count ? max(end.y - begin.y + 1, 0) : 0;
        // A piece is so many lines, or one of so many parts of a line.
        int line_count = lines > pieces ? (lines + pieces - 1) / pieces : 1, parts = max(pieces / max(lines, 1), 1);
        for (int piece = int(entry.y); piece < int(entry.y + at_once); ++piece) {
            int first_line = piece / parts * line_count, part = piece % parts;
            int line_end = piece < pieces ? min(first_line + min(line_count, LINES_ROOM), lines) : 0;
            barrier();
            for (int line = first_line + lane; line < line_end; line += TEAM) {
                vec2 stretch = stretch_on_line(sides, columns, float(begin.y + line) - middle.y) + middle.x;
                int from = max(texel_from(ceil(stretch.x), end.x + 1), begin.x);
                int texels = max(min(texel_from(floor(stretch.y) + 1.0, end.x + 1) - 1, end.x) - from + 1, 0);
                int first_of_part = texels * part / parts;
                first_texel[own_lines + line - first_line] = from + first_of_part;
                texel_count[own_lines + line - first_line] = texels * (part + 1) / parts - first_of_part;
            }
            barrier();
            int line = first_line, t = lane;
            while (true) {
                while (line < line_end && t >= texel_count[own_lines + line - first_line]) {
                    t -= texel_count[own_lines + line - first_line];
                    ++line;
                }
                if (line >= line_end) break;
                ivec2 texel = ivec2(first_texel[own_lines + line - first_line] + t, begin.y + line);
                texel = columns ? texel.yx : texel;
                t += TEAM;
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
                        add_to_sums(texel, size, g, share * splat_colour[own_colours + g]);
                    } else if (CUT) {
                        add_to_sums(texel, size, g, share * window_energy(curve_row, x, g));
                    } else {
                        vec4 throughput = throughput_swept(at.x, throughput_of(splat), band_of(splat),
                            middles[own_colours + g], bends[own_colours + g]);
                        add_to_sums(texel, size, g, share * throughput * spectrum_at(drawn_at, shape, g));
                    }
                }
            }
        }
    }
}
