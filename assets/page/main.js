// The page: what the reader set, and the picture that follows. No server, no library; see docs/page.md.

import { readData } from "./data.js";
import { lackOf, Light } from "./light.js";
import { bindPanel, bindReading, byId, tell, tellIndex } from "./panel.js";
import { coloursOf, drawIndex, drawSpectrum, nmUnder } from "./plots.js";
import { lampSpectrum, spectrumAt } from "./probe.js";
import { beamRows, photonRows } from "./records.js";
import { asBright, COUNT, indexOf, indexTable, lightTable, placesOf, single } from "./spectra.js";
import { areaAt, around, extent, fromAbove, fromCamera, startAbove, startAround, uvAt } from "./views.js";

const SLOW_MS = 45, FAST_MS = 25, SETTLED_MS = 180, COARSEST = 4, MODES = { camera: 0, above: 1, space: 2 };

function problem(text) {
  byId("problem").textContent = text;
  byId("problem").hidden = !text;
}

function showStill(head, array) {
  const bytes = array("still");
  if (!bytes) return;
  byId("still").src = URL.createObjectURL(new Blob([bytes], { type: "image/jpeg" }));
  byId("still").alt = `${head.title}: a still picture`;
  byId("still").hidden = false;
  byId("picture").hidden = true;
}

