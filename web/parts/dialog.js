// @ts-check
/**
 * A modal dialog. The browser keeps the focus inside and gives it back; Escape and a click beside it close it.
 */
import { html, useLayoutEffect, useRef } from "../vendor/preact-htm.js";

/** @typedef {import("../vendor/preact-htm.js").Child} Child */

/**
 * Mount it to open, unmount it to close.
 * @param {{title: string, onClose: () => void, wide?: boolean, children?: Child}} props
 */
export function Dialog({ title, onClose, wide = false, children }) {
  const element = useRef(/** @type {HTMLDialogElement | null} */ (null));
  useLayoutEffect(() => {
    const dialog = element.current;
    dialog?.showModal();
    return () => dialog?.close();
  }, []);
  /** @param {Event} event */
  const cancel = (event) => {
    event.preventDefault();
    onClose();
  };
  /** @param {MouseEvent} event */
  const click = (event) => {
    if (event.target === element.current) onClose();
  };
  const kind = wide ? "wide" : "";
  return html`<dialog ref=${element} class=${kind} aria-label=${title} onCancel=${cancel} onMouseDown=${click}>
    <div class="dialog-body">
      <h2>${title}</h2>
      ${children}
    </div>
  </dialog>`;
}
