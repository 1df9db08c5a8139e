// @ts-check
/**
 * What a pixel looks like and what a whole picture needs: displayed colours, automatic maxima, the exposure that fits.
 *
 * The shader's twin for single pixels (letters on a pixel must stand out from it) and for statistics. Pure.
 */
import { NOT_A_NUMBER, inferno, signed } from "./colours.js";
import { ERRORS, gamma22, halfTable, luminance, niceCeil, percentile, pixelError, sample, srgb } from "./maths.js";

/** @typedef {import("./maths.js").Rgb} Rgb */
/** @typedef {import("./pictures.js").Pixels} Pixels */
/** @typedef {import("./settings.js").ViewerSettings} ViewerSettings */
/**
 * How a picture is drawn. `max` is a number here: the automatic one is resolved.
 * @typedef {Pick<ViewerSettings, "mode" | "tone" | "ev"> & {max: number}} Look
 */

export const WHITE_SHARE = 0.99; // of the pixels stay below white, or below the end of a map

/**
 * How a box looks: a reference beside error maps keeps its colours, for a maximum of errors says nothing about it.
 * @param {{mode: Look["mode"]}} seen @param {ViewerSettings} settings @param {number} max @returns {Look}
 */
export function lookOf({ mode }, settings, max) {
  const beside = mode === "picture" && settings.mode !== "picture";
  return { mode, tone: beside && settings.tone === "falsecolour" ? "srgb" : settings.tone, ev: settings.ev, max };
}

/**
 * The one number of a pixel in a map; null where the colours are shown.
 * @param {Pick<Look, "mode" | "tone">} look @param {Rgb} c @param {Rgb | null} reference @returns {number | null}
 */
export function mapped({ mode, tone }, c, reference) {
  if (mode !== "picture") return reference ? pixelError(mode, c, reference) : null;
  return tone === "falsecolour" ? luminance(c) : null;
}

/**
 * The colour on the screen, each channel 0 to 1.
 * @param {Look} look @param {Rgb} c @param {Rgb | null} reference @returns {Rgb}
 */
export function displayed(look, c, reference) {
  const value = mapped(look, c, reference);
  if (![...c, value ?? 0].every(Number.isFinite)) return NOT_A_NUMBER;
  if (value !== null) return look.mode === "signed" ? signed(value / look.max) : inferno(value / look.max);
  const curve = look.tone === "gamma22" ? gamma22 : srgb;
  const gain = 2 ** look.ev;
  return [curve(c[0] * gain), curve(c[1] * gain), curve(c[2] * gain)];
}

/** Whether dark letters read better than light ones on a displayed colour. @param {Rgb} c @returns {boolean} */
export const isBright = (c) => luminance(c) > 0.46;

/**
 * What 99 % of the pixels stay below in a map (for signed differences: either way from 0); NaN where there is nothing
 * to measure.
 * @param {Look["mode"]} mode @param {Pixels} picture @param {Pixels | null} reference @returns {number}
 */
export function reach(mode, { width, height, halves }, reference) {
  const floats = halfTable();
  const at = (/** @type {Uint16Array} */ bits, /** @type {number} */ i) => floats[bits[i] ?? 0] ?? 0;
  if (mode === "picture") {
    const values = sample(width * height, (i) => luminance([at(halves, i), at(halves, i + 1), at(halves, i + 2)]));
    return percentile(values, WHITE_SHARE);
  }
  if (!comparable({ width, height }, reference)) return NaN;
  const error = ERRORS[mode];
  const other = reference.halves;
  const channel = (/** @type {number} */ i) => error(at(halves, i), at(other, i));
  return percentile(
    sample(width * height, (i) => Math.abs(channel(i) + channel(i + 1) + channel(i + 2)) / 3),
    WHITE_SHARE,
  );
}

/**
 * The exposure in stops at which 99 % of the pixels have no channel beyond white.
 * @param {Pixels} picture @returns {number | null} null: all black
 */
export function normalisingEv({ width, height, halves }) {
  const floats = halfTable();
  const brightest = (/** @type {number} */ i) =>
    Math.max(floats[halves[i] ?? 0] ?? 0, floats[halves[i + 1] ?? 0] ?? 0, floats[halves[i + 2] ?? 0] ?? 0);
  const white = percentile(sample(width * height, brightest), WHITE_SHARE);
  return white > 0 ? -Math.log2(white) : null;
}

/** @param {{width: number, height: number}} picture @param {Pixels | null} reference @returns {reference is Pixels} */
export function comparable(picture, reference) {
  return reference !== null && reference.width === picture.width && reference.height === picture.height;
}

/**
 * The maximum that all pictures share when the user has set none: a round number above what most of any picture
 * reaches. `remember` keeps what was measured, by picture, map and reference: measuring takes milliseconds, drawing
 * must not.
 * @param {Look["mode"]} mode @param {readonly {pixels: Pixels, reference: Pixels | null}[]} pictures
 * @param {WeakMap<Pixels, Map<string, {reference: Pixels | null, reach: number}>>} remember @returns {number}
 */
export function automaticMax(mode, pictures, remember) {
  let most = 0;
  for (const { pixels, reference } of pictures) {
    const known = remember.get(pixels) ?? new Map();
    remember.set(pixels, known);
    let entry = known.get(mode);
    if (entry?.reference !== reference) known.set(mode, (entry = { reference, reach: reach(mode, pixels, reference) }));
    if (entry.reach > most) most = entry.reach;
  }
  return niceCeil(most);
}
