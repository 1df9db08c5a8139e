// @ts-check
/**
 * One experiment in the browser: its detail and its cells, kept as the service has them.
 *
 * Cells are fetched page by page, a small page first so that something is on screen at once; then the
 * experiment's stream says what changed. An event costs as much as the cells in it, never the whole grid, and
 * subscribers hear of any number of changes at most once a frame. What is shown of it is the views' business.
 */
import { Unreachable, experiments } from "./api.js";
import { follow } from "./events.js";
import { CellIndex, axesOf } from "./views/experiment/axes.js";

/** @typedef {import("./api.js").Cell} Cell */
/** @typedef {import("./api.js").Experiment} Experiment */
/** @typedef {import("./api.js").ExperimentDetail} ExperimentDetail */
/** @typedef {import("./api.js").Progress} Progress */
/** @typedef {import("./api.js").Update} Update */

const FIRST_PAGE = 200; // cells: about two screens of pictures
const PAGE = 2000; // cells: what the service gives at most
const RETRY_SECONDS = [1, 2, 4, 8]; // between tries while the service cannot be reached

export class ExperimentModel {
  /** @type {ExperimentDetail | null} */
  detail = null;
  /** The newest counts and state. @type {Experiment | null} */
  experiment = null;
  /** By position; a hole is not loaded yet. @type {(Cell | undefined)[]} */
  cells = [];
  /** @type {CellIndex | null} */
  index = null;
  /** By `cell`. @type {Map<number, Cell>} */
  references = new Map();
  /** By `progressKey`. @type {Map<string, Progress>} */
  progress = new Map();
  /** True once every page has come. */
  complete = false;
  /** True once the experiment was deleted. */
  gone = false;
  /** Why there is nothing to show. @type {unknown} */
  problem = null;
  /** @type {"live" | "reconnecting" | "down"} */
  stream = "live";
  /** Grows whenever cells changed here, page by page too; progress alone leaves it. */
  revision = 0;
  /** The service's revision at which cells of this experiment last changed: what was read since then is still true. */
  seen = 0;

  /** @type {Set<() => void>} */
  #subscribers = new Set();
  /** @type {{close(): void} | null} */
  #following = null;
  /** Positions that the stream told us of while pages were under way: those pages may be older. @type {Set<number> | null} */
  #fresh = null;
  #again = false;
  #frame = 0;
  #closed = false;

  /** @param {number} id */
  constructor(id) {
    this.id = id;
  }

  /** Fetches everything, then follows. While the service cannot be reached it is tried again; other errors end up in `problem`. */
  async open() {
    for (let tries = 0; !this.#closed; tries++) {
      try {
        const detail = await experiments.get(this.id);
        this.detail = detail;
        this.experiment = detail;
        this.problem = null;
        this.#notify();
        await this.#load();
        return;
      } catch (error) {
        this.problem = error;
        this.#notify();
        if (!(error instanceof Unreachable)) return;
        await pause(RETRY_SECONDS[Math.min(tries, RETRY_SECONDS.length - 1)] ?? 1);
      }
    }
  }

  close() {
    this.#closed = true;
    this.#following?.close();
    this.#subscribers.clear();
    cancelAnimationFrame(this.#frame);
  }

  /** `hear` is called after changes, at most once a frame. @param {() => void} hear @returns {() => void} unsubscribes */
  subscribe(hear) {
    this.#subscribers.add(hear);
    return () => this.#subscribers.delete(hear);
  }

  /** @param {Cell} cell @returns {Progress | undefined} */
  progressOf(cell) {
    return this.progress.get(progressKey(cell));
  }

  /** Every page, from the first; what the stream says meanwhile wins over a page. */
  async #load() {
    do {
      this.#again = false;
      this.#fresh = new Set();
      /** @type {number | null} */
      let start = 0;
      while (start !== null && !this.#closed) {
        const limit = start === 0 ? FIRST_PAGE : PAGE;
        const page = await experiments.cells(this.id, { start, limit });
        if (this.#closed) return;
        for (const cell of page.cells) if (!this.#fresh.has(cell.position)) this.#put(cell);
        if (start === 0) {
          this.seen = page.revision;
          this.#follow(page.revision);
        }
        start = page.next;
        this.#changed();
      }
      this.complete = true;
      this.#fresh = null;
      this.#changed();
    } while (this.#again && !this.#closed);
  }

  /** Everything again, while what is there stays on screen. */
  async #reload() {
    while (!this.#closed && !this.gone) {
      try {
        return await this.#load();
      } catch (error) {
        if (!(error instanceof Unreachable)) return; // deleted meanwhile: the stream says so
        await pause(1);
      }
    }
  }

  /** @param {number} after */
  #follow(after) {
    if (this.#following) return;
    this.#following = follow(
      experiments.eventsUrl(this.id),
      {
        update: (/** @type {Update} */ update) => this.#update(update),
        progress: (/** @type {Progress} */ progress) => this.#advance(progress),
        gone: () => {
          this.gone = true;
          this.#following?.close();
          this.#notify();
        },
        status: (/** @type {"live" | "reconnecting" | "down"} */ status) => {
          this.stream = status;
          this.#notify();
        },
      },
      { after },
    );
  }

  /** @param {Update} update */
  #update(update) {
    this.experiment = update.experiment;
    if (update.cells.length || update.reload) this.seen = update.revision;
    for (const cell of update.cells) {
      this.#fresh?.add(cell.position);
      this.#put(cell);
      if (cell.state !== "running") this.progress.delete(progressKey(cell));
    }
    if (update.reload) {
      this.progress.clear();
      if (this.#fresh) this.#again = true;
      else this.#reload();
    }
    this.#changed();
  }

  /** @param {Progress} progress */
  #advance(progress) {
    this.progress.set(progressKey(progress), progress);
    this.#notify();
  }

  /** @param {Cell} cell */
  #put(cell) {
    this.cells[cell.position] = cell;
    if (cell.role === "reference") this.references.set(cell.cell, cell);
    else if (this.detail) (this.index ??= new CellIndex(axesOf(this.detail))).put(cell);
  }

  #changed() {
    this.revision++;
    this.#notify();
  }

  #notify() {
    if (this.#frame) return;
    this.#frame = requestAnimationFrame(() => {
      this.#frame = 0;
      for (const hear of this.#subscribers) hear();
    });
  }
}

/** @param {number} seconds @returns {Promise<void>} */
function pause(seconds) {
  return new Promise((resolve) => setTimeout(resolve, 1000 * seconds));
}

/** A cell may be rendered both for itself and as a reference. @param {{role: string, cell: number}} of */
function progressKey(of) {
  return `${of.role}:${of.cell}`;
}

/** How far a cell is, 0 to 1, over all the replicates that the experiment wants. @param {Cell} cell @param {Progress | undefined} progress */
export function fractionOf(cell, progress) {
  if (!progress || progress.replicate < cell.had) return cell.had / cell.wanted;
  return Math.min(1, (progress.replicate + progress.done / Math.max(1, progress.passes)) / cell.wanted);
}
