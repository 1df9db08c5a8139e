// @ts-check
/**
 * The bar that pictures, curves and table obey: which axes stand where, what the others are pinned to, what is hidden, which
 * metric counts and what it is compared with.
 */
import { html, useRef } from "../../vendor/preact-htm.js";
import { Pin, Segmented, Select } from "./controls.js";
import { baselines, isolating, toggling } from "./view.js";

/** @typedef {import("./view.js").View} View */
/** @typedef {typeof import("../../address.js").setParams} Set */

/** @param {{view: View, metrics: readonly import("../../api.js").MetricInfo[], set: Set}} props */
export function Bar({ view, metrics, set }) {
  const axes = view.axes.map((axis) => ({ value: axis.name, label: axis.title }));
  const { rows, cols } = view;
  return html`<div class="bar" role="group" aria-label="What is shown">
    <div class="bar-group">
      <${Segmented}
        label="metric"
        choices=${metrics.map((metric) => ({ value: metric.name, title: `${metric.formula}: ${metric.line}` }))}
        value=${view.metric.name}
        onChange=${(/** @type {string} */ metric) => set({ metric, scale: null })}
      />
      <${Baseline} view=${view} set=${set} />
    </div>
    <div class="bar-group">
      <${Select}
        label="rows"
        choices=${axes}
        value=${rows.name}
        onChange=${(/** @type {string} */ name) => set({ rows: name, cols: name === cols.name ? rows.name : cols.name })}
      />
      <button
        class="button quiet icon"
        title="Swap rows and columns"
        aria-label="Swap rows and columns"
        onClick=${() => set({ rows: cols.name, cols: rows.name })}
      >
        <svg width="16" height="16" viewBox="0 0 16 16" fill="none" stroke="currentColor" stroke-width="1.5" aria-hidden="true">
          <path d="M2.5 5.5h10M10 3l2.5 2.5L10 8M13.5 10.5h-10M6 8l-2.5 2.5L6 13" />
        </svg>
      </button>
      <${Select}
        label="columns"
        choices=${axes}
        value=${cols.name}
        onChange=${(/** @type {string} */ name) => set({ cols: name, rows: name === rows.name ? cols.name : rows.name })}
      />
    </div>
    ${view.pinned.map(
      (axis) => html`<div class="bar-group" key=${axis.name}>
        <${Pin}
          label=${axis.title}
          values=${axis.values}
          value=${view.at[axis.name]}
          onChange=${(/** @type {string} */ value) => set({ [axis.name]: value })}
        />
      </div>`,
    )}
    <${Filters} view=${view} set=${set} />
  </div>`;
}

/** @param {{view: View, set: Set}} props */
function Baseline({ view, set }) {
  const axes = baselines(view);
  if (!axes.length) return null;
  const value = view.baseline ? `${view.baseline.axis}:${view.baseline.value}` : "none";
  return html`<label class="control" title="The error under a picture is given as a multiple of this one's">
    <span class="control-label">relative to</span>
    <select
      value=${value}
      onChange=${(/** @type {{currentTarget: HTMLSelectElement}} */ event) => set({ base: event.currentTarget.value })}
    >
      ${axes.map(
        (axis) => html`<optgroup key=${axis.name} label=${axis.title}>
          ${axis.values.map((one) => html`<option key=${one} value=${`${axis.name}:${one}`}>${one}</option>`)}
        </optgroup>`,
      )}
      <option value="none">nothing</option>
    </select>
  </label>`;
}

/** Which values of each axis are shown, in a panel of its own. @param {{view: View, set: Set}} props */
function Filters({ view, set }) {
  const button = useRef(/** @type {HTMLButtonElement | null} */ (null));
  const panel = useRef(/** @type {HTMLDivElement | null} */ (null));
  const hidden = [...view.hidden.values()].reduce((sum, values) => sum + values.size, 0);
  const axes = view.axes.filter((axis) => axis.values.length > 1);
  if (!axes.length) return null;

  /** @param {{newState: string}} event */
  function placed(event) {
    if (event.newState !== "open" || !button.current || !panel.current) return;
    const at = button.current.getBoundingClientRect();
    const { style, offsetWidth } = panel.current;
    style.top = `${at.bottom + 6}px`;
    style.left = `${Math.max(8, at.right - offsetWidth)}px`;
    style.maxHeight = `${innerHeight - at.bottom - 24}px`;
  }

  return html`<button ref=${button} class="button bar-filter" aria-haspopup="dialog" onClick=${() => panel.current?.togglePopover()}>
      Filter${hidden > 0 && html` <span class="tag number">${hidden} hidden</span>`}
    </button>
    <div class="filters" popover="auto" ref=${panel} role="dialog" aria-label="Filter" onToggle=${placed}>
      ${axes.map(
        (axis) => html`<fieldset key=${axis.name}>
          <legend>
            <b>${axis.title}</b>
            <button class="link" disabled=${!view.hidden.get(axis.name)?.size} onClick=${() => set({ [`hide.${axis.name}`]: null })}>all</button>
          </legend>
          ${axis.values.map(
            (value) => html`<p key=${value}>
              <label>
                <input type="checkbox" checked=${!view.hidden.get(axis.name)?.has(value)} onChange=${() => set(toggling(view, axis.name, value))} />
                <span class="name">${value}</span>
              </label>
              <button class="link" onClick=${() => set(isolating(view, axis.name, value))}>only</button>
            </p>`,
          )}
        </fieldset>`,
      )}
    </div>`;
}
