// @ts-check
/**
 * Fetches the float16 pixels of pictures, nearest need first, and keeps the ones that were used last.
 *
 * `want` says what the viewer shows, in the order of its need; a few requests run at a time. A picture that fails stays
 * failed with its error until `retry`; one that the server could not be asked for is asked for again by itself.
 */
import { ApiProblem, Unreachable } from "../api.js";

/** @typedef {import("../api.js").Problem} Problem */
/** Linear radiance, RGB rows from the top. @typedef {{width: number, height: number, halves: Uint16Array}} Pixels */
/** @typedef {{url: string, bytes: number}} Want  `bytes`: expected size */
/**
 * @typedef {{status: "ready", pixels: Pixels} | {status: "failed", error: Error}
 *   | {status: "waiting" | "loading" | "skipped"}} Entry
 */

export const KEEP_BYTES = 256 * 2 ** 20;
const AT_ONCE = 3; // of the six connections that a browser opens to one host, some belong to events and thumbnails
const RETRY_MS = 3000;
const ALWAYS = 2; // the first ones wanted (the current picture and its reference) are fetched however large they are

/** @param {string} url @param {AbortSignal} signal @returns {Promise<Pixels>} */
export async function fetchPixels(url, signal) {
  const response = await fetch(url, { signal }).catch((error) => {
    throw error instanceof DOMException && error.name === "AbortError" ? error : new Unreachable();
  });
  if (!response.ok) {
    /** @type {Problem | null} */
    const problem = await response.json().catch(() => null);
    if (typeof problem?.title === "string") throw new ApiProblem(problem);
    throw new Error(`the server answered ${response.status} ${response.statusText} without saying why`);
  }
  const width = Number(response.headers.get("X-Width"));
  const height = Number(response.headers.get("X-Height"));
  const buffer = await response.arrayBuffer().catch(() => {
    throw new Unreachable();
  });
  if (!(width > 0 && height > 0) || buffer.byteLength !== width * height * 6) {
    throw new Error(
      `expected ${width} × ${height} pixels of 6 bytes, got ${buffer.byteLength} bytes; a proxy may have changed them`,
    );
  }
  return { width, height, halves: new Uint16Array(buffer) };
}

export class Pictures {
  /** @param {() => void} onChange @param {{load?: typeof fetchPixels, keep?: number}} [options] */
  constructor(onChange, { load = fetchPixels, keep = KEEP_BYTES } = {}) {
    this.onChange = onChange;
    this.load = load;
    this.keep = keep;
    /** @type {Map<string, Entry>} ready ones in the order of their last use */
    this.entries = new Map();
    /** @type {readonly Want[]} */
    this.wanted = [];
    this.abort = new AbortController();
    this.running = 0;
    /** @type {ReturnType<typeof setTimeout> | undefined} */
    this.timer = undefined;
  }

  /** @param {string} url @returns {Entry} */
  get(url) {
    return this.entries.get(url) ?? { status: "waiting" };
  }

  /** @param {string} url @returns {Pixels | null} */
  pixels(url) {
    const entry = this.entries.get(url);
    return entry?.status === "ready" ? entry.pixels : null;
  }

  /** Most needed first: the current picture, its reference, then neighbours. @param {readonly Want[]} wanted */
  want(wanted) {
    this.wanted = wanted;
    for (const { url } of [...wanted].reverse()) this.touch(url);
    this.next();
  }

  /** Fetch a failed or skipped one now. @param {string} url */
  retry(url) {
    this.entries.delete(url);
    const bytes = this.wanted.find((want) => want.url === url)?.bytes ?? 0;
    this.start({ url, bytes });
  }

  close() {
    this.abort.abort();
    clearTimeout(this.timer);
    this.entries.clear();
    this.wanted = [];
  }

  /** @param {string} url */
  touch(url) {
    const entry = this.entries.get(url);
    if (entry?.status !== "ready") return;
    this.entries.delete(url);
    this.entries.set(url, entry);
  }

  next() {
    let planned = 0;
    for (const [place, want] of this.wanted.entries()) {
      planned += want.bytes;
      const { status } = this.get(want.url);
      if (status !== "waiting" && !(status === "skipped" && place < ALWAYS)) continue;
      if (place >= ALWAYS && planned > this.keep) {
        this.entries.set(want.url, { status: "skipped" }); // it would push out what is needed more
      } else if (this.running < AT_ONCE) {
        this.start(want);
      }
    }
  }

  /** @param {Want} want */
  async start({ url }) {
    this.running += 1;
    this.entries.set(url, { status: "loading" });
    /** @type {Entry} */
    let entry;
    try {
      entry = { status: "ready", pixels: await this.load(url, this.abort.signal) };
    } catch (error) {
      entry = { status: "failed", error: error instanceof Error ? error : new Error(String(error)) };
    }
    if (this.abort.signal.aborted) return;
    this.running -= 1;
    this.entries.set(url, entry);
    if (entry.status === "failed" && entry.error instanceof Unreachable) this.later();
    this.evict();
    this.next();
    this.onChange();
  }

  /** Asks again for what the server was not there for. */
  later() {
    clearTimeout(this.timer);
    this.timer = setTimeout(() => {
      for (const [url, entry] of this.entries) {
        if (entry.status === "failed" && entry.error instanceof Unreachable) this.entries.delete(url);
      }
      this.next();
    }, RETRY_MS);
  }

  /** Drops the ready ones that were not used for longest, but none that is wanted most. */
  evict() {
    const needed = new Set(this.wanted.slice(0, ALWAYS).map((want) => want.url));
    const wanted = new Set(this.wanted.map((want) => want.url));
    let bytes = 0;
    for (const entry of this.entries.values()) if (entry.status === "ready") bytes += entry.pixels.halves.byteLength;
    for (const [url, entry] of this.entries) {
      if (bytes <= this.keep) return;
      if (entry.status !== "ready" || needed.has(url)) continue;
      bytes -= entry.pixels.halves.byteLength;
      if (wanted.has(url))
        this.entries.set(url, { status: "skipped" }); // else it would be fetched again at once
      else this.entries.delete(url);
    }
  }
}
