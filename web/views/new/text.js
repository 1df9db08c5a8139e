// @ts-check
/** The grid as the text of a TOML file: for who has one, or needs what the form has no field for. */
import { html, useRef } from "../../vendor/preact-htm.js";
import { Icon } from "../../parts/icons.js";

/**
 * @param {{text: string, onText: (text: string) => void, fromForm: string | null, linkable: boolean}} props
 * `fromForm`: the text of what the form holds, null while unknown
 */
export function GridEditor({ text, onText, fromForm, linkable }) {
  const input = useRef(/** @type {HTMLInputElement | null} */ (null));
  async function open() {
    const file = input.current?.files?.[0];
    if (file) onText(await file.text());
    if (input.current) input.current.value = "";
  }
  /** @param {DragEvent} event */
  async function drop(event) {
    const file = event.dataTransfer?.files[0];
    if (!file) return;
    event.preventDefault();
    onText(await file.text());
  }
  return html`<section class="form-section panel">
    <div class="form-title">
      <h2>The grid</h2>
      <p class="hint">The same text as for <code>./dartboard run grid.toml</code></p>
      <input ref=${input} class="unseen" type="file" tabindex="-1" aria-hidden="true" accept=".toml" onChange=${open} />
      <button class="button" type="button" onClick=${() => input.current?.click()}>
        <${Icon} name="upload" /> Open a file…
      </button>
      ${fromForm !== null &&
      fromForm !== text &&
      html`<button class="button" type="button" title="Replaces this text" onClick=${() => onText(fromForm)}>
        Fill in from the form
      </button>`}
    </div>
    <textarea
      class="editor"
      spellcheck="false"
      autocapitalize="off"
      aria-label="Grid as TOML"
      placeholder=${'scenes = ["cornell_box"]\nsamplers = ["independent", "stratified"]\nspp = [4, 16, 64]'}
      value=${text}
      onInput=${(/** @type {{currentTarget: {value: string}}} */ event) => onText(event.currentTarget.value)}
      onDrop=${drop}
    ></textarea>
    <p class="hint">Scenes by name: built in, or uploaded in the form.</p>
    ${!linkable && html`<p class="hint">This text is too long for a link; it is lost when the page is left.</p>`}
  </section>`;
}
