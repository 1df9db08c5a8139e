// @ts-check
/**
 * Samplers or integrators to choose from. One plugin may be taken several times with different parameters: each is a
 * variant, a curve of its own.
 */
import { html } from "../../vendor/preact-htm.js";
import { Icon } from "../../parts/icons.js";
import { allowed, entryOf } from "./catalog.js";
import { onText } from "./fields.js";
import { label } from "./form.js";

/** @typedef {import("./catalog.js").Entry} Entry */
/** @typedef {import("./catalog.js").Parameter} Parameter */
/** @typedef {import("./form.js").Choice} Choice */
/** @typedef {(chosen: readonly Choice[]) => void} OnChange */

/** @param {{entries: readonly Entry[], chosen: readonly Choice[], onChange: OnChange}} props */
export function Plugins({ entries, chosen, onChange }) {
  const unknown = chosen.filter(({ type }) => !entryOf(entries, type));
  return html`<ul class="plugins">
    ${entries.map((entry) => html`<${Plugin} key=${entry.name} ...${{ entry, entries, chosen, onChange }} />`)}
    ${unknown.map(
      (one) => html`<li class="plugin" key=${label(one)}>
        <label class="plugin-head">
          <input type="checkbox" checked onChange=${() => onChange(chosen.filter((other) => other !== one))} />
          <strong>${label(one)}</strong><span class="hint">this server does not know it</span>
        </label>
      </li>`,
    )}
  </ul>`;
}

/** @param {{entry: Entry, entries: readonly Entry[], chosen: readonly Choice[], onChange: OnChange}} props */
function Plugin({ entry, entries, chosen, onChange }) {
  const variants = chosen.filter(({ type }) => entryOf(entries, type) === entry);
  const rest = chosen.filter((one) => !variants.includes(one));
  const toggle = () => onChange(variants.length ? rest : inserted(entries, rest, { type: entry.name, parameters: {} }));
  const another = () => {
    const last = variants.at(-1);
    onChange(chosen.flatMap((one) => (one === last ? [one, varied(entry, one)] : [one])));
  };
  return html`<li class=${`plugin ${variants.length ? "on" : ""}`}>
    <label class="plugin-head">
      <input type="checkbox" checked=${variants.length > 0} onChange=${toggle} />
      <strong>${entry.name}</strong>
      <span class="hint">${entry.line}</span>
      ${entry.rounding && entry.rounding !== "every spp" && html`<span class="tag">rounds ${entry.rounding}</span>`}
    </label>
    ${variants.length > 0 &&
    entry.parameters.length > 0 &&
    html`<div class="variants">
      ${variants.map(
        (variant, index) => html`<${Variant}
          key=${index}
          entry=${entry}
          variant=${variant}
          first=${index === 0}
          onChange=${(/** @type {Choice} */ next) => onChange(chosen.map((one) => (one === variant ? next : one)))}
          onRemove=${variants.length > 1 ? () => onChange(chosen.filter((one) => one !== variant)) : undefined}
        />`,
      )}
      <button class="button quiet small" type="button" onClick=${another}>
        <${Icon} name="plus" /> Compare with other parameters
      </button>
    </div>`}
  </li>`;
}

/**
 * The new choice before the first that the catalog has later: the order of the catalog, without sorting what is there.
 * @param {readonly Entry[]} entries @param {readonly Choice[]} chosen @param {Choice} one
 */
function inserted(entries, chosen, one) {
  const names = entries.map(({ name }) => name);
  const later = chosen.findIndex(({ type }) => names.indexOf(type) > names.indexOf(one.type));
  return later < 0 ? [...chosen, one] : [...chosen.slice(0, later), one, ...chosen.slice(later)];
}

/**
 * Another one like `one`: a switch is turned, since two alike would be one.
 * @param {Entry} entry @param {Choice} one @returns {Choice}
 */
function varied(entry, one) {
  const first = entry.parameters[0];
  if (first?.type !== "bool") return { ...one };
  const { [first.name]: now = String(first.default), ...others } = one.parameters;
  const next = String(now !== "true");
  return { ...one, parameters: next === String(first.default) ? others : { ...others, [first.name]: next } };
}

/**
 * @param {{entry: Entry, variant: Choice, first: boolean, onChange: (next: Choice) => void,
 *   onRemove?: () => void}} props
 */
function Variant({ entry, variant, first, onChange, onRemove }) {
  return html`<div class="variant" role="group" aria-label=${label(variant)}>
    <${Parameters} entry=${entry} choice=${variant} onChange=${onChange} explained=${first} />
    ${onRemove &&
    html`<button
      class="button quiet icon variant-remove"
      type="button"
      title="Remove this variant"
      aria-label=${`Remove ${label(variant)}`}
      onClick=${onRemove}
    >
      <${Icon} name="close" />
    </button>`}
  </div>`;
}

/**
 * The parameters of a choice as fields; an empty one is the default.
 * @param {{entry: Entry, choice: Choice, onChange: (next: Choice) => void, explained?: boolean}} props
 */
export function Parameters({ entry, choice, onChange, explained = true }) {
  /** @type {(name: string, text: string) => void} */
  const set = (name, text) => {
    const { [name]: _, ...others } = choice.parameters;
    const usual = entry.parameters.find((parameter) => parameter.name === name)?.default;
    onChange({ ...choice, parameters: text === "" || text === String(usual) ? others : { ...others, [name]: text } });
  };
  return html`<div class="parameters">
    ${entry.parameters.map((parameter) => {
      const { name, type, line } = parameter;
      const text = choice.parameters[name] ?? "";
      const usual = parameter.default === null ? "as the scene" : String(parameter.default);
      const about = [line, allowed(parameter)].filter(Boolean).join("; ");
      return html`<label class="parameter" key=${name} title=${about}>
        <span class="parameter-line">
          ${type === "bool" &&
          html`<input
            type="checkbox"
            checked=${(text || usual) === "true"}
            onChange=${() => set(name, String((text || usual) !== "true"))}
          />`}
          <code>${name}</code>
          ${type !== "bool" &&
          html`<input
            type="text"
            inputmode=${type === "str" ? "text" : "decimal"}
            autocomplete="off"
            placeholder=${usual}
            value=${text}
            onInput=${onText((typed) => set(name, typed.trim()))}
          />`}
        </span>
        ${explained && html`<span class="hint">${line}</span>`}
      </label>`;
    })}
  </div>`;
}
