// @ts-check
/**
 * The REST interface of the service: the one place that knows its URLs.
 *
 * Every answer is plain JSON of a shape in `openapi.d.ts`. A refused request throws `ApiProblem` with the server's own
 * sentences; a server that does not answer throws `Unreachable`. Views show both, they never write such texts.
 */

/** @typedef {import("./openapi.d.ts").components["schemas"]} Schemas */
/** @typedef {Schemas["Attempt"]} Attempt */
/** @typedef {Schemas["Attempts"]} Attempts */
/** @typedef {Schemas["Cell"]} Cell */
/** @typedef {Schemas["Cells"]} Cells */
/** @typedef {Schemas["Convergence"]} Convergence */
/** @typedef {Schemas["Deleted"]} Deleted */
/** @typedef {Schemas["DryRun"]} DryRun */
/** @typedef {Schemas["Experiment"]} Experiment */
/** @typedef {Schemas["ExperimentDetail"]} ExperimentDetail */
/** @typedef {Schemas["Fault"]} Fault */
/** @typedef {Schemas["Health"]} Health */
/** @typedef {Schemas["MetricInfo"]} MetricInfo */
/** @typedef {Schemas["Overview"]} Overview */
/** @typedef {Schemas["Point"]} Point */
/** @typedef {Schemas["PointFile"]} PointFile */
/** @typedef {Schemas["Problem"]} Problem */
/** @typedef {Schemas["Progress"]} Progress */
/** @typedef {Schemas["Scene"]} Scene */
/** @typedef {Schemas["SceneParameter"]} SceneParameter */
/** @typedef {Schemas["SceneInfo"]} SceneInfo */
/** @typedef {Schemas["Series"]} Series */
/** @typedef {Schemas["Slope"]} Slope */
/** @typedef {Schemas["Update"]} Update */
/** @typedef {Schemas["Worker"]} Worker */
/** @typedef {Experiment["state"]} State */
/** @typedef {Cell["role"]} Role */
/** @typedef {Partial<Schemas["Submission"]>} Submission */

/** A request that the server understood and refused. `problem` is what it said (RFC 9457). */
export class ApiProblem extends Error {
  /** @param {Problem} problem */
  constructor(problem) {
    super(problem.detail || problem.title);
    this.name = "ApiProblem";
    this.problem = problem;
  }
}

/** No answer: the server has ended, or the network has. Trying again later may help. */
export class Unreachable extends Error {
  constructor() {
    super("the server does not answer; start it with ./dartboard up, this page goes on by itself");
    this.name = "Unreachable";
  }
}

/**
 * The answer to a request, as JSON; null for an empty one.
 * @param {string} path @param {RequestInit} [init] @returns {Promise<any>}
 */
async function request(path, init = {}) {
  let response, text;
  try {
    response = await fetch(path, { ...init, headers: { Accept: "application/json", ...init.headers } });
    text = await response.text();
  } catch (error) {
    if (error instanceof DOMException && error.name === "AbortError") throw error;
    throw new Unreachable();
  }
  const data = parsed(text);
  if (response.ok) return data;
  throw new ApiProblem(isProblem(data) ? data : unexplained(path, response));
}

/** @param {string} text @returns {unknown} */
function parsed(text) {
  try {
    return text ? JSON.parse(text) : null;
  } catch {
    return null;
  }
}

/** @param {any} data @returns {data is Problem} */
function isProblem(data) {
  return typeof data?.title === "string" && typeof data?.status === "number";
}

/** What a proxy or a broken server leaves to say. @param {string} path @param {Response} response @returns {Problem} */
function unexplained(path, response) {
  const title = `${response.status} ${response.statusText}`.trim();
  const detail = `${path} was answered with ${title} and no explanation; the server's log may have one`;
  return { type: "about:blank", title, status: response.status, detail, instance: path, problems: [] };
}

/** @param {string} path @param {{signal?: AbortSignal}} [options] @returns {Promise<any>} */
export function getJson(path, { signal } = {}) {
  return request(path, { signal });
}

/**
 * @param {string} path @param {unknown} [body] @param {Record<string, string>} [headers]
 * @param {{signal?: AbortSignal}} [options] @returns {Promise<any>}
 */
export function postJson(path, body, headers = {}, { signal } = {}) {
  if (body === undefined) return request(path, { method: "POST", headers, signal });
  const typed = { "Content-Type": "application/json", ...headers };
  return request(path, { method: "POST", headers: typed, body: JSON.stringify(body), signal });
}

/** @param {string} path @param {Blob} bytes @param {string} type media type @returns {Promise<any>} */
export function postBytes(path, bytes, type) {
  return request(path, { method: "POST", headers: { "Content-Type": type }, body: bytes });
}

/** @param {string} path @returns {Promise<any>} */
export function del(path) {
  return request(path, { method: "DELETE" });
}

