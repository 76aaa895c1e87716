// What the programs of a picture in motion share: which primitive every pixel sees first, as the rasteriser found it,
// and where its ray meets that.

#include "camera/globals.glsl"
#include "camera/start.glsl"

layout(std140, binding = BIND_MOVING) uniform Moving { MovingParameters m; };
layout(rg32ui, binding = IMAGE_VISIBLE) uniform readonly restrict uimage2D visible;

const vec2 PIXEL_MIDDLE = vec2(0.5);

// A pixel by its number. Without a division of integers, which a software renderer does ray by ray.
uvec2 pixel_of(uint number) {
    int width = int(p.size.x), row = int((float(number) + 0.5) / float(width)), column = int(number) - row * width;
    row += column < 0 ? -1 : (column >= width ? 1 : 0);
    return uvec2(int(number) - row * width, row);
}

// Primitive and object; NONE where nothing is seen.
uvec2 seen_first(uvec2 pixel) { return imageLoad(visible, ivec2(pixel)).xy; }

// Unit, outward; of what is no curved solid.
vec3 normal_of(uint primitive) {
    Hit hit;
    hit.primitive = primitive;
    Triangle facet = hit_triangle(hit);
    vec3 normal = normalize(facet_normal(facet.edge1, facet.edge2));
    if (CONVEX_SOLIDS && is_plane(primitive)) normal = planes[primitive & ~PLANE_BIT].xyz;
    return normal;
}

// Where the path's ray meets the plane, or the curved face, of what it sees first.
Hit hit_on(uvec2 first, Path path) {
    Hit hit;
    hit.primitive = first.x;
    hit.object = first.y;
    hit.normal_g = normal_of(first.x);
    Triangle facet = hit_triangle(hit);
    vec3 away = path.position - facet.vertex;
    float inverse = 1.0 / dot(path.direction, facet_normal(facet.edge1, facet.edge2));
    vec3 q = cross(away, path.direction);
    hit.bary = vec2(-dot(facet.edge2, q), dot(facet.edge1, q)) * inverse;
    hit.distance = -dot(away, hit.normal_g) / dot(path.direction, hit.normal_g);
    if (CONVEX_SOLIDS && is_plane(first.x))
        hit.distance =
            (planes[first.x & ~PLANE_BIT].w - dot(hit.normal_g, path.position)) / dot(path.direction, hit.normal_g);
    // Its triangles lie within it, so that a ray which meets them meets it, but for rounding and beyond a face's
    // rim.
    if (CURVED_SOLIDS && is_curved(first.x)) {
        Piece piece = piece_at(first.x & ~CURVED_BIT);
        vec2 interval = piece_interval(piece, path.position, path.direction);
        bool meets = interval.x <= interval.y;
        hit.distance =
            meets ? (interval.x > 0.0 ? interval.x : interval.y) : dot(piece.origin - path.position, path.direction);
        hit.normal_g = normalize(piece_gradient(piece, path.position + hit.distance * path.direction));
    }
    return hit;
}

// Unit, outward: how what a pixel sees first faces.
vec3 facing_of(uvec2 first, uvec2 pixel) {
    if (CURVED_SOLIDS && is_curved(first.x)) return hit_on(first, path_from(pixel, PIXEL_MIDDLE, 1.0)).normal_g;
    return normal_of(first.x);
}

uint kind_of(uvec2 first) { return first.y == NONE ? NONE : object_at(first.y).kind; }
