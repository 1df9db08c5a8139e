// @ts-check
/**
 * What the viewer keeps beside its settings: loaded pixels, the held Shift key, its being a dialog, and state that is
 * reported late.
 */
import { useEffect, useLayoutEffect, useReducer, useRef, useState } from "../vendor/preact-htm.js";
import { Pictures } from "./pictures.js";
import { urlOf, wants } from "./seen.js";

/** @typedef {import("./pictures.js").Entry} Entry */
/** @typedef {import("./pictures.js").Pixels} Pixels */
/** @typedef {import("./viewer.js").ViewerPicture} ViewerPicture */
/**
 * @typedef {object} Loaded
 * @property {(picture: ViewerPicture | null) => Entry} entry
 * @property {(picture: ViewerPicture | null) => Pixels | null} pixels
 * @property {(url: string) => void} retry
 */

const REPORT_MS = 200; // of rest, before what changed is reported

/**
 * State that belongs to the viewer while one works with it: it changes at once, is reported after a moment of rest, and
 * takes over what is given from outside (back in the browser's history) unless that is what it reported itself.
 * @template {object} T
 * @param {T} given @param {(a: T, b: T) => boolean} same @param {(value: T) => void} report
 * @returns {[value: T, change: (change: Partial<T>) => void, now: () => T]}
 */
export function useOwn(given, same, report) {
  const [value, set] = useState(given);
  const now = useRef(value);
  const reported = useRef(given);
  const before = useRef(given);
  const timer = useRef(/** @type {ReturnType<typeof setTimeout> | undefined} */ (undefined));
  const tell = useRef(() => {});
  tell.current = () => {
    clearTimeout(timer.current);
    timer.current = undefined;
    if (same(now.current, reported.current)) return;
    reported.current = now.current;
    report(now.current);
  };

  useLayoutEffect(() => {
    const changed = !same(given, before.current);
    before.current = given;
    if (!changed || timer.current !== undefined || same(given, reported.current)) return;
    now.current = reported.current = given;
    set(given);
  });
  useEffect(() => () => tell.current(), []);

  /** @param {Partial<T>} change */
  const change = (change) => {
    now.current = { ...now.current, ...change };
    set(now.current);
    clearTimeout(timer.current);
    timer.current = setTimeout(() => tell.current(), REPORT_MS);
  };
  return [value, change, () => now.current];
}

/**
 * The pixels of the row and its references. While a newer version of a picture is on its way, `pixels` are the ones
 * before.
 * @param {readonly ViewerPicture[]} row @param {number} index
 * @param {(picture: ViewerPicture) => ViewerPicture | null} referenceOf
 * @returns {Loaded}
 */
export function useLoaded(row, index, referenceOf) {
  const [, redraw] = useReducer((count) => count + 1, 0);
  const [store] = useState(() => new Pictures(() => redraw(null)));
  const lastShown = useRef(/** @type {Map<string, string>} */ (new Map()));
  const wanted = wants(row, index, referenceOf);
  useEffect(() => store.want(wanted), [wanted.map(({ url }) => url).join(" ")]);
  useEffect(() => () => store.close(), []);
  return {
    entry: (picture) => store.get(urlOf(picture) ?? ""),
    pixels: (picture) => {
      const url = urlOf(picture);
      if (!picture || url === null) return null;
      const name = `${picture.role ?? "cell"} ${picture.key}`;
      const { status } = store.get(url);
      if (status === "ready") lastShown.current.set(name, url);
      const known =
        status === "ready" || status === "failed" || status === "skipped" ? url : lastShown.current.get(name);
      return known === undefined ? null : store.pixels(known);
    },
    retry: (url) => {
      store.retry(url);
      redraw(null);
    },
  };
}

/** Whether Shift is held by itself; with another key it belongs to that key. @returns {boolean} */
export function useHeldShift() {
  const [held, set] = useState(false);
  useEffect(() => {
    const down = (/** @type {KeyboardEvent} */ event) =>
      set((before) => (event.key === "Shift" ? before || !event.repeat : false));
    const up = (/** @type {KeyboardEvent} */ event) => event.key === "Shift" && set(false);
    const away = () => set(false); // the key comes up where nobody hears it
    addEventListener("keydown", down);
    addEventListener("keyup", up);
    addEventListener("blur", away);
    return () => {
      removeEventListener("keydown", down);
      removeEventListener("keyup", up);
      removeEventListener("blur", away);
    };
  }, []);
  return held;
}

/**
 * Opens a dialog over everything, with the focus in it; when it goes the focus returns.
 * @param {() => void} onClose Escape was pressed
 * @returns {import("../vendor/preact-htm.js").Ref<HTMLDialogElement | null>}
 */
export function useModal(onClose) {
  const element = useRef(/** @type {HTMLDialogElement | null} */ (null));
  const latest = useRef(onClose);
  latest.current = onClose;
  useLayoutEffect(() => {
    const dialog = element.current;
    if (!dialog) return;
    const { style } = document.documentElement;
    const { overflow } = style;
    style.overflow = "hidden"; // a wheel beside the pictures would scroll what lies under
    dialog.showModal();
    dialog.focus();
    const cancel = (/** @type {Event} */ event) => {
      event.preventDefault(); // it goes when the page says so
      latest.current();
    };
    const closed = () => latest.current();
    dialog.addEventListener("cancel", cancel);
    dialog.addEventListener("close", closed); // a second Escape closes whatever the first was told
    return () => {
      dialog.removeEventListener("close", closed);
      dialog.close();
      style.overflow = overflow;
    };
  }, []);
  return element;
}
