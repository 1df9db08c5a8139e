// @ts-check
/**
 * From the boxes on the page to what is drawn: where each one is, which part of its picture it shows, what is cut off.
 *
 * Coordinates are CSS pixels: of the window where gestures ask, of the canvas where it is painted.
 */
import { lookOf } from "./looks.js";
import { place, shrunk } from "./maths.js";

/** @typedef {import("./gl.js").Drawing} Drawing */
/** @typedef {import("./maths.js").Box} Box */
/** @typedef {import("./maths.js").Size} Size */
/** @typedef {import("./maths.js").View} View */
/** @typedef {import("./seen.js").Seen} Seen */
/** @typedef {import("./settings.js").ViewerSettings} ViewerSettings */
/** @typedef {import("./stage.js").StageProps} StageProps */

const ROOM = 8; // CSS pixels between a picture that fits and the edge of its pane

/** @param {Element} body @param {string} id @returns {DOMRect | null} */
export function boxOf(body, id) {
  return body.querySelector(`[data-view="${CSS.escape(id)}"]`)?.getBoundingClientRect() ?? null;
}

/** A pane less the room around a picture that fits. @template {Size} B @param {B} box @returns {B} */
export function inner(box) {
  return { ...box, width: Math.max(box.width - 2 * ROOM, 1), height: Math.max(box.height - 2 * ROOM, 1) };
}

/**
 * What a box shows: in a pane the view of the settings, for pictures of another size the same part of them; in a tile
 * the same composition made smaller.
 * @param {ViewerSettings} settings @param {Seen} current @param {Size} large @param {Seen} seen @param {Size} box
 * @param {boolean} tile @returns {View}
 */
export function viewOf({ zoom, x, y }, current, large, seen, box, tile) {
  if (tile) return shrunk({ zoom, x, y }, current.size, large, box, seen.size);
  if (zoom === null) return { zoom, x, y };
  return { zoom: (zoom * current.size.width) / seen.size.width, x, y };
}

/**
 * The rectangle in which a picture is fitted, in the middle of its box.
 * @template {Box} B @param {B} box @returns {B}
 */
export function fitted(box) {
  return { ...inner(box), x: box.x + ROOM, y: box.y + ROOM };
}

/**
 * @param {HTMLElement} body @param {DOMRect} whole @param {number} ratio @param {StageProps} props
 * @returns {(Drawing & {own: boolean})[]}
 */
export function drawingsOf(body, whole, ratio, { panes, tiles, current, flipped, settings, max, hover }) {
  const { layout, split } = settings;
  const large = boxOf(body, current.id) ?? whole;
  const drawings = [];
  for (const [number, seen] of [...panes, ...tiles].entries()) {
    const second = layout === "wipe" && number === 1 && !flipped && panes.length === 2;
    const { pixels, reference, trouble } = seen;
    const rect = boxOf(body, second ? current.id : seen.id);
    if (!rect || !pixels || trouble) continue;
    const tile = number >= panes.length;
    const box = { x: rect.x - whole.x, y: rect.y - whole.y, width: rect.width, height: rect.height };
    const room = tile ? box : fitted(box);
    const view = viewOf(settings, current, inner(large), seen, room, tile);
    const clip = tile ? visible(box, body, whole) : { ...box };
    if (layout === "wipe" && !tile && !flipped && panes.length === 2) {
      if (second) clip.x += clip.width * split;
      clip.width *= second ? 1 - split : split;
    }
    const own = !tile && hover.value?.id === (second ? current.id : seen.id);
    drawings.push({
      pixels,
      reference,
      place: place(view, seen.size, room, ratio),
      clip,
      own,
      ...lookOf(seen, settings, max),
    });
  }
  return drawings;
}

/**
 * The part of a tile's box that the strip has not scrolled away.
 * @param {Box} box @param {HTMLElement} body @param {DOMRect} whole
 */
function visible(box, body, whole) {
  const strip = body.querySelector(".viewer-strip")?.getBoundingClientRect() ?? whole;
  const left = Math.max(box.x, strip.x - whole.x);
  const top = Math.max(box.y, strip.y - whole.y);
  const right = Math.min(box.x + box.width, strip.right - whole.x);
  const bottom = Math.min(box.y + box.height, strip.bottom - whole.y);
  return { x: left, y: top, width: Math.max(right - left, 0), height: Math.max(bottom - top, 0) };
}
