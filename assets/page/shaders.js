// The page's shaders: light of photons and beams added up in a map of what is seen, and pictures made of the map.
// A texel of the map's level 0 is a pixel and holds the light that falls on what it shows of the receiver, linear
// Rec.709. Broad photons are drawn in coarser texels, to its right. A photon is drawn as the desktop program draws it
// (shaders/light/splat_shapes.glsl there).

export const LEVELS = 6;

const COMMON = `#version 300 es
precision highp float;
precision highp int;
precision highp sampler2D;
#define LEVELS ${LEVELS}
uniform ivec2 size;         // texels of level 0
uniform mat3 to_uv, to_texel;  // (place, 1) to (place, 1) times a weight, which is positive where it is seen
vec4 rect_of(int level) {
  vec2 s = vec2(size), low = level == 0 ? vec2(0.0) : vec2(s.x, s.y - s.y * exp2(float(1 - level)));
  return vec4(low, low + s * exp2(float(-level)));
}
// How m times a place moves with it, where that is seen, homogeneous.
mat2 jacobian(mat3 m, vec3 seen) {
  vec2 at = seen.xy / seen.z;
  return mat2(m[0].xy - at * m[0].z, m[1].xy - at * m[1].z) / seen.z;
}
// Area on the receiver of the texel about a place.
float texel_area(vec2 texel) {
  float w = (to_uv * vec3(texel, 1.0)).z;
  return abs(determinant(to_uv)) / max(w * w * w, 1e-30);
}
`;

const TABLES = `
uniform sampler2D paths;    // indices over x: as shown, as traced
uniform sampler2D light;    // by row: energy below each place of the support; lines
uniform vec2 support;       // x of the light's ends
uniform int lines;
const int SAMPLES = 2048;
vec4 interpolated(sampler2D table, int row, float share) {
  float at = clamp(share, 0.0, 1.0) * float(SAMPLES - 1), i = min(floor(at), float(SAMPLES - 2));
  return mix(texelFetch(table, ivec2(i, row), 0), texelFetch(table, ivec2(i + 1.0, row), 0), at - i);
}
vec3 energy_below(int row, float x) { return interpolated(light, row, (x - support.x) / (support.y - support.x)).rgb; }
vec4 line_of(int row, int k) { return texelFetch(light, ivec2(SAMPLES + k, row), 0); }
`;

// Two triangles of four vertices for each record of so many texels.
const RECORDS = (texels) => `
uniform sampler2D records;
const int TEXELS = ${texels};
vec4 record(int k) { return texelFetch(records, ivec2(TEXELS * ((gl_VertexID >> 2) & 255) + k, gl_VertexID >> 10), 0); }
vec2 corner() { return vec2(gl_VertexID & 1, (gl_VertexID >> 1) & 1) * 2.0 - 1.0; }
`;

const GAUSSIAN = `
const float SQRT_HALF = 0.70710678, TWO_PI = 6.2831853;
// To 3e-7 (Abramowitz and Stegun 1964, 7.1.28).
float error_function(float x) {
  float a = abs(x);
  float p = 1.0 + a * (0.0705230784 + a * (0.0422820123 + a * (0.0092705272 + a * (0.0001520143 + a * (0.0002765672
    + a * 0.0000430638)))));
  p *= p; p *= p; p *= p; p *= p;
  return sign(x) * (1.0 - 1.0 / p);
}
float below_normal(float z) { return 0.5 + 0.5 * error_function(clamp(z, -8.0, 8.0) * SQRT_HALF); }
float excess(float z) { return 0.39894228 * exp(-0.5 * z * z) - z * (1.0 - below_normal(z)); }
`;

// Of a splat. What lies away from its centre, in parts of texels, is turned to corners (-1 to 1), which the fan widens;
// those to along and across, to cycles, and to how far inside of the light's edge, 0 to 1 over its blur.
const SPLAT = (way) => `
flat ${way} vec4 band, rect;     // x: from, anchor, to; standard deviation; texels of its level
flat ${way} vec4 shape;          // half a texel across, along; 1 / its width; row
flat ${way} vec3 weights, ripple, lit;  // throughput at the anchor, its slopes below and above; waves' heights
flat ${way} float fine;          // parts of a texel's side, each of which is drawn
flat ${way} mat2 to_corner, cycles;
flat ${way} vec2 centre, widening, spread;
`;

