// A spectral light tracer, independent of SpectraSplat: one wavelength a photon, Fresnel by chance, one photon one
// pixel. Emission, wavelength and the first choice follow one low-discrepancy sequence; photons are aimed at the glass;
// direct light is found from the camera. Sixteen photons go side by side (`#pragma omp simd`).
//
//     g++ -O3 -march=native -ffast-math -fno-finite-math-only -fopenmp tracer.cpp -o tracer
//     ./tracer scene.bin out.bin PHOTONS SAMPLES_A_PIXEL SEED
//
// scene.bin: float32 numbers in the order in which `main` reads them (written by neutral.py). out.bin: float32
// (height, width, 4): X, Y, Z in cd per square unit, and the share of the pixel in which the receiver is seen.
#include <omp.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <numeric>
#include <vector>

constexpr int LANES = 16, DIMENSIONS = 6, MAX_DEPTH = 64;
constexpr float FAR = 1e30f, OFFSET = 2e-5f, PI = 3.14159265f;

struct V {
    float x, y, z;
};
static V operator+(V a, V b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
static V operator-(V a, V b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
static V operator*(V a, float s) { return {a.x * s, a.y * s, a.z * s}; }
static float dot(V a, V b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
static V cross(V a, V b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
static V unit(V a) { return a * (1.0f / std::sqrt(dot(a, a))); }

struct Hit {
    float t = FAR, u = 0, v = 0;
    int triangle = -1;  // -1: nothing, or the sphere where there is one
};
struct Node {
    V low, high;
    int first, count;  // count 0: children at first and first + 1
};
struct Light {
    bool is_area;
    V position, direction, tangent, bitangent;
    float strength, cos_half_angle, width, height;  // strength: W/(sr nm), of an area W/(sr unit^2 nm)
};
struct Camera {
    V position, right, up, forward;
    float tan_half;
    int width, height;
};

static Camera camera;
static Light light;
static float cauchy_a, cauchy_b, albedo, half_width, half_height;  // the receiver: a rectangle in z = 0
static bool smooth;
static V centre;
static float radius;  // 0: no sphere
static std::vector<V> p0, e1, e2, normals;
static std::vector<Node> nodes;
static float cmf[401][3], cdf[402];

static uint32_t next_random(uint32_t &state) {
    state = state * 747796405u + 2891336453u;
    uint32_t word = ((state >> ((state >> 28) + 4)) ^ state) * 277803737u;
    return (word >> 22) ^ word;
}
static float uniform(uint32_t &state) { return (next_random(state) >> 8) * 0x1p-24f; }

// Moeller and Trumbore 1997.
static inline void meet(int i, V o, V d, Hit &hit) {
    V p = cross(d, e2[i]), s = o - p0[i], q = cross(s, e1[i]);
    float inverse = 1.0f / dot(e1[i], p), u = dot(s, p) * inverse, v = dot(d, q) * inverse, t = dot(e2[i], q) * inverse;
    bool is_met = u >= 0 && v >= 0 && u + v <= 1 && t > 0 && t < hit.t;
    if (is_met) hit = {t, u, v, i};
}

struct Box {
    V low{FAR, FAR, FAR}, high{-FAR, -FAR, -FAR};
    void add(V p) {
        low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
        high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
    }
    void add(int i) { add(p0[i]), add(p0[i] + e1[i]), add(p0[i] + e2[i]); }
    float area() const {
        V s = high - low;
        return s.x * s.y + s.y * s.z + s.z * s.x;
    }
};
static Box all;

// Splits where the surface area heuristic is least, of all places on all axes.
static void build(int node, std::vector<int> &order, const std::vector<V> &middle) {
    auto [first, count] = std::pair{nodes[node].first, nodes[node].count};
    auto begin = order.begin() + first;
    auto sort = [&](int axis) {
        std::sort(begin, begin + count, [&](int a, int b) { return (&middle[a].x)[axis] < (&middle[b].x)[axis]; });
    };
    Box whole;
    for (int k = 0; k < count; k++) whole.add(begin[k]);
    nodes[node].low = whole.low, nodes[node].high = whole.high;
    float least = count <= 2 ? 0 : FAR;
    int half = 0, best_axis = 0;
    for (int axis = 0; axis < 3 && count > 2; axis++) {
        sort(axis);
        std::vector<float> right(count);
        Box box, other;
        for (int k = count - 1; k > 0; k--) box.add(begin[k]), right[k] = box.area() * (count - k);
        for (int k = 1; k < count; k++) {
            other.add(begin[k - 1]);
            float cost = other.area() * k + right[k];
            if (cost < least) least = cost, half = k, best_axis = axis;
        }
    }
    if (!half || (count <= 8 && least > whole.area() * (count - 1))) return;
    sort(best_axis);
    int child = int(nodes.size());
    nodes.push_back({{}, {}, first, half});
    nodes.push_back({{}, {}, first + half, count - half});
    nodes[node].first = child, nodes[node].count = 0;
    build(child, order, middle);
    build(child + 1, order, middle);
}

static void walk(V o, V d, Hit &hit) {
    V inverse{1 / d.x, 1 / d.y, 1 / d.z};
    auto enters = [&](const Node &n) {
        float ax = (n.low.x - o.x) * inverse.x, bx = (n.high.x - o.x) * inverse.x;
        float ay = (n.low.y - o.y) * inverse.y, by = (n.high.y - o.y) * inverse.y;
        float az = (n.low.z - o.z) * inverse.z, bz = (n.high.z - o.z) * inverse.z;
        float near = std::max({std::min(ax, bx), std::min(ay, by), std::min(az, bz), 0.0f});
        float far = std::min({std::max(ax, bx), std::max(ay, by), std::max(az, bz), hit.t});
        return near <= far ? near : FAR;
    };
    int stack[64], depth = 0, at = 0;
    if (enters(nodes[0]) == FAR) return;
    while (true) {
        const Node &n = nodes[at];
        if (n.count) {
            for (int i = n.first; i < n.first + n.count; i++) meet(i, o, d, hit);
        } else {
            float left = enters(nodes[n.first]), right = enters(nodes[n.first + 1]);
            int nearer = n.first + (right < left), other = n.first + (right >= left);
            if (std::max(left, right) < FAR) stack[depth++] = other;
            if (std::min(left, right) < FAR) {
                at = nearer;
                continue;
            }
        }
        if (!depth) return;
        at = stack[--depth];
    }
}

static bool meet_sphere(V o, V d, float &t) {
    V s = o - centre;
    float b = dot(s, d), c = dot(s, s) - radius * radius, discriminant = b * b - c;
    if (discriminant < 0) return false;
    float root = std::sqrt(discriminant), near = -b - root, far = -b + root;
    t = near > OFFSET * 4 ? near : far;
    return t > OFFSET * 4;
}

static Hit glass_hit(V o, V d) {
    Hit hit;
    if (radius > 0) {
        float t;
        if (meet_sphere(o, d, t)) hit.t = t;
    } else if (!nodes.empty())
        walk(o, d, hit);
    return hit;
}
static bool is_blocked(V from, V to) {
    V way = to - from;
    float length = std::sqrt(dot(way, way));
    return glass_hit(from, way * (1 / length)).t < length;
}

// Nearest hits of sixteen rays: few triangles are all tried, which vectorises; many go through the tree.
static void glass_hits(const V *o, const V *d, Hit *hits) {
    if (p0.size() > 300 || radius > 0) {
        for (int l = 0; l < LANES; l++) hits[l] = glass_hit(o[l], d[l]);
        return;
    }
    alignas(64) float ox[LANES], oy[LANES], oz[LANES], dx[LANES], dy[LANES], dz[LANES], ts[LANES];
    alignas(64) int found[LANES];
    for (int l = 0; l < LANES; l++) {
        ox[l] = o[l].x, oy[l] = o[l].y, oz[l] = o[l].z, dx[l] = d[l].x, dy[l] = d[l].y, dz[l] = d[l].z;
        ts[l] = FAR, found[l] = -1;
    }
    for (int i = 0; i < int(p0.size()); i++) {
        V p = p0[i], a = e1[i], b = e2[i];
#pragma omp simd
        for (int l = 0; l < LANES; l++) {
            float px = dy[l] * b.z - dz[l] * b.y, py = dz[l] * b.x - dx[l] * b.z, pz = dx[l] * b.y - dy[l] * b.x;
            float inverse = 1.0f / (a.x * px + a.y * py + a.z * pz);
            float sx = ox[l] - p.x, sy = oy[l] - p.y, sz = oz[l] - p.z;
            float u = (sx * px + sy * py + sz * pz) * inverse;
            float qx = sy * a.z - sz * a.y, qy = sz * a.x - sx * a.z, qz = sx * a.y - sy * a.x;
            float v = (dx[l] * qx + dy[l] * qy + dz[l] * qz) * inverse;
            float t = (b.x * qx + b.y * qy + b.z * qz) * inverse;
            bool is_met = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0) & (t < ts[l]);
            ts[l] = is_met ? t : ts[l];
            found[l] = is_met ? i : found[l];
        }
    }
    for (int l = 0; l < LANES; l++) hits[l] = {ts[l], 0, 0, found[l]};
}

struct Photon {
    V o, d;
    float index, power[3], choice;
    int depth;
    bool is_alive;
};

static void frame_round(V axis, V &a, V &b) {
    a = unit(cross(axis, std::fabs(axis.z) < 0.9f ? V{0, 0, 1} : V{1, 0, 0}));
    b = cross(axis, a);
}

// A photon towards the rectangle that holds the glass's box as seen from its starting point; dead where the lamp sends
// nothing that way. A point of the rectangle, a wavelength and, of an area, the starting point come from `x`.
static Photon emitted(const float *x) {
    Photon photon{};
    photon.o = light.position;
    float power = light.strength;
    if (light.is_area) {
        photon.o = photon.o + light.tangent * ((x[4] - 0.5f) * light.width) + light.bitangent * ((x[5] - 0.5f) * light.height);
        power *= light.width * light.height;
    }
    V axis = unit((all.low + all.high) * 0.5f - photon.o), a, b;
    frame_round(axis, a, b);
    float low_a = FAR, high_a = -FAR, low_b = FAR, high_b = -FAR;
    for (int corner = 0; corner < 8; corner++) {
        V p = V{corner & 1 ? all.low.x : all.high.x, corner & 2 ? all.low.y : all.high.y, corner & 4 ? all.low.z : all.high.z} - photon.o;
        float s = dot(p, a) / dot(p, axis), t = dot(p, b) / dot(p, axis);
        low_a = std::min(low_a, s), high_a = std::max(high_a, s), low_b = std::min(low_b, t), high_b = std::max(high_b, t);
    }
    photon.d = unit(axis + a * (low_a + x[0] * (high_a - low_a)) + b * (low_b + x[1] * (high_b - low_b)));
    float cosine = dot(photon.d, axis), facing = dot(photon.d, light.direction);
    power *= (high_a - low_a) * (high_b - low_b) * cosine * cosine * cosine;
    power *= light.is_area ? std::max(facing, 0.0f) : facing >= light.cos_half_angle ? 1.0f : 0.0f;
    int bin = std::clamp(int(std::upper_bound(cdf, cdf + 402, x[2]) - cdf) - 1, 0, 400);
    float share = cdf[bin + 1] - cdf[bin];  // the chance of this bin of 1 nm
    float nm = 380 + bin - 0.5f + (x[2] - cdf[bin]) / share;
    photon.index = cauchy_a + cauchy_b * 1e6f / (nm * nm);
    for (int c = 0; c < 3; c++) photon.power[c] = power * 683.002f * cmf[bin][c] / share;
    photon.choice = x[3];
    photon.is_alive = power > 0;
    return photon;
}

// Reflection or refraction by chance; normals are turned against the ray.
static void scatter(Photon &photon, const Hit &hit, float choice) {
    V place = photon.o + photon.d * hit.t, geometric, normal;
    if (radius > 0)
        geometric = normal = unit(place - centre);
    else {
        int i = hit.triangle;
        geometric = normal = unit(cross(e1[i], e2[i]));
        if (smooth) normal = unit(normals[3 * i] * (1 - hit.u - hit.v) + normals[3 * i + 1] * hit.u + normals[3 * i + 2] * hit.v);
    }
    bool is_inside = dot(photon.d, geometric) > 0;
    if (is_inside) geometric = geometric * -1, normal = normal * -1;
    float theta = dot(photon.d, normal);
    if (theta >= 0) normal = geometric, theta = dot(photon.d, normal);
    float eta = is_inside ? photon.index : 1 / photon.index, w2 = 1 - eta * eta * (1 - theta * theta), reflectance = 1, w = 0;
    if (w2 > 0) {
        w = std::sqrt(w2);
        float s = (eta * -theta - w) / (eta * -theta + w), p = (-theta - eta * w) / (-theta + eta * w);
        reflectance = 0.5f * (s * s + p * p);
    }
    bool is_reflected = choice < reflectance;
    photon.d = is_reflected ? photon.d - normal * (2 * theta) : photon.d * eta - normal * (eta * theta + w);
    photon.d = unit(photon.d);
    if ((dot(photon.d, geometric) > 0) != is_reflected) photon.is_alive = false;
    photon.o = place + geometric * (is_reflected ? OFFSET : -OFFSET);
    if (++photon.depth >= MAX_DEPTH) photon.is_alive = false;
}

// Where the camera sees the receiver's point: its pixel, or -1, and what radiance a watt there gives that pixel.
static int seen_pixel(V place, float &factor) {
    V way = place - camera.position;
    float depth = dot(way, camera.forward);
    float x = dot(way, camera.right) / (depth * camera.tan_half), y = dot(way, camera.up) / (depth * camera.tan_half);
    int column = int(std::floor((x * camera.height + camera.width) * 0.5f)), row = int(std::floor((1 - y) * camera.height * 0.5f));
    if (depth <= 0 || column < 0 || row < 0 || column >= camera.width || row >= camera.height) return -1;
    float length2 = dot(way, way), cosine = depth / std::sqrt(length2), pixel = 2 * camera.tan_half / camera.height;
    factor = albedo / PI * (std::fabs(way.z) / std::sqrt(length2)) / (length2 * pixel * pixel * cosine * cosine * cosine);
    return row * camera.width + column;
}

static void trace(int64_t photons, uint32_t seed, std::vector<double> &picture) {
    double golden = 1.0;  // the root of g^(D+1) = g + 1 (Roberts 2018: a sequence of low discrepancy)
    for (int k = 0; k < 60; k++) golden = std::pow(1 + golden, 1.0 / (DIMENSIONS + 1));
    double step[DIMENSIONS], shift[DIMENSIONS];
    for (int k = 0; k < DIMENSIONS; k++) step[k] = std::pow(golden, -(k + 1)), shift[k] = uniform(seed);
#pragma omp parallel
    {
        int threads = omp_get_num_threads(), me = omp_get_thread_num();
        uint32_t state = seed * 9781u + me * 6271u + 17u;
        std::vector<double> own(picture.size());
        Photon lane[LANES] = {};
        V o[LANES], d[LANES];
        Hit hits[LANES];
        int64_t number = me;
        while (true) {
            int alive = 0;
            for (int l = 0; l < LANES; l++) {
                while (!lane[l].is_alive && number < photons) {
                    float x[DIMENSIONS];
                    for (int k = 0; k < DIMENSIONS; k++) {
                        double value = shift[k] + double(number) * step[k];
                        x[k] = std::min(float(value - std::floor(value)), 0.9999999f);
                    }
                    lane[l] = emitted(x);
                    number += threads;
                }
                alive += lane[l].is_alive;
                o[l] = lane[l].is_alive ? lane[l].o : V{0, 0, 1e6f};
                d[l] = lane[l].is_alive ? lane[l].d : V{0, 0, 1};
            }
            if (!alive) break;
            glass_hits(o, d, hits);
            for (int l = 0; l < LANES; l++) {
                Photon &photon = lane[l];
                if (!photon.is_alive) continue;
                if (hits[l].t < FAR) {
                    if (smooth && radius == 0 && p0.size() <= 300) meet(hits[l].triangle, photon.o, photon.d, hits[l] = Hit{});
                    scatter(photon, hits[l], photon.depth ? uniform(state) : photon.choice);
                    continue;
                }
                photon.is_alive = false;
                if (!photon.depth || photon.d.z >= 0) continue;  // direct light is the camera's
                V place = photon.o - photon.d * (photon.o.z / photon.d.z);
                float factor;
                if (std::fabs(place.x) > half_width || std::fabs(place.y) > half_height) continue;
                int pixel = seen_pixel(place, factor);
                if (pixel < 0 || is_blocked(place, camera.position)) continue;
                for (int c = 0; c < 3; c++) own[pixel * 4 + c] += photon.power[c] * factor / double(photons);
            }
        }
#pragma omp critical
        for (size_t k = 0; k < own.size(); k++) picture[k] += own[k];
    }
}

// Direct light on the receiver and the share of each pixel that shows it, from `samples` camera rays a pixel.
static void direct(int samples, uint32_t seed, std::vector<double> &picture) {
    double white[3] = {};
    for (auto &row : cmf)
        for (int c = 0; c < 3; c++) white[c] += 683.002 * row[c];
    double r2[2] = {0.7548776662466927, 0.5698402909980532}, r1 = 0.6180339887498949;
#pragma omp parallel for schedule(dynamic, 4)
    for (int row = 0; row < camera.height; row++)
        for (int column = 0; column < camera.width; column++) {
            uint32_t state = seed + uint32_t(row * camera.width + column) * 31u;
            double shift[4] = {uniform(state), uniform(state), uniform(state), uniform(state)}, sum = 0, seen = 0;
            for (int s = 0; s < samples; s++) {
                auto at = [&](int k, double by) { return float(std::fmod(shift[k] + s * by, 1.0)); };
                float x = (2 * (column + at(0, r2[0])) - camera.width) / camera.height, y = 1 - 2 * (row + at(1, r2[1])) / camera.height;
                V d = unit(camera.forward + camera.right * (x * camera.tan_half) + camera.up * (y * camera.tan_half));
                Hit hit = glass_hit(camera.position, d);
                V place = camera.position - d * (camera.position.z / d.z);
                if (hit.t < FAR || d.z >= 0) continue;
                seen += 1;
                if (std::fabs(place.x) > half_width || std::fabs(place.y) > half_height) continue;
                V from = light.position;
                if (light.is_area)
                    from = from + light.tangent * ((at(2, r1) - 0.5f) * light.width) + light.bitangent * ((at(3, r2[0]) - 0.5f) * light.height);
                V way = place - from;
                float length2 = dot(way, way), facing = dot(way, light.direction) / std::sqrt(length2);
                float strength = light.is_area ? std::max(facing, 0.0f) * light.width * light.height : facing >= light.cos_half_angle ? 1.0f : 0.0f;
                if (strength > 0 && from.z > 0 && !is_blocked(place, from))
                    sum += light.strength * strength * std::fabs(way.z) / (length2 * std::sqrt(length2)) * albedo / PI;
            }
            double *pixel = &picture[(row * camera.width + column) * 4];
            for (int c = 0; c < 3; c++) pixel[c] += sum * white[c] / samples;
            pixel[3] = seen / samples;
        }
}

int main(int count, char **words) {
    if (count != 6) return std::fprintf(stderr, "usage: tracer scene.bin out.bin PHOTONS SAMPLES SEED\n"), 2;
    FILE *file = std::fopen(words[1], "rb");
    if (!file) return std::fprintf(stderr, "%s cannot be read\n", words[1]), 2;
    auto number = [&] {
        float value = 0;
        if (std::fread(&value, 4, 1, file) != 1) std::exit(3);
        return value;
    };
    auto vector = [&] {
        float x = number(), y = number(), z = number();
        return V{x, y, z};
    };
    camera.width = int(number()), camera.height = int(number());
    camera.position = vector(), camera.right = vector(), camera.up = vector(), camera.forward = vector(), camera.tan_half = number();
    light.is_area = number() > 0, light.position = vector(), light.direction = vector(), light.tangent = vector(), light.bitangent = vector();
    light.strength = number(), light.cos_half_angle = number(), light.width = number(), light.height = number();
    cauchy_a = number(), cauchy_b = number(), albedo = number(), half_width = number(), half_height = number();
    float total = 0;
    for (auto &row : cmf)
        for (float &value : row) total += value = number();
    for (int k = 0; k < 401; k++) cdf[k + 1] = cdf[k] + 0.97f * (cmf[k][0] + cmf[k][1] + cmf[k][2]) / total + 0.03f / 401;
    centre = vector(), radius = number(), smooth = number() > 0;
    int triangles = int(number());
    std::vector<V> corners(3 * size_t(triangles)), corner_normals(3 * size_t(triangles));
    for (V &p : corners) p = vector();
    for (V &n : corner_normals) n = vector();
    for (V p : corners) all.add(p);
    if (triangles && radius == 0) {
        std::vector<V> middle;
        for (int i = 0; i < triangles; i++) {
            V a = corners[3 * i], b = corners[3 * i + 1], c = corners[3 * i + 2];
            p0.push_back(a), e1.push_back(b - a), e2.push_back(c - a), middle.push_back((a + b + c) * (1 / 3.0f));
        }
        std::vector<int> order(triangles);
        std::iota(order.begin(), order.end(), 0);
        nodes.reserve(2 * size_t(triangles));
        nodes.push_back({{}, {}, 0, triangles});
        build(0, order, middle);
        auto sorted = [&](std::vector<V> values) {
            std::vector<V> result;
            for (int i : order) result.push_back(values[i]);
            return result;
        };
        p0 = sorted(p0), e1 = sorted(e1), e2 = sorted(e2);
        for (int i : order)
            for (int k = 0; k < 3; k++) normals.push_back(corner_normals[3 * i + k]);
    }
    std::vector<double> picture(size_t(camera.width) * camera.height * 4);
    uint32_t seed = uint32_t(std::atoll(words[5]) * 7919 + 1);
    direct(std::atoi(words[4]), seed, picture);
    if (triangles) trace(std::atoll(words[3]), seed, picture);
    std::vector<float> out(picture.begin(), picture.end());
    FILE *result = std::fopen(words[2], "wb");
    if (!result || std::fwrite(out.data(), 4, out.size(), result) != out.size()) return 4;
    return std::fclose(result);
}
