// The controls: what a reader sets, in words that a screen reader speaks too.

import { abbeNumber, LAST_NM, FIRST_NM, valueAt } from "./spectra.js";

export const byId = (id) => document.getElementById(id);
const VIEWS = ["camera", "above", "space"];
const HINTS = {
  camera: "Touch the picture, or move over it with the arrow keys, to see the spectrum of the light there.",
  above: "Drag to move, pinch or turn the wheel to come nearer; touch to see the spectrum of the light there.",
  space: "Drag, or use the arrow keys, to turn; pinch or turn the wheel to come nearer.",
};

function option(select, value, text) {
  const made = document.createElement("option");
  made.value = value;
  made.textContent = text;
  select.append(made);
}

function paragraphs(parent, sentences) {
  for (const sentence of sentences.filter(Boolean)) {
    const made = document.createElement("p");
    made.textContent = sentence;
    parent.append(made);
  }
}

const percent = (share) => `${(100 * share).toFixed(share < 0.01 ? 1 : 0)} %`;

// What is only first order, with the range in which that was measured.
function trust(head) {
  const checked = head.limits?.checked, sentences = (head.first_order ?? []).map(({ what, range, error }) =>
    `First order only: ${what}${range ? ` (measured for ${range}` : ""}${error ? `${range ? ", " : " ("}error ${error}` : ""}${range || error ? ")" : ""}.`);
  if (checked?.nrmse !== undefined && checked.nrmse !== null)
    sentences.push(`For dispersion × ${checked.gains.join(" to × ")}${checked.glasses?.length ? ` and ${checked.glasses.join(", ")}` : ""} this page was held against ${checked.against}: they differ by ${percent(checked.nrmse)} (root mean square).`);
  return sentences;
}

// Fills the page and binds it: `set(changes)` takes what the reader wants, `act` has reset, save, play(what), theme.
export function bindPanel(head, glasses, set, act) {
  document.title = head.title;
  byId("title").textContent = head.title;
  byId("description").textContent = head.description ?? "";
  byId("gain").max = head.limits?.gain_max ?? 2;
  head.groups.forEach((group, g) => {
    const row = document.createElement("label"), name = document.createElement("span"), select = document.createElement("select");
    row.className = "row";
    name.textContent = head.groups.length > 1 || !group.name ? `Glass of ${(group.objects ?? [group.name]).join(", ")}` : "Glass";
    for (const choice of group.choices)
      option(select, choice, `${head.glasses[choice].name} (V ${abbeNumber(glasses(choice)).toFixed(1)})`);
    select.dataset.group = g;
    select.addEventListener("change", () => set({ glass: [g, Number(select.value)] }));
    row.append(name, select);
    byId("glasses").append(row);
  });
  option(byId("spectrum"), -1, "as in the scene");
  head.spectra.forEach((spectrum, i) => spectrum.choice && option(byId("spectrum"), i, spectrum.name));
  for (const view of VIEWS) byId(`view-${view}`).addEventListener("click", () => set({ view }));
  if (!head.camera?.pixel_to_uv) byId("view-camera").hidden = true;
  byId("dispersion").hidden = !head.groups.length;
  const onInput = (id, changes) => byId(id).addEventListener("input", () => set(changes(byId(id))));
  onInput("gain", ({ value }) => ({ gain: Number(value), playing: null }));
  onInput("spectrum", ({ value }) => ({ spectrum: Number(value) }));
  onInput("single", ({ checked }) => ({ isSingle: checked, playing: null }));
  onInput("nm", ({ value }) => ({ nm: Number(value), isSingle: true, playing: null }));
  onInput("exposure", ({ value }) => ({ exposure: Number(value) }));
  for (const what of ["gain", "nm"]) byId(`${what}-play`).addEventListener("click", () => act.play(what));
  for (const what of ["reset", "save", "theme"]) byId(what).addEventListener("click", act[what]);
  bindSteps(head, act);
  paragraphs(byId("limits"), [...trust(head), ...(head.notes ?? [])]);
  byId("made").textContent = `Made with SpectraSplat ${head.version ?? ""} from ${head.scene}, receiver ${head.receiver}. The photons are stored with their dispersion still open: nothing is traced here, and nothing is loaded from anywhere.`;
}

function bindSteps(head, act) {
  if (!head.steps?.length) return;
  const box = byId("steps"), text = document.createElement("p"), bar = document.createElement("div"), count = document.createElement("span");
  let now = 0;
  const go = (by) => {
    now = Math.min(Math.max(now + by, 0), head.steps.length - 1);
    const step = head.steps[now];
    text.textContent = [step.title, step.text].filter(Boolean).join(". ");
    count.textContent = `${now + 1} of ${head.steps.length}`;
    act.step(step.set ?? {});
  };
  for (const [name, by] of [["Back", -1], ["Next", 1]]) {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = name;
    button.addEventListener("click", () => go(by));
    bar.append(button);
  }
  bar.className = "bar";
  bar.append(count);
  text.setAttribute("aria-live", "polite");
  box.append(text, bar);
  box.hidden = false;
  go(0);
}

// What is set, as numbers and words beside the controls.
export function tell(state, shown) {
  byId("gain").value = state.gain;
  const v = state.gain > 0 && shown.length ? `V ${abbeNumber(shown[0]).toFixed(1)}` : "none";
  byId("gain-says").textContent = `× ${state.gain.toFixed(2)} (${v})`;
  byId("gain").setAttribute("aria-valuetext", `times ${state.gain.toFixed(2)}, Abbe number ${v}`);
  for (const select of document.querySelectorAll("#glasses select")) select.value = state.rows[select.dataset.group];
  byId("spectrum").value = state.spectrum;
  byId("single").checked = state.isSingle;
  byId("nm").value = state.nm;
  byId("nm-says").textContent = state.isSingle ? `${Math.round(state.nm)} nm` : "off";
  byId("nm").setAttribute("aria-valuetext", `${Math.round(state.nm)} nanometres`);
  byId("exposure").value = state.exposure;
  byId("exposure-says").textContent = `${state.exposure > 0 ? "+" : ""}${state.exposure.toFixed(1)} stops`;
  for (const what of ["gain", "nm"]) {
    byId(`${what}-play`).setAttribute("aria-pressed", state.playing === what);
    byId(`${what}-play`).textContent = state.playing === what ? "❚❚" : "▶";
  }
  for (const view of VIEWS) byId(`view-${view}`).setAttribute("aria-pressed", state.view === view);
  byId("hint").textContent = HINTS[state.view];
}

// n(λ) where it is read.
export function tellIndex(state, shown, own) {
  const nm = state.readNm, n = valueAt(shown, nm);
  const words = `n(${nm} nm) = ${n.toFixed(5)}` + (Math.abs(n - valueAt(own, nm)) > 5e-6 ? `, in the scene ${valueAt(own, nm).toFixed(5)}` : "");
  byId("index-says").textContent = words;
  byId("index").setAttribute("aria-valuenow", nm);
  byId("index").setAttribute("aria-valuetext", words);
}

export function bindReading(canvas, nmUnder, state, set) {
  const read = (event) => set({ readNm: nmUnder(canvas, event) });
  canvas.addEventListener("pointerdown", read);
  canvas.addEventListener("pointermove", read);
  canvas.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: -1, ArrowRight: 1, ArrowDown: -1, ArrowUp: 1, PageUp: 20, PageDown: -20 }[event.key];
    if (!step) return;
    event.preventDefault();
    set({ readNm: Math.min(Math.max(state.readNm + step, FIRST_NM), LAST_NM) });
  });
}