export const SPLAT_VERTEX = COMMON + TABLES + RECORDS(6) + GAUSSIAN + SPLAT("out") + `
uniform float smoothing, finest;  // spacings; parts of a texel's side in which what is small is drawn
vec4 place_v2, v01, span;  // its place, change with the third index; with the others; x: from, anchor, to; light's row
const float TEXEL = 1.0 / 12.0, NARROWED = 0.4 / 0.45;
vec2 shift_to(float x) {
  vec4 n = interpolated(paths, 0, x) - interpolated(paths, 1, span.y);
  return n.x * v01.xy + n.y * v01.zw + n.z * place_v2.zw;
}
// Point of the emission lattice, in steps of which three are the shortest (shaders/lib/lattice.glsl there): its two
// lowest frequencies, cycles a spacing; the third is their sum.
vec2 frequency(float count, float before) {
  const float GOLDEN_RATIO = 1.618033989, ROOT_5 = 2.236067977;
  float k = max(round(0.5 * log(ROOT_5 * count) / log(GOLDEN_RATIO)), 2.0) - before;
  float sign_k = mod(k, 2.0) < 0.5 ? 1.0 : -1.0, power = pow(GOLDEN_RATIO, k);
  return vec2(sqrt(count) * sign_k / power, (power - sign_k / power) / (ROOT_5 * sqrt(count)));
}
vec2 longest_axis(float ss, float st, float tt) {
  float difference = 0.5 * (ss - tt), root = sqrt(difference * difference + st * st);
  vec2 axis = difference >= 0.0 ? vec2(root + difference, st) : vec2(st, root - difference);
  return dot(axis, axis) > 0.0 ? normalize(axis) : vec2(1.0, 0.0);
}
float cross2(vec2 a, vec2 b) { return a.x * b.y - a.y * b.x; }
float sinc(float x) { float a = 3.14159265 * x; return abs(a) < 1e-2 ? 1.0 - a * a / 6.0 : sin(a) / a; }
// What is drawn, in its own frame, texels: its Fourier transform at k cycles a texel.
vec2 e, m;  // along, across
float shear, box, across2, along2;
float damping(vec2 k) {
  float ka = dot(k, e), kc = dot(k, m) + shear * ka;
  return exp(-0.5 * TWO_PI * TWO_PI * (across2 * kc * kc + along2 * ka * ka)) * sinc(box * kc) * sinc(box * ka);
}
float kept(float edge, float wide, float s) {
  return 1.0 - 2.0 * s / wide * (excess((edge - 0.5 * wide) / s) - excess((edge + 0.5 * wide) / s));
}
void main() {
  gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
  place_v2 = record(0); v01 = record(2); span = record(3);
  // Sides of a lattice cell; throughput from, at the anchor, to; points of the lattice, edge, change of W by the sides.
  vec4 sides = record(1), carried = record(4), origin = record(5);
  float x_lo = max(span.x, support.x), x_hi = min(span.z, support.y);
  if (x_hi <= x_lo) return;
  vec2 to_lo = shift_to(x_lo), to_hi = shift_to(x_hi);
  // In texels, by the derivatives in the middle: a place d texels away is seen d / (1 + fan · d) away.
  vec3 seen = to_texel * vec3(place_v2.xy + 0.5 * (to_lo + to_hi), 1.0);
  if (seen.z <= 0.0) return;
  centre = seen.xy / seen.z;
  mat2 j = jacobian(to_texel, seen);
  vec2 fan = vec2(to_texel[0].z, to_texel[1].z) * inverse(j) / seen.z;
  vec2 chord = j * (to_hi - to_lo), s = j * sides.xy, t = j * sides.zw;
  float cell = cross2(s, t), smoothed = smoothing;
  bool lattice = origin.x > 0.0 && abs(cell) > 1e-6;
  // Less where the spectrum stays within a spacing: what ripple that leaves is taken off.
  if (lattice) {
    float parted = 2.5 * length(vec2(cross2(chord, t), cross2(s, chord)) / cell) - 0.25;
    smoothed *= mix(NARROWED, 1.0, clamp(max(parted, 4.0 - 4.0 * sqrt(abs(cell))), 0.0, 1.0));
  }
  vec2 axis = longest_axis(dot(s, s), dot(s, t), dot(t, t)), longest = mat2(s, t) * axis;
  s *= smoothed; t *= smoothed;
  // Broad photons go to coarser texels, whose bilinear reading blurs them too; small ones are drawn in parts of texels.
  vec3 cov = vec3(s.x * s.x + t.x * t.x, s.x * s.y + t.x * t.y, s.y * s.y + t.y * t.y);
  float difference = 0.5 * (cov.x - cov.z), radius = sqrt(difference * difference + cov.y * cov.y);
  vec3 areas = vec3(cross2(s, t), 0.25 * sqrt(TEXEL) * vec2(cross2(s, chord), cross2(t, chord)));
  fine = dot(areas, areas) < 0.09 ? finest : 1.0;
  if (smoothed * fine * length(longest) > 0.75) fan += dot(origin.zw, axis) / dot(longest, longest) * longest;
  float thin = 0.5 * (cov.x + cov.z) - radius, taken = 0.0, finer = fine;
  int level = 0;
  for (int k = 1; k < LEVELS && fine == 1.0; ++k)
    if (thin * finer * finer > 2.25) { level = k; finer *= 0.5; taken = 0.25 * taken + 11.0 / 48.0; }
  s *= finer; t *= finer; chord *= finer; centre *= finer; fan /= finer; cell = cross2(s, t);
  cov *= finer * finer; radius *= finer * finer; thin *= finer * finer;
  // Along the sweep; or along what is too thin for that, if its sweep leaves it by less than half a texel.
  e = longest_axis(cov.x, cov.y, cov.z);
  e *= dot(e, chord) < 0.0 ? -1.0 : 1.0;
  float sweep = length(chord), aside = abs(e.x * chord.y - e.y * chord.x), blur = 0.0;
  if (sweep < 1e-4 || (thin < 0.15 && aside < 0.5 && radius > aside * aside * TEXEL)) {
    sweep = dot(e, chord);
    blur = aside * aside * TEXEL;
  } else e = chord / sweep;
  m = vec2(-e.y, e.x);
  mat2 frame = mat2(e, m);
  vec2 sa = s * frame, ta = t * frame;
  float a = sa.x * sa.x + ta.x * ta.x, b = sa.x * sa.y + ta.x * ta.y, c = sa.y * sa.y + ta.y * ta.y;
  float determinant = cell * cell - taken * (a + c - taken);
  a -= taken; c -= taken;
  // Across and along: a box as wide as a texel there, and the rest of the texel as a Gaussian.
  box = max(abs(m.x), abs(m.y));
  float narrow = min(abs(m.x), abs(m.y));
  across2 = max(c + blur, 0.01) + narrow * narrow * TEXEL;
  float total = across2 + box * box * TEXEL;
  shear = b / total;
  along2 = max((a * (total - c) + determinant) / total + narrow * narrow * TEXEL, 0.01 + 0.12 * shear * shear);
  float sigma = sqrt(along2 + box * box * TEXEL), root = sqrt(across2);
  sweep = max(sweep, 0.03 * sigma);
  float reach = 0.5 * sweep + 3.0 * sigma, edge = 3.0 * sqrt(total);
  vec2 long_side = e * reach, short_side = (m + shear * e) * edge;
  // What fans out too far along one axis is not drawn there, and the rest is brighter for it (shaders/lib/fan.glsl).
  widening = vec2(dot(fan, long_side), dot(fan, short_side));
  widening *= min(1.0, min(3.0 / max(length(fan) * sqrt(thin + 2.0 * radius), 1e-9),
    0.8 * reach / max(abs(widening.x) * 0.5 * sweep, 1e-9)));
  bool is_along = abs(widening.x) >= abs(widening.y);
  vec2 most = is_along ? vec2(3.0, 0.05) : vec2(0.05, 3.0), size2 = min(abs(widening), most);
  widening = clamp(widening, -most, most);
  float end = min((0.85 - min(size2.x, size2.y)) / max(max(size2.x, size2.y), 1e-9), 1.0);
  vec2 ends = is_along ? vec2(end, 1.0) : vec2(1.0, end);
  float amplitude = 4.0 / box / (kept(reach, sweep, sigma) + kept(ends.x * reach, sweep, sigma))
    / (kept(edge, box, root) + kept(ends.y * edge, box, root));
  // Splats about a lattice's points add up to 1 and a ripple, which each takes off.
  ripple = vec3(0.0); cycles = mat2(0.0); lit = vec3(1.0, 0.0, 0.0);
  float swept = sweep * sweep * TEXEL, share = swept / (sigma * sigma + swept);
  mat2 to_spacings = smoothed / cell * mat2(t.y, -t.x, -s.y, s.x);
  if (lattice && abs(cell) > 1e-6) {
    vec2 steps[3], k[3];
    steps[0] = frequency(origin.x, 0.0); steps[1] = frequency(origin.x, 1.0); steps[2] = steps[0] + steps[1];
    vec3 heights, seen;
    for (int i = 0; i < 3; ++i) {
      k[i] = to_spacings * steps[i];
      float coarse = max(abs(k[i].x), abs(k[i].y)), ka = TWO_PI * dot(k[i], e);
      float turns2 = smoothed * smoothed * dot(steps[i], steps[i]) - taken * dot(k[i], k[i]);
      heights[i] = min(damping(k[i]), 2.0 * exp(-0.5 * TWO_PI * TWO_PI * max(turns2, 0.0)));
      heights[i] = max(heights[i], 0.0) * clamp(5.0 - 5.0 * coarse, 0.0, 1.0);
      seen[i] = 2.0 * exp(-0.5 * ka * ka * share * sigma * sigma);
    }
    vec3 less = heights - 2.0 * heights.yxx * heights.zzy;
    ripple = less * seen;
    amplitude /= 1.0 - 2.0 * dot(heights, less);
    cycles = transpose(mat2(k[0], k[1])) * mat2((1.0 - share) * long_side, short_side);
  }
  // Where the light's emission ends the splat does, too (shaders/light/splat_lines.glsl there).
  if (origin.y > 0.0 && abs(cell) > 1e-6) {
    float turn = TWO_PI / 4096.0 * floor(origin.y / 4096.0);
    float inside = (2.0 * mod(origin.y, 4096.0) - 1.0) / 4095.0 - 1.0;
    vec2 within = to_spacings * vec2(cos(turn), sin(turn));
    float ahead = dot(within, e), variance = dot(within, within) * TEXEL + ahead * ahead * share * sigma * sigma;
    if (variance < 0.16) {
      float sharp = sqrt(TEXEL / max(variance, 1e-12));
      lit = vec3(0.5, 0.0, 0.0) + sharp * vec3(inside, (1.0 - share) * dot(within, long_side), dot(within, short_side));
      amplitude /= below_normal(inside / 0.42);
    }
  }
  spread = vec2(reach / sweep, edge * SQRT_HALF / root);
  band = vec4(x_lo, span.y, x_hi, sqrt(along2) / sweep);
  weights = amplitude * vec3(carried.y, (carried.y - carried.x) / max(span.y - span.x, 1e-6),
    (carried.z - carried.y) / max(span.z - span.y, 1e-6));
  shape = vec4(0.5 * box * SQRT_HALF / root, 0.5 * box / sweep, 1.0 / box, span.w);
  rect = rect_of(level);
  to_corner = inverse(mat2(long_side, short_side));
  // A rectangle about all of it, and half a texel more where parts of texels are drawn.
  vec2 low = vec2(1e9), high = -low, corner = corner();
  for (int i = 0; i < 4; ++i) {
    vec2 c = vec2(i & 1, i >> 1) * 2.0 - 1.0;
    if (dot(widening, vec2(is_along, !is_along) * c) < 0.0) c *= ends;
    vec2 away = (c.x * long_side + c.y * short_side) * frame / (1.0 + dot(widening, c));
    low = min(low, away); high = max(high, away);
  }
  vec2 at = mix(low, high, 0.5 + 0.5 * corner) + 0.5 * (fine - 1.0) * (abs(e.x) + abs(e.y)) * corner;
  at = rect.xy + (centre + frame * at) / fine;
  gl_Position = vec4(at / vec2(1.5 * float(size.x), size.y) * 2.0 - 1.0, 0.0, 1.0);
}`;

