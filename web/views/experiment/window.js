// @ts-check
/**
 * Showing a few of many: which rows of equal height a scrolled box needs. `windowOf` is pure.
 */
import { useEffect, useLayoutEffect, useState } from "../../vendor/preact-htm.js";

/** @typedef {{top: number, left: number, width: number, height: number}} Port what of the content is visible, px */

/**
 * First and one past the last of the items that are visible, with `more` on both sides.
 * @param {number} from px @param {number} extent px @param {number} size px an item @param {number} count
 * @returns {[number, number]}
 */
export function windowOf(from, extent, size, count, more = 2) {
  const first = Math.max(0, Math.floor(from / size) - more);
  return [Math.min(first, count), Math.min(count, Math.ceil((from + extent) / size) + more)];
}

/** What of a scrolling element is visible; follows scrolling and resizing, at most once a frame. @param {{current: HTMLElement | null}} ref @returns {Port} */
export function usePort(ref) {
  const [port, setPort] = useState({ top: 0, left: 0, width: 0, height: 0 });
  useLayoutEffect(() => {
    const element = ref.current;
    if (!element) return;
    setPort(read(element));
  }, []);
  useEffect(() => {
    const element = ref.current;
    if (!element) return;
    let frame = 0;
    const look = () => {
      frame ||= requestAnimationFrame(() => {
        frame = 0;
        setPort(read(element));
      });
    };
    const resizes = new ResizeObserver(look);
    resizes.observe(element);
    element.addEventListener("scroll", look, { passive: true });
    return () => {
      resizes.disconnect();
      element.removeEventListener("scroll", look);
      cancelAnimationFrame(frame);
    };
  }, []);
  return port;
}

/** @param {HTMLElement} element @returns {Port} */
function read(element) {
  return { top: element.scrollTop, left: element.scrollLeft, width: element.clientWidth, height: element.clientHeight };
}
