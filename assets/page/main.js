// The page: what the reader set, and the picture that follows. No server, no library; see docs/pages.md.

import {readData} from "./data.js";
import {lackOf, Light} from "./light.js";
import {bindPanel, bindReading, byId, tell, tellIndex, VIEWS} from "./panel.js";
import {coloursOf, drawIndex, drawSpectrum, nmUnder} from "./plots.js";
import {lampSpectrum, spectrumAt} from "./probe.js";
import {beamRows, photonRows} from "./records.js";
import {COUNT, indexOf, indexTable, lightTable, placesOf, scaled, single} from "./spectra.js";
import {areaAt, around, fromAbove, fromCamera, inverse, uvAt} from "./views.js";

const SLOW_MS = 100, FAST_MS = 25, SETTLED_MS = 180, WIDEST = 4, COARSEST = 16;
const LIGHT = ["rows", "gain", "spectrum", "nm", "isSingle"], SEEN = ["space", "view", "above"];
const ARROWS = new Map([["ArrowLeft", [-1, 0]], ["ArrowRight", [1, 0]], ["ArrowUp", [0, -1]], ["ArrowDown", [0, 1]]]);

function problem(text) {
  byId("problem").textContent = text;
  byId("problem").hidden = !text;
}

// Instead of what lies below it, the still, without controls that it would not follow.
function showStill(why) {
  problem(why);
  byId("still").hidden = false;
  document.body.className = "is-still";
}

