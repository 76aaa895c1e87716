// Pinhole and orthographic cameras: from a place in the picture to a ray. Pure functions.

struct CameraRay {
    vec3 position;  // GPU space
    vec3 direction;  // unit
};

// `picture`: (-1, -1) is the lower left corner, (1, 1) the upper right one. `half_right` and
// `half_up` reach from the picture's middle to its border: on the plane at distance one from a
// pinhole, on the film (GPU units) of an orthographic camera.
CameraRay camera_ray(vec3 position, vec3 forward, vec3 half_right, vec3 half_up, bool orthographic, vec2 picture) {
    vec3 across = picture.x * half_right + picture.y * half_up;
    if (orthographic) return CameraRay(position + across, forward);
    return CameraRay(position, normalize(forward + across));
}

// Point of a pixel (row 0 is the picture's top) in the coordinates of `camera_ray`.
vec2 picture_point(uvec2 pixel, vec2 within_pixel, uvec2 size) {
    vec2 unit = (vec2(pixel) + within_pixel) / vec2(size);
    return vec2(2.0 * unit.x - 1.0, 1.0 - 2.0 * unit.y);
}
