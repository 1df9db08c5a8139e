// @ts-check
/**
 * Keyboard shortcuts: each view registers its own, and the help overlay lists what is registered.
 *
 * A key acts only if nobody types, no dialog is open (unless it has `data-keys`), and no key of the browser is meant.
 * The view that registered last comes first, so a view's key wins over the page's.
 */
import { useEffect, useRef } from "./vendor/preact-htm.js";

/**
 * @typedef {object} Shortcut
 * @property {string | readonly string[]} [keys] "e", "Shift+e", "Ctrl+k", "?", "ArrowLeft", "Escape"; several act alike
 * @property {string} [shown] how the help writes the keys; default: `keys`
 * @property {string} does
 * @property {(event: KeyboardEvent) => void} [run] without it the row is only listed
 */
/** @typedef {{title: string, shortcuts: readonly Shortcut[], enabled: boolean}} Group */

/** @type {Group[]} */
const groups = [];

/** Every registered group: those of the view, then those of the page around it. @returns {readonly Group[]} */
export function registered() {
  return groups;
}

/**
 * Registers `shortcuts` while the component is there. `enabled` says whether they act; they are listed either way.
 * @param {string} title @param {readonly Shortcut[]} shortcuts @param {boolean} [enabled]
 */
export function useKeys(title, shortcuts, enabled = true) {
  const group = useRef(/** @type {Group} */ ({ title, shortcuts, enabled }));
  Object.assign(group.current, { title, shortcuts, enabled });
  useEffect(() => {
    groups.push(group.current);
    return () => void groups.splice(groups.indexOf(group.current), 1);
  }, []);
}

/** "Shift+e" for an event, in the form that shortcuts are written in. @param {KeyboardEvent} event */
function name(event) {
  const letter = event.key.length === 1;
  const alphabetic = letter && event.key.toLowerCase() !== event.key.toUpperCase();
  const control = event.ctrlKey || event.metaKey ? "Ctrl+" : "";
  // "?" takes Shift on most keyboards and none on others: only letters and named keys are told apart by it.
  const shift = event.shiftKey && (!letter || alphabetic) ? "Shift+" : "";
  return control + (event.altKey ? "Alt+" : "") + shift + (letter ? event.key.toLowerCase() : event.key);
}

/** Whether a key belongs to the element that has the focus. @param {KeyboardEvent} event */
function taken(event) {
  const target = event.composedPath()[0];
  if (!(target instanceof HTMLElement)) return false;
  if (target.isContentEditable || target.matches("textarea, select")) return true;
  if (!target.matches("input")) return false;
  const type = /** @type {HTMLInputElement} */ (target).type;
  if (/^(checkbox|button|submit|reset|file|color)$/.test(type)) return false;
  return !/^(range|radio)$/.test(type) || event.key.length > 1;
}

addEventListener("keydown", (event) => {
  if (event.defaultPrevented || event.isComposing || taken(event)) return;
  const dialog = document.querySelector("dialog:modal");
  if (dialog && !dialog.hasAttribute("data-keys")) return;
  const pressed = name(event);
  for (const group of [...groups].reverse()) {
    if (!group.enabled) continue;
    for (const { keys, run } of group.shortcuts) {
      if (!run || keys === undefined || ![keys].flat().includes(pressed)) continue;
      event.preventDefault();
      run(event);
      return;
    }
  }
});