export const SPLAT_FRAGMENT = COMMON + TABLES + GAUSSIAN + SPLAT("in") + `
out vec4 deposited;
float carried_at(float x) { return max(weights.x + (x - band.y) * (x < band.y ? weights.y : weights.z), 0.0); }
float share_of(float away, float half_texel, float scale) {
  vec2 ends = clamp(vec2(away - half_texel, away + half_texel) * scale, -6.0, 6.0);
  return 0.5 * (error_function(ends.y) - error_function(ends.x));
}
// What a texel gets, or a part of one, whose middle is there.
vec3 light_at(vec2 place) {
  vec2 c = to_corner * (place - centre);
  float w = 1.0 / (1.0 - dot(widening, c));
  c *= w;
  if (w < 0.149 || any(greaterThan(abs(c), vec2(1.0)))) return vec3(0.0);
  vec2 at = vec2(0.0, 0.5) + spread.yx * c.yx, turns = cycles * c;
  vec3 away = abs(fract(vec3(turns, turns.x + turns.y)) * 2.0 - 1.0);
  float share = w * w * share_of(at.x, w * shape.x, 1.0) * clamp(dot(lit, vec3(1.0, c)), 0.0, 1.0);
  share *= 1.0 - dot(ripple, 2.0 * away * away * (3.0 - 2.0 * away) - 1.0);
  // What lands within three standard deviations of the texel, in parts: their light times the share of what is spread
  // about their middles that the texel gets along the sweep.
  float s = band.w, reach = shape.y + 3.0 * s, from = clamp(at.y - reach, 0.0, 1.0), to = clamp(at.y + reach, 0.0, 1.0);
  int row = int(shape.w), parts = clamp(int(ceil(1.3 * (to - from) / s)), 3, 8);
  float step_way = (to - from) / float(parts), x_from = mix(band.x, band.z, from);
  float own = SQRT_HALF / sqrt(max(s * s - step_way * step_way / 12.0, 0.25 * s * s));
  vec3 sum = vec3(0.0), before = energy_below(row, x_from);
  for (int i = 1; i <= parts; ++i) {
    float way = from + float(i) * step_way, x = mix(band.x, band.z, way);
    vec3 now = energy_below(row, x);
    sum += (now - before) * share_of(way - 0.5 * step_way - at.y, shape.y, own) * carried_at(0.5 * (x_from + x));
    before = now;
    x_from = x;
  }
  for (int k = 0; k < lines; ++k) {
    vec4 line = line_of(row, k);
    if (line.w < band.x || line.w >= band.z) continue;
    float way = (line.w - band.x) / (band.z - band.x);
    sum += line.rgb * share_of(way - at.y, shape.y, SQRT_HALF / s) * carried_at(line.w);
  }
  return shape.z * share * sum;
}
void main() {
  if (any(lessThan(gl_FragCoord.xy, rect.xy)) || any(greaterThanEqual(gl_FragCoord.xy, rect.zw))) discard;
  vec3 sum = vec3(0.0);
  for (int i = 0; i < int(fine * fine); ++i)
    sum += light_at((gl_FragCoord.xy - 0.5 - rect.xy) * fine + vec2(i % int(fine), i / int(fine)) + 0.5);
  deposited = vec4(sum, 0.0);
}`;

