// What a light of some spectrum sends to which place of the traced interval of paths: tables for the shaders.
// Wavelengths are in nm, one value a nanometre from 380 to 780. x is the coordinate of the paths, 0 to 1: affine in the
// index of the one glass that disperses, or in the wavelength where there are several.

export const FIRST_NM = 380, LAST_NM = 780, COUNT = 401, D_NM = 587.5618;
export const SAMPLES = 2048;

export const valueAt = (values, nm) => {
  const place = Math.min(Math.max(nm - FIRST_NM, 0), COUNT - 1), i = Math.min(Math.floor(place), COUNT - 2);
  return values[i] + (place - i) * (values[i + 1] - values[i]);
};

// n(λ) with `gain` times the dispersion and the same index at the d line.
export function indexOf(glass, gain) {
  const d = valueAt(glass, D_NM);
  return Float64Array.from(glass, (n) => d + gain * (n - d));
}

// (n_d - 1) / (n_F - n_C).
export const abbeNumber = (glass) => (valueAt(glass, D_NM) - 1) / (valueAt(glass, 486.1327) - valueAt(glass, 656.2725));

// x of every nanometre, and whether all of it was traced. `nm`: the wavelength at equal steps of x, where x is not
// affine in the index.
export function placesOf(head, index, nm) {
  const span = head.n_at_1 - head.n_at_0, free = new Float64Array(COUNT);
  for (let i = 0, k = 0; i < COUNT; i++) {
    while (k < nm.length - 2 && nm[k + 1] < FIRST_NM + i) k++;
    free[i] = head.mode === "index" ? (index[i] - head.n_at_0) / span :
                                      (k + (FIRST_NM + i - nm[k]) / (nm[k + 1] - nm[k])) / (nm.length - 1);
  }
  return { x: free.map((x) => Math.min(Math.max(x, 0), 1)), isWithin: free.every((x) => x > -1e-4 && x < 1 + 1e-4) };
}

// A spectrum, { density (401,), lines [[nm, W]] }, of another power.
export function scaled({density, lines}, scale) {
  return { density: density.map((w) => w * scale), lines: lines.map(([nm, w]) => [nm, w * scale]) };
}

// A single wavelength in place of a spectrum: what 10 nm of an even one as bright would have there.
export function single(nm, spectrum) {
  const power = [...spectrum.density, ...spectrum.lines.map(([, watts]) => watts)].reduce((sum, watts) => sum + watts);
  return { density: new Float32Array(COUNT), lines: [[nm, power / 12]] };
}

// Rows of the shaders' table: (red, green, blue, 0) below each place between the ends of the light, then its lines
// (red, green, blue, x). A row a spectrum; `response`: what each colour gets of a watt, by nanometre.
export function lightTable(rows, x, response) {
  const ends = [];
  for (const { density, lines } of rows) {
    ends.push(...x.filter((_, i) => [i - 1, i, i + 1].some((k) => density[k] > 0)));
    for (const [nm] of lines) ends.push(valueAt(x, nm) - 2e-4, valueAt(x, nm) + 2e-4);
  }
  const low = Math.min(1, ...ends), high = Math.max(0, ...ends);
  const middle = (low + high) / 2, half = Math.max((high - low) / 2, 2e-4), support = [middle - half, middle + half];
  const lineCount = Math.max(...rows.map(({ lines }) => lines.length));
  const width = SAMPLES + lineCount, table = new Float32Array(4 * width * rows.length);
  rows.forEach((spectrum, r) => {
    const energy = (nm, watts) => response.map((colour) => watts * valueAt(colour, nm));
    const base = 4 * width * r;
    // Cells of a nanometre, half ones at the ends; even within.
    const below = [0, 0, 0], step = (support[1] - support[0]) / (SAMPLES - 1);
    let sample = 0;
    const put = (share, cell) => table.set(below.map((sum, c) => sum + share * cell[c]), base + 4 * sample++);
    for (let i = 0; i < COUNT; i++) {
      const [from, to] = [i - 0.5, i + 0.5].map((middle) => valueAt(x, FIRST_NM + middle));
      if (to <= 0 || from >= 1) continue; // beyond what was traced
      const cell = energy(FIRST_NM + i, spectrum.density[i] * (i % (COUNT - 1) ? 1 : 0.5));
      while (sample < SAMPLES && support[0] + sample * step < to)
        put(Math.max(support[0] + sample * step - from, 0) / Math.max(to - from, 1e-12), cell);
      for (let c = 0; c < 3; c++) below[c] += cell[c];
    }
    while (sample < SAMPLES) put(0, below);
    spectrum.lines.forEach(
      ([nm, watts], k) => table.set([...energy(nm, watts), valueAt(x, nm)], base + 4 * (SAMPLES + k)));
  });
  return { table, width, height: rows.length, support, lineCount };
}

// Two rows of the paths' table over x: each group's variable (its glass's index) as shown, and as traced; three groups
// and 0. `variable` (groups, samples), `nm` (samples,): as traced, at equal steps of x.
export function indexTable(head, shown, variable, nm) {
  const table = new Float32Array(8 * SAMPLES), last = nm.length - 1, groups = variable.length / nm.length;
  for (let k = 0; k < SAMPLES; k++) {
    const x = k / (SAMPLES - 1), place = x * last, i = Math.min(Math.floor(place), last - 1);
    const at = (values, from) => values[from + i] + (place - i) * (values[from + i + 1] - values[from + i]);
    for (let g = 0; g < Math.min(groups, 3); g++) {
      const n = head.mode === "index" ? head.n_at_0 + x * (head.n_at_1 - head.n_at_0) : at(variable, g * nm.length);
      table[4 * k + g] = head.mode === "index" || !shown[g] ? n : valueAt(shown[g], at(nm, 0));
      table[4 * (SAMPLES + k) + g] = n;
    }
  }
  return table;
}
