// Where an object that has moved since it was packed stands now (ObjectPlaces, app/gpu/scene_motion.py), GPU space.
layout(binding = UNIT_PLACES) uniform sampler2D places;

// The row of its matrix for coordinate `axis`.
vec4 place_row(uint object, int axis) {
    int column = int(object % uint(PLACES_A_ROW)), row = int(object / uint(PLACES_A_ROW));
    return texelFetch(places, ivec2(3 * column + axis, row), 0);
}
