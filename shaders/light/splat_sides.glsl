// The straight sides between which a splat is drawn, for splat_add.comp, which works out the texels there, and for
// footprint.comp, which counts them.
struct Sides {
    vec4 normal_x;  // about the splat's centre, texels: a place is within where its products with the normals are no
    vec4 normal_y;  // larger than `far`
    vec4 far;
    vec2 lowest;  // box about them
    vec2 highest;
};

// From a place about the centre to straight (xi, eta); what fans out is at that over 1 - dot(fan, it).
void frame_of(SplatRecord splat, out vec2 to_xi, out vec2 to_eta) {
    float area = splat.along.x * splat.across.y - splat.along.y * splat.across.x;
    to_xi = vec2(splat.across.y, -splat.across.x) / area;
    to_eta = vec2(-splat.along.y, splat.along.x) / area;
}

bool has_area(SplatRecord splat) {
    float area = splat.along.x * splat.across.y - splat.along.y * splat.across.x;
    return is_finite(area) && area != 0.0;
}

// Of `part`: least xi and eta, largest xi and eta.
vec2 corner_place(SplatRecord splat, vec4 part, int corner) {
    vec2 at = vec2((corner & 1) == 0 ? part.x : part.z, (corner & 2) == 0 ? part.y : part.w);
    return (at.x * splat.along + at.y * splat.across) / (1.0 + dot(splat.fan, at));
}

// A small splat is the triangle that splat.vert draws.
Sides small_sides(SplatRecord splat) {
    vec2 unit = 1.0 / splat.along;
    return Sides(vec4(-unit.x, 0.0, unit.x, 0.0), vec4(0.0, -unit.y, unit.y, 0.0), vec4(1.0, 1.0, 2.0, 1.0),
        -splat.along, 3.0 * splat.along);
}

Sides swept_sides(SplatRecord splat, vec4 part) {
    vec2 to_xi, to_eta;
    frame_of(splat, to_xi, to_eta);
    vec2 to_w = splat.fan.x * to_xi + splat.fan.y * to_eta;
    Sides sides;
    sides.normal_x = vec4(-to_xi.x, -to_eta.x, to_xi.x, to_eta.x) + vec4(-part.xy, part.zw) * to_w.x;
    sides.normal_y = vec4(-to_xi.y, -to_eta.y, to_xi.y, to_eta.y) + vec4(-part.xy, part.zw) * to_w.y;
    sides.far = vec4(-part.xy, part.zw);
    sides.lowest = vec2(1e30);
    sides.highest = vec2(-1e30);
    for (int corner = 0; corner < 4; ++corner) {
        vec2 place = corner_place(splat, part, corner);
        sides.lowest = min(sides.lowest, place);
        sides.highest = max(sides.highest, place);
    }
    return sides;
}

// Between which places on a line of texels, `aside` from the centre, those within the sides lie. Lines are rows, or
// columns. A side along the lines holds all of a line or nothing.
vec2 stretch_on_line(Sides sides, bool columns, float aside) {
    vec4 normal = columns ? sides.normal_y : sides.normal_x;
    vec4 most = sides.far - (columns ? sides.normal_x : sides.normal_y) * aside, at = most / normal;
    vec4 up = mix(vec4(1e30), at, greaterThan(normal, vec4(0.0)));
    vec4 down = mix(vec4(-1e30), at, lessThan(normal, vec4(0.0)));
    bool is_beside = any(lessThan(mix(vec4(0.0), most, equal(normal, vec4(0.0))), vec4(0.0)));
    float high = min(min(up.x, up.y), min(up.z, up.w)), low = max(max(down.x, down.y), max(down.z, down.w));
    return is_beside ? vec2(0.0, -1e30) : vec2(low, high);
}

// In how many pieces a splat is added, each of PIECE_TEXELS at most, and whether these are made of columns: bits from
// COLUMNS_BIT on.
uint pieces_to_add(SplatRecord splat) {
    if (splat.kind == 1u || !has_area(splat)) return 1u << PIECES_BIT;
    vec4 part = part_that_fans(splat.fan);
    Sides sides = swept_sides(splat, part);
    vec2 box = min(sides.highest + splat.centre, splat.rect.zw) - max(sides.lowest + splat.centre, splat.rect.xy);
    box = clamp(box, 0.0, 65535.0);
    // Lines go the way in which there are fewer of them. The longest stretch is at a corner.
    bool columns = box.x < box.y;
    float longest = 0.0;
    for (int corner = 0; corner < 4; ++corner) {
        vec2 place = corner_place(splat, part, corner);
        vec2 ends = stretch_on_line(sides, columns, columns ? place.x : place.y);
        longest = max(longest, ends.y - ends.x);
    }
    int lines = int(min(box.x, box.y)) + 1, texels = int(clamp(longest, 0.0, max(box.x, box.y))) + 1;
    int at_once = clamp(PIECE_TEXELS / texels, 1, MOST_LINES), parts = (texels + PIECE_TEXELS - 1) / PIECE_TEXELS;
    int pieces = (lines + at_once - 1) / at_once * parts;
    return uint(pieces) << PIECES_BIT | (columns ? 1u << COLUMNS_BIT : 0u);
}