/**
 * The query that holds the values that are set, with its question mark.
 * @param {Record<string, string | number | boolean | null | undefined>} values
 */
function query(values) {
  const set = Object.entries(values).filter(([, value]) => value !== undefined && value !== null && value !== "");
  const text = new URLSearchParams(set.map(([key, value]) => [key, String(value)])).toString();
  return text && `?${text}`;
}

/** @param {number | string} id */
const at = (id) => `/api/experiments/${encodeURIComponent(id)}`;

export const overviewEvents = "/api/events";

export const experiments = {
  /** @returns {Promise<Experiment[]>} newest first */
  list: () => getJson("/api/experiments"),
  /** @param {number | string} id @returns {Promise<ExperimentDetail>} */
  get: (id) => getJson(at(id)),
  /** @param {Submission} submission @param {AbortSignal} [signal] @returns {Promise<DryRun>} */
  dryRun: (submission, signal) => postJson("/api/experiments?dry_run=true", submission, {}, { signal }),
  /**
   * The same `key` never makes two experiments.
   * @param {Submission} submission @param {string} key @returns {Promise<Experiment>}
   */
  submit: (submission, key) => postJson("/api/experiments", submission, { "Idempotency-Key": key }),
  /**
   * @param {number} id @param {"pause" | "resume" | "cancel" | "retry" | "restore"} action
   * @returns {Promise<Experiment>}
   */
  act: (id, action) => postJson(`${at(id)}/${action}`),
  /** @param {number} id @param {{dryRun?: boolean}} [options] @returns {Promise<Deleted>} */
  remove: (id, { dryRun = false } = {}) => del(at(id) + (dryRun ? "?dry_run=true" : "")),
  /** @param {number} id @param {{after?: number, start?: number, limit?: number}} [page] @returns {Promise<Cells>} */
  cells: (id, page = {}) => getJson(`${at(id)}/cells${query(page)}`),
  /** @param {number} id @param {{metric: string, scene?: string}} which @returns {Promise<Convergence>} */
  convergence: (id, which) => getJson(`${at(id)}/convergence${query(which)}`),
  /** @param {number} id */
  eventsUrl: (id) => `${at(id)}/events`,
  /** @param {number} id */
  csvUrl: (id) => `${at(id)}/results.csv`,
  /** @param {number} id */
  jsonUrl: (id) => `${at(id)}/results.json`,
  /** @param {number} id */
  reportUrl: (id) => `${at(id)}/report`,
};

export const scenes = {
  /** @returns {Promise<Scene[]>} */
  list: () => getJson("/api/scenes"),
  /** What can be swept in a scene. @param {string} digest @param {string} colour @returns {Promise<SceneParameter[]>} */
  parameters: (digest, colour) => getJson(`/api/scenes/${digest}/parameters${query({ colour })}`),
  /**
   * @param {Blob} zip a scene's folder @param {string} name @param {string} [main] its XML file
   * @returns {Promise<Scene>}
   */
  upload: (zip, name, main) => postBytes(`/api/scenes${query({ name, main })}`, zip, "application/zip"),
};

export const points = {
  /** @param {Blob} npz sets of points, as numpy writes them @param {string} name @returns {Promise<PointFile>} */
  upload: (npz, name) => postBytes(`/api/points${query({ name })}`, npz, "application/octet-stream"),
};

export const cells = {
  /** History and logs. @param {number} cell @returns {Promise<Attempts>} */
  attempts: (cell) => getJson(`/api/cells/${cell}/attempts`),
  /** @param {number} cell @param {{role?: Role, k?: number | "mean"}} [which] */
  exrUrl: (cell, which = {}) => `/api/cells/${cell}/image.exr${query(which)}`,
};

/**
 * A tone-mapped PNG; `v` only makes URLs of a changing picture distinct.
 * @param {number} cell
 * @param {{role?: Role, k?: number, size?: 64 | 128 | 256 | 512, ev?: number, tone?: string, max?: number,
 *   v?: string | number}} [how]
 */
export function previewUrl(cell, how = {}) {
  return `/api/cells/${cell}/preview.png${query(how)}`;
}

/**
 * The per-pixel error as a PNG, from 0 to `max`.
 * @param {number} cell @param {string} metric
 * @param {{reference: number, k?: number, size?: number, max?: number, v?: string | number}} how
 */
export function errorUrl(cell, metric, how) {
  return `/api/cells/${cell}/error/${encodeURIComponent(metric)}.png${query(how)}`;
}

/**
 * Float16 RGB rows, see `X-Width`.
 * @param {number} cell @param {{role?: Role, k?: number | "mean", size?: number}} [which]
 */
export function pixelsUrl(cell, which = {}) {
  return `/api/cells/${cell}/pixels${query(which)}`;
}
