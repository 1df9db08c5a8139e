// @ts-check
/**
 * Short notes at the foot of the page: what was done, with the way back, or what failed.
 */
import { html, useEffect, useState } from "../vendor/preact-htm.js";
import { Icon } from "./icons.js";

/**
 * @typedef {object} Note
 * @property {string} text
 * @property {{label: string, run: () => void}} [action]
 * @property {"plain" | "bad"} [tone]
 */

const SHOWN_MS = 10_000; // long enough to read, think, and reach "Undo"
const MOST = 3;

/** @type {(Note & {id: number})[]} */
let notes = [];
let made = 0;
/** @type {Set<() => void>} */
const watchers = new Set();

/** @param {typeof notes} next */
function put(next) {
  notes = next;
  watchers.forEach((watcher) => watcher());
}

/** Shows a note for a while. @param {Note} note */
export function toast(note) {
  const id = ++made;
  put([...notes, { ...note, id }].slice(-MOST));
  setTimeout(() => dismiss(id), SHOWN_MS);
}

/**
 * Runs what the user asked for and says what went wrong with it.
 * @template T @param {Promise<T>} work @returns {Promise<T | undefined>}
 */
export async function told(work) {
  try {
    return await work;
  } catch (error) {
    toast({ text: error instanceof Error ? error.message : String(error), tone: "bad" });
    return undefined;
  }
}

/** @param {number} id */
function dismiss(id) {
  put(notes.filter((note) => note.id !== id));
}

/**
 * Notes, and above them what else the whole page has to say.
 * @param {{children?: import("../vendor/preact-htm.js").Child}} props
 */
export function Toasts({ children }) {
  const [, redraw] = useState(0);
  useEffect(() => {
    const watcher = () => redraw((count) => count + 1);
    watchers.add(watcher);
    return () => void watchers.delete(watcher);
  }, []);
  return html`<div class="toasts" role="status" aria-live="polite">
    ${children}
    ${notes.map(
      ({ id, text, action, tone }) =>
        html`<div class=${`toast ${tone ?? ""}`} key=${id}>
          <span class="toast-text">${text}</span>
          ${action &&
          html`<button
            class="button quiet"
            onClick=${() => {
              dismiss(id);
              action.run();
            }}
          >
            ${action.label}
          </button>`}
          <button class="button quiet icon" aria-label="Dismiss" onClick=${() => dismiss(id)}>
            <${Icon} name="close" />
          </button>
        </div>`,
    )}
  </div>`;
}
