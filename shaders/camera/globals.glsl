// What all programs of the camera's pass have in common: parameters, lights, spectra, a path, and what is looked up
// where it ends.

#ifdef HALTS
// Rounds that this invocation's loops have run in this dispatch; see camera/waiting.glsl.
uint rounds = 0u;
#define COUNT_ROUNDS(count) rounds += uint(count)
#endif

#include "lib/medium.glsl"
#include "lib/band.glsl"
#include "lib/interface.glsl"
#include "lib/camera.glsl"
#include "lib/lights.glsl"
#include "lib/lookup.glsl"
#include "lib/random.glsl"

layout(std140, binding = BIND_PARAMETERS) uniform Parameters { CameraParameters p; };
// Every ray asks all lights: constants to all, where they fit a uniform block.
#ifdef LIGHTS_IN_STORAGE
layout(std430, binding = BIND_LIGHTS) readonly restrict buffer Lights { CameraLight lights[]; };
#else
layout(std140, binding = BIND_LIGHTS) uniform Lights { CameraLight lights[LIGHT_ROOM]; };
#endif
// Per object: reflectance in linear Rec.709; number of its absorption row, or -1.
layout(std430, binding = BIND_OBJECT_COLOURS) readonly restrict buffer ObjectColours { vec4 object_colours[]; };
layout(std430, binding = BIND_CELL_CDF) readonly restrict buffer CellCdf { float cell_cdf[]; };
layout(std430, binding = BIND_COUNTERS) restrict buffer Counters { uint fallbacks[5]; };

#include "lib/textures.glsl"

#define FELL_COLUMNS 0
#define FELL_DEPTH 1
#define FELL_STACK 2
#define FELL_CUT 3
#define FELL_LOOPS 4

// Which of its turns a pixel's dispersed sample takes, and whether this sample took one. A picture in colour counts
// them beside its sums, since where glass fills a pixel in part only some samples are dispersed, and all bands must
// have had as many.
uint turn = 0u;
bool took_turn = false;

// What a look has met: a mark of the lights that shine on the surface there, whether it saw one itself, and whether it
// stepped over texels of a map.
uint lights_seen = 0u;
bool saw_light = false, skipped_texels = false;

#include "camera/path.glsl"

// What a sample has found so far. Global: an array handed from function to function is copied there and back by some
// drivers.
vec4 radiance[TARGETS];
// Where in its pixel what is being followed lies.
vec2 look_place;

#include "camera/emission.glsl"
#include "lib/footprint.glsl"
#include "camera/finish.glsl"
#include "camera/receiver.glsl"
#include "camera/receiver_light.glsl"
#include "camera/taps.glsl"
