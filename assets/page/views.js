// Where the eye is, and which place of the receiver each pixel shows: 3 x 3 matrices, by rows, from (pixel right, pixel
// down, 1) to (u, v, 1) times a weight.

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const mul = (a, k) => a.map((x) => k * x);
const plus = (a, b, k) => [a[0] + k * b[0], a[1] + k * b[1], a[2] + k * b[2]];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a) => mul(a, 1 / (Math.hypot(...a) || 1));
const HALF_ANGLE = 0.35; // of the view all round, over the canvas' smaller side

export const uvAt = (m, px, py) => {
  const [u, v, w] = [0, 3, 6].map((row) => m[row] * px + m[row + 1] * py + m[row + 2]);
  return w > 0 ? [u / w, v / w] : null;
};

export function inverse([a, b, c, d, e, f, g, h, i]) {
  const [x, y, z] = [[a, d, g], [b, e, h], [c, f, i]], minors = [cross(y, z), cross(z, x), cross(x, y)];
  return minors.flat().map((minor) => minor / dot(x, minors[0]));
}

// Area on the receiver of the pixel at a place.
export const areaAt = ([a, b, c, d, e, f, g, h, i], [px, py]) =>
  Math.abs(dot([a, b, c], cross([d, e, f], [g, h, i])) / (g * px + h * py + i) ** 3);

// The scene's own camera, on a canvas of another size.
export const fromCamera = ({camera}, width, height) =>
  camera.pixel_to_uv.flat().map((value, i) => value * [camera.width / width, camera.height / height, 1][i % 3]);

// Straight from above: `centre` (u, v), units across the canvas' smaller side.
export function fromAbove({centre, across}, width, height) {
  const k = across / Math.min(width, height);
  return [k, 0, centre[0] - (k * width) / 2, 0, -k, centre[1] + (k * height) / 2, 0, 0, 1];
}

// About a place, to `radius` on either side: angles round the up axis and above the horizon; `axes`: two of the
// horizon, up. Also what the glass is drawn with.
export function around({plane}, {target, axes: [side, ahead, up], turn, lift, radius}, width, height) {
  const { cos, sin } = Math, distance = radius / Math.tan(HALF_ANGLE);
  const back = plus(mul(plus(mul(side, cos(turn)), ahead, sin(turn)), cos(lift)), up, sin(lift));
  const eye = plus(target, back, distance), right = unit(cross(up, back)), over = cross(back, right);
  // A pixel's direction is linear in (px, py, 1).
  const k = (2 * Math.tan(HALF_ANGLE)) / Math.min(width, height);
  const corner = plus(plus(mul(back, -1), right, (-k * width) / 2), over, (k * height) / 2);
  const columns = [mul(right, k), mul(over, -k), corner];
  const normal = cross(plane.u, plane.v), from = plus(eye, plane.origin, -1), tall = -dot(from, normal);
  const rows = [plane.u, plane.v].map((axis) => plus(mul(normal, dot(from, axis)), axis, tall)).concat([normal]);
  const toUv = rows.flatMap((row) => columns.map((column) => (Math.sign(tall) || 1) * dot(row, column)));
  // Nothing is cut off in front or behind: all depths are the same.
  const clip = (axis, scale) => [...mul(axis, scale), -scale * dot(axis, eye)];
  const toClip = [clip(right, 2 / (k * width)), clip(over, 2 / (k * height)), [0, 0, 0, 0], clip(back, -1)].flat();
  return { toUv, eye, toClip };
}
