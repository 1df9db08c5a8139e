// @ts-check
/**
 * The arithmetic of the viewer: float16, tone curves, errors of a pixel, percentiles, and where a picture lies on the
 * screen.
 *
 * Pure and without a page, so tests import it. `gl.js` does the tone curves and errors a second time in its shader;
 * whoever changes a formula here changes it there, and the browser tests hold the two together.
 *
 * Screen coordinates are CSS pixels with y down; picture coordinates are pixels with (0, 0) at the top left corner of
 * the first one, so pixel (3, 5) covers x from 3 to 4 and y from 5 to 6.
 */

/** @typedef {{width: number, height: number}} Size */
/** @typedef {{x: number, y: number}} Spot */
/** @typedef {{x: number, y: number, width: number, height: number}} Box  a rectangle on the screen */
/**
 * What is seen of a picture. `zoom` is CSS pixels per picture pixel, null fits the whole picture in; `x` and `y` are
 * the point in the middle of the box as fractions of the picture, so one view serves pictures of different sizes.
 * @typedef {{zoom: number | null, x: number, y: number}} View
 */
/** @typedef {{scale: number, left: number, top: number}} Place  screen = left + scale · picture */
/** @typedef {readonly [number, number, number]} Rgb */

export const RELATIVE_EPSILON = 0.01; // radiance², the same as in the metric relmse
export const MAX_ZOOM = 160; // CSS pixels per pixel: a pixel then shows its three values in large letters
export const MIN_ZOOM = 1 / 32;
/** What `=` and `-` step through. */
export const ZOOM_STOPS = [
  1 / 32,
  1 / 16,
  1 / 8,
  1 / 4,
  1 / 3,
  1 / 2,
  2 / 3,
  1,
  1.5,
  2,
  3,
  4,
  6,
  8,
  12,
  16,
  24,
  32,
  48,
  64,
  96,
  128,
  MAX_ZOOM,
];

// -- float16 ----------------------------------------------------------------------------------------------------------

/** The number that a float16's 16 bits mean. @param {number} bits @returns {number} */
export function halfToFloat(bits) {
  const sign = bits & 0x8000 ? -1 : 1;
  const exponent = (bits >> 10) & 0x1f;
  const fraction = bits & 0x3ff;
  if (exponent === 0) return sign * fraction * 2 ** -24;
  if (exponent === 31) return fraction ? NaN : sign * Infinity;
  return sign * (1 + fraction / 1024) * 2 ** (exponent - 15);
}

/** @type {Float32Array | null} */
let halves = null;

/**
 * Every float16 by its bits: a table reads a whole picture some ten times faster than the formula.
 * @returns {Float32Array}
 */
export function halfTable() {
  halves ??= Float32Array.from({ length: 65536 }, (_, bits) => halfToFloat(bits));
  return halves;
}

// -- tone and error ---------------------------------------------------------------------------------------------------

/** @param {number} v @returns {number} */
export const clamp01 = (v) => (v > 0 ? Math.min(v, 1) : 0); // NaN becomes 0

/** Linear radiance to the sRGB curve, both 0 to 1 (IEC 61966-2-1). @param {number} v @returns {number} */
export function srgb(v) {
  const c = clamp01(v);
  return c <= 0.0031308 ? 12.92 * c : 1.055 * c ** (1 / 2.4) - 0.055;
}

/** @param {number} v @returns {number} */
export const gamma22 = (v) => clamp01(v) ** (1 / 2.2);

/** Of Rec. 709 primaries. @param {Rgb} c @returns {number} */
export const luminance = ([r, g, b]) => 0.2126 * r + 0.7152 * g + 0.0722 * b;

/**
 * Errors of one channel, by the mode that shows them. A pixel's error is the mean over its channels, as in the metrics.
 * @type {Readonly<Record<"signed" | "absolute" | "squared" | "relative", (v: number, reference: number) => number>>}
 */
export const ERRORS = {
  signed: (value, reference) => value - reference,
  absolute: (value, reference) => Math.abs(value - reference),
  squared: (value, reference) => (value - reference) ** 2,
  relative: (value, reference) => (value - reference) ** 2 / (reference ** 2 + RELATIVE_EPSILON),
};

/** @param {keyof typeof ERRORS} kind @param {Rgb} c @param {Rgb} reference @returns {number} */
export function pixelError(kind, c, reference) {
  const error = ERRORS[kind];
  return (error(c[0], reference[0]) + error(c[1], reference[1]) + error(c[2], reference[2])) / 3;
}

