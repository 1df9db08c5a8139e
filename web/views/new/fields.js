// @ts-check
/** Small parts of the form: a titled section, a text field, and the faults beside them. */
import { html } from "../../vendor/preact-htm.js";

/** @typedef {import("../../vendor/preact-htm.js").Child} Child */
/** @typedef {import("../../api.js").Fault} Fault */

/** What in the form shows a fault of which key of a grid. @type {Record<string, string>} */
const SHOWN_AT = { scene: "scenes", crop: "scenes" };

/** What an empty field says: each scene has its own. */
export const AS_THE_SCENE = "as the scene";

/** The keys of a grid that the form has a field for. */
export const FIELDS = [
  "name",
  "scenes",
  "samplers",
  "integrators",
  "spp",
  "sweep",
  "replicates",
  "resolution",
  "max_depth",
  "rfilter",
  "colour",
  "reference",
];

/**
 * A handler that passes on what was typed or chosen.
 * @param {(text: string) => void} set @returns {(event: {currentTarget: {value: string}}) => void}
 */
export function onText(set) {
  return (event) => set(event.currentTarget.value);
}

/** The field of the form that shows a fault, null for none. @param {Fault} fault */
export function placeOf({ field }) {
  const key = field?.split(/[.[]/)[0] ?? "";
  const shown = SHOWN_AT[key] ?? key;
  return FIELDS.includes(shown) ? shown : null;
}

/** @param {{of: string, faults: readonly Fault[]}} props */
export function Faults({ of: field, faults }) {
  const own = faults.filter((fault) => placeOf(fault) === field);
  return html`<div id=${`fault-${field}`} class="faults-here" role="status">
    ${own.map(({ detail }) => html`<p class="fault" key=${detail}>${detail}</p>`)}
  </div>`;
}

/**
 * @param {{id: string, title: string, hint?: Child, faults: readonly Fault[], aside?: Child, children?: Child}} props
 */
export function Section({ id, title, hint, faults, aside, children }) {
  return html`<section class="form-section panel" id=${id} aria-labelledby=${`${id}-title`}>
    <div class="form-title">
      <h2 id=${`${id}-title`}>${title}</h2>
      <p class="hint">${hint}</p>
      ${aside}
    </div>
    ${children}
    <${Faults} of=${id} faults=${faults} />
  </section>`;
}

/**
 * One line of text with its label, and its faults if it has a field of its own.
 * @param {{label: string, value: string, onInput: (value: string) => void, field?: string, faults?: readonly Fault[],
 *   placeholder?: string, hint?: Child, numeric?: boolean, wide?: boolean}} props
 */
export function TextField({ label, value, onInput, field, faults = [], placeholder, hint, numeric, wide }) {
  const wrong = field !== undefined && faults.some((fault) => placeOf(fault) === field);
  return html`<div class="field">
    <label>
      <span class="label">${label}</span>
      <input
        type="text"
        class=${wide ? "wide" : "short"}
        inputmode=${numeric ? "numeric" : "text"}
        autocomplete="off"
        value=${value}
        placeholder=${placeholder}
        aria-invalid=${wrong}
        aria-describedby=${field ? `fault-${field}` : null}
        onInput=${onText(onInput)}
      />
    </label>
    ${hint && html`<p class="hint">${hint}</p>`} ${field && html`<${Faults} of=${field} faults=${faults} />`}
  </div>`;
}

/**
 * The option "" leaves it to each scene.
 * @param {{label: string, value: string, options: readonly string[], onChange: (value: string) => void}} props
 */
export function SelectField({ label, value, options, onChange }) {
  const known = options.includes(value) ? options : [value, ...options];
  return html`<div class="field">
    <label>
      <span class="label">${label}</span>
      <select value=${value} onChange=${onText(onChange)}>
        ${known.map((one) => html`<option key=${one} value=${one} selected=${one === value}>${one || AS_THE_SCENE}</option>`)}
      </select>
    </label>
  </div>`;
}
