// @ts-check
/**
 * The address bar as the state of the page: what is shown can be linked, reloaded and gone back to.
 *
 * A path is a view (`/`, `/new`, `/experiments/7`), its query is what the view is set to. Reading is immediate;
 * writing to the browser's history waits a moment, because browsers refuse hundreds of entries in a few seconds and a
 * dragged slider makes that many.
 */
import { useCallback, useEffect, useState } from "./vendor/preact-htm.js";

const WRITE_MS = 150;

let here = new URL(location.href);
/** @type {number | undefined} */
let timer;
/** @type {Set<() => void>} */
const listeners = new Set();

function changed() {
  listeners.forEach((listener) => listener());
}

function write() {
  clearTimeout(timer);
  if (here.href !== location.href) history.replaceState(null, "", here);
}

addEventListener("popstate", () => {
  clearTimeout(timer);
  here = new URL(location.href);
  changed();
});
addEventListener("pagehide", write);

/** Goes to another view; back returns to this one. @param {string} path @param {{replace?: boolean}} [options] */
export function navigate(path, { replace = false } = {}) {
  write();
  here = new URL(path, here);
  if (replace) history.replaceState(null, "", here);
  else history.pushState(null, "", here);
  scrollTo(0, 0);
  changed();
}

/** @returns {{path: string, params: URLSearchParams}} */
export function useRoute() {
  const [, redraw] = useState(0);
  useEffect(() => {
    const listener = () => redraw((count) => count + 1);
    listeners.add(listener);
    listener();
    return () => void listeners.delete(listener);
  }, []);
  return { path: here.pathname, params: here.searchParams };
}

/** The whole address as it is now, for a link to copy. */
export function address() {
  return here.href;
}

/**
 * Sets several values of the query at once; null or "" takes one out, a list repeats the name.
 * @param {Record<string, string | readonly string[] | null>} values
 * @param {{push?: boolean}} [options] push: back undoes it
 */
export function setParams(values, { push = false } = {}) {
  if (push) write();
  const next = new URL(here);
  for (const [name, value] of Object.entries(values)) {
    next.searchParams.delete(name);
    for (const one of value === null || value === "" ? [] : [value].flat()) next.searchParams.append(name, one);
  }
  if (next.href === here.href) return;
  here = next;
  clearTimeout(timer);
  if (push) history.pushState(null, "", here);
  else timer = window.setTimeout(write, WRITE_MS);
  changed();
}

/**
 * One value of the query as state. The fallback is not written, so that addresses stay short.
 * @param {string} name @param {string} fallback
 * @returns {[string, (value: string | null, options?: {push?: boolean}) => void]}
 */
export function useParam(name, fallback) {
  const { params } = useRoute();
  /** @type {(value: string | null, options?: {push?: boolean}) => void} */
  const set = useCallback(
    /** @param {string | null} value @param {{push?: boolean}} [options] */
    (value, options) => setParams({ [name]: value === fallback ? null : value }, options),
    [name, fallback],
  );
  return [params.get(name) ?? fallback, set];
}

/** Makes links to views stay in the page; downloads, the API, new tabs and other hosts are left to the browser. */
export function captureLinks() {
  document.addEventListener("click", (event) => {
    const modified = event.metaKey || event.ctrlKey || event.shiftKey || event.altKey;
    if (event.defaultPrevented || event.button || modified) return;
    const link = event.target instanceof Element ? event.target.closest("a") : null;
    if (!(link instanceof HTMLAnchorElement) || link.target || link.hasAttribute("download")) return;
    const url = new URL(link.href, here);
    if (url.origin !== here.origin || /^\/(api\/|static\/|openapi\.json$)/.test(url.pathname)) return;
    if (url.hash && url.pathname === here.pathname) return;
    event.preventDefault();
    navigate(url.pathname + url.search + url.hash);
  });
}
