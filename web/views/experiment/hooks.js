// @ts-check
/** When to work: what is slow is done rarely, what is far away not at all. */
import { useEffect, useRef, useState } from "../../vendor/preact-htm.js";

const MARGIN = "300px"; // what is about to be scrolled into view counts as near

/** `value`, renewed at most every `ms`: at once after a quiet time, and always with the last one in the end. @template T @param {T} value @param {number} ms @returns {T} */
export function useSlowly(value, ms) {
  const [slow, setSlow] = useState(value);
  const last = useRef(0);
  useEffect(() => {
    if (Object.is(slow, value)) return;
    const timer = setTimeout(
      () => {
        last.current = performance.now();
        setSlow(() => value);
      },
      Math.max(0, last.current + ms - performance.now()),
    );
    return () => clearTimeout(timer);
  }, [value, slow]);
  return slow;
}

/** Runs `work` once the page is at rest; returns what cancels it. @param {() => void} work @returns {() => void} */
export function whenIdle(work) {
  if (!("requestIdleCallback" in window)) {
    const timer = setTimeout(work, 1500); // Safari
    return () => clearTimeout(timer);
  }
  const handle = requestIdleCallback(work, { timeout: 5000 });
  return () => cancelIdleCallback(handle);
}

/** Whether an element is, or is about to be, in view while the page is; and the ref for it. @returns {[boolean, (element: HTMLElement | null) => void]} */
export function useNear() {
  const [near, setNear] = useState(false);
  const element = useRef(/** @type {HTMLElement | null} */ (null));
  useEffect(() => {
    if (!element.current) return;
    const observer = new IntersectionObserver(([entry]) => setNear(entry?.isIntersecting ?? false), { rootMargin: MARGIN });
    observer.observe(element.current);
    return () => observer.disconnect();
  }, []);
  const [set] = useState(() => (/** @type {HTMLElement | null} */ found) => void (element.current = found));
  return [near, set];
}
