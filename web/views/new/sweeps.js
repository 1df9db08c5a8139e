// @ts-check
/** Sweeps in the form: a parameter of the scene, its values, and where it applies; as many as are wanted. */
import { html, useEffect, useState } from "../../vendor/preact-htm.js";
import { scenes as api } from "../../api.js";
import { Icon } from "../../parts/icons.js";
import { onText } from "./fields.js";
import { scenesOf } from "./scenes.js";

/** @typedef {import("../../api.js").Scene} Scene */
/** @typedef {import("../../api.js").SceneParameter} SceneParameter */
/** @typedef {import("./form.js").SceneChoice} SceneChoice */
/** @typedef {import("./form.js").Sweep} Sweep */

const EMPTY = { parameter: "", values: "", scenes: [] };
const OFFERED = 500; // names in the list below a field; a scene of many objects has thousands

/**
 * @param {{sweeps: readonly Sweep[], scenes: readonly SceneChoice[], known: readonly Scene[], colour: string,
 *   onChange: (next: readonly Sweep[]) => void}} props
 */
export function Sweeps({ sweeps, scenes, known, colour, onChange }) {
  const offered = useParameters(sweeps.length > 0 ? scenesOf(scenes, known).map(({ digest }) => digest) : [], colour);
  /** @param {number} at @param {Partial<Sweep>} change */
  const set = (at, change) => onChange(sweeps.map((one, index) => (index === at ? { ...one, ...change } : one)));
  return html`${sweeps.map(
      (sweep, index) => html`<div class="sweep" key=${index} role="group" aria-label=${`Sweep ${index + 1}`}>
        <${Field}
          title="Parameter"
          list="scene-parameters"
          placeholder="sphere.bsdf.nu"
          value=${sweep.parameter}
          onChange=${(/** @type {string} */ parameter) => set(index, { parameter })}
        />
        <${Field}
          title="Values"
          placeholder=${nowText(offered, sweep.parameter) || "10, 100, 1000"}
          value=${sweep.values}
          onChange=${(/** @type {string} */ values) => set(index, { values })}
        />
        <button
          class="button quiet icon"
          type="button"
          title="Remove this sweep"
          aria-label=${`Remove sweep ${index + 1}`}
          onClick=${() => onChange(sweeps.filter((_, other) => other !== index))}
        >
          <${Icon} name="close" />
        </button>
        ${scenes.length > 1 && html`<${Where} sweep=${sweep} scenes=${scenes} onChange=${(/** @type {string[]} */ next) => set(index, { scenes: next })} />`}
      </div>`,
    )}
    <datalist id="scene-parameters">
      ${offered.slice(0, OFFERED).map(({ name, kind, now }) => html`<option key=${name} value=${name}>${now === null ? kind : `now ${JSON.stringify(now)}`}</option>`)}
    </datalist>
    <div class="row">
      <button class="button" type="button" onClick=${() => onChange([...sweeps, EMPTY])}><${Icon} name="plus" /> Add a sweep</button>
      <p class="hint">Numbers, or colours as [0.8, 0.2, 0.1]. Several sweeps multiply; every combination gets a reference of its own.</p>
    </div>`;
}

/**
 * @param {{title: string, value: string, placeholder: string, list?: string, onChange: (text: string) => void}} props
 */
function Field({ title, value, placeholder, list, onChange }) {
  return html`<label>
    <span class="label">${title}</span>
    <input
      type="text"
      list=${list}
      spellcheck="false"
      autocomplete="off"
      placeholder=${placeholder}
      aria-describedby="fault-sweep"
      value=${value}
      onInput=${onText(onChange)}
    />
  </label>`;
}

/** Which of the scenes a sweep applies to; none chosen means all. @param {{sweep: Sweep, scenes: readonly SceneChoice[], onChange: (next: string[]) => void}} props */
function Where({ sweep, scenes, onChange }) {
  /** @param {string} name */
  const toggled = (name) => (sweep.scenes.includes(name) ? sweep.scenes.filter((one) => one !== name) : [...sweep.scenes, name]);
  return html`<div class="chips">
    <span class="hint">in</span>
    <button class="chip" type="button" aria-pressed=${sweep.scenes.length === 0} onClick=${() => onChange([])}>every scene</button>
    ${scenes.map(
      ({ name }) =>
        html`<button key=${name} class="chip" type="button" aria-pressed=${sweep.scenes.includes(name)} onClick=${() => onChange(toggled(name))}>${name}</button>`,
    )}
  </div>`;
}

/** What can be swept in any of some scenes; empty until the server has told. @param {readonly string[]} digests @param {string} colour */
function useParameters(digests, colour) {
  const [found, setFound] = useState(/** @type {readonly SceneParameter[]} */ ([]));
  useEffect(() => {
    let wanted = true;
    const asked = digests.map((digest) => api.parameters(digest, colour).catch(() => [])); // a help, not a need
    void Promise.all(asked).then((lists) => {
      if (wanted) setFound([...new Map(lists.flat().map((one) => [one.name, one])).values()]);
    });
    return () => {
      wanted = false;
    };
  }, [digests.join(), colour]);
  return found;
}

/** What the scene's file says, as a hint. @param {readonly SceneParameter[]} offered @param {string} parameter */
function nowText(offered, parameter) {
  const now = offered.find(({ name }) => name === parameter)?.now ?? null;
  return now === null ? "" : `now ${JSON.stringify(now)}`;
}
