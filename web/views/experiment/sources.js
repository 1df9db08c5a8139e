// @ts-check
/**
 * Which picture stands for a cell: its first replicate, or what is there of it, or the error of that.
 *
 * The token in an address changes when the picture does, and only then: a finished picture may be kept for ever. Pure.
 */
import { errorUrl, previewUrl } from "../../api.js";

/** @typedef {import("../../api.js").Cell} Cell */
/** @typedef {import("../../api.js").Progress} Progress */
/**
 * @typedef {object} How
 * @property {string | null} metric name, for an error map; null for the picture itself
 * @property {number} pixels longest side on the screen, in the screen's own pixels
 * @property {number} ev stops
 * @property {string} tone
 * @property {number | null} max end of the colours; null while it is not known
 */

const SIZES = /** @type {const} */ ([64, 128, 256, 512]); // px that the service offers

/** The address of what to show for a cell; null while there is nothing. @param {Cell} cell @param {Progress | undefined} progress @param {How} how @returns {string | null} */
export function sourceOf(cell, progress, how) {
  const size = SIZES.find((side) => side >= how.pixels) ?? 512;
  if (how.metric !== null && cell.role === "cell") {
    const { reference } = cell;
    if (reference === null || reference === undefined || !cell.metrics?.[how.metric] || how.max === null) return null;
    return errorUrl(cell.cell, how.metric, { reference, k: 0, size, max: how.max });
  }
  const token = tokenOf(cell, progress);
  if (!token) return null;
  const max = how.tone === "falsecolour" ? how.max ?? 1 : undefined;
  return previewUrl(cell.cell, { role: cell.role, ...(cell.role === "cell" ? { k: 0 } : {}), size, ev: how.ev, tone: how.tone, max, v: token });
}

/** A reference is the mean of what there is, so it changes with every replicate; a cell shows its first. @param {Cell} cell @param {Progress | undefined} progress */
export function tokenOf(cell, progress) {
  if (cell.had > 0) return cell.role === "reference" ? `n${cell.had}` : "done";
  return progress?.preview ? `p${progress.preview}` : "";
}
