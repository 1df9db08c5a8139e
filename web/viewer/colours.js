// @ts-check
/**
 * The colour maps: inferno for what starts at 0, blue–white–red for what has a sign.
 *
 * Inferno (S. van der Walt, N. Smith, E. Firing; CC0) as 33 equally spaced colours, linear in between: within 1.5/255
 * of the 256 original ones. The shader reads the same table, so a colour bar and the picture beside it agree.
 */
import { clamp01 } from "./maths.js";

/** @typedef {import("./maths.js").Rgb} Rgb */

const INFERNO =
  "000004 040312 0b0724 150b37 210c4a 2e0a5a 3c0965 4a0c6b 57106d 63146e 70196e 7d1e6d 89226a 962766 a32b61 af315c " +
  "bb3755 c63e4d d14644 db4f3b e35932 eb6528 f1711e f67f14 f98d0a fb9c06 fcab0f fbba1f f9ca32 f5d949 f2e865 f3f586 " +
  "fcffa4";

/** Stops of inferno, each channel 0 to 1 in sRGB. @type {readonly Rgb[]} */
export const INFERNO_STOPS = INFERNO.split(" ").map(rgb);

/** Below zero, zero, above zero. @type {readonly [Rgb, Rgb, Rgb]} */
export const SIGNED_STOPS = [rgb("2166ac"), rgb("ffffff"), rgb("b2182b")];

/** What marks NaN and infinity: no map has this colour. @type {Rgb} */
export const NOT_A_NUMBER = rgb("ff00ff");

/** @param {string} hex @returns {Rgb} */
function rgb(hex) {
  const n = Number.parseInt(hex, 16);
  return [(n >> 16) / 255, ((n >> 8) & 255) / 255, (n & 255) / 255];
}

/** @param {Rgb} a @param {Rgb} b @param {number} t @returns {Rgb} */
const mix = (a, b, t) => [a[0] + (b[0] - a[0]) * t, a[1] + (b[1] - a[1]) * t, a[2] + (b[2] - a[2]) * t];

/** 0 to 1, clamped. @param {number} t @returns {Rgb} */
export function inferno(t) {
  const at = clamp01(t) * (INFERNO_STOPS.length - 1);
  const low = Math.min(Math.floor(at), INFERNO_STOPS.length - 2);
  return mix(INFERNO_STOPS[low] ?? NOT_A_NUMBER, INFERNO_STOPS[low + 1] ?? NOT_A_NUMBER, at - low);
}

/** −1 (blue) to 1 (red), clamped. @param {number} t @returns {Rgb} */
export function signed(t) {
  const [below, zero, above] = SIGNED_STOPS;
  return t < 0 ? mix(zero, below, clamp01(-t)) : mix(zero, above, clamp01(t));
}

/** @param {Rgb} c @returns {string} */
export const css = (c) => `rgb(${c.map((v) => Math.round(v * 255)).join(" ")})`;

/** A CSS gradient from left to right. @param {"inferno" | "signed"} map @returns {string} */
export function gradient(map) {
  return `linear-gradient(to right, ${(map === "inferno" ? INFERNO_STOPS : SIGNED_STOPS).map(css).join(", ")})`;
}
