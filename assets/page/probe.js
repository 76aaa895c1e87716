// The spectrum of the light at one place of the receiver, from the photons and beams themselves, without the map.

import { BEAM, PHOTON } from "./records.js";
import { COUNT, FIRST_NM, SAMPLES, valueAt } from "./spectra.js";

const STEP_NM = 10;

const bins = () => Array.from({ length: Math.floor(COUNT / STEP_NM) }, (_, k) => ({ nm: FIRST_NM + STEP_NM * (k + 0.5), power: 0 }));

// W a bin: lines and all.
const powers = ({ density, lines }) => bins().map((_, k) => {
  let sum = lines.reduce((all, [nm, watts]) => all + (Math.floor((nm - FIRST_NM) / STEP_NM) === k ? watts : 0), 0);
  for (let i = 0; i < STEP_NM; i++) sum += density[STEP_NM * k + i];
  return sum;
});

// The lamp's own: [{ nm, power }] in steps of 10 nm.
export function lampSpectrum(spectrum) {
  const power = powers(spectrum);
  return bins().map((bin, k) => ({ ...bin, power: power[k] }));
}

// The same of what falls on a place. `rows`: a spectrum a light, `x` of every nanometre, `texel` in units.
export function spectrumAt([u, v], { head, photons, beams, paths, rows, x, texel }) {
  const found = bins(), power = rows.map(powers);
  for (const bin of found) bin.x = valueAt(x, bin.nm);
  addPhotons(found, power, photons, paths, head.photons?.smoothing, texel, u, v);
  addBeams(found, power, beams, u, v);
  return found;
}

function addPhotons(found, power, { rows, count }, paths, smoothing, texel, u, v) {
  const index = (row, x, g) => paths[4 * (SAMPLES * row + Math.round(x * (SAMPLES - 1))) + g];
  for (let i = 0; i < count; i++) {
    const r = rows.subarray(PHOTON * i, PHOTON * i + PHOTON), [sx, sy, tx, ty] = [r[4], r[5], r[6], r[7]].map((side) => side * smoothing);
    const shift = (x) => {
      const [a, b, c] = [0, 1, 2].map((g) => index(0, x, g) - index(1, r[13], g));
      return [r[0] + a * r[8] + b * r[10] + c * r[2], r[1] + a * r[9] + b * r[11] + c * r[3]];
    };
    const [from, to] = [shift(r[12]), shift(r[14])], wide = 3 * (Math.hypot(sx, sy) + Math.hypot(tx, ty)) + 3 * texel;
    if (u < Math.min(from[0], to[0]) - wide || u > Math.max(from[0], to[0]) + wide) continue;
    if (v < Math.min(from[1], to[1]) - wide || v > Math.max(from[1], to[1]) + wide) continue;
    const blur = (texel * texel) / 12, xx = sx * sx + tx * tx + blur, xy = sx * sy + tx * ty, yy = sy * sy + ty * ty + blur, area = xx * yy - xy * xy;
    found.forEach((bin, k) => {
      if (bin.x < r[12] || bin.x >= r[14]) return;
      const [px, py] = shift(bin.x), dx = u - px, dy = v - py;
      const beside = bin.x < r[13] ? (bin.x - r[12]) / (r[13] - r[12]) : (bin.x - r[13]) / Math.max(r[14] - r[13], 1e-9);
      const carried = bin.x < r[13] ? r[16] + beside * (r[17] - r[16]) : r[17] + beside * (r[18] - r[17]);
      bin.power += (carried * power[r[15]][k] * Math.exp((-0.5 * (yy * dx * dx - 2 * xy * dx * dy + xx * dy * dy)) / area)) / (2 * Math.PI * Math.sqrt(area));
    });
  }
}

function addBeams(found, power, { rows, count, edges }, u, v) {
  for (let i = 0; i < count; i++) {
    const r = rows.subarray(BEAM * i, BEAM * i + BEAM), du = u - r[0], dv = v - r[1], reach = Math.hypot(r[2], r[3]);
    if (Math.abs(du * r[2] + dv * r[3]) > reach * reach * 1.001 || Math.abs(dv * r[2] - du * r[3]) > reach * r[4] * 1.001) continue;
    found.forEach((bin, k) => {
      if (bin.x < r[16] || bin.x >= r[17]) return;
      const t = (bin.x - r[16]) / (r[17] - r[16]);
      for (let e = r[5]; e < r[5] + r[6]; e++) {
        const [a, b, c] = [0, 1, 2].map((j) => edges[8 * e + j] + t * edges[8 * e + 4 + j]);
        if (a * du + b * dv + c < 0) return;
      }
      const tilt = 1 + r[12] * (u - r[14]) + r[13] * (v - r[15]);
      bin.power += Math.max(tilt, 0) * (r[8] + t * (r[9] + t * r[10])) * power[r[7]][k];
    });
  }
}
