// @ts-check
/**
 * A button that opens a short list of actions. Arrow keys move, Escape and a click elsewhere close. The list is made
 * when it opens: a page may hold hundreds of these.
 */
import { html, useLayoutEffect, useRef, useState } from "../vendor/preact-htm.js";
import { Icon } from "./icons.js";

/** @typedef {{label: string, icon: import("./icons.js").IconName, run: () => void, danger?: boolean}} Action */

const GAP = 4; // pixels between the button and its list

/** @param {{label: string, actions: readonly Action[]}} props */
export function Menu({ label, actions }) {
  const [open, setOpen] = useState(false);
  const button = useRef(/** @type {HTMLButtonElement | null} */ (null));
  const list = useRef(/** @type {HTMLDivElement | null} */ (null));

  useLayoutEffect(() => {
    if (!open) return undefined;
    list.current?.showPopover();
    place();
    items()[0]?.focus();
    /** @param {Event} event */
    const elsewhere = (event) => {
      const target = /** @type {Node} */ (event.target);
      if (![list, button].some(({ current }) => current?.contains(target))) hide();
    };
    addEventListener("scroll", place, { passive: true });
    addEventListener("pointerdown", elsewhere);
    return () => {
      removeEventListener("scroll", place);
      removeEventListener("pointerdown", elsewhere);
    };
  }, [open]);

  /** The list stands below the button, above it near the foot of the window. */
  function place() {
    if (!button.current || !list.current) return;
    const at = button.current.getBoundingClientRect();
    const { offsetHeight, offsetWidth, style } = list.current;
    const below = at.bottom + GAP + offsetHeight < innerHeight;
    style.top = `${below ? at.bottom + GAP : Math.max(GAP, at.top - GAP - offsetHeight)}px`;
    style.left = `${Math.max(GAP, at.right - offsetWidth)}px`;
  }

  function hide() {
    setOpen(false);
  }

  /** @returns {HTMLButtonElement[]} */
  function items() {
    return [...(list.current?.querySelectorAll("button") ?? [])];
  }

  /** @param {KeyboardEvent} event */
  function key(event) {
    const all = items();
    const here = all.indexOf(/** @type {HTMLButtonElement} */ (document.activeElement));
    /** @type {Record<string, number>} */
    const moves = { ArrowDown: here + 1, ArrowUp: here - 1, Home: 0, End: -1 };
    const next = moves[event.key];
    if (event.key === "Tab" || event.key === "Escape") {
      event.preventDefault();
      hide();
      button.current?.focus();
    }
    if (next === undefined) return;
    event.preventDefault();
    all.at(next % all.length)?.focus();
  }

  /** @param {Action} action */
  function choose(action) {
    hide();
    button.current?.focus();
    action.run();
  }

  return html`<button
      ref=${button}
      class="button quiet icon"
      aria-haspopup="menu"
      aria-expanded=${open}
      aria-label=${label}
      title=${label}
      onClick=${() => setOpen(!open)}
    >
      <${Icon} name="more" />
    </button>
    ${open &&
    html`<div ref=${list} class="menu" popover="manual" role="menu" aria-label=${label} onKeyDown=${key}>
      ${actions.map(
        (action) => html`<button
          key=${action.label}
          role="menuitem"
          tabindex="-1"
          class=${action.danger ? "danger" : ""}
          onClick=${() => choose(action)}
        >
          <${Icon} name=${action.icon} /> ${action.label}
        </button>`,
      )}
    </div>`}`;
}
