// Photons and beams as the shaders take them: some texels of four floats each, 256 photons or beams a row of a texture.

export const PHOTON = 24, BEAM = 20, ABREAST = 256;
const table = (count, floats) => new Float32Array(floats * ABREAST * Math.ceil(count / ABREAST));

// Place, change with the third index; sides; change with two indices; x and row; throughput, 0; points of its
// lattice, edge of its light, by how much it widens along its sides.
const PLACES = ["position", "axis_s", "axis_t", "dposition_dn", "x", "light", "throughput", "lattice", "edge", "fan"];
const PLACED_AT = [0, 4, 6, 8, 12, 15, 16, 20, 21, 22];

export function photonRows(head, array) {
  const count = (array("photons.position")?.length ?? 0) / 2, rows = table(count, PHOTON);
  const put = (name, at, first) => {
    const values = array(`photons.${name}`), width = values ? values.length / count : 0;
    const unit = name === "throughput" ? head.photons.unit : 1;
    for (let i = 0; i < count; i++)
      for (let k = first; k < Math.min(width, first + 4); k++)
        rows[PHOTON * i + at + k - first] = values[width * i + k] * unit;
  };
  PLACES.forEach((name, k) => put(name, PLACED_AT[k], 0));
  put("dposition_dn", 2, 4);
  return { rows, count };
}

// A rectangle that holds the polygon; edges and row; density; slope; x, 0. Edges about its middle, two texels each.
export function beamRows(array) {
  const x = array("beams.x"), count = x ? x.length / 2 : 0, rows = table(count, BEAM);
  if (!count) return { rows, count, most: 0, edges: new Float32Array(0) };
  const names = ["density", "slope", "centre", "light", "first", "edge", "hull_first", "hull"];
  const [density, slope, centre, light, first, edge, hullFirst, hull] = names.map((name) => array(`beams.${name}`));
  const edges = new Float32Array(4096 * Math.ceil(edge.length / 4096));
  let most = 0;
  for (let i = 0; i < count; i++) {
    const { middle, along, half } = rectangle(hull, hullFirst[i], hullFirst[i + 1]);
    const [a, b, c] = density.subarray(3 * i), two = (values) => values.subarray(2 * i, 2 * i + 2);
    rows.set([...middle, along[0] * half[0], along[1] * half[0], half[1], first[i], first[i + 1] - first[i]], BEAM * i);
    rows.set([light?.[i] ?? 0, a, 4 * b - 3 * a - c, 2 * (a - 2 * b + c), 0], BEAM * i + 7);
    [slope, centre, x].forEach((values, k) => rows.set(two(values), BEAM * i + 12 + 2 * k));
    // Of a polygon narrower than its penumbrae only their mean is seen: all its edges are as soft.
    let widest = 0;
    for (let k = 8 * first[i] + 3; k < 8 * first[i + 1]; k += 4) widest = Math.max(widest, edge[k]);
    const isNarrow = Math.sqrt(4 * half[0] * half[1]) < 4 * widest;
    most = Math.max(most, first[i + 1] - first[i]);
    for (let e = first[i]; e < first[i + 1]; e++) {
      const line = edge.subarray(8 * e, 8 * e + 8);
      const scale = 2 / (Math.hypot(line[0], line[1]) + Math.hypot(line[4], line[5]));
      const distance = ([a, b, c, soft]) =>
        (c + a * middle[0] + b * middle[1]) * scale + (soft < 0 && !isNarrow ? 1e6 : 0);
      const [from, to] = [line.subarray(0, 4), line.subarray(4)].map(
        (end) => [end[0] * scale, end[1] * scale, distance(end), isNarrow ? widest : end[3]]);
      edges.set(from, 8 * e);
      edges.set(to.map((value, k) => value - from[k]), 8 * e + 4);
    }
  }
  return { rows, count, most, edges };
}

// The rectangle about a convex polygon, corners `from` to `to`, along its longest side.
function rectangle(hull, from, to) {
  let longest = 1e-12, along = [1, 0];
  for (let i = from, j = to - 1; i < to; j = i++) {
    const side = [hull[2 * i] - hull[2 * j], hull[2 * i + 1] - hull[2 * j + 1]], length = Math.hypot(...side);
    if (length > longest) [longest, along] = [length, side.map((part) => part / length)];
  }
  const [ex, ey] = along, low = [Infinity, Infinity], high = [-Infinity, -Infinity];
  for (let k = from; k < to; k++)
    [hull[2 * k] * ex + hull[2 * k + 1] * ey, hull[2 * k + 1] * ex - hull[2 * k] * ey].forEach((place, axis) => {
      low[axis] = Math.min(low[axis], place);
      high[axis] = Math.max(high[axis], place);
    });
  const [half, [p, q]] = [-1, 1].map((sign) => [0, 1].map((axis) => (high[axis] + sign * low[axis]) / 2));
  return { middle: [p * ex - q * ey, p * ey + q * ex], along, half };
}