export const BEAM_VERTEX = COMMON + TABLES + RECORDS(5) + `
flat out vec4 parabola, tilt, band;
flat out vec2 about;
flat out ivec3 list;
void main() {
  gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
  vec4 quad = record(0);     // middle, half of its long side
  vec4 more = record(1);     // half of its short side (length), first edge, edges, row
  vec4 span = record(4);     // x: from, to; 0
  if (span.y <= support.x || span.x >= support.y) return;
  vec2 corner = corner();
  float reach = length(quad.zw);
  vec2 e = reach > 0.0 ? quad.zw / reach : vec2(1.0, 0.0);
  vec2 right = e * reach, up = vec2(-e.y, e.x) * more.x;
  vec3 seen = to_texel * vec3(quad.xy + corner.x * right + corner.y * up, 1.0);
  // A texel farther out, as the sides go there.
  vec2 along = jacobian(to_texel, seen) * right, across = jacobian(to_texel, seen) * up;
  if (length(along) < 1e-6 * length(across)) along = vec2(across.y, -across.x);
  if (length(across) < 1e-6 * length(along)) across = vec2(-along.y, along.x);
  along = normalize(along);
  across = normalize(across);
  float spread = max(abs(along.x * across.y - along.y * across.x), 0.1);
  vec2 margin = 0.75 * (corner.x * along + corner.y * across) / spread;
  parabola = record(2);  // 1, t, t²; 0
  tilt = record(3);      // relative, per unit; about
  band = vec4(span.xy, 0.0, 0.0);
  about = quad.xy;
  list = ivec3(more.yzw);
  gl_Position = vec4((seen.xy + margin * seen.z) / vec2(1.5 * float(size.x), size.y) * 2.0 - seen.z, 0.0, seen.z);
}`;

