// @ts-check
/** The keyboard help: what every registered shortcut does, and those of the viewer where it is not open. */
import { html } from "../vendor/preact-htm.js";
import { registered } from "../keys.js";
import { Dialog } from "../parts/dialog.js";
import { Icon } from "../parts/icons.js";
import { shortcuts as viewerShortcuts } from "../viewer/actions.js";

/** @typedef {import("../keys.js").Shortcut} Shortcut */

/** The keys of the viewer can be looked up anywhere: they are a convention of such tools (tev and its kin). */
const VIEWER = "Viewer";
/** @type {readonly Shortcut[]} */
const VIEWER_KEYS = viewerShortcuts(/** @type {any} */ ({})); // listed, never run

/** @param {{onClose: () => void}} props */
export function Help({ onClose }) {
  /** @type {Map<string, readonly Shortcut[]>} */
  const groups = new Map();
  for (const { title, shortcuts } of registered()) groups.set(title, [...(groups.get(title) ?? []), ...shortcuts]);
  if (!groups.has(VIEWER)) groups.set(VIEWER, VIEWER_KEYS);
  return html`<${Dialog} title="Keyboard shortcuts" onClose=${onClose} wide>
    <button class="button quiet icon dialog-close" aria-label="Close" onClick=${onClose}>
      <${Icon} name="close" />
    </button>
    <div class="shortcuts">
      ${[...groups].map(
        ([title, shortcuts]) => html`<section key=${title}>
          <h3>${title}</h3>
          ${title === VIEWER && html`<p class="hint">These act while a picture has the focus.</p>`}
          <dl>
            ${shortcuts.map(
              (shortcut) => html`<div key=${shortcut.does}>
                <dt>${written(shortcut)}</dt>
                <dd>${shortcut.does}</dd>
              </div>`,
            )}
          </dl>
        </section>`,
      )}
    </div>
    <p class="hint">Shortcuts rest while you type.</p>
  <//>`;
}

/** @type {Record<string, string>} */
const NAMES = { ArrowLeft: "←", ArrowRight: "→", ArrowUp: "↑", ArrowDown: "↓", Escape: "Esc", " ": "Space" };

/** Keys as caps, with what joins them as plain text. @param {Shortcut} shortcut */
function written({ keys, shown }) {
  const text = shown ?? [keys ?? []].flat().join(" / ");
  return text.split(/( \/ | … |, )/).map((part) => {
    if (/^( \/ | … |, )$/.test(part)) return html`<span class="muted">${part}</span>`;
    if (/^[a-z]{2,}$/.test(part)) return html`<span>${part}</span>`;
    return part.split(/[+ ]/).map((key, index) => [index > 0 && "\u200a", html`<kbd>${NAMES[key] ?? key}</kbd>`]);
  });
}