/**
 * The pixel that holds a point, null outside.
 * @param {Size & {halves: Uint16Array}} picture @param {Spot} at @returns {Rgb | null}
 */
export function pixelAt({ width, height, halves: bits }, at) {
  const x = Math.floor(at.x);
  const y = Math.floor(at.y);
  if (!(x >= 0 && y >= 0 && x < width && y < height)) return null;
  const start = (y * width + x) * 3;
  return [halfToFloat(bits[start] ?? 0), halfToFloat(bits[start + 1] ?? 0), halfToFloat(bits[start + 2] ?? 0)];
}

// -- statistics -------------------------------------------------------------------------------------------------------

/**
 * The value below which a share `p` (0 to 1) of the finite values lies, linear between ranks; NaN for none.
 * @param {Float32Array} values @param {number} p @returns {number}
 */
export function percentile(values, p) {
  const sorted = values.filter(Number.isFinite).sort();
  if (sorted.length === 0) return NaN;
  const rank = p * (sorted.length - 1);
  const low = Math.floor(rank);
  const below = sorted[low] ?? NaN;
  const above = sorted[Math.min(low + 1, sorted.length - 1)] ?? NaN;
  return below + (above - below) * (rank - low);
}

/**
 * One number for each pixel, for at most `limit` pixels spread over the picture: `measure(index of the pixel's red)`.
 * @param {number} pixels @param {(start: number) => number} measure @param {number} [limit] @returns {Float32Array}
 */
export function sample(pixels, measure, limit = 1 << 17) {
  const count = Math.min(pixels, limit);
  const values = new Float32Array(count);
  for (let i = 0; i < count; i++) values[i] = measure(Math.floor((i * pixels) / count) * 3);
  return values;
}

/** The next of 1, 2, 5 × 10ⁿ at or above. @param {number} v @returns {number} */
export function niceCeil(v) {
  if (!(v > 0) || !Number.isFinite(v)) return 1;
  const power = 10 ** Math.floor(Math.log10(v));
  const step = [1, 2, 5, 10].find((s) => s * power >= v * (1 - 1e-9)) ?? 10;
  return Number((step * power).toPrecision(3)); // 5 × 10⁻³ is not 0.005 in floating point, and it would show
}

/**
 * A number in at most seven characters, for places that must not jump: "0.123", "17.25", "3.2e−4", "65504".
 * @param {number} v @param {number} [digits] significant ones @returns {string}
 */
export function compact(v, digits = 3) {
  if (Number.isNaN(v)) return "NaN";
  const size = Math.abs(v);
  const sign = v < 0 ? "−" : "";
  if (size === 0) return "0";
  if (size === Infinity) return `${sign}inf`;
  if (size < 10 ** (1 - digits)) return `${sign}${size.toExponential(Math.max(digits - 2, 0)).replace("-", "−")}`;
  const whole = Math.max(Math.floor(Math.log10(size)) + 1, 1);
  return sign + size.toFixed(Math.max(digits + 1 - whole, 0));
}

/** A number that stands by itself, such as a maximum: "0.5", "2", "1e−4". @param {number} v @returns {string} */
export function short(v) {
  const size = Math.abs(v);
  const text =
    size >= 1e-3 || size === 0 ? String(Number(size.toPrecision(3))) : size.toExponential().replace("-", "−");
  return (v < 0 ? "−" : "") + text.replace(/(\.\d\d)\d+e/, "$1e");
}

// -- where a picture lies ---------------------------------------------------------------------------------------------

/** @param {Size} size @param {Size} box @returns {number} */
export function fitZoom(size, box) {
  return Math.max(Math.min(box.width / size.width, box.height / size.height), 1e-6);
}

/** @param {View} view @param {Size} size @param {Size} box @returns {number} */
export const zoomOf = (view, size, box) => view.zoom ?? fitZoom(size, box);

/**
 * Where the picture's corner is and how large its pixels are. `ratio` (device pixels per CSS pixel) sets the corner on
 * a whole device pixel where the zoom is whole, so that each pixel covers whole device pixels.
 * @param {View} view @param {Size} size @param {Box} box @param {number} [ratio] @returns {Place}
 */
export function place(view, size, box, ratio) {
  const scale = zoomOf(view, size, box);
  const left = box.x + box.width / 2 - view.x * size.width * scale;
  const top = box.y + box.height / 2 - view.y * size.height * scale;
  if (!ratio || Math.abs(scale * ratio - Math.max(Math.round(scale * ratio), 1)) > 1e-3) return { scale, left, top };
  return { scale, left: Math.round(left * ratio) / ratio, top: Math.round(top * ratio) / ratio };
}

