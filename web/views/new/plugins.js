// @ts-check
/**
 * Samplers or integrators to choose from. One plugin may be taken several times with different parameters: each is a
 * variant, a curve of its own.
 */
import { html } from "../../vendor/preact-htm.js";
import { Icon } from "../../parts/icons.js";
import { allowed, entryOf, isReplay, replayOf } from "./catalog.js";
import { onText } from "./fields.js";
import { label } from "./form.js";
import { PointFileField } from "./pointfile.js";

/** @typedef {import("./catalog.js").Entry} Entry */
/** @typedef {import("./catalog.js").Parameter} Parameter */
/** @typedef {import("./form.js").Choice} Choice */
/** @typedef {import("./form.js").Upload} Upload */
/** `points`: where a file was sent just now, all of them. @typedef {(chosen: readonly Choice[], points?: readonly Upload[]) => void} OnChange */
/** @typedef {(next: Choice, points?: readonly Upload[]) => void} OnChoice */

/** Replays are chosen elsewhere (`replays.js`). @param {{entries: readonly Entry[], chosen: readonly Choice[], onChange: OnChange, points?: readonly Upload[]}} props */
export function Plugins({ entries, chosen, onChange, points = [] }) {
  const unknown = chosen.filter(({ type }) => !entryOf(entries, type));
  const sources = [...new Set(entries.map(({ source }) => source))];
  return html`<ul class="plugins">
    ${sources.map((source) => [
      sources.length > 1 && html`<li class="plugins-source" key=${source}>${source}</li>`,
      ...entries
        .filter((entry) => entry.source === source)
        .map((entry) => html`<${Plugin} key=${entry.name} ...${{ entry, entries, chosen, onChange, points }} />`),
    ])}
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

/** @param {{entry: Entry, entries: readonly Entry[], chosen: readonly Choice[], onChange: OnChange, points: readonly Upload[]}} props */
function Plugin({ entry, entries, chosen, onChange, points }) {
  const folded = replayOf(entry);
  const own = chosen.filter(({ type }) => entryOf(entries, type) === entry);
  const variants = folded ? own.filter((one) => !isReplay(entry, one)) : own;
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
      ${entry.limit && html`<span class="tag">at most ${entry.limit} spp</span>`}
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
          points=${points}
          onChange=${/** @type {OnChoice} */ ((next, sent) => onChange(chosen.map((one) => (one === variant ? next : one)), sent))}
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
 * @param {{entry: Entry, variant: Choice, first: boolean, onChange: OnChoice, points: readonly Upload[],
 *   onRemove?: () => void}} props
 */
function Variant({ entry, variant, first, onChange, onRemove, points }) {
  return html`<div class="variant" role="group" aria-label=${label(variant)}>
    <${Parameters} ...${{ entry, choice: variant, onChange, explained: first, points }} />
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
 * @param {{entry: Entry, choice: Choice, onChange: OnChoice, explained?: boolean, points?: readonly Upload[]}} props
 */
export function Parameters({ entry, choice, onChange, explained = true, points = [] }) {
  /** @type {(name: string, text: string, sent?: readonly Upload[]) => void} */
  const set = (name, text, sent) => {
    const { [name]: _, ...others } = choice.parameters;
    const usual = entry.parameters.find((parameter) => parameter.name === name)?.default;
    onChange({ ...choice, parameters: text === "" || text === String(usual) ? others : { ...others, [name]: text } }, sent);
  };
  return html`<div class="parameters">
    ${entry.parameters.map((parameter) => {
      const { name, type, line, options, replays } = parameter;
      if (parameter === replayOf(entry)) return null;
      const text = choice.parameters[name] ?? "";
      if (parameter.required) {
        /** @param {Upload} file */
        const sent = ({ name: called, digest }) =>
          set(name, called, [...points.filter((one) => one.name !== called), { name: called, digest }]);
        return html`<div class="parameter" key=${name}>
          <${PointFileField} value=${text} points=${points} onSent=${sent} />
        </div>`;
      }
      const usual = parameter.default === null ? parameter.unset : String(parameter.default);
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
          ${options.length > 0 &&
          html`<select value=${text || usual} onChange=${onText((picked) => set(name, picked))}>
            ${options.map(
              (option, at) => html`<option key=${option} value=${option} selected=${option === (text || usual)} title=${parameter.meanings[at]}>
                ${option}${replays.includes(option) && " (replay)"}
              </option>`,
            )}
          </select>`}
          ${type !== "bool" &&
          options.length === 0 &&
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