// `most`: edges of a polygon.
export const BEAM_FRAGMENT = (most) => COMMON + TABLES + `
uniform sampler2D edges;    // two texels an edge: x, y, c, softness at the band's start; their change
flat in vec4 parabola, tilt, band;
flat in vec2 about;          // the rectangle's middle
flat in ivec3 list;
out vec4 deposited;
vec4 edge_texel(int i) { return texelFetch(edges, ivec2(i & 1023, i >> 10), 0); }
vec2 place;                 // about that
mat2 sides;                 // of the texel on the receiver
// An edge where the texel is the square about 0: normal, distance inside; and the side of the square over which it is
// averaged, for the texel and the penumbra.
vec4 seen_line(vec4 line) {
  vec2 n = line.xy * sides;
  float per = inversesqrt(max(dot(n, n), 1e-30)), soft = max(line.w, 0.0) * length(line.xy) * per;
  return vec4(n, dot(line.xy, place) + line.z, sqrt(1.0 + 4.0 * soft * soft));
}
// Part of the texel within all edges at t: what borders it, by lengths times distances
// (shaders/light/beam_coverage.glsl there).
vec3 line_at(int e, float t) {
  vec4 line = seen_line(edge_texel(2 * e) + t * edge_texel(2 * e + 1));
  float per = inversesqrt(max(dot(line.xy, line.xy), 1e-30));
  return vec3(line.xy * per, line.z * per / line.w);
}
vec2 in_texel(vec2 n, float h) {
  vec2 foot = -h * n, d = vec2(-n.y, n.x);
  d = mix(d, vec2(1e-9), lessThan(abs(d), vec2(1e-9)));
  vec2 p = (-0.5 - foot) / d, q = (0.5 - foot) / d, low = min(p, q), high = max(p, q);
  return vec2(max(low.x, low.y), min(high.x, high.y));
}
float covered(float t) {
  vec3 lines[${most}];
  int count = 0;
  for (int i = 0; i < list.y; ++i) {
    vec3 own = line_at(list.x + i, t);
    float reach = 0.5 * (abs(own.x) + abs(own.y));
    if (own.z <= -reach) return 0.0;
    if (own.z < reach) lines[count++] = own;
  }
  if (count == 0) return 1.0;
  float twice = 0.0;
  vec4 low = vec4(-0.5), high = vec4(0.5);
  for (int i = 0; i < count; ++i) {
    vec3 own = lines[i];
    vec2 interval = in_texel(own.xy, own.z);
    for (int j = 0; j < count; ++j) {
      if (j == i) continue;
      vec3 other = lines[j];
      float turn = dot(own.xy, other.xy), along = own.x * other.y - own.y * other.x;
      if (abs(along) < 1e-6) {
        float inside = other.z - own.z * turn;
        if (inside < 0.0 || (inside == 0.0 && turn > 0.0 && j < i)) interval.y = interval.x;
        continue;
      }
      float s = (own.z * turn - other.z) / along;
      if (along > 0.0) interval.x = max(interval.x, s); else interval.y = min(interval.y, s);
    }
    twice += own.z * max(interval.y - interval.x, 0.0);
    vec4 inside = vec4(own.z) + 0.5 * vec4(-own.x, own.x, -own.y, own.y), d = vec4(own.y, own.y, own.x, own.x);
    d = mix(d, vec4(1e-9), lessThan(abs(d), vec4(1e-9)));
    vec4 s = -inside / d;
    low = mix(low, max(low, s), greaterThan(d, vec4(0.0)));
    high = mix(min(high, s), high, greaterThan(d, vec4(0.0)));
  }
  vec4 sides = max(high - low, 0.0);
  return clamp(0.5 * twice + 0.25 * (sides.x + sides.y + sides.z + sides.w), 0.0, 1.0);
}
vec2 positive(float start, float change) {
  float end = start + change, t = start / (start - end);
  return vec2(start > 0.0 ? 0.0 : end > 0.0 ? t : 2.0, end > 0.0 ? 1.0 : start > 0.0 ? t : -1.0);
}
float density_at(float t) { return parabola.x + t * (parabola.y + t * parabola.z); }
vec3 sum = vec3(0.0);
void add(vec2 interval, int parts, bool whole) {
  vec3 before = energy_below(list.z, mix(band.x, band.y, interval.x));
  for (int i = 0; i < parts; ++i) {
    vec2 part = mix(interval.xx, interval.yy, (vec2(i) + vec2(0.5, 1.0)) / float(parts));
    vec3 now = energy_below(list.z, mix(band.x, band.y, part.y));
    sum += (whole ? 1.0 : covered(part.x)) * density_at(part.x) * (now - before);
    before = now;
  }
}
void main() {
  vec2 texel = gl_FragCoord.xy;
  if (any(greaterThanEqual(texel, vec2(size)))) discard;
  vec3 uvw = to_uv * vec3(texel, 1.0);
  if (uvw.z <= 0.0) discard;
  vec2 uv = uvw.xy / uvw.z;
  place = uv - about;
  sides = jacobian(to_uv, uvw);
  float wide = band.y - band.x;
  vec2 lit = wide > 0.0 ? (clamp(support, band.x, band.y) - band.x) / wide : vec2(0.0, 1.0), touched = lit, whole = lit;
  // Parts of the band: three of what is lit where the density changes, or sixteenths of a texel that edges move.
  bool is_even = abs(parabola.y) + abs(parabola.z) < 0.005 * parabola.x;
  float moves = is_even ? 0.0 : 3.0 / max(lit.y - lit.x, 1e-6);
  for (int i = 0; i < list.y; ++i) {
    int e = 2 * (list.x + i);
    vec4 start = edge_texel(e), from = seen_line(start), to = seen_line(start + edge_texel(e + 1));
    float h = from.z, dh = to.z - h, r = 0.5 * (abs(from.x) + abs(from.y)) * from.w;
    float dr = 0.5 * (abs(to.x) + abs(to.y)) * to.w - r;
    vec2 touches = positive(h + r, dh + dr), covers = positive(h - r, dh - dr);
    if (covers.x > lit.x || covers.y < lit.y) moves = max(moves, 16.0 * abs(dh / from.w) / length(from.xy));
    touched = vec2(max(touched.x, touches.x), min(touched.y, touches.y));
    whole = vec2(max(whole.x, covers.x), min(whole.y, covers.y));
  }
  if (touched.x > touched.y) discard;
  if (whole.x < whole.y) {
    add(whole, 3, true);
    ivec2 parts = clamp(ivec2(ceil(moves * abs(whole - touched))), 1, 4);
    if (whole.x > touched.x) add(vec2(touched.x, whole.x), parts.x, false);
    if (whole.y < touched.y) add(vec2(whole.y, touched.y), parts.y, false);
  } else add(touched, clamp(int(ceil(moves * (touched.y - touched.x))), 1, 8), false);
  for (int k = 0; k < lines; ++k) {
    vec4 line = line_of(list.z, k);
    if (line.w < band.x || line.w >= band.y) continue;
    float t = (line.w - band.x) / wide;
    if (t >= touched.x && t <= touched.y) sum += covered(t) * density_at(t) * line.rgb;
  }
  deposited = vec4(max(1.0 + dot(tilt.xy, uv - tilt.zw), 0.0) * texel_area(texel) * sum, 0.0);
}`;

