// Pixels of a picture in motion that want a program of their own, one number each: from the beginning those that look
// at all they see directly themselves, from the end those that see glass or mirrors.
layout(std430, binding = BIND_MOVING_LISTS) restrict buffer MovingLists {
    uint uneven_count;
    uint specular_count;
    uint pixels[];
};

uint specular_pixel(uint i) {
    if (COATS) {
        // A coated pixel may be on both.
        return pixels[2u * p.size.x * p.size.y - 1u - i];
    } else {
        return pixels[p.size.x * p.size.y - 1u - i];
    }
}
