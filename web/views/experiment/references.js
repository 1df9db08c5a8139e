// @ts-check
/**
 * Where the references of an image grid stand. Pure.
 *
 * Cells of one estimand share a reference: often there is one for the whole grid, else one a row (scenes on rows) or one a
 * column (integrators of different path lengths on columns). Where it differs along both, the viewer shows it.
 */
import { placeAt } from "./view.js";

/** @typedef {import("./axes.js").CellIndex} CellIndex */
/** @typedef {import("./view.js").View} View */
/** @typedef {{side: "one" | "row" | "column" | "none", at: (row: string | undefined, col: string | undefined) => number | undefined}} References
 * `at` gives the `cell` of the reference */

/** @param {CellIndex | null} index @param {View} view @returns {References} */
export function referencesOf(index, view) {
  /** @type {Map<string, number | null>} null: it differs along the row */
  const byRow = new Map();
  /** @type {Map<string, number | null>} */
  const byCol = new Map();
  const all = new Set();
  for (const row of view.rows.values) {
    for (const col of view.cols.values) {
      const reference = index?.at(placeAt(view, row, col))?.reference;
      if (reference === null || reference === undefined) continue;
      all.add(reference);
      note(byRow, row, reference);
      note(byCol, col, reference);
    }
  }
  const [only] = all;
  if (all.size === 0) return { side: "none", at: () => undefined };
  if (all.size === 1) return { side: "one", at: () => only };
  if (![...byRow.values()].includes(null)) return { side: "row", at: (row) => byRow.get(row ?? "") ?? undefined };
  if (![...byCol.values()].includes(null)) return { side: "column", at: (_row, col) => byCol.get(col ?? "") ?? undefined };
  return { side: "none", at: () => undefined };
}

/** @param {Map<string, number | null>} lines @param {string} line @param {number} reference */
function note(lines, line, reference) {
  const known = lines.get(line);
  if (known === undefined) lines.set(line, reference);
  else if (known !== reference) lines.set(line, null);
}