/** @param {Place} at @param {Spot} screen @returns {Spot} */
export const toPicture = (at, screen) => ({ x: (screen.x - at.left) / at.scale, y: (screen.y - at.top) / at.scale });

/** @param {Place} at @param {Spot} picture @returns {Spot} */
export const toScreen = (at, picture) => ({ x: at.left + picture.x * at.scale, y: at.top + picture.y * at.scale });

/**
 * The view in which the point `picture` (pixels) lies under `screen`.
 * @param {number} zoom @param {Size} size @param {Box} box @param {Spot} picture @param {Spot} screen @returns {View}
 */
function pinned(zoom, size, box, picture, screen) {
  return {
    zoom,
    x: clamp01((picture.x + (box.x + box.width / 2 - screen.x) / zoom) / size.width),
    y: clamp01((picture.y + (box.y + box.height / 2 - screen.y) / zoom) / size.height),
  };
}

/**
 * Zoom by a factor so that what is under `anchor` stays there, as far as the middle of the box stays on the picture.
 * @param {View} view @param {Size} size @param {Box} box @param {number} factor @param {Spot} anchor @returns {View}
 */
export function zoomAt(view, size, box, factor, anchor) {
  return zoomTo(view, size, box, zoomOf(view, size, box) * factor, anchor);
}

/**
 * @param {View} view @param {Size} size @param {Box} box @param {number} zoom
 * @param {Spot} [anchor] default: the middle @returns {View}
 */
export function zoomTo(view, size, box, zoom, anchor = { x: box.x + box.width / 2, y: box.y + box.height / 2 }) {
  const under = toPicture(place(view, size, box), anchor);
  return pinned(Math.min(Math.max(zoom, MIN_ZOOM), MAX_ZOOM), size, box, under, anchor);
}

/**
 * Move the picture by screen pixels.
 * @param {View} view @param {Size} size @param {Box} box @param {number} dx @param {number} dy @returns {View}
 */
export function pan(view, size, box, dx, dy) {
  const zoom = zoomOf(view, size, box);
  return { zoom, x: clamp01(view.x - dx / (size.width * zoom)), y: clamp01(view.y - dy / (size.height * zoom)) };
}

/**
 * Two fingers moved from `before` to `after`: what is under the middle between them follows it, and their distance
 * zooms.
 * @param {View} view @param {Size} size @param {Box} box @param {readonly [Spot, Spot]} before
 * @param {readonly [Spot, Spot]} after
 * @returns {View}
 */
export function pinch(view, size, box, before, after) {
  const middle = (/** @type {readonly [Spot, Spot]} */ [a, b]) => ({ x: (a.x + b.x) / 2, y: (a.y + b.y) / 2 });
  const spread = (/** @type {readonly [Spot, Spot]} */ [a, b]) => Math.max(Math.hypot(a.x - b.x, a.y - b.y), 1);
  const from = middle(before);
  const to = middle(after);
  return pan(zoomAt(view, size, box, spread(after) / spread(before), from), size, box, to.x - from.x, to.y - from.y);
}

/** The next stop above (+1) or below (−1). @param {number} zoom @param {1 | -1} direction @returns {number} */
export function nextStop(zoom, direction) {
  const stops = direction > 0 ? ZOOM_STOPS : [...ZOOM_STOPS].reverse();
  return stops.find((stop) => (stop - zoom) * direction > zoom * 1e-3) ?? zoom;
}

/**
 * The view of a small box that shows what a large one shows: the zoom relative to fitting is the same.
 * @param {View} view @param {Size} size @param {Size} large @param {Size} small
 * @param {Size} [shown] size of the picture in the small box
 * @returns {View}
 */
export function shrunk(view, size, large, small, shown = size) {
  if (view.zoom === null) return view;
  return { ...view, zoom: (view.zoom / fitZoom(size, large)) * fitZoom(shown, small) };
}

/**
 * Columns for `count` boxes in which a picture of the given shape becomes largest; fewer columns where it is the same.
 * @param {number} count @param {Size} picture @param {Size} box @param {number} [caption] height above each picture
 * @returns {number}
 */
export function bestColumns(count, picture, box, caption = 0) {
  let best = 1;
  let zoom = 0;
  for (let columns = 1; columns <= count; columns++) {
    const rows = Math.ceil(count / columns);
    const cell = { width: box.width / columns, height: Math.max(box.height / rows - caption, 1) };
    const fit = fitZoom(picture, cell);
    if (fit > zoom * 1.001) [best, zoom] = [columns, fit];
  }
  return best;
}
