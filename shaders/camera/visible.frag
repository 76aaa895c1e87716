// Which primitive, and of which object, a pixel sees first; with DISTANCES: how far away.
#if DISTANCES
layout(std140, binding = BIND_PARAMETERS) uniform Parameters { CameraParameters p; };
in vec3 way_from_camera;
layout(location = 0) out float distance_gpu;
#else
flat in uvec2 seen;
layout(location = 0) out uvec2 visible;
#endif

void main() {
    if (DISTANCES) {
        distance_gpu = p.orthographic != 0u ? dot(way_from_camera, p.forward) : length(way_from_camera);
    } else {
        visible = seen;
    }
}