export const WHOLE_VERTEX = `#version 300 es
void main() { gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0); }`;

export const VIEW_FRAGMENT = COMMON + `
uniform sampler2D map;
uniform sampler2D base;     // camera: the picture without the caustic
uniform sampler2D weight;   // camera: share of the receiver's light in each pixel
uniform sampler2D glass;    // in space: the glass as it is seen
uniform vec2 pixels;
uniform int view;           // 0 camera, 1 from above, 2 in space
uniform vec4 whites;        // of base, of weight; 2^exposure; 0
uniform vec3 diffuse;       // reflectance / pi
uniform vec4 mark;          // where the finger is: pixels right, down; 1 if it is
out vec4 shown;
vec3 bilinear(int level, vec2 place) {
  vec4 r = rect_of(level);
  vec2 q = clamp(place, vec2(0.5), r.zw - r.xy - 0.5) + r.xy - 0.5;
  ivec2 i = ivec2(q);
  vec2 f = q - vec2(i);
  vec3 low = mix(texelFetch(map, i, 0).rgb, texelFetch(map, i + ivec2(1, 0), 0).rgb, f.x);
  return mix(low, mix(texelFetch(map, i + ivec2(0, 1), 0).rgb, texelFetch(map, i + 1, 0).rgb, f.x), f.y);
}
vec3 irradiance(vec2 texel) {
  vec3 sum = vec3(0.0);
  for (int level = 0; level < LEVELS; ++level)
    sum += bilinear(level, texel * exp2(float(-level))) * exp2(float(-2 * level));
  return sum / texel_area(texel);
}
float fifth_powers(vec3 c) { vec3 q = c * c; return dot(q * q, c); }
float norm(vec3 c) { float most = max(max(max(c.r, c.g), c.b), 1e-30); return most * pow(fifth_powers(c / most), 0.2); }
// The desktop program's tone curve (shaders/lib/tone.glsl there).
vec3 tone(vec3 rgb) {
  float grey = max(dot(rgb, vec3(0.212639, 0.7151687, 0.0721923)), 1e-30), depth = norm(max(1.0 - rgb / grey, 0.0));
  float over = max(depth - 0.8, 0.0) / 0.2, limited = min(depth, 0.8) + 0.2 * (over / (1.0 + over));
  rgb = max(grey + limited / max(depth, 1e-30) * (rgb - grey), 0.0);
  float n = norm(rgb) * pow(3.0, -0.2), above = max(n - 0.5, 0.0) / 0.5, share = above / (above + 12.0);
  float kept = min(n, 0.5) + 0.5 * (above / (1.0 + above));
  vec3 chroma = rgb * (kept / max(n, 1e-30));
  vec3 display = chroma + share * sqrt(share) * (kept - chroma);
  return display / max(max(max(display.r, display.g), display.b), 1.0);
}
vec3 encoded(vec3 c) {
  return mix(1.055 * pow(max(c, 0.0031308), vec3(1.0 / 2.4)) - 0.055, 12.92 * c, lessThanEqual(c, vec3(0.0031308)));
}
void main() {
  vec2 pixel = vec2(gl_FragCoord.x, pixels.y - gl_FragCoord.y), texel = gl_FragCoord.xy / pixels * vec2(size);
  vec3 uvw = to_uv * vec3(texel, 1.0);
  vec3 rgb = uvw.z > 0.0 ? irradiance(texel) : vec3(0.0);
  if (view == 0) {
    vec2 at = pixel / pixels;
    rgb = whites.x * pow(texture(base, at).rgb, vec3(2.4)) + whites.y * texture(weight, at).rgb * rgb;
  } else {
    // A faint light shows where the receiver's plane is.
    rgb = diffuse * rgb + (uvw.z > 0.0 ? 0.012 : 0.002) / whites.z;
  }
  vec3 display = encoded(tone(rgb * whites.z));
  if (view == 2) {
    vec4 solid = texelFetch(glass, ivec2(gl_FragCoord.xy), 0);
    display = display * (1.0 - solid.a) + solid.rgb;
  }
  float ring = abs(length(pixel - mark.xy) - mark.w) / max(0.12 * mark.w, 0.6);
  if (mark.z > 0.0 && ring < 1.5) display = mix(vec3(1.0), display, smoothstep(0.5, 1.5, ring));
  shown = vec4(display, 1.0);
}`;

export const SOLID_VERTEX = `#version 300 es
precision highp float;
uniform mat4 to_clip;
layout(location = 0) in vec3 position;
layout(location = 1) in vec4 colour;
out vec3 world;
flat out vec4 tint;
void main() { world = position; tint = colour; gl_Position = to_clip * vec4(position, 1.0); }`;

export const SOLID_FRAGMENT = `#version 300 es
precision highp float;
uniform vec3 eye;
in vec3 world;
flat in vec4 tint;
out vec4 shown;
void main() {
  vec3 n = normalize(cross(dFdx(world), dFdy(world))), toward = normalize(eye - world);
  float slant = pow(1.0 - abs(dot(n, toward)), 3.0), lit = 0.55 + 0.45 * abs(dot(n, toward));
  float alpha = tint.a < 1.0 ? 0.1 + 0.5 * slant : 1.0;
  shown = vec4(tint.rgb * lit * alpha, alpha);
}`;
