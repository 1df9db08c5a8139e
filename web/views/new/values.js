// @ts-check
/** The numbers of a grid: samples per pixel, pictures and their size, and what they are measured against. */
import { html, useState } from "../../vendor/preact-htm.js";
import { Icon } from "../../parts/icons.js";
import { entryOf } from "./catalog.js";
import { AS_THE_SCENE, Faults, onText, SelectField, TextField } from "./fields.js";
import { Parameters } from "./plugins.js";

/** @typedef {import("../../api.js").Fault} Fault */
/** @typedef {import("./catalog.js").Catalog} Catalog */
/** @typedef {import("./form.js").Form} Form */
/** @typedef {import("./form.js").Reference} Reference */
/** @typedef {(change: Partial<Form>) => void} Change */

const POWERS = Array.from({ length: 13 }, (_, power) => String(2 ** power)); // 1 to 4096
/** Enough points for a slope, evenly apart on a logarithmic axis. @type {readonly [string, readonly string[]][]} */
const LADDERS = [
  ["4, 16, 64, 256", ["4", "16", "64", "256"]],
  ["4, 8, 16 … 256", ["4", "8", "16", "32", "64", "128", "256"]],
];
const SIZES = ["64", "128", "256", "512"];

/** @param {{spp: readonly string[], onChange: (spp: readonly string[]) => void}} props */
export function Spp({ spp, onChange }) {
  const [text, setText] = useState("");
  const all = sorted([...POWERS, ...spp]);
  /** @param {readonly string[]} values */
  const set = (values) => onChange(sorted(values));
  /** @param {Event} event */
  const add = (event) => {
    event.preventDefault();
    const values = text.split(/[\s,;]+/).filter(Boolean);
    if (values.length) set([...spp, ...values]);
    setText("");
  };
  return html`<div class="chips">
      ${all.map(
        (one) => html`<button
          key=${one}
          class="chip number"
          type="button"
          aria-pressed=${spp.includes(one)}
          onClick=${() => set(spp.includes(one) ? spp.filter((other) => other !== one) : [...spp, one])}
        >
          ${one}
        </button>`,
      )}
    </div>
    <form class="row" onSubmit=${add}>
      <input
        type="text"
        class="short"
        inputmode="numeric"
        aria-label="Other samples per pixel"
        placeholder="other: 9, 25"
        value=${text}
        onInput=${onText(setText)}
        onBlur=${add}
      />
      <button class="button"><${Icon} name="plus" /> Add</button>
      <span class="spacer"></span>
      <span class="hint">or all of</span>
      ${LADDERS.map(
        ([title, values]) =>
          html`<button key=${title} type="button" class="button quiet" onClick=${() => set(values)}>${title}</button>`,
      )}
    </form>`;
}

/** Each once, by number; what is no number comes last. @param {readonly string[]} texts */
function sorted(texts) {
  /** @param {string} text */
  const order = (text) => (Number.isFinite(Number(text)) ? Number(text) : Number.MAX_VALUE);
  return [...new Set(texts)].sort((one, other) => order(one) - order(other));
}

