// Two small graphs: the index by wavelength, and the spectrum at a place.

import {COUNT, FIRST_NM, LAST_NM, valueAt} from "./spectra.js";

// Colour of a wavelength on a screen, by the observer's own table (linear Rec.709 up to a factor).
export function coloursOf(observer) {
  const most = Math.max(...observer.flatMap((values) => [...values]));
  return Array.from({ length: COUNT }, (_, i) => {
    const rgb = observer.map((values) => values[i] / most), white = Math.max(-Math.min(...rgb), 0);
    const top = Math.max(...rgb) + white, bright = Math.min(Math.max(1.6 * top, 0.08), 1);
    const shown = rgb.map((c) => (((c + white) / (top || 1)) * bright) ** (1 / 2.2));
    return `rgb(${shown.map((c) => Math.round(255 * c)).join(" ")})`;
  });
}

const LEFT = 44, RIGHT = 10, TOP = 8, BOTTOM = 20;
const across = (width, nm) => LEFT + ((nm - FIRST_NM) / (LAST_NM - FIRST_NM)) * (width - LEFT - RIGHT);

// The wavelength under a pointer.
export function nmUnder(canvas, event) {
  const box = canvas.getBoundingClientRect(), share = (event.clientX - box.left - LEFT) / (box.width - LEFT - RIGHT);
  return Math.round(Math.min(Math.max(FIRST_NM + share * (LAST_NM - FIRST_NM), FIRST_NM), LAST_NM));
}

function begin(canvas) {
  const ratio = window.devicePixelRatio || 1, pen = canvas.getContext("2d");
  const width = canvas.clientWidth, height = canvas.clientHeight;
  Object.assign(canvas, { width: Math.round(width * ratio), height: Math.round(height * ratio) });
  pen.scale(ratio, ratio);
  pen.font = "11px system-ui, sans-serif";
  pen.fillStyle = pen.strokeStyle = getComputedStyle(canvas).color;
  pen.textAlign = "center";
  pen.globalAlpha = 0.7;
  for (const nm of [400, 500, 600, 700]) pen.fillText(nm === 700 ? "700 nm" : nm, across(width, nm), height - 5);
  pen.fillRect(LEFT, height - BOTTOM, width - LEFT - RIGHT, 1);
  pen.globalAlpha = 1;
  return { pen, width, height };
}

function reading({ pen, width, height }, nm, y) {
  pen.globalAlpha = 0.6;
  pen.fillRect(across(width, nm) - 0.5, TOP, 1, height - BOTTOM - TOP);
  pen.globalAlpha = 1;
  if (y === undefined) return;
  pen.beginPath();
  pen.arc(across(width, nm), y, 4, 0, 7);
  pen.fill();
}

// n(λ) in colours, with the scene's own glass as a thin line; `nm`: where it is read.
export function drawIndex(canvas, shown, own, nm, colours) {
  const plot = begin(canvas), { pen, width, height } = plot, floor = height - BOTTOM;
  const least = Math.min(...shown, ...own), most = Math.max(...shown, ...own);
  const margin = Math.max(0.08 * (most - least), 0.002), low = least - margin, high = most + margin;
  const up = (n) => floor - ((n - low) / (high - low)) * (floor - TOP);
  pen.textAlign = "right";
  pen.globalAlpha = 0.7;
  for (const n of [high - margin, (high + low) / 2, low + margin]) pen.fillText(n.toFixed(3), LEFT - 6, up(n) + 4);
  const curve = (values) => {
    pen.beginPath();
    values.forEach((n, i) => pen.lineTo(across(width, FIRST_NM + i), up(n)));
    pen.stroke();
  };
  pen.setLineDash([3, 3]);
  curve(own);
  pen.setLineDash([]);
  pen.globalAlpha = 1;
  curve(shown);
  for (let i = 0; i < COUNT - 1; i += 2) {
    pen.fillStyle = colours[i];
    pen.fillRect(across(width, FIRST_NM + i), up(shown[i]) - 2, (2 * (width - LEFT - RIGHT)) / COUNT + 0.6, 4);
  }
  pen.fillStyle = getComputedStyle(canvas).color;
  reading(plot, nm, up(valueAt(shown, nm)));
}

// Bars of 10 nm, by the tallest.
export function drawSpectrum(canvas, found, nm, colours) {
  const plot = begin(canvas), { pen, width, height } = plot, floor = height - BOTTOM;
  const most = Math.max(1e-30, ...found.map(({ power }) => power));
  for (const bin of found) {
    const left = across(width, bin.nm - 5), tall = (bin.power / most) * (floor - TOP);
    pen.fillStyle = colours[Math.round(bin.nm) - FIRST_NM];
    pen.fillRect(left, floor - tall, across(width, bin.nm + 5) - left - 1, tall);
  }
  pen.fillStyle = getComputedStyle(canvas).color;
  reading(plot, nm);
}
