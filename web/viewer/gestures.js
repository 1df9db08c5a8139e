// @ts-check
/**
 * Mouse, pen and fingers on pictures: wheel and pinch zoom, drag moves, a click selects, a double click shows 100 %.
 *
 * Knows boxes and views, not pictures or settings: the host says which box an element is and takes new views.
 */
import { pan, pinch, zoomAt, zoomOf, zoomTo } from "./maths.js";

/** @typedef {import("./maths.js").Box} Box */
/** @typedef {import("./maths.js").Size} Size */
/** @typedef {import("./maths.js").Spot} Spot */
/** @typedef {import("./maths.js").View} View */
/**
 * A box in screen coordinates, with the size of its picture.
 * @typedef {{id: string, element: Element, box: Box, size: Size}} Pane
 */
/**
 * @typedef {object} Host
 * @property {(target: EventTarget | null) => Pane | null} paneAt
 * @property {(pane: Pane) => View} view     what the box shows, its zoom in pixels of its own picture
 * @property {(pane: Pane, view: View) => void} setView
 * @property {(hover: {pane: Pane, spot: Spot} | null) => void} hover
 * @property {(id: string) => void} tap
 */

const SLACK = 4; // CSS pixels that a click may move before it is a drag
const WHEEL_LINE = 16; // pixels of a wheel that counts lines, as browsers scroll them
const WHEEL_RATE = 0.0018; // one notch (100 pixels) zooms by a fifth
const PINCH_RATE = 0.01; // touch pads report a pinch as a wheel with small steps

/** @param {HTMLElement} stage @param {Host} host @returns {() => void} takes the listeners off again */
export function attachGestures(stage, host) {
  /** @type {Map<number, Spot>} where each finger or button is now */
  const down = new Map();
  /** @type {Pane | null} */
  let pane = null;
  /** @type {Spot | null} */
  let pressed = null;
  let dragging = false;

  /** @param {MouseEvent} event @returns {Spot} */
  const spotOf = (event) => ({ x: event.clientX, y: event.clientY });

  /** @param {PointerEvent} event */
  function onDown(event) {
    if (event.button > 1 || event.defaultPrevented) return;
    const target = host.paneAt(event.target);
    if (!target || (pane && target.id !== pane.id)) return;
    pane = target;
    down.set(event.pointerId, spotOf(event));
    dragging = down.size > 1;
    pressed = spotOf(event);
    host.hover({ pane, spot: pressed });
    pane.element.setPointerCapture(event.pointerId); // not the stage: a click goes to what has the pointer
  }

  /** @param {PointerEvent} event */
  function onMove(event) {
    const spot = spotOf(event);
    const before = down.get(event.pointerId);
    if (!before || !pane) {
      const target = host.paneAt(event.target);
      host.hover(target && { pane: target, spot });
      return;
    }
    host.hover({ pane, spot });
    if (!dragging && pressed && Math.hypot(spot.x - pressed.x, spot.y - pressed.y) < SLACK) return;
    dragging = true;
    const { size, box } = pane;
    const other = [...down].find(([id]) => id !== event.pointerId)?.[1];
    down.set(event.pointerId, spot);
    const view = host.view(pane);
    host.setView(
      pane,
      other
        ? pinch(view, size, box, [before, other], [spot, other])
        : pan(view, size, box, spot.x - before.x, spot.y - before.y),
    );
    stage.classList.add("viewer-dragging");
  }

  /** @param {PointerEvent} event */
  function onUp(event) {
    if (!down.delete(event.pointerId) || down.size > 0) return;
    if (!dragging && pane && event.type === "pointerup") host.tap(pane.id);
    if (event.pointerType === "touch" && dragging) host.hover(null);
    stage.classList.remove("viewer-dragging");
    pane = pressed = null;
    dragging = false;
  }

  /** @param {PointerEvent} event */
  function onLeave(event) {
    if (!down.size && event.pointerType !== "touch") host.hover(null);
  }

  /** @param {WheelEvent} event */
  function onWheel(event) {
    const target = host.paneAt(event.target);
    if (!target) return;
    event.preventDefault();
    const amount = event.deltaMode === WheelEvent.DOM_DELTA_LINE ? event.deltaY * WHEEL_LINE : event.deltaY;
    const rate = event.ctrlKey ? PINCH_RATE : WHEEL_RATE;
    const factor = Math.exp(-Math.min(Math.max(amount * rate, -0.7), 0.7));
    host.setView(target, zoomAt(host.view(target), target.size, target.box, factor, spotOf(event)));
    host.hover({ pane: target, spot: spotOf(event) });
  }

  /** @param {MouseEvent} event */
  function onDouble(event) {
    const target = host.paneAt(event.target);
    if (!target) return;
    event.preventDefault();
    const { size, box } = target;
    const view = host.view(target);
    const actual = view.zoom !== null && Math.abs(zoomOf(view, size, box) - 1) < 1e-3;
    host.setView(target, actual ? { zoom: null, x: 0.5, y: 0.5 } : zoomTo(view, size, box, 1, spotOf(event)));
  }

  /** @type {readonly [string, (event: any) => void][]} */
  const listeners = [
    ["pointerdown", onDown],
    ["pointermove", onMove],
    ["pointerup", onUp],
    ["pointercancel", onUp],
    ["pointerleave", onLeave],
    ["wheel", onWheel],
    ["dblclick", onDouble],
  ];
  for (const [name, listener] of listeners) stage.addEventListener(name, listener, { passive: false });
  return () => listeners.forEach(([name, listener]) => stage.removeEventListener(name, listener));
}