/** @param {{form: Form, change: Change, catalog: Catalog, faults: readonly Fault[]}} props */
export function Pictures({ form, change, catalog, faults }) {
  const { replicates, width, height, depth, rfilter, colour } = form;
  const filter = entryOf(catalog.rfilters, rfilter.type);
  /** @type {(key: keyof Form) => (text: string) => void} */
  const set = (key) => (text) => change({ [key]: text.replace("−", "-") });
  /** @param {string} side */
  const square = (side) => change({ width: side, height: side });
  return html`<div class="fields">
    <${TextField}
      label="Replicates"
      field="replicates"
      numeric
      value=${replicates}
      faults=${faults}
      placeholder="4"
      hint="pictures of each cell with other seeds; their spread is the error bar"
      onInput=${set("replicates")}
    />
    <div class="field">
      <span class="label">Resolution</span>
      <div class="size">
        <${Side} label="Width in pixels" placeholder="width" value=${width} onInput=${set("width")} />
        <span class="muted">×</span>
        <${Side} label="Height in pixels" placeholder="height" value=${height} onInput=${set("height")} />
      </div>
      <div class="row">
        ${SIZES.map(
          (side) =>
            html`<button key=${side} type="button" class="link" onClick=${() => square(side)}>${side}²</button>`,
        )}
        <button type="button" class="link" onClick=${() => square("")}>${AS_THE_SCENE}</button>
      </div>
      <${Faults} of="resolution" faults=${faults} />
    </div>
    <${TextField}
      label="Longest path"
      field="max_depth"
      numeric
      value=${depth}
      faults=${faults}
      placeholder=${AS_THE_SCENE}
      hint="edges; -1 is unlimited"
      onInput=${set("depth")}
    />
    <div class="field">
      <${SelectField}
        label="Filter"
        value=${rfilter.type}
        options=${["", ...names(catalog.rfilters)]}
        onChange=${(/** @type {string} */ type) => change({ rfilter: { type, parameters: {} } })}
      />
      ${filter &&
      html`<${Parameters}
        entry=${filter}
        choice=${rfilter}
        onChange=${(/** @type {Form["rfilter"]} */ next) => change({ rfilter: next })}
      />`}
      <p class="hint">${filter?.line ?? "box where its file names none: pixels stay independent"}</p>
      <${Faults} of="rfilter" faults=${faults} />
    </div>
    <div class="field">
      <${SelectField} label="Colour" value=${colour} options=${["rgb", "spectral"]} onChange=${set("colour")} />
      <p class="hint">spectral follows wavelengths instead of three colours, and takes longer</p>
      <${Faults} of="colour" faults=${faults} />
    </div>
  </div>`;
}

/** @param {{label: string, placeholder: string, value: string, onInput: (text: string) => void}} props */
function Side({ label, placeholder, value, onInput }) {
  return html`<input
    type="text"
    class="tiny"
    inputmode="numeric"
    autocomplete="off"
    aria-label=${label}
    aria-describedby="fault-resolution"
    placeholder=${placeholder}
    value=${value}
    onInput=${onText(onInput)}
  />`;
}

/**
 * `own` is what the chosen scenes say of their references.
 * @param {{reference: Reference, own: readonly {name: string, reference: string}[], catalog: Catalog,
 *   onChange: (next: Reference) => void}} props
 */
export function ReferenceFields({ reference, own, catalog, onChange }) {
  const { wanted, spp, sampler, integrator } = reference;
  /** @type {(key: keyof Reference) => (value: string | boolean) => void} */
  const set = (key) => (value) => onChange({ ...reference, [key]: value });
  return html`<div class="row" role="group" aria-label="Reference">
      <button type="button" class="chip" aria-pressed=${wanted} onClick=${() => set("wanted")(true)}>render one</button>
      <button type="button" class="chip" aria-pressed=${!wanted} onClick=${() => set("wanted")(false)}>none</button>
      ${!wanted && html`<p class="hint">Without one there are pictures and times, but no errors and no curves.</p>`}
    </div>
    ${wanted &&
    html`<div class="fields">
      <${TextField}
        label="Samples per pixel"
        numeric
        value=${spp}
        placeholder=${AS_THE_SCENE}
        hint="in total, in two independent halves"
        onInput=${set("spp")}
      />
      <${SelectField} label="Sampler" value=${sampler} options=${["", ...names(catalog.samplers.filter(complete))]} onChange=${set("sampler")} />
      <${SelectField}
        label="Integrator"
        value=${integrator}
        options=${["", ...names(catalog.integrators)]}
        onChange=${set("integrator")}
      />
    </div>`}
    ${wanted &&
    !(integrator && sampler && spp) &&
    html`<ul class="hint">
      ${own.map(({ name, reference }) => html`<li key=${name}><b>${name}</b> has ${reference}</li>`)}
    </ul>`}`;
}

/** Whether a plugin can be named alone. @param {import("./catalog.js").Entry} entry */
function complete({ parameters }) {
  return !parameters.some(({ required }) => required);
}

/** @param {readonly {name: string}[]} entries */
function names(entries) {
  return entries.map(({ name }) => name);
}
