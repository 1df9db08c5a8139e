// @ts-check
/**
 * What a viewer is set to, and what each setting is called: exposure, tone map, comparison with the reference, layout,
 * view.
 *
 * Pure. A setting that the user has not touched has its default and is left out of addresses (`toParams`). `max`
 * belongs to the map that is shown: null means automatic, and choosing another map makes it automatic again.
 */
import { MAX_ZOOM, MIN_ZOOM, clamp01, niceCeil } from "./maths.js";

/** @typedef {"srgb" | "gamma22" | "falsecolour"} Tone */
/**
 * What is shown: the picture, or its difference to the reference.
 * @typedef {"picture" | "signed" | "absolute" | "squared" | "relative"} Mode
 */
/** @typedef {"single" | "side" | "wipe"} Layout */
/**
 * @typedef {object} ViewerSettings
 * @property {number} ev         exposure in stops, for the tone maps srgb and gamma22
 * @property {Tone} tone         used in mode "picture"
 * @property {Mode} mode
 * @property {number | null} max what false colour and error maps end at, linear; null: chosen from the pictures
 * @property {Layout} layout     one picture, all of the row, or a split between one and the reference
 * @property {number} split      where the wipe is, 0 to 1 from the left of the box
 * @property {number | null} zoom CSS pixels per pixel of the picture; null: the whole picture
 * @property {number} x          what is in the middle, as a fraction of the picture's width
 * @property {number} y          and of its height
 */

/** @type {Readonly<ViewerSettings>} */
export const DEFAULTS = Object.freeze({
  ev: 0,
  tone: "srgb",
  mode: "picture",
  max: null,
  layout: "single",
  split: 0.5,
  zoom: null,
  x: 0.5,
  y: 0.5,
});

/** @type {readonly {name: Tone, label: string, line: string}[]} */
export const TONES = [
  { name: "srgb", label: "sRGB", line: "colours as sRGB screens show them; brighter than white is cut off" },
  { name: "gamma22", label: "γ 2.2", line: "a plain power curve, as many older figures have it" },
  { name: "falsecolour", label: "False colour", line: "luminance from 0 to a maximum in inferno" },
];

/** @type {readonly {name: Exclude<Mode, "picture">, label: string, title: string, formula: string, line: string}[]} */
export const ERROR_MODES = [
  {
    name: "signed",
    label: "Signed",
    title: "difference",
    formula: "I − R",
    line: "blue is too dark, red is too bright",
  },
  {
    name: "absolute",
    label: "|Δ|",
    title: "absolute error",
    formula: "|I − R|",
    line: "absolute difference to the reference",
  },
  { name: "squared", label: "Δ²", title: "squared error", formula: "(I − R)²", line: "its mean is the metric mse" },
  {
    name: "relative",
    label: "Δ²/R²",
    title: "relative squared error",
    formula: "(I − R)² / (R² + 0.01)",
    line: "its mean is the metric relmse",
  },
];

export const LAYOUTS = /** @type {const} */ ([
  { name: "single", label: "Single", keys: "1…9", line: "one large picture, flip with the number keys" },
  { name: "side", label: "Side by side", keys: "s", line: "all pictures, zoomed and moved together" },
  {
    name: "wipe",
    label: "Wipe",
    keys: "w",
    line: "the picture on the left, its reference on the right of a split to drag",
  },
]);

export const EV_LIMIT = 20;

/** @param {unknown} v @param {number} fallback @returns {number} */
const finite = (v, fallback) => (typeof v === "number" && Number.isFinite(v) ? v : fallback);

/** @template {string} T @param {readonly {name: T}[]} known @param {unknown} name @param {T} fallback @returns {T} */
const known = (known, name, fallback) => known.find((one) => one.name === name)?.name ?? fallback;

/**
 * Whole settings from any part of them; values that cannot be are defaults.
 * @param {Partial<ViewerSettings> | undefined} given @returns {ViewerSettings}
 */
