// @ts-check
/**
 * Comparing the errors of cells. Only cells that are measured against the same reference are ever compared: others
 * have different expected pictures, and the lower number would mean nothing. Pure.
 */
import { niceCeil } from "../../viewer/maths.js";

/** @typedef {import("../../api.js").Cell} Cell */
/** @typedef {import("../../api.js").MetricInfo} MetricInfo */
/** @typedef {{mean: number, se: number | null, n: number}} Estimate */
/** @typedef {"best" | "tied" | ""} Rank */

const TIED = 2; // standard errors of a difference: closer than this, nobody is better

/** @param {Cell} cell @param {string} metric @returns {Estimate | null} */
export function estimateOf(cell, metric) {
  const measured = cell.metrics?.[metric];
  return measured ? { mean: measured[0], se: measured[1], n: measured[2] } : null;
}

/** An error as 1.08e-2, the form in which errors are compared; a ratio as 1.0023. @param {Estimate} estimate @param {MetricInfo} metric */
export function meanText({ mean }, metric) {
  return metric.lower_is_better === null ? mean.toFixed(4) : mean.toExponential(2);
}

/** Error as a multiple of the baseline's, 1 for the baseline itself; null where they cannot be compared. @param {Cell} cell @param {Cell | undefined} baseline @param {MetricInfo} metric @returns {number | null} */
export function ratioTo(cell, baseline, metric) {
  if (!baseline || metric.lower_is_better === null || baseline.reference !== cell.reference) return null;
  const own = estimateOf(cell, metric.name)?.mean;
  const other = estimateOf(baseline, metric.name)?.mean;
  return own !== undefined && other !== undefined && other > 0 && own > 0 ? own / other : null;
}

/**
 * Which cells of a line are best: among those of one reference that were rendered with equally many samples, the lowest
 * error and whatever cannot be told from it. A cell without company has no rank, and a replay, which shows a mistake, none
 * in any company.
 * @param {readonly Cell[]} cells @param {MetricInfo} metric @returns {Map<number, Rank>} by position
 */
export function ranks(cells, metric) {
  /** @type {Map<number, Rank>} */
  const found = new Map();
  if (metric.lower_is_better === null) return found;
  const sign = metric.lower_is_better ? 1 : -1;
  /** @type {Map<string, {cell: Cell, estimate: Estimate}[]>} */
  const groups = new Map();
  for (const cell of cells) {
    const estimate = estimateOf(cell, metric.name);
    if (!estimate || cell.reference === null || cell.reference === undefined || cell.replay) continue;
    const alike = `${cell.reference} ${cell.spp_actual}`;
    const group = groups.get(alike) ?? [];
    group.push({ cell, estimate });
    groups.set(alike, group);
  }
  for (const group of groups.values()) {
    const [best, ...rest] = group.sort((a, b) => sign * (a.estimate.mean - b.estimate.mean));
    if (!best || !rest.length) continue;
    found.set(best.cell.position, "best");
    for (const { cell, estimate } of rest) {
      const spread = Math.hypot(best.estimate.se ?? 0, estimate.se ?? 0);
      if (Math.abs(estimate.mean - best.estimate.mean) < TIED * spread) found.set(cell.position, "tied");
    }
  }
  return found;
}

/**
 * Along which of the two axes of a grid a best cell means something: along samplers or integrators, never along spp,
 * where the most samples always win, nor along scenes.
 * @param {string} rows name of the axis on the rows @param {string} cols
 * @returns {"row" | "column" | null}
 */
export function rankedAlong(rows, cols) {
  const methods = ["sampler", "integrator"];
  if (methods.includes(cols)) return "row";
  return methods.includes(rows) ? "column" : null;
}

/**
 * One end of the colours for all error maps that are shown, so that they can be compared: twice the largest mean error,
 * rounded so that it holds still while numbers come in. null while there is no number.
 * @param {Iterable<Cell>} cells @param {string} metric
 */
export function sharedMaximum(cells, metric) {
  let largest = 0;
  for (const cell of cells) largest = Math.max(largest, Math.abs(estimateOf(cell, metric)?.mean ?? 0));
  return largest > 0 && Number.isFinite(largest) ? niceCeil(2 * largest) : null;
}
