// The browser's part of a live view (app/api/view.py): shows pictures as they come, sends what the mouse does.
// No library and no build step: anywidget loads this file as it is.

const LOW_NM = 380, HIGH_NM = 780;
const SEND_EVERY_MS = 30;

function element(parent, tag, className, text) {
  const made = document.createElement(tag);
  if (className) made.className = className;
  if (text !== undefined) made.textContent = text;
  parent.append(made);
  return made;
}

// Sends what gathers at most every SEND_EVERY_MS, the last of it always: `add` folds a message into the waiting one.
function paced(send, add) {
  let waiting = null, timer = 0, last = 0;
  function flush() {
    timer = 0;
    last = performance.now();
    const message = waiting;
    waiting = null;
    if (message !== null) send(message);
  }
  return (message) => {
    waiting = waiting !== null && waiting.kind === message.kind ? add(waiting, message) : (flush(), message);
    if (!timer) timer = setTimeout(flush, Math.max(0, SEND_EVERY_MS - (performance.now() - last)));
  };
}

function summed(before, now) {
  const told = { ...now };
  for (const key of ["dx", "dy", "amount"]) if (key in now) told[key] = before[key] + now[key];
  return told;
}

// Colour of one wavelength, for the curve's filling only (after D. Bruton's piecewise ramps).
function colourOf(nm) {
  const ramp = (a, b) => Math.min(1, Math.max(0, (nm - a) / (b - a)));
  const red = nm < 440 ? 0.6 * (1 - ramp(380, 440)) : ramp(510, 580);
  const green = nm < 490 ? ramp(440, 490) : 1 - ramp(580, 645);
  const blue = 1 - ramp(490, 510);
  const ends = 0.35 + 0.65 * Math.min(ramp(380, 420), 1 - ramp(700, 780));
  return `rgb(${[red, green, blue].map((c) => Math.round(255 * Math.max(0, c) ** 0.8 * ends)).join(",")})`;
}

function drawSpectrum(canvas, light) {
  const pen = canvas.getContext("2d"), { width, height } = canvas;
  pen.clearRect(0, 0, width, height);
  const ink = getComputedStyle(canvas).color, floor = height - 16;
  const x = (nm) => ((nm - LOW_NM) / (HIGH_NM - LOW_NM)) * width;
  pen.fillStyle = pen.strokeStyle = ink;
  pen.font = "11px sans-serif";
  pen.textAlign = "center";
  for (const nm of [400, 500, 600, 700]) pen.fillText(nm === 700 ? "700 nm" : nm, x(nm), height - 3);
  pen.beginPath();
  pen.moveTo(0, floor + 0.5);
  pen.lineTo(width, floor + 0.5);
  pen.stroke();
  if (!light || !light.wavelength_nm) return;
  const nm = light.wavelength_nm, half = (nm[1] - nm[0]) / 2;
  const caustic = light.caustic ?? nm.map(() => 0), direct = light.direct ?? nm.map(() => 0);
  const most = Math.max(1e-30, ...nm.map((_, i) => caustic[i] + direct[i]));
  const up = (value) => (value / most) * (floor - 4);
  nm.forEach((centre, i) => {
    const left = x(centre - half), wide = x(centre + half) - left + 0.5;
    pen.globalAlpha = 0.3;
    pen.fillStyle = ink;
    pen.fillRect(left, floor - up(direct[i]), wide, up(direct[i]));
    pen.globalAlpha = 1;
    pen.fillStyle = colourOf(centre);
    pen.fillRect(left, floor - up(caustic[i] + direct[i]), wide, up(caustic[i]));
  });
}

function wordsOf(light) {
  if (!light) return "Move the cursor over a surface to read its spectrum.";
  if (!light.object) return "Nothing is there.";
  const place = light.position.map((v) => v.toPrecision(3)).join(", ");
  if (!light.wavelength_nm) return `${light.object} at ${place}`;
  const width = light.wavelength_nm[1] - light.wavelength_nm[0];
  const total = (values) => values.reduce((sum, v) => sum + v, 0) * width;
  const parts = [];
  parts.push(light.caustic ? `caustic ${total(light.caustic).toPrecision(3)}` : "caustic: too few photons to tell");
  if (light.direct) parts.push(`direct ${total(light.direct).toPrecision(3)}`);
  const error = light.caustic && light.error > 0.005 ? `, ±${(100 * light.error).toFixed(0)} % a bin` : "";
  return `${light.object} at ${place}: ${parts.join(" + ")} W/unit²${error}`;
}

function statusOf(told) {
  if (told.moving) return "coarse while it moves";
  const parts = [`${told.photons.toLocaleString("en")} photons`, `${told.samples} samples a pixel`];
  if (told.first_order) parts.push("dispersion to first order");
  if (!told.done) parts.push("refining…");
  return parts.join(" · ");
}