export function complete(given = {}) {
  const { max, zoom } = given;
  return {
    ev: Math.min(Math.max(finite(given.ev, 0), -EV_LIMIT), EV_LIMIT),
    tone: known(TONES, given.tone, "srgb"),
    mode: known(ERROR_MODES, given.mode, /** @type {any} */ (null)) ?? "picture",
    max: typeof max === "number" && max > 0 && Number.isFinite(max) ? max : null,
    layout: known(LAYOUTS, given.layout, "single"),
    split: clamp01(finite(given.split, 0.5)),
    zoom: typeof zoom === "number" && zoom > 0 ? Math.min(Math.max(zoom, MIN_ZOOM), MAX_ZOOM) : null,
    x: clamp01(finite(given.x, 0.5)),
    y: clamp01(finite(given.y, 0.5)),
  };
}

/**
 * The same numbers with only the digits that matter, so that what comes back from an address equals what was sent.
 * @param {ViewerSettings} s @returns {ViewerSettings}
 */
export function rounded(s) {
  const digits = (/** @type {number} */ v, /** @type {number} */ places) => Number(v.toFixed(places));
  return {
    ...s,
    ev: digits(s.ev, 2),
    max: s.max === null ? null : Number(s.max.toPrecision(3)),
    split: digits(s.split, 3),
    zoom: s.zoom === null ? null : Number(s.zoom.toPrecision(4)),
    x: digits(s.x, 5),
    y: digits(s.y, 5),
  };
}

/** @param {ViewerSettings} a @param {ViewerSettings} b @returns {boolean} */
export const same = (a, b) => JSON.stringify(rounded(a)) === JSON.stringify(rounded(b));

/**
 * Settings for the query of an address: text, or null for a default.
 * @param {ViewerSettings} s @returns {Record<string, string | null>}
 */
export function toParams(s) {
  const r = rounded(s);
  /** @type {Record<string, string | null>} */
  const params = {};
  for (const name of /** @type {(keyof ViewerSettings)[]} */ (Object.keys(DEFAULTS))) {
    params[name] = r[name] === DEFAULTS[name] ? null : String(r[name]);
  }
  return params;
}

/** @param {(name: string) => string | null} get @returns {ViewerSettings} */
export function fromParams(get) {
  const given = Object.entries(DEFAULTS).map(([name, fallback]) => {
    const text = get(name);
    return [name, text === null ? fallback : typeof fallback === "string" ? text : Number(text)];
  });
  return complete(Object.fromEntries(given));
}

/**
 * The colour map that shows, null for colours as they are.
 * @param {Pick<ViewerSettings, "mode" | "tone">} s @returns {"inferno" | "signed" | null}
 */
export function mapOf({ mode, tone }) {
  if (mode === "signed") return "signed";
  return mode === "picture" && tone !== "falsecolour" ? null : "inferno";
}

/** @param {ViewerSettings} s @returns {Partial<ViewerSettings>} */
export function nextTone(s) {
  if (s.mode !== "picture") return { mode: "picture", max: null };
  const at = TONES.findIndex((tone) => tone.name === s.tone);
  return { tone: TONES[(at + 1) % TONES.length]?.name ?? "srgb", max: null };
}

/** @param {ViewerSettings} s @param {1 | -1} direction @returns {Partial<ViewerSettings>} */
export function nextMode(s, direction) {
  /** @type {Mode[]} */
  const modes = ["picture", ...ERROR_MODES.map((mode) => mode.name)];
  const at = modes.indexOf(s.mode) + direction + modes.length;
  return { mode: modes[at % modes.length] ?? "picture", max: null };
}

/**
 * The next of 1, 2, 5 × 10ⁿ above (+1) or below (−1).
 * @param {number} max @param {1 | -1} direction @returns {number}
 */
export function nextMax(max, direction) {
  if (direction > 0) return niceCeil(max * 1.01);
  return Number((1 / niceCeil(1.01 / max)).toPrecision(3)); // the reciprocals of 1, 2, 5 are 1, 0.5, 0.2
}

/** "+1.5", "−0.37", "0". @param {number} ev @returns {string} */
export function signedNumber(ev) {
  const text = String(Number(Math.abs(ev).toFixed(2)));
  return ev < 0 && text !== "0" ? `−${text}` : ev > 0 && text !== "0" ? `+${text}` : text;
}
