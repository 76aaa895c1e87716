// A picture in motion, what is seen directly: every pixel looks the caustic maps up. One invocation is for one cell
// between four points of the lattice and reads once what all its pixels share: on a software renderer reading that for
// every pixel takes five times as long as the lookups do. Where the points of a cell agree, on direct light and on
// which map of which object is shown (moving_cells.comp), both lie between its corners. Other pixels are listed for
// moving_uneven.comp: a program that holds all that these need would take twice as long, even where none is.
layout(local_size_x = 32, local_size_y = 8) in;

#include "camera/moving.glsl"

layout(rgba32f, binding = IMAGE_PICTURE) uniform writeonly restrict image2D picture;
layout(rgba32f, binding = IMAGE_PLACES) uniform readonly restrict image2D places;
layout(rgba32f, binding = IMAGE_LIGHT) uniform readonly restrict image2D light;
layout(r32ui, binding = IMAGE_CELLS) uniform readonly restrict uimage2D cells;
#include "camera/moving_lists.glsl"

// Texels that a pixel is long from which on two lookups stand for it, and up to which these do.
const float TWO_LOOKUPS = 1.25, MOST_TEXELS = 2.0;

// What lies between a cell's corners.
struct Corners {
    vec4 here;
    vec4 right;
    vec4 down;
    vec4 across;
};

vec4 between(Corners c, vec2 share) {
    return mix(mix(c.here, c.right, share.x), mix(c.down, c.across, share.x), share.y);
}

// How a cell's pixels look the map up.
struct MapLook {
    bool covered;  // there is one
    vec4 factor;  // from a texel's energy to radiance
    vec2 low, high;  // middles of the outermost texels: beyond its border a map keeps its own value
    vec2 apart;  // half the way between two lookups
    float lookups;
};

// `side`: of a pixel, of the cell's.
MapLook look_of(uint map, Corners places, vec2 side) {
    MapLook look =
        MapLook(map != NONE && map / LATTICE_OBJECTS != LATTICE_MAPS, vec4(0.0), vec2(0.0), vec2(0.0), vec2(0.0), 1.0);
    if (look.covered) {
        uint placement = map / LATTICE_OBJECTS, object = map % LATTICE_OBJECTS;
        Placement window = placements[placement];
        vec4 rect = window.rect;
        look.low = floor(rect.xy) + 0.5;
        look.high = ceil(rect.zw) - 0.5;
        // The pixel's longer side, in texels. Two bilinear lookups along it have the second moment of a box of its
        // length, taken of texels that are boxes themselves: d² = (length² - 1) / 12.
        vec2 texel = places.here.xy / places.here.z;
        vec2 right = side.x * (places.right.xy / places.right.z - texel),
             down = side.y * (places.down.xy / places.down.z - texel);
        vec2 longer = dot(right, right) > dot(down, down) ? right : down;
        float texels = length(longer), told_apart = min(texels, MOST_TEXELS);
        if (texels > TWO_LOOKUPS) {
            look.lookups = 2.0;
            look.apart = sqrt((told_apart * told_apart - 1.0) / 12.0) / texels * longer;
        }
        bool plain = receivers[object_at(object).receiver].reflectance_class == 0u;
        look.factor = p.map_scale * INVERSE_PI / (look.lookups * texel_area_at(window, vec3(0.0, 0.0, 1.0)))
#if COATS || ROUGH_DIFFUSE
            * vec4(1.0);  // `albedo_of` has the rest
#else
            * (plain ? object_colours[object] : vec4(1.0));
#endif
    }
    return look;
}

// Radiance by the caustic, at a texel.
vec4 caustic(MapLook look, vec2 texel) {
    vec2 to_uv = 1.0 / vec2(textureSize(caustic_map[0], 0));
    vec4 sum = textureLod(caustic_map[0], clamp(texel - look.apart, look.low, look.high) * to_uv, 0.0);
    if (look.lookups > 1.0)
        sum += textureLod(caustic_map[0], clamp(texel + look.apart, look.low, look.high) * to_uv, 0.0);
    return look.factor * map_to_channels(sum);
}

// Reflectance of the base that a pixel sees, for what the maps hold.
vec3 albedo_of(uvec2 pixel, uvec2 first) {
    SurfaceInteraction seen;
    seen.object = first.y;
    seen.direction = path_from(pixel, PIXEL_MIDDLE, 1.0).direction;
    seen.normal_g = normal_of(first.x);
    seen.reflectance = object_colours[first.y].rgb;
    if (COATS) seen.coat_normal = dot(seen.direction, seen.normal_g) < 0.0 ? seen.normal_g : -seen.normal_g;
    return base_albedo(seen, receivers[object_at(first.y).receiver].reflectance_class == 0u);
}

void list_uneven(uint number) {
    uint place = atomicAdd(uneven_count, 1u);
    pixels[place] = number;
    COUNT_GROUPS(uneven_groups, place, PIXELS_LISTED)
}

void list_specular(uint number) {
    uint place = atomicAdd(specular_count, 1u);
    pixels[specular_place(place)] = number;
    COUNT_GROUPS(specular_groups, place, PIXELS_LISTED)
}

void main() {
    ivec2 cell = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(cell, ivec2(m.lattice) - 1))) return;
    uvec2 from = uvec2(cell) * m.lattice_step;
    uint map = imageLoad(cells, cell).x;
    Corners lights = Corners(imageLoad(light, cell), imageLoad(light, cell + ivec2(1, 0)),
        imageLoad(light, cell + ivec2(0, 1)), imageLoad(light, cell + 1));
    // The last points of the lattice lie on the picture's border.
    vec2 side = 1.0 / vec2(max(min(from + m.lattice_step, p.size - 1u) - from, uvec2(1u)));
#if HAS_RECEIVERS
    Corners texels = Corners(imageLoad(places, cell), imageLoad(places, cell + ivec2(1, 0)),
        imageLoad(places, cell + ivec2(0, 1)), imageLoad(places, cell + 1));
    MapLook look = look_of(map, texels, side);
#endif
    for (uvec2 off = uvec2(0u); off.y < m.lattice_step;
        off = off.x + 1u < m.lattice_step ? off + uvec2(1u, 0u) : uvec2(0u, off.y + 1u)) {
        uvec2 pixel = from + off;
        vec2 share = vec2(off) * side;
        bool inside = all(lessThan(pixel, p.size));
        uvec2 first = inside ? seen_first(pixel) : uvec2(NONE);
        bool even = map != NONE && first.y == map % LATTICE_OBJECTS;
        vec4 found = even ? between(lights, share) : vec4(0.0);
        if (HAS_RECEIVERS) {
            // By all of them: a software renderer runs what an `if` leaves out, too.
            vec4 texel = between(texels, share), by_caustic = caustic(look, texel.xy / texel.z);
            if (even && look.covered)
                found += COATS || ROUGH_DIFFUSE ? by_caustic * vec4(albedo_of(pixel, first), 1.0) : by_caustic;
        }
        if (!even && inside) {
            bool specular = is_specular(kind_of(first));
            uint number = pixel.y * p.size.x + pixel.x;
            if (!specular) list_uneven(number);
            if (!COATS && specular) list_specular(number);
        }
        if (COATS) {
            // What a coat reflects is followed besides.
            uint kind = inside ? kind_of(first) : NONE;
            if (is_specular(kind) || (kind == KIND_DIFFUSE && is_coated(first.y)))
                list_specular(pixel.y * p.size.x + pixel.x);
        }
        if (inside) imageStore(picture, ivec2(pixel), vec4(found.rgb, 1.0));
    }
}