async function start() {
  const data = await readData(document), { head, array, shapeOf } = data;
  const glassN = array("glass_n"), observer = array("observer"), density = array("spectra.density") ?? array("density");
  const glass = (row) => glassN.subarray(COUNT * row, COUNT * (row + 1));
  const spectra = head.spectra.map(({ lines }, i) => ({ density: density.subarray(COUNT * i, COUNT * (i + 1)), lines: lines ?? [] }));
  const nmOf = array("nm"), variable = array("variable"), reflectance = array("reflectance"), colours = coloursOf(observer);
  head.meshes ??= [];
  const records = { photons: photonRows(head, array, shapeOf), beams: beamRows(array) }, lit = extent(records, head.window);
  const fresh = () => ({
    gain: 1, rows: head.groups.map(({ row }) => row), spectrum: -1, isSingle: false, nm: 550, exposure: 0, readNm: 588, playing: null,
    view: head.camera?.pixel_to_uv ? "camera" : "above", above: startAbove(lit), space: startAround(head, lit), mark: null,
  });
  const state = fresh(), canvas = byId("picture"), shown = { index: [], own: [], rows: [], x: null, paths: null };
  const dirty = { tables: true, map: true, glass: true, spectrum: true, words: true };
  const times = { first: 0, frames: [] };
  let light = null, queued = false, settle = 0, lastFrame = 0, toUv = null;
  // While something moves the map has every so many pixels only, as many as keep pace; all of them once it rests.
  let moves = true, coarse = COARSEST, finest = 1;

  // ---- one frame ------------------------------------------------------------------------------

  function tables() {
    shown.index = state.rows.map((row) => indexOf(glass(row), state.gain));
    shown.own = head.groups.map(({ row }) => glass(row));
    const places = placesOf(head, shown.index[0], nmOf);
    shown.x = places.x;
    shown.rows = head.lights.map((lamp) => {
      const own = spectra[lamp.spectrum], chosen = state.spectrum < 0 ? own : asBright(spectra[state.spectrum], own, observer);
      return state.isSingle ? single(state.nm, chosen) : chosen;
    });
    shown.paths = indexTable(head, shown.index, variable, nmOf);
    light.setTables(lightTable(shown.rows, shown.x, observer, reflectance), shown.paths);
    problem(places.isWithin ? "" : "This glass goes beyond the indices that were traced: the ends of its spectrum are left out.");
  }

  function fit() {
    const ratio = Math.min(window.devicePixelRatio || 1, 2), width = Math.max(64, Math.min(Math.round(canvas.clientWidth * ratio), 1600));
    const aspect = head.camera ? head.camera.height / head.camera.width : 0.75, height = Math.round(width * aspect);
    if (canvas.width === width && canvas.height === height) return;
    Object.assign(canvas, { width, height });
    canvas.style.aspectRatio = `${width} / ${height}`;
    dirty.glass = dirty.map = true;
  }

  function frame(now) {
    queued = false;
    if (!light) return;
    light.counts.draws = light.counts.bytes = 0;
    play(now);
    fit();
    if (dirty.tables) tables();
    const { width, height } = canvas;
    toUv = state.view === "camera" ? fromCamera(head, width, height) : fromAbove(state.above, width, height);
    if (state.view === "space") {
      const camera = around(head, state.space, width, height);
      toUv = camera.toUv;
      if (dirty.glass) light.drawGlass(camera, width, height);
      dirty.glass = false;
    }
    if (dirty.map) light.gather(toUv, width, height, moves ? coarse : 1);
    light.show(MODES[state.view], (head.exposure_ev ?? 0) + state.exposure, markPixel(), width, height);
    if (dirty.words) tell(state, shown.index);
    if (dirty.words && shown.index.length) {
      drawIndex(byId("index"), shown.index[0], shown.own[0], state.readNm, colours);
      tellIndex(state, shown.index[0], shown.own[0]);
    }
    if (dirty.spectrum && (!moves || coarse === 1)) spectrum();
    const isMoving = dirty.map;
    dirty.tables = dirty.map = dirty.words = false;
    if (lastFrame && isMoving) {
      times.frames = [...times.frames.slice(-2), now - lastFrame];
      const isAll = (test) => times.frames.length === 3 && times.frames.every(test), before = coarse;
      if (isAll((ms) => ms > SLOW_MS)) finest = coarse = Math.min(2 * coarse, COARSEST);
      else if (isAll((ms) => ms < FAST_MS)) coarse = Math.max(coarse / 2, finest);
      if (coarse !== before) times.frames = [];
    }
    lastFrame = state.playing || isMoving ? now : 0;
    clearTimeout(settle);
    if (state.playing) queue();
    else settle = setTimeout(settled, Math.max(SETTLED_MS, 3 * (times.frames.at(-1) ?? 0)));
  }

  function whole() {
    moves = false;
    dirty.map = true;
    frame(performance.now());
  }

  function settled() {
    lastFrame = 0;
    if (!moves) return;
    moves = false;
    dirty.map = coarse > 1;
    queue();
  }

  function queue() {
    if (queued) return;
    queued = true;
    requestAnimationFrame(frame);
  }

  function play(now) {
    if (state.playing === "gain") state.gain = (head.limits?.gain_max ?? 2) * (0.5 - 0.5 * Math.cos(now / 1400));
    if (state.playing === "nm") Object.assign(state, { nm: 400 + ((now / 20) % 300), isSingle: true });
    if (state.playing) moves = dirty.tables = dirty.map = dirty.spectrum = dirty.words = true;
  }

  // ---- the place under the finger ----------------------------------------------------------------

  function markPixel() {
    if (!state.mark) return null;
    const m = toUv, [u, v] = state.mark;
    // (m - uv w) p = 0, for p = (right, down, 1).
    const [a, b, c] = [0, 1, 2].map((k) => m[k] - u * m[6 + k]), [d, e, f] = [0, 1, 2].map((k) => m[3 + k] - v * m[6 + k]);
    const area = a * e - b * d;
    return Math.abs(area) < 1e-30 ? null : [(b * f - c * e) / area, (c * d - a * f) / area];
  }

  // At the ring; of the lamp while there is none.
  function spectrum() {
    dirty.spectrum = false;
    const about = { head, ...records, paths: shown.paths, rows: shown.rows, x: shown.x, texel: state.mark ? Math.sqrt(areaAt(toUv, markPixel() ?? [0, 0])) : 0 };
    const found = state.mark ? spectrumAt(state.mark, about) : lampSpectrum(shown.rows[0]);
    drawSpectrum(byId("here"), found, state.readNm, colours);
    const most = found.reduce((best, bin) => (bin.power > best.power ? bin : best));
    byId("here-says").textContent = !state.mark ? "Spectrum of the lamp. Touch the picture to see that of the light there."
      : most.power > 0 ? `Light at the ring: most of it at ${most.nm} nm.` : "No light from the glass falls at the ring.";
  }

  function markAt(event) {
    const box = canvas.getBoundingClientRect();
    const uv = uvAt(toUv, ((event.clientX - box.left) / box.width) * canvas.width, ((event.clientY - box.top) / box.height) * canvas.height);
    set({ mark: uv });
  }

  // ---- what the reader does ------------------------------------------------------------------------

  function set(changes) {
    const { glass: chosen, ...rest } = changes;
    if (chosen) state.rows[chosen[0]] = chosen[1];
    Object.assign(state, rest);
    const names = Object.keys(changes);
    const isLight = names.some((name) => ["glass", "gain", "spectrum", "nm", "isSingle", "rows"].includes(name));
    if (isLight) dirty.tables = dirty.map = true;
    dirty.words = true;
    const isSeen = ["space", "view", "above"].some((name) => names.includes(name));
    dirty.glass ||= isSeen;
    dirty.map ||= isSeen;
    moves ||= isLight || isSeen;
    dirty.spectrum ||= isLight || names.includes("mark") || names.includes("readNm");
    queue();
  }

  // A lesson's step: by names.
  function step({ gain, glass: name, nm, spectrum: lamp }) {
    const changes = { gain: gain ?? 1, isSingle: nm !== undefined, playing: null, rows: head.groups.map(({ row }) => row) };
    if (nm !== undefined) changes.nm = nm;
    if (name) changes.rows[0] = head.glasses.findIndex((one) => one.name === name);
    changes.spectrum = lamp ? head.spectra.findIndex((one) => one.name === lamp) : -1;
    if (changes.rows[0] < 0) changes.rows[0] = head.groups[0].row;
    set(changes);
  }

  const act = {
    step,
    play: (what) => set({ playing: state.playing === what ? null : what, ...(what === "nm" ? { isSingle: true } : {}) }),
    reset: () => set(fresh()),
    theme: () => {
      const isDark = document.documentElement.classList.contains("dark") || (!document.documentElement.classList.contains("light") && matchMedia("(prefers-color-scheme: dark)").matches);
      document.documentElement.className = isDark ? "light" : "dark";
      set({});
      dirty.spectrum = true;
    },
    save: () => {
      whole();
      canvas.toBlob((blob) => {
        const link = document.createElement("a");
        link.href = URL.createObjectURL(blob);
        link.download = `${(head.scene ?? "caustic").replace(/\W+/g, "_")}.png`;
        link.click();
        setTimeout(() => URL.revokeObjectURL(link.href), 10000);
      });
    },
  };

  function bindPicture() {
    const fingers = new Map();
    let spread = 0;
    const nearer = (factor) => state.view === "above" ? set({ above: { ...state.above, across: state.above.across * factor } })
      : state.view === "space" && set({ space: { ...state.space, distance: state.space.distance * factor } });
    const drag = (dx, dy) => {
      const scale = Math.min(canvas.clientWidth, canvas.clientHeight), { above, space } = state;
      if (state.view === "space") set({ space: { ...space, turn: space.turn - (3 * dx) / scale, lift: Math.min(Math.max(space.lift + (3 * dy) / scale, -1.5), 1.5) } });
      if (state.view === "above") set({ above: { ...above, centre: [above.centre[0] - (dx * above.across) / scale, above.centre[1] + (dy * above.across) / scale] } });
    };
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      fingers.set(event.pointerId, { x: event.clientX, y: event.clientY, moved: 0 });
      if (state.view === "camera") markAt(event);
    });
    canvas.addEventListener("pointermove", (event) => {
      const finger = fingers.get(event.pointerId);
      if (!finger) return;
      const dx = event.clientX - finger.x, dy = event.clientY - finger.y;
      Object.assign(finger, { x: event.clientX, y: event.clientY, moved: finger.moved + Math.hypot(dx, dy) });
      if (fingers.size === 2) {
        const [p, q] = [...fingers.values()], wide = Math.hypot(p.x - q.x, p.y - q.y);
        if (spread) nearer(spread / wide);
        spread = wide;
      } else if (state.view === "camera") markAt(event);
      else drag(dx, dy);
    });
    const up = (event) => {
      if (state.view !== "camera" && fingers.get(event.pointerId)?.moved < 4) markAt(event);
      fingers.delete(event.pointerId);
      spread = 0;
    };
    canvas.addEventListener("pointerup", up);
    canvas.addEventListener("pointercancel", up);
    // A page is scrolled by the wheel too: only who has touched the picture turns it for that.
    canvas.addEventListener("wheel", (event) => {
      if (state.view === "camera" || document.activeElement !== canvas) return;
      event.preventDefault();
      nearer(1.001 ** event.deltaY);
    }, { passive: false });
    canvas.addEventListener("keydown", (event) => {
      const [dx, dy] = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key] ?? [0, 0];
      if (event.key === "+" || event.key === "-") nearer(event.key === "+" ? 0.9 : 1.1);
      if (!dx && !dy) return;
      event.preventDefault();
      if (state.view !== "camera") return drag(-12 * dx, -12 * dy);
      const [x, y] = markPixel() ?? [canvas.width / 2, canvas.height / 2];
      set({ mark: uvAt(toUv, x + dx * canvas.width * 0.01, y + dy * canvas.width * 0.01) ?? state.mark });
    });
  }

  // ---- the beginning ---------------------------------------------------------------------------------

  async function open() {
    const gl = canvas.getContext("webgl2", { antialias: false, alpha: false, powerPreference: "high-performance" }), lack = lackOf(gl);
    if (lack) return lack;
    light = new Light(gl, head, array, records);
    if (head.camera?.pixel_to_uv)
      for (const name of ["base", "weight"]) light.picture(light[name], await data.picture(name, "image/png"));
    if (!light.isFull) byId("made").textContent += " This device adds light up in 16 bits: bright places are less exact.";
    Object.assign(dirty, { tables: true, map: true, glass: true, spectrum: true, words: true });
    return null;
  }

  canvas.setAttribute("aria-label", `${head.title}: the picture. ${head.description ?? ""}`);
  bindPanel(head, glass, set, act);
  bindReading(byId("index"), nmUnder, state, set);
  bindReading(byId("here"), nmUnder, state, set);
  bindPicture();
  const lack = await open();
  if (lack) {
    problem(lack);
    showStill(head, array);
  }
  canvas.addEventListener("webglcontextlost", (event) => {
    event.preventDefault();
    light = null;
    problem("The browser took the graphics card away: the picture comes back when it is free again.");
  });
  canvas.addEventListener("webglcontextrestored", async () => {
    await open();
    problem("");
    queue();
  });
  new ResizeObserver(() => set({})).observe(canvas);
  if (light) frame(performance.now());
  times.first = performance.now();
  window.spectrasplat = { state, set, times, head, get light() { return light; }, frame: whole };
}

start().catch((error) => {
  problem(`This page could not be shown: ${error.message}`);
  throw error;
});
