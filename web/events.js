// @ts-check
/**
 * The live streams of the service (server-sent events), and the two things every page shows from them: what renders
 * now, and whether the server is there.
 *
 * A stream recovers by itself, after a restart of the server too: it asks for what came after the last event it saw.
 * Browsers grant six connections per host to all tabs together, so a page holds *one* stream, and none while it is
 * hidden; the header takes the worker's state from whichever stream the page has.
 */
import { useEffect, useState } from "./vendor/preact-htm.js";
import { overviewEvents } from "./api.js";

/** @typedef {import("./api.js").Worker} Worker */
/** @typedef {"live" | "reconnecting" | "down"} Status */
/**
 * @typedef {object} Handlers
 * @property {(data: any) => void} [update]
 * @property {(data: any) => void} [progress]
 * @property {() => void} [gone] what is followed was deleted, or never was
 * @property {(status: Status) => void} [status]
 */

const RETRY_MS = [300, 1000, 2000]; // soon, then rarer
const DOWN_MS = 2500; // a server that restarts is back sooner; longer is worth a word
const HIDDEN_MS = 5000; // a glance at another tab should not cost a reconnection

/** @type {{worker: Worker | null, status: Status}} */
let live = { worker: null, status: "live" };
/** @type {Set<() => void>} */
const watchers = new Set();
let followed = 0;

/** @param {Partial<typeof live>} news */
function tell(news) {
  live = { ...live, ...news };
  watchers.forEach((watcher) => watcher());
}

/**
 * Follows the stream at `path`. `after` is the revision that the caller knows; without it the stream starts with now.
 * @param {string} path @param {Handlers} handlers @param {{after?: number}} [options] @returns {{close: () => void}}
 */
export function follow(path, handlers, { after } = {}) {
  /** @type {EventSource | null} */
  let source = null;
  let last = after;
  let failures = 0;
  let closed = false;
  /** @type {number | undefined} */
  let timer;
  /** @type {number | undefined} */
  let sleep;
  /** Fires once the server has been away for long; -1 from then on. @type {number | undefined} */
  let alarm = live.status === "down" ? -1 : undefined;

  /** @param {Status} status */
  function report(status) {
    tell({ status });
    handlers.status?.(status);
  }

  function open() {
    clearTimeout(timer);
    stop();
    source = new EventSource(last === undefined ? path : `${path}?after=${last}`);
    source.onopen = () => {
      failures = 0;
      clearTimeout(alarm);
      alarm = undefined;
      report("live");
    };
    source.onerror = failed;
    source.addEventListener("update", (event) => {
      const data = JSON.parse(event.data);
      if (after !== undefined) last = data.revision;
      if (data.worker) tell({ worker: data.worker });
      handlers.update?.(data);
    });
    source.addEventListener("progress", (event) => handlers.progress?.(JSON.parse(event.data)));
    source.addEventListener("gone", ended);
  }

  function stop() {
    source?.close();
    source = null;
  }

  function failed() {
    stop();
    if (closed) return;
    report(alarm === -1 ? "down" : "reconnecting");
    alarm ??= window.setTimeout(() => {
      alarm = -1;
      if (!closed) report("down");
    }, DOWN_MS);
    const wait = RETRY_MS[Math.min(failures++, RETRY_MS.length - 1)];
    timer = window.setTimeout(failures > 1 ? probe : open, wait);
  }

  /** An EventSource does not tell why it failed; one plain request does. */
  async function probe() {
    const control = new AbortController();
    try {
      const response = await fetch(path, { signal: control.signal, headers: { Accept: "text/event-stream" } });
      control.abort();
      if (closed) return;
      if (response.status === 404) ended();
      else open();
    } catch {
      if (!closed) failed();
    }
  }

  function ended() {
    close();
    handlers.gone?.();
  }

  function visibility() {
    clearTimeout(sleep);
    if (!document.hidden && !source) open();
    else if (document.hidden) sleep = window.setTimeout(rest, HIDDEN_MS);
  }

  function rest() {
    stop();
    clearTimeout(timer);
    clearTimeout(alarm);
    alarm = undefined;
  }

  function close() {
    if (closed) return;
    closed = true;
    followed -= 1;
    rest();
    clearTimeout(sleep);
    document.removeEventListener("visibilitychange", visibility);
    window.removeEventListener("online", visibility);
    watchers.forEach((watcher) => watcher());
  }

  followed += 1;
  document.addEventListener("visibilitychange", visibility);
  window.addEventListener("online", visibility);
  open();
  watchers.forEach((watcher) => watcher());
  return { close };
}

/**
 * What renders now and whether the server is there, whatever the page follows. Where the page follows nothing, this
 * follows the overview.
 * @returns {{worker: Worker | null, status: Status}}
 */
export function useLive() {
  const [state, setState] = useState(live);
  useEffect(() => {
    /** @type {{close: () => void} | null} */
    let own = null;
    /** @type {number | undefined} */
    let timer;
    function watch() {
      setState(live);
      clearTimeout(timer);
      timer = window.setTimeout(choose, 200); // a view that opens gets the time to open its own
    }
    function choose() {
      if (own && followed > 1) {
        const stream = own;
        own = null;
        stream.close();
      } else if (!own && followed === 0) {
        own = follow(overviewEvents, {});
      }
    }
    watchers.add(watch);
    watch();
    return () => {
      watchers.delete(watch);
      clearTimeout(timer);
      own?.close();
    };
  }, []);
  return state;
}
