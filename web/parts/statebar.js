// @ts-check
/**
 * How far an experiment is, as one bar: its cells stacked by state, done ones first, what waits at the end.
 */
import { html } from "../vendor/preact-htm.js";
import { count, counted } from "../format.js";

/** @typedef {import("../api.js").State} State */

/** Every state in the order of the bar. @type {readonly State[]} */
export const STATES = ["done", "running", "failed", "cancelled", "paused", "queued"];

/**
 * The numbers of cells by state, references included, without the zeros.
 * @param {{cells: Record<string, number>, references: Record<string, number>}} experiment @returns {[State, number][]}
 */
export function byState({ cells, references }) {
  /** @type {[State, number][]} */
  const all = STATES.map((state) => [state, (cells[state] ?? 0) + (references[state] ?? 0)]);
  return all.filter(([, number]) => number);
}

/** @param {{experiment: {cells: Record<string, number>, references: Record<string, number>}}} props */
export function StateBar({ experiment }) {
  const parts = byState(experiment);
  const total = parts.reduce((sum, [, number]) => sum + number, 0);
  const words = parts.map(([state, number]) => `${count(number)} ${state}`).join(", ");
  return html`<div class="statebar" role="img" aria-label=${`${counted(total, "cell")}: ${words}`}>
    <div class="statebar-track">
      ${parts.map(([state, flexGrow]) => html`<span key=${state} data-state=${state} style=${{ flexGrow }}></span>`)}
    </div>
    <div class="statebar-legend" aria-hidden="true">
      ${parts.map(
        ([state, number]) => html`<span class="state" data-state=${state} key=${state}>${state}</span>
          <span class="number">${count(number)}</span>`,
      )}
    </div>
  </div>`;
}
