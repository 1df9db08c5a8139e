// @ts-check
/**
 * What is drawn over the pictures: their frames, the values of large pixels, and the cross that is linked in all of
 * them.
 */
import { compact, halfToFloat, toScreen } from "./maths.js";
import { displayed, isBright, mapped } from "./looks.js";

/** @typedef {import("./gl.js").Drawing} Drawing */
/** @typedef {import("./maths.js").Box} Box */
/** @typedef {import("./maths.js").Rgb} Rgb */
/** @typedef {import("./maths.js").Spot} Spot */

const VALUES_FROM = 32; // CSS pixels per pixel: three numbers fit
const OUTLINE_FROM = 6; // from here the cross is the outline of a pixel
const MOST_VALUES = 4000; // pixels with letters: more cannot be read, and would take long

/**
 * @param {CanvasRenderingContext2D} context scaled to CSS pixels @param {Box} whole
 * @param {readonly (Drawing & {own: boolean})[]} drawings `own`: the pointer is in it
 * @param {Spot | null} hover fractions of a picture @param {{line: string, mono: string}} style
 */
export function drawOverlay(context, whole, drawings, hover, style) {
  context.clearRect(0, 0, whole.width, whole.height);
  for (const drawing of drawings) {
    const { clip } = drawing;
    if (clip.width <= 0 || clip.height <= 0) continue;
    context.save();
    context.beginPath();
    context.rect(clip.x, clip.y, clip.width, clip.height);
    context.clip();
    frame(context, drawing, style.line);
    if (drawing.place.scale >= VALUES_FROM) values(context, drawing, style.mono);
    if (hover) cross(context, drawing, hover);
    context.restore();
  }
}

/**
 * A line around the picture: without it a black one has no end.
 * @param {CanvasRenderingContext2D} context @param {Drawing} drawing @param {string} colour
 */
function frame(context, { place: { left, top, scale }, pixels: { width, height } }, colour) {
  context.strokeStyle = colour;
  context.lineWidth = 1;
  context.strokeRect(left - 0.5, top - 0.5, width * scale + 1, height * scale + 1);
}

/** @param {CanvasRenderingContext2D} context @param {Drawing} drawing @param {string} mono */
function values(context, drawing, mono) {
  const { place, clip, pixels, reference } = drawing;
  const { scale, left, top } = place;
  const first = {
    x: Math.max(Math.floor((clip.x - left) / scale), 0),
    y: Math.max(Math.floor((clip.y - top) / scale), 0),
  };
  const last = {
    x: Math.min(Math.ceil((clip.x + clip.width - left) / scale), pixels.width),
    y: Math.min(Math.ceil((clip.y + clip.height - top) / scale), pixels.height),
  };
  if ((last.x - first.x) * (last.y - first.y) > MOST_VALUES) return;
  context.textAlign = "center";
  context.textBaseline = "middle";
  let font = 0;
  for (let y = first.y; y < last.y; y++) {
    for (let x = first.x; x < last.x; x++) {
      const c = colourAt(pixels, x, y);
      const r = reference ? colourAt(reference, x, y) : null;
      const value = mapped(drawing, c, r);
      const lines = (value === null ? c : [value]).map((v) => compact(v));
      const longest = Math.max(...lines.map((line) => line.length), 5);
      const size = Math.floor(Math.min((scale * 0.9) / (longest * 0.61), (scale * 0.86) / (lines.length * 1.15), 15));
      if (size !== font) context.font = `${(font = size)}px ${mono}`;
      context.fillStyle = isBright(displayed(drawing, c, r)) ? "rgb(0 0 0 / 0.86)" : "rgb(255 255 255 / 0.9)";
      lines.forEach((line, i) => {
        context.fillText(
          line,
          left + (x + 0.5) * scale,
          top + (y + 0.5) * scale + (i - (lines.length - 1) / 2) * size * 1.15,
        );
      });
    }
  }
}

/** @param {import("./pictures.js").Pixels} pixels @param {number} x @param {number} y @returns {Rgb} */
function colourAt({ width, halves }, x, y) {
  const i = (y * width + x) * 3;
  return [halfToFloat(halves[i] ?? 0), halfToFloat(halves[i + 1] ?? 0), halfToFloat(halves[i + 2] ?? 0)];
}

/**
 * Dark and light, so that it shows on anything.
 * @param {CanvasRenderingContext2D} context @param {Drawing & {own: boolean}} drawing @param {Spot} hover
 */
function cross(context, { place, pixels, own }, hover) {
  const pixel = { x: Math.floor(hover.x * pixels.width), y: Math.floor(hover.y * pixels.height) };
  const corner = toScreen(place, pixel);
  const { scale } = place;
  context.beginPath();
  if (scale >= OUTLINE_FROM) context.rect(corner.x, corner.y, scale, scale);
  if (!own) {
    const middle = { x: corner.x + scale / 2, y: corner.y + scale / 2 };
    const gap = Math.max(scale / 2, 3);
    for (const [x, y] of /** @type {const} */ ([
      [1, 0],
      [-1, 0],
      [0, 1],
      [0, -1],
    ])) {
      context.moveTo(middle.x + x * gap, middle.y + y * gap);
      context.lineTo(middle.x + x * (gap + 7), middle.y + y * (gap + 7));
    }
  }
  context.lineWidth = 3;
  context.strokeStyle = "rgb(0 0 0 / 0.65)";
  context.stroke();
  context.lineWidth = 1.25;
  context.strokeStyle = "#fff";
  context.stroke();
}