async function start() {
  // The still is a picture already: it is on the screen before anything else is read.
  await byId("still").decode().catch(() => {});
  await new Promise((done) => requestAnimationFrame(() => setTimeout(done)));
  const times = { first: 0, frame: 0 };
  const { head, array, picture } = await readData(document).catch(() => {
    throw new Error("the data of this file are damaged or cut off; copy or export it again.");
  });
  const [glassN, density, nmOf, variable] = ["glass_n", "spectra.density", "nm", "variable"].map(array);
  const part = (values, row) => values.subarray(COUNT * row, COUNT * (row + 1)), glass = (row) => part(glassN, row);
  const [observer, response] = ["observer", "response"].map((name) => [0, 1, 2].map((c) => part(array(name), c)));
  const spectra = head.spectra.map(({ lines }, i) => ({ density: part(density, i), lines }));
  const colours = coloursOf(observer), shapeOfPicture = head.camera ? head.camera.height / head.camera.width : 0.75;
  const records = { photons: photonRows(head, array), beams: beamRows(array) };
  const ownLight = () => ({ gain: 1, rows: head.groups.map(({ row }) => row), spectrum: -1, isSingle: false, nm: 550 });
  const ownView = () => ({ view: head.camera ? "camera" : "above", above: head.lit, space: head.around, exposure: 0 });
  const fresh = () => ({...ownLight(), ...ownView(), readNm: 588, mark: null, playing: null });
  const state = fresh(), canvas = byId("picture"), shown = { index: [], rows: [], x: null, paths: null };
  const dirty = { tables: true, map: true, glass: true, spectrum: true };
  let light = null, queued = false, settle = 0, toUv = null;
  // While something moves the picture has every so many pixels only, up to WIDEST, and beyond that fewer photons, as
  // many as keep pace; all of them once it rests.
  let moves = true, coarse = WIDEST, finest = 1;

  function tables() {
    shown.index = state.rows.map((row) => indexOf(glass(row), state.gain));
    const places = placesOf(head, shown.index[0], nmOf);
    shown.x = places.x;
    shown.rows = head.lights.map((lamp) => {
      const own = spectra[lamp.spectrum];
      const chosen = state.spectrum < 0 ? own : scaled(spectra[state.spectrum], lamp.luminous);
      return state.isSingle ? single(state.nm, chosen) : chosen;
    });
    shown.paths = indexTable(head, shown.index, variable, nmOf);
    light.setTables(lightTable(shown.rows, shown.x, response), shown.paths);
    problem(places.isWithin ? "" : "The ends of the spectrum are left out: this glass goes beyond the traced indices.");
  }

  function fit() {
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    const width = Math.max(64, Math.min(Math.round(canvas.clientWidth * ratio), 1600));
    const height = Math.round(width * shapeOfPicture);
    if (canvas.width === width && canvas.height === height) return;
    Object.assign(canvas, { width, height });
    dirty.glass = dirty.map = true;
  }

  function frame(now) {
    const begun = performance.now();
    queued = false;
    if (!light) return;
    light.draws = 0;
    play(now);
    fit();
    if (dirty.tables) tables();
    const { width, height } = canvas, step = moves ? coarse : 1;
    const flat = () =>
      (state.view === "above" ? fromAbove(state.above, width, height) : fromCamera(head, width, height));
    const camera = state.view === "space" ? around(head, state.space, width, height) : { toUv: flat() };
    toUv = camera.toUv;
    if (camera.eye && dirty.glass) light.drawGlass(camera, width, height);
    if (dirty.map) light.gather(toUv, width, height, Math.min(step, WIDEST), Math.max(step / WIDEST, 1) ** 2);
    light.show(VIEWS.indexOf(state.view), head.exposure_ev + state.exposure, markPixel(), width, height);
    tell(state, shown.index);
    if (shown.index.length) {
      const own = glass(head.groups[0].row);
      drawIndex(byId("index"), shown.index[0], own, state.readNm, colours);
      tellIndex(state, shown.index[0], own);
    }
    if (dirty.spectrum && step === 1) spectrum();
    if (moves && dirty.map) keepPace(begun);
    dirty.tables = dirty.map = dirty.glass = false;
    clearTimeout(settle);
    if (state.playing) queue();
    else if (moves) settle = setTimeout(settled, SETTLED_MS + times.frame);
  }

  // Reading a pixel waits until the picture is drawn.
  function keepPace(begun) {
    light.gl.readPixels(0, 0, 1, 1, light.gl.RGBA, light.gl.UNSIGNED_BYTE, new Uint8Array(4));
    times.frame = performance.now() - begun;
    if (times.frame > SLOW_MS) finest = coarse = Math.min(2 * coarse, COARSEST);
    else if (times.frame < FAST_MS) coarse = Math.max(coarse / 2, finest);
  }

  function whole() {
    moves = false;
    dirty.map = dirty.spectrum = true;
    frame(performance.now());
  }

  function settled() {
    finest = 1;
    moves = false;
    dirty.map = coarse > 1;
    queue();
  }

  function queue() {
    if (!queued) requestAnimationFrame(frame);
    queued = true;
  }

  function play(now) {
    if (state.playing === "gain") state.gain = head.limits.gain_max * (0.5 - 0.5 * Math.cos(now / 1400));
    if (state.playing === "nm") Object.assign(state, { nm: 400 + ((now / 20) % 300), isSingle: true });
    if (state.playing) moves = dirty.tables = dirty.map = dirty.spectrum = true;
  }

  const markPixel = () => state.mark && uvAt(inverse(toUv), ...state.mark);

  // At the ring; of the lamp while there is none.
  function spectrum() {
    dirty.spectrum = false;
    const texel = state.mark ? Math.sqrt(areaAt(toUv, markPixel() ?? [0, 0])) : 0;
    const about = { head, ...records, ...shown, texel };
    const found = state.mark ? spectrumAt(state.mark, about) : lampSpectrum(shown.rows[0]);
    drawSpectrum(byId("here"), found, state.readNm, colours);
    const most = found.reduce((best, bin) => (bin.power > best.power ? bin : best));
    const { lamp, none } = byId("here-says").dataset, there = `Light at the ring: most of it at ${most.nm} nm.`;
    byId("here-says").textContent = !state.mark ? lamp : most.power > 0 ? there : none;
  }

  function markAt(event) {
    const box = canvas.getBoundingClientRect(), ratio = canvas.width / box.width;
    set({ mark: uvAt(toUv, (event.clientX - box.left) * ratio, (event.clientY - box.top) * ratio) });
  }

  function set(changes) {
    Object.assign(state, changes);
    const among = (names) => names.some((name) => name in changes), isLight = among(LIGHT), isSeen = among(SEEN);
    dirty.tables ||= isLight;
    dirty.map ||= isLight || isSeen;
    dirty.glass ||= isSeen;
    dirty.spectrum ||= isLight || among(["mark", "readNm"]);
    moves ||= isLight || isSeen;
    queue();
  }

  const act = {
    // A lesson's step: a spectrum by its name.
    step: ({ gain = 1, nm, spectrum: name }) => {
      const spectrum = head.spectra.findIndex((one) => one.name === name);
      set({...ownLight(), gain, spectrum, isSingle: nm !== undefined, nm: nm ?? state.nm, playing: null });
    },
    play: (what) => set({ playing: state.playing === what ? null : what, isSingle: state.isSingle || what === "nm" }),
    reset: () => set(fresh()),
    save: () => {
      byId("framed").hidden = window === window.parent;
      whole();
      canvas.toBlob((blob) => {
        const href = URL.createObjectURL(blob), download = `${head.scene.replace(/\W+/g, "_") || "caustic"}.png`;
        Object.assign(document.createElement("a"), { href, download }).click();
        setTimeout(() => URL.revokeObjectURL(href), 10000);
      });
    },
  };

  function bindPicture() {
    const fingers = new Map();
    const spread = ([p, q] = fingers.values()) => Math.hypot(p.x - q.x, p.y - q.y);
    const nearer = (factor) => {
      const { view, above, space } = state;
      if (view === "above") set({ above: {...above, across: above.across * factor } });
      if (view === "space") set({ space: {...space, radius: space.radius * factor } });
    };
    const drag = (dx, dy) => {
      const scale = Math.min(canvas.clientWidth, canvas.clientHeight), { view, above, space } = state;
      const turn = space.turn - (3 * dx) / scale, lift = Math.min(Math.max(space.lift + (3 * dy) / scale, -1.5), 1.5);
      if (view === "space") set({ space: {...space, turn, lift } });
      const [u, v] = above.centre, k = above.across / scale;
      if (view === "above") set({ above: {...above, centre: [u - dx * k, v + dy * k] } });
    };
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      fingers.set(event.pointerId, { x: event.clientX, y: event.clientY, moved: 0 });
      if (state.view === "camera") markAt(event);
    });
    canvas.addEventListener("pointermove", (event) => {
      const finger = fingers.get(event.pointerId), before = fingers.size === 2 && spread();
      if (!finger) return;
      const dx = event.clientX - finger.x, dy = event.clientY - finger.y;
      Object.assign(finger, { x: event.clientX, y: event.clientY, moved: finger.moved + Math.hypot(dx, dy) });
      if (before) nearer(before / spread());
      else if (state.view === "camera") markAt(event);
      else drag(dx, dy);
    });
    canvas.addEventListener("pointerup", (event) => {
      if (state.view !== "camera" && fingers.get(event.pointerId)?.moved < 4) markAt(event);
    });
    canvas.addEventListener("lostpointercapture", (event) => fingers.delete(event.pointerId));
    // A page is scrolled by the wheel too: only who has touched the picture turns it for that.
    canvas.addEventListener("wheel", (event) => {
      if (state.view === "camera" || document.activeElement !== canvas) return;
      event.preventDefault();
      nearer(1.001 ** event.deltaY);
    }, { passive: false });
    canvas.addEventListener("keydown", (event) => {
      const [dx, dy] = ARROWS.get(event.key) ?? [0, 0];
      if (event.key === "+" || event.key === "-") nearer(event.key === "+" ? 0.9 : 1.1);
      if (!dx && !dy) return;
      event.preventDefault();
      if (state.view !== "camera") return drag(-12 * dx, -12 * dy);
      const [x, y] = markPixel() ?? [canvas.width / 2, canvas.height / 2], step = canvas.width * 0.01;
      set({ mark: uvAt(toUv, x + dx * step, y + dy * step) ?? state.mark });
    });
  }

  async function open() {
    const gl = canvas.getContext("webgl2", { antialias: false, alpha: false, powerPreference: "high-performance" });
    const lack = lackOf(gl);
    if (lack) throw new Error(lack);
    light = new Light(gl, head, array, records);
    if (head.camera)
      for (const name of ["base", "weight"]) light.picture(light[name], await picture(name, "image/png"));
    byId("half").hidden = light.isFull;
    Object.assign(dirty, { tables: true, map: true, glass: true, spectrum: true });
    frame(performance.now());
    byId("still").hidden = true;
    document.body.className = "";
  }

  await open();
  times.first = performance.now();
  bindPanel(head, state, set, act);
  for (const name of ["index", "here"]) bindReading(byId(name), nmUnder, state, set);
  bindPicture();
  canvas.addEventListener("webglcontextlost", (event) => {
    event.preventDefault();
    light = null;
    showStill("The browser took the graphics card away: the picture is live again when it is free.");
  });
  canvas.addEventListener("webglcontextrestored", () => open().catch(stays));
  for (const when of ["beforeprint", "afterprint"])
    window.addEventListener(when, () => {
      document.documentElement.classList.toggle("is-printed", when === "beforeprint"); // dark ink
      whole();
    });
  new ResizeObserver(() => set({})).observe(canvas);
  window.spectrasplat = { state, set, times, head, get light() { return light; }, frame: whole };
}

const stays = (error) => showStill(`This picture stays still: ${error.message}`);
start().catch(stays);
