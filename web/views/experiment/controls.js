// @ts-check
/** The small controls of the experiment page: one of a few values, one of many, and a number on a scale. */
import { html, useRef } from "../../vendor/preact-htm.js";

/** @typedef {{value: string, label?: string, title?: string}} Choice */

const FEW = 6; // values that stand side by side; more become a slider or a list
const FEW_LETTERS = 54; // of all their labels together

let made = 0; // groups so far: radio buttons belong together by name

/**
 * Buttons of which one is on: radio buttons to the keyboard and to a screen reader.
 * @param {{label: string, choices: readonly Choice[], value: string, onChange: (value: string) => void, shown?: boolean}} props
 * shown: whether the label is visible
 */
export function Segmented({ label, choices, value, onChange, shown = false }) {
  const name = useRef("");
  name.current ||= `segmented-${++made}`;
  return html`<fieldset class="segmented">
    <legend class=${shown ? "control-label" : "unseen"}>${label}</legend>
    <div class="segmented-track">
      ${choices.map(
        (choice) =>
          html`<label key=${choice.value} title=${choice.title ?? null}>
            <input type="radio" name=${name.current} checked=${choice.value === value} onChange=${() => onChange(choice.value)} />
            <span class="name">${choice.label ?? choice.value}</span>
          </label>`,
      )}
    </div>
  </fieldset>`;
}

/** @param {{label: string, choices: readonly Choice[], value: string, onChange: (value: string) => void, title?: string}} props */
export function Select({ label, choices, value, onChange, title }) {
  return html`<label class="control" title=${title ?? null}>
    <span class="control-label">${label}</span>
    <select
      value=${value}
      onChange=${(/** @type {{currentTarget: HTMLSelectElement}} */ event) => onChange(event.currentTarget.value)}
    >
      ${choices.map((choice) => html`<option key=${choice.value} value=${choice.value}>${choice.label ?? choice.value}</option>`)}
    </select>
  </label>`;
}

/**
 * The value that an axis is pinned to: side by side where they are few and short, a slider where they are numbers, else
 * a list.
 * @param {{label: string, values: readonly string[], value: string, onChange: (value: string) => void}} props
 */
export function Pin({ label, values, value, onChange }) {
  const letters = values.reduce((sum, one) => sum + one.length + 3, 0);
  if (values.length <= FEW && letters <= FEW_LETTERS) {
    return html`<${Segmented} label=${label} choices=${values.map((one) => ({ value: one }))} value=${value} onChange=${onChange} shown />`;
  }
  if (values.every((one) => Number.isFinite(Number(one)))) {
    return html`<${Slider}
      label=${label}
      min=${0}
      max=${values.length - 1}
      step=${1}
      value=${values.indexOf(value)}
      text=${value}
      onInput=${(/** @type {number} */ place) => onChange(values[place] ?? value)}
    />`;
  }
  return html`<${Select} label=${label} choices=${values.map((one) => ({ value: one }))} value=${value} onChange=${onChange} />`;
}

/** @param {{label: string, min: number, max: number, step: number, value: number, text: string, onInput: (value: number) => void, title?: string, onReset?: () => void}} props */
export function Slider({ label, min, max, step, value, text, onInput, title, onReset }) {
  return html`<label class="control" title=${title ?? null}>
    <span class="control-label">${label}</span>
    <input
      type="range"
      min=${min}
      max=${max}
      step=${step}
      value=${value}
      aria-valuetext=${text}
      onInput=${(/** @type {{currentTarget: HTMLInputElement}} */ event) => onInput(Number(event.currentTarget.value))}
      onDblClick=${onReset ?? null}
    />
    <output class="number control-value">${text}</output>
  </label>`;
}
