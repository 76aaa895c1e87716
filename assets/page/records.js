// Photons and beams as the shaders take them: some texels of four floats each, 256 photons or beams a row of a texture.

export const PHOTON = 24, BEAM = 20, ABREAST = 256;
const table = (count, floats) => new Float32Array(floats * ABREAST * Math.ceil(count / ABREAST));

// Place, change with the third index; sides; change with two indices; x and row; throughput, 0; points of its
// lattice, edge of its light, by how much it widens along its sides.
const PLACES = { position: 0, axis_s: 4, axis_t: 6, dposition_dn: 8, x: 12, light: 15, throughput: 16, lattice: 20, edge: 21, fan: 22 };

export function photonRows(head, array, shapeOf) {
  const count = shapeOf("photons.position")[0], rows = table(count, PHOTON);
  const put = (name, at, first) => {
    const values = array(`photons.${name}`), width = values ? values.length / count : 0;
    const unit = name === "throughput" ? head.photons.unit : 1;
    for (let i = 0; i < count; i++)
      for (let k = first; k < Math.min(width, first + 4); k++) rows[PHOTON * i + at + k - first] = values[width * i + k] * unit;
  };
  for (const [name, at] of Object.entries(PLACES)) put(name, at, 0);
  put("dposition_dn", 2, 4);
  return { rows, count };
}

// A rectangle that holds the polygon; edges and row; density; slope; x, 0. Edges about its middle, two texels each.
export function beamRows(array) {
  const x = array("beams.x"), count = x ? x.length / 2 : 0, rows = table(count, BEAM);
  if (!count) return { rows, count, most: 0, edges: new Float32Array(0) };
  const [density, slope, centre, light, first, edge, hullFirst, hull] =
    ["density", "slope", "centre", "light", "first", "edge", "hull_first", "hull"].map((name) => array(`beams.${name}`));
  const edges = new Float32Array(4096 * Math.ceil(edge.length / 4096));
  let most = 0;
  for (let i = 0; i < count; i++) {
    const { middle, along, half } = rectangle(hull, hullFirst[i], hullFirst[i + 1]), [a, b, c] = density.subarray(3 * i);
    rows.set([...middle, along[0] * half[0], along[1] * half[0], half[1], first[i], first[i + 1] - first[i], light?.[i] ?? 0,
      a, 4 * b - 3 * a - c, 2 * (a - 2 * b + c), 0, slope[2 * i], slope[2 * i + 1], centre[2 * i], centre[2 * i + 1], x[2 * i], x[2 * i + 1]], BEAM * i);
    // Of a polygon narrower than its penumbrae only their mean is seen: all its edges are as soft.
    const softness = Array.from(edge.subarray(8 * first[i], 8 * first[i + 1])).filter((_, k) => k % 4 === 3).map((soft) => Math.max(soft, 0));
    const widest = Math.max(...softness), isNarrow = Math.sqrt(4 * half[0] * half[1]) < 4 * widest;
    most = Math.max(most, first[i + 1] - first[i]);
    for (let e = first[i]; e < first[i + 1]; e++) {
      const line = edge.subarray(8 * e, 8 * e + 8);
      const scale = 2 / (Math.hypot(line[0], line[1]) + Math.hypot(line[4], line[5]));
      const [from, to] = [0, 4].map((k) =>
        [line[k] * scale, line[k + 1] * scale, (line[k + 2] + line[k] * middle[0] + line[k + 1] * middle[1]) * scale + (line[k + 3] < 0 && !isNarrow ? 1e6 : 0), isNarrow ? widest : line[k + 3]]);
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
  const half = [0, 1].map((axis) => (high[axis] - low[axis]) / 2), [p, q] = [0, 1].map((axis) => (high[axis] + low[axis]) / 2);
  return { middle: [p * ex - q * ey, p * ey + q * ex], along, half };
}
