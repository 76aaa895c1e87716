// The controls: what a reader sets, in words that a screen reader speaks too.

import {abbeNumber, LAST_NM, FIRST_NM, valueAt} from "./spectra.js";

export const byId = (id) => document.getElementById(id);
export const VIEWS = ["camera", "above", "space"];

// Binds the page: `set(changes)` takes what the reader wants, `act` has step, reset, save, play(what).
export function bindPanel(head, state, set, act) {
  const onInput = (element, changes) =>
    element.addEventListener("input", () => set({...changes(element), playing: null }));
  document.querySelectorAll("#glasses select")
    .forEach((select, g) => onInput(select, ({ value }) => ({ rows: state.rows.with(g, Number(value)) })));
  for (const id of ["gain", "spectrum", "exposure"]) onInput(byId(id), ({ value }) => ({ [id]: Number(value) }));
  onInput(byId("single"), ({ checked }) => ({ isSingle: checked }));
  onInput(byId("nm"), ({ value }) => ({ nm: Number(value), isSingle: true }));
  for (const view of VIEWS) byId(`view-${view}`).addEventListener("click", () => set({ view }));
  for (const what of ["gain", "nm"]) byId(`${what}-play`).addEventListener("click", () => act.play(what));
  for (const what of ["reset", "save"]) byId(what).addEventListener("click", act[what]);
  if (head.steps.length) bindSteps(head.steps, act);
}

function bindSteps(steps, act) {
  let now = 0;
  const go = (by) => {
    now = Math.min(Math.max(now + by, 0), steps.length - 1);
    byId("step-says").textContent = [steps[now].title, steps[now].text].filter(Boolean).join(". ");
    byId("step-count").textContent = `${now + 1} of ${steps.length}`;
    act.step(steps[now].set);
  };
  for (const [id, by] of [["back", -1], ["next", 1]]) byId(id).addEventListener("click", () => go(by));
  byId("steps").hidden = false;
  go(0);
}

// What is set, as numbers and words beside the controls.
export function tell(state, shown) {
  const says = (id, value, text, spoken) => {
    byId(id).value = value;
    byId(`${id}-says`).textContent = text;
    byId(id).setAttribute("aria-valuetext", spoken ?? text);
  };
  const v = state.gain > 0 && shown.length ? `V ${abbeNumber(shown[0]).toFixed(1)}` : "no colours";
  says("gain", state.gain, `× ${state.gain.toFixed(2)} (${v})`);
  says("nm", state.nm, state.isSingle ? `${Math.round(state.nm)} nm` : "off", `${Math.round(state.nm)} nanometres`);
  says("exposure", state.exposure, `${state.exposure > 0 ? "+" : ""}${state.exposure.toFixed(1)} stops`);
  document.querySelectorAll("#glasses select").forEach((select, g) => (select.value = state.rows[g]));
  byId("spectrum").value = state.spectrum;
  byId("single").checked = state.isSingle;
  for (const what of ["gain", "nm"]) {
    byId(`${what}-play`).setAttribute("aria-pressed", state.playing === what);
    byId(`${what}-play`).textContent = state.playing === what ? "❚❚" : "▶";
  }
  for (const view of VIEWS) {
    byId(`view-${view}`).setAttribute("aria-pressed", state.view === view);
    byId(`hint-${view}`).hidden = state.view !== view;
  }
}

// n(λ) where it is read.
export function tellIndex(state, shown, own) {
  const nm = state.readNm, n = valueAt(shown, nm), before = valueAt(own, nm);
  const scene = Math.abs(n - before) > 5e-6 ? `, in the scene ${before.toFixed(5)}` : "";
  byId("index-says").textContent = `n(${nm} nm) = ${n.toFixed(5)}${scene}`;
  byId("index").setAttribute("aria-valuenow", nm);
  byId("index").setAttribute("aria-valuetext", byId("index-says").textContent);
}

export function bindReading(canvas, nmUnder, state, set) {
  for (const name of ["pointerdown", "pointermove"])
    canvas.addEventListener(name, (event) => set({ readNm: nmUnder(canvas, event) }));
  canvas.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: -1, ArrowRight: 1, ArrowDown: -1, ArrowUp: 1, PageUp: 20, PageDown: -20 }[event.key];
    if (!step) return;
    event.preventDefault();
    set({ readNm: Math.min(Math.max(state.readNm + step, FIRST_NM), LAST_NM) });
  });
}
