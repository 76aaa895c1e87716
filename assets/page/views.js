// Where the eye is, and which place of the receiver each pixel shows: 3 x 3 matrices, by rows, from (pixel right, pixel
// down, 1) to (u, v, 1) times a weight.

import { BEAM, PHOTON } from "./records.js";

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const plus = (a, b, k) => [a[0] + k * b[0], a[1] + k * b[1], a[2] + k * b[2]];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a) => a.map((x) => x / (Math.hypot(...a) || 1));
const upOf = ({ up }) => (up === "y" ? [0, 1, 0] : [0, 0, 1]);

export const uvAt = (m, px, py) => {
  const [u, v, w] = [0, 3, 6].map((row) => m[row] * px + m[row + 1] * py + m[row + 2]);
  return w > 0 ? [u / w, v / w] : null;
};

export function inverse([a, b, c, d, e, f, g, h, i]) {
  const minors = [e * i - f * h, c * h - b * i, b * f - c * e, f * g - d * i, a * i - c * g, c * d - a * f, d * h - e * g, b * g - a * h, a * e - b * d];
  const area = a * minors[0] + b * minors[3] + c * minors[6];
  return minors.map((minor) => minor / area);
}

// Area on the receiver of the pixel at a place.
export function areaAt(m, [px, py]) {
  const [a, b, c, d, e, f, g, h, i] = m, weight = g * px + h * py + i;
  return Math.abs((a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)) / weight ** 3);
}

// The scene's own camera, on a canvas of another size.
export function fromCamera(head, width, height) {
  const kx = head.camera.width / width, ky = head.camera.height / height, m = head.camera.pixel_to_uv.flat();
  return m.map((value, i) => value * [kx, ky, 1][i % 3]);
}

// Straight from above: `centre` (u, v), units across the canvas' smaller side.
export function fromAbove({ centre, across }, width, height) {
  const k = across / Math.min(width, height);
  return [k, 0, centre[0] - (k * width) / 2, 0, -k, centre[1] + (k * height) / 2, 0, 0, 1];
}

// About the receiver: angles round the up axis and above the horizon, distance. Also what the glass is drawn with.
export function around(head, { target, turn, lift, distance }, width, height) {
  const { plane } = head, up = upOf(head), side = unit(cross(up, Math.abs(up[0]) < 0.9 ? [1, 0, 0] : [0, 0, 1])), ahead = cross(up, side);
  const level = plus(side.map((x) => x * Math.cos(turn)), ahead, Math.sin(turn));
  const back = plus(level.map((x) => x * Math.cos(lift)), up, Math.sin(lift));
  const eye = plus(target, back, distance), right = unit(cross(up, back)), over = cross(back, right), toward = back.map((x) => -x);
  const k = (2 * Math.tan(0.35)) / Math.min(width, height);
  // A pixel's direction is linear in (px, py, 1).
  const columns = [right.map((x) => x * k), over.map((x) => -x * k), plus(plus(toward, right, (-k * width) / 2), over, (k * height) / 2)];
  const normal = cross(plane.u, plane.v), from = minus(eye, plane.origin), height0 = -dot(from, normal), sign = Math.sign(height0) || 1;
  const rows = [plane.u, plane.v].map((axis) => plus(normal.map((x) => x * dot(from, axis)), axis, height0)).concat([normal]);
  const toUv = rows.flatMap((row) => columns.map((column) => sign * dot(row, column)));
  const near = distance / 50, far = distance * 50, fx = 2 / (k * width), fy = 2 / (k * height), a = (far + near) / (far - near), b = (2 * far * near) / (far - near);
  const row = (axis, scale) => [...axis.map((x) => x * scale), -scale * dot(axis, eye)];
  const depth = row(toward, a);
  depth[3] -= b;
  return { toUv, eye, toClip: [...row(right, fx), ...row(over, fy), ...depth, ...row(toward, 1)] };
}

// Where most light lands, four fifths of it along u and along v: middle and size, by the rows of records.js.
export function extent({ photons, beams }, w) {
  const places = [];
  const each = ({ rows, count }, width, add) => {
    for (let i = 0, step = Math.ceil(count / 3000); i < count; i += step) add(rows.subarray(width * i, width * i + width));
  };
  each(photons, PHOTON, (r) => places.push([r[0], r[1], r[17]]));
  each(beams, BEAM, (r) => [-1, 1].forEach((k) => places.push([r[0] + k * r[2], r[1] + k * r[3], r[8] * r[4] * Math.hypot(r[2], r[3])])));
  const total = places.reduce((sum, place) => sum + place[2], 0);
  const ends = (axis, from, to) => {
    let below = 0, low = null, high = from;
    for (const place of places.toSorted((p, q) => p[axis] - q[axis])) {
      below += place[2] / total;
      if (below >= 0.1) low ??= place[axis];
      if (below <= 0.9) high = place[axis];
    }
    return total > 0 ? [(low + high) / 2, Math.max(high - low, 0.02 * (to - from))] : [(from + to) / 2, to - from];
  };
  const [u, v] = [ends(0, w.u0, w.u1), ends(1, w.v0, w.v1)];
  return { middle: [u[0], v[0]], size: 1.5 * Math.max(u[1], v[1]) };
}

// Where `around` begins: from the scene's camera, at the middle of what is lit.
export function startAround(head, { middle, size }) {
  const { plane } = head, target = plus(plus(plane.origin, plane.u, middle[0]), plane.v, middle[1]);
  const up = upOf(head), side = unit(cross(up, Math.abs(up[0]) < 0.9 ? [1, 0, 0] : [0, 0, 1])), ahead = cross(up, side);
  const from = unit(head.camera ? minus(head.camera.eye, target) : plus(plus(side, ahead, 1), up, 1));
  return { target, turn: Math.atan2(dot(from, ahead), dot(from, side)), lift: Math.asin(Math.min(Math.max(dot(from, up), 0.3), 0.95)), distance: 1.7 * size };
}

// Where `fromAbove` begins.
export const startAbove = ({ middle, size }) => ({ centre: middle, across: size });
