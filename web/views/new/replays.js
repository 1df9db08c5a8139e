// @ts-check
/** Replays to choose from, folded away: samplers that show a published mistake, beside those that are right. */
import { html } from "../../vendor/preact-htm.js";
import { entryOf, isReplay, replayOf } from "./catalog.js";
import { label } from "./form.js";

/** @typedef {import("./catalog.js").Entry} Entry */
/** @typedef {import("./form.js").Choice} Choice */

/** @param {{entries: readonly Entry[], chosen: readonly Choice[], onChange: (chosen: readonly Choice[]) => void}} props */
export function Replays({ entries, chosen, onChange }) {
  const taken = chosen.filter((one) => isReplay(entryOf(entries, one.type), one) && replayOf(entryOf(entries, one.type)));
  const offered = entries.flatMap(offers);
  if (!offered.length) return null;
  const names = new Set(offered.map(({ choice }) => label(choice)));
  const others = taken.filter((one) => !names.has(label(one))).map((choice) => ({ choice, meaning: "with parameters of its own" }));
  return html`<details class="replays" open=${taken.length > 0}>
    <summary>
      Replays: published mistakes, to see what they do
      ${taken.length > 0 && html`<span class="hint number">${taken.length} chosen</span>`}
    </summary>
    <p class="hint">
      Each shows one mistake of a published study on purpose. Its curve is labelled, dashed, and drawn at the samples that were asked.
    </p>
    <ul class="plugins">
      ${[...offered, ...others].map(({ choice, meaning }) => {
        const text = label(choice);
        const on = taken.some((one) => label(one) === text);
        const toggle = () => onChange(on ? chosen.filter((one) => label(one) !== text) : [...chosen, choice]);
        return html`<li class=${`plugin ${on ? "on" : ""}`} key=${text}>
          <label class="plugin-head">
            <input type="checkbox" checked=${on} onChange=${toggle} />
            <strong>${text}</strong>
            <span class="hint">${meaning}</span>
          </label>
        </li>`;
      })}
    </ul>
  </details>`;
}

/** What there is to choose of one sampler. @param {Entry} entry @returns {{choice: Choice, meaning: string}[]} */
function offers(entry) {
  const parameter = replayOf(entry);
  if (!parameter) return [];
  return parameter.replays.map((option) => ({
    choice: { type: entry.name, parameters: { [parameter.name]: option } },
    meaning: parameter.meanings[parameter.options.indexOf(option)] ?? "",
  }));
}