function render({ model, el }) {
  const send = (message) => model.send(message);
  const [width, height] = model.get("size");
  el.classList.add("spectrasplat-view");
  const stage = element(el, "div", "stage");
  stage.style.maxWidth = `${width}px`;
  const canvas = element(stage, "canvas", "picture");
  canvas.width = width;
  canvas.height = height;
  canvas.style.aspectRatio = `${width} / ${height}`;
  canvas.tabIndex = 0;
  canvas.setAttribute("aria-label", "The scene: drag to walk round, turn the wheel to come nearer");
  canvas.title = "Drag: walk round. Shift and drag: move across. Wheel: nearer. Double click: as it was.";
  const side = element(el, "div", "side");
  const sliders = element(side, "div", "sliders");
  const spectrum = element(side, "canvas", "spectrum");
  spectrum.width = 300;
  spectrum.height = 120;
  spectrum.setAttribute("role", "img");
  const words = element(side, "div", "words", wordsOf(null));
  const status = element(side, "div", "status", "Waiting for the first picture…");
  const problem = element(side, "div", "problem");
  const brush = canvas.getContext("2d");
  drawSpectrum(spectrum, null);

  // ---- what comes from Python

  let shown = 0;
  const bytesOf = (raw) =>
    raw.buffer ? new Uint8Array(raw.buffer, raw.byteOffset, raw.byteLength) : new Uint8Array(raw);
  const decoded = (raw) => createImageBitmap(new Blob([bytesOf(raw)], { type: "image/jpeg" }));
  const draw = (picture) => (brush.drawImage(picture, 0, 0, width, height), picture.close());
  // What a saved notebook shows: a page that needs no kernel (docs/pages.md).
  const kept = document.createElement("iframe");
  kept.className = "kept";
  kept.title = "The caustic, whose dispersion can be dragged";
  function onPage() {
    const page = model.get("page");
    if (shown || !page) return;
    kept.srcdoc = page;
    el.prepend(kept);
    stage.hidden = side.hidden = true;
  }
  function onLive() {
    kept.remove();
    stage.hidden = side.hidden = false;
  }
  async function onMessage(message, buffers) {
    if (message.kind === "light") {
      drawSpectrum(spectrum, message);
      words.textContent = wordsOf(message);
      spectrum.setAttribute("aria-label", words.textContent);
    } else if (message.kind === "picture") {
      const picture = await decoded(buffers[0]);
      send({ kind: "seen", number: message.number });
      if (message.number < shown) return;
      if (!shown) onLive();
      shown = message.number;
      draw(picture);
      status.textContent = statusOf(message);
      canvas.dataset.number = String(message.number);
    }
  }
  model.on("msg:custom", onMessage);

  // ---- sliders, one for each object of glass

  const rows = new Map();
  function onGlasses() {
    const listed = model.get("glasses");
    if (listed.map((g) => g.object).join("\n") !== [...rows.keys()].join("\n")) {
      sliders.replaceChildren();
      rows.clear();
      for (const glass of listed) addRow(glass);
    }
    for (const glass of listed) {
      const row = rows.get(glass.object);
      if (!row.held) row.show(glass.gain);
    }
  }
  function addRow(glass) {
    const label = element(sliders, "label", "row");
    element(label, "span", "name", glass.object);
    const range = element(label, "input", "range");
    Object.assign(range, { type: "range", min: 0, max: glass.most, step: 0.01 });
    range.title = "How many times stronger than in nature colours spread; double click: 1.";
    const number = element(label, "output", "number");
    const row = { held: false, show: (gain) => ((range.value = gain), (number.textContent = `×${gain.toFixed(2)}`)) };
    const tell = paced(send, summed);
    const set = (value) => {
      number.textContent = `×${value.toFixed(2)}`;
      tell({ kind: "gain", object: glass.object, value });
    };
    range.addEventListener("input", () => set(Number(range.value)));
    range.addEventListener("dblclick", () => (row.show(1), set(1)));
    range.addEventListener("pointerdown", () => (row.held = true));
    // What Python says of a slider that was just let go is older than what it shows.
    range.addEventListener("pointerup", () => setTimeout(() => (row.held = false), 300));
    rows.set(glass.object, row);
  }
  const onTold = () => (problem.textContent = model.get("told"));
  model.on("change:glasses", onGlasses);
  model.on("change:told", onTold);
  onGlasses();
  onTold();
  onPage();

  // ---- mouse

  const move = paced(send, summed);
  const placeOf = (event) => {
    const box = canvas.getBoundingClientRect();
    return [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
  };
  let at = null;
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    at = [event.clientX, event.clientY];
  });
  canvas.addEventListener("pointermove", (event) => {
    if (at === null) {
      move({ kind: "hover", place: placeOf(event) });
      return;
    }
    const tall = canvas.getBoundingClientRect().height;
    const message = { dx: (event.clientX - at[0]) / tall, dy: (event.clientY - at[1]) / tall };
    at = [event.clientX, event.clientY];
    move({ kind: event.shiftKey || event.buttons & 6 ? "pan" : "orbit", ...message });
  });
  const letGo = () => (at = null);
  canvas.addEventListener("pointerup", letGo);
  canvas.addEventListener("pointercancel", letGo);
  canvas.addEventListener("pointerleave", () => at === null && move({ kind: "hover", place: null }));
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener(
    "wheel",
    (event) => {
      event.preventDefault(); // the page stays where it is
      const lines = event.deltaMode === 1 ? 3 : 100;
      const [x, y] = placeOf(event);
      move({ kind: "zoom", amount: -event.deltaY / lines, x, y });
    },
    { passive: false },
  );
  canvas.addEventListener("dblclick", () => move({ kind: "home" }));
  canvas.addEventListener("keydown", (event) => {
    const step = 0.04;
    const turns = { ArrowLeft: [step, 0], ArrowRight: [-step, 0], ArrowUp: [0, step], ArrowDown: [0, -step] };
    const nearer = { "+": 1, "=": 1, "-": -1 };
    if (event.key in turns) move({ kind: "orbit", dx: turns[event.key][0], dy: turns[event.key][1] });
    else if (event.key in nearer) move({ kind: "zoom", amount: nearer[event.key], x: 0.5, y: 0.5 });
    else return;
    event.preventDefault();
    event.stopPropagation(); // the notebook has keys of its own
  });

  send({ kind: "hello" });
  return () => {
    model.off("msg:custom", onMessage);
    model.off("change:glasses", onGlasses);
    model.off("change:told", onTold);
  };
}

export default { render };
