// The spectrum of the light at one place of the receiver, from the photons and beams themselves, without the map.

import {BEAM, PHOTON} from "./records.js";
import {COUNT, FIRST_NM, SAMPLES, valueAt} from "./spectra.js";

const STEP_NM = 10;
const BINS = Array.from({ length: Math.floor(COUNT / STEP_NM) }, (_, k) => FIRST_NM + STEP_NM * (k + 0.5));

// W a bin: lines and all.
const powers = ({ density, lines }) => BINS.map((middle, k) => {
  const sum = density.subarray(STEP_NM * k, STEP_NM * (k + 1)).reduce((all, watts) => all + watts, 0);
  return lines.reduce((all, [nm, watts]) => all + (Math.abs(nm - middle) < STEP_NM / 2 ? watts : 0), sum);
});

// The lamp's own: [{ nm, power }] in steps of 10 nm.
export const lampSpectrum = (spectrum) => powers(spectrum).map((power, k) => ({nm: BINS[k], power}));

// The same of what falls on a place. `rows`: a spectrum a light, `x` of every nanometre, `texel` in units.
export function spectrumAt([u, v], {head, photons, beams, paths, rows, x, texel}) {
  const found = BINS.map((nm) => ({ nm, power: 0, x: valueAt(x, nm) })), power = rows.map(powers);
  addPhotons(found, power, photons, paths, head.photons.smoothing, texel, u, v);
  addBeams(found, power, beams, u, v);
  return found;
}

const isBeyond = (at, from, to, wide) => at < Math.min(from, to) - wide || at > Math.max(from, to) + wide;

function addPhotons(found, power, { rows, count }, paths, smoothing, texel, u, v) {
  const index = (row, x, g) => paths[4 * (SAMPLES * row + Math.round(x * (SAMPLES - 1))) + g];
  const blur = (texel * texel) / 12;
  for (let i = 0; i < count; i++) {
    const r = rows.subarray(PHOTON * i, PHOTON * i + PHOTON), [lo, anchor, hi, lamp] = r.subarray(12);
    const [sx, sy, tx, ty] = r.subarray(4, 8).map((side) => side * smoothing);
    const placeOf = (x) => {
      const [a, b, c] = [0, 1, 2].map((g) => index(0, x, g) - index(1, anchor, g));
      return [r[0] + a * r[8] + b * r[10] + c * r[2], r[1] + a * r[9] + b * r[11] + c * r[3]];
    };
    const from = placeOf(lo), to = placeOf(hi), wide = 3 * (Math.hypot(sx, sy) + Math.hypot(tx, ty) + texel);
    if (isBeyond(u, from[0], to[0], wide) || isBeyond(v, from[1], to[1], wide)) continue;
    const xx = sx * sx + tx * tx + blur, xy = sx * sy + tx * ty, yy = sy * sy + ty * ty + blur;
    const area = xx * yy - xy * xy;
    found.forEach((bin, k) => {
      if (bin.x < lo || bin.x >= hi) return;
      const [px, py] = placeOf(bin.x), dx = u - px, dy = v - py;
      const [near, far] = bin.x < anchor ? [lo, anchor] : [anchor, hi];
      const share = (bin.x - near) / Math.max(far - near, 1e-9), [p, q] = r.subarray(bin.x < anchor ? 16 : 17);
      const density = Math.exp((-0.5 * (yy * dx * dx - 2 * xy * dx * dy + xx * dy * dy)) / area) / Math.sqrt(area);
      bin.power += (((p + share * (q - p)) * density) / (2 * Math.PI)) * power[lamp][k];
    });
  }
}

function addBeams(found, power, { rows, count, edges }, u, v) {
  for (let i = 0; i < count; i++) {
    const r = rows.subarray(BEAM * i, BEAM * i + BEAM), du = u - r[0], dv = v - r[1], reach = Math.hypot(r[2], r[3]);
    if (Math.abs(du * r[2] + dv * r[3]) > reach * reach * 1.001) continue;
    if (Math.abs(dv * r[2] - du * r[3]) > reach * r[4] * 1.001) continue;
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
