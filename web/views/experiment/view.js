// @ts-check
/**
 * What the experiment page is set to: one reading of the address that pictures, curves and table obey.
 *
 * Exposure, tone and layout of the viewer are in the address too, under the names that `viewer/settings.js` gives them.
 * Every axis is either on the rows, on the columns, or *pinned* to one value; on any axis values may be hidden. What
 * the address does not say has a default, and a value that the grid does not have counts as not said, so an old or
 * mistyped link still opens. Pure: views change the address with `setParams`.
 */
import { EV_LIMIT } from "../../viewer/settings.js";
import { axesOf, placeOf, valueOn } from "./axes.js";

/** @typedef {import("../../api.js").Cell} Cell */
/** @typedef {import("../../api.js").ExperimentDetail} ExperimentDetail */
/** @typedef {import("../../api.js").MetricInfo} MetricInfo */
/** @typedef {import("./axes.js").Axis} Axis */
/** @typedef {import("./axes.js").Place} Place */
/**
 * @typedef {object} View
 * @property {Axis[]} axes every axis, with every value
 * @property {Axis} rows with the values that are shown
 * @property {Axis} cols with the values that are shown
 * @property {Axis[]} pinned the other axes that have more than one value, with the values that are shown
 * @property {Place} at the value each axis is pinned to, should it be neither on rows nor on columns
 * @property {Map<string, Set<string>>} hidden axis name → values that are not shown
 * @property {MetricInfo} metric
 * @property {{axis: string, value: string} | null} baseline what ratios are taken to; null: none
 * @property {boolean} errors error maps in place of pictures
 * @property {number} ev stops
 * @property {Tone} tone
 * @property {number | null} size px, the width of a thumbnail; null: as the width of the grid allows
 * @property {number | null} scale end of the colours of error maps or false colours; null: chosen by itself
 * @property {"spp" | "seconds"} against what curves are drawn
 * @property {"overlay" | "multiples"} arrange of the curves
 * @property {string} sort column of the table, with "-" in front for falling; "" is the order of the plan
 * @property {string} filter words that a row of the table must hold
 * @property {number | null} selected position of a cell
 * @property {boolean} open whether the viewer is open on the selected cell
 */
/** @typedef {"srgb" | "gamma22" | "falsecolour"} Tone */

export const SIZES = [96, 128, 176, 256]; // px
const METHODS = ["sampler", "integrator"]; // axes that errors may be compared along

/**
 * @param {URLSearchParams} params @param {ExperimentDetail} detail
 * @param {string | null} spp that is pinned where the address does not say
 * @returns {View}
 */
export function viewOf(params, detail, spp) {
  const axes = axesOf(detail);
  const hidden = new Map(axes.map((axis) => [axis.name, hiddenOn(params, axis)]));
  /** @param {Axis} axis @returns {Axis} */
  const shown = (axis) => ({ ...axis, values: axis.values.filter((value) => !hidden.get(axis.name)?.has(value)) });
  const [rows, cols] = gridAxes(params, axes);
  /** @type {Place} */
  const at = {};
  for (const axis of axes) {
    const { values } = shown(axis);
    const wanted = [params.get(axis.name), axis.name === "spp" ? spp : null, values[0]];
    at[axis.name] = wanted.find((value) => value && values.includes(value)) ?? "";
  }
  const tone = params.get("tone");
  return {
    axes,
    rows: shown(rows),
    cols: shown(cols),
    pinned: axes.filter((axis) => axis !== rows && axis !== cols && axis.values.length > 1).map(shown),
    at,
    hidden,
    metric: metricOf(params, detail),
    baseline: baselineOf(params, axes),
    errors: params.get("show") === "errors",
    ev: clamp(Number(params.get("ev")) || 0, -EV_LIMIT, EV_LIMIT),
    tone: tone === "gamma22" || tone === "falsecolour" ? tone : "srgb",
    size: SIZES.find((size) => size === Number(params.get("size"))) ?? null,
    scale: Number(params.get("scale")) > 0 ? Number(params.get("scale")) : null,
    against: params.get("against") === "seconds" ? "seconds" : "spp",
    arrange: params.get("arrange") === "multiples" ? "multiples" : "overlay",
    sort: params.get("sort") ?? "",
    filter: params.get("q") ?? "",
    selected: params.has("cell") ? Number(params.get("cell")) : null,
    open: params.get("viewer") === "open",
  };
}

/** The place at a row and a column. @param {View} view @param {string} row @param {string} col @returns {Place} */
export function placeAt(view, row, col) {
  return { ...view.at, [view.rows.name]: row, [view.cols.name]: col };
}

/** Whether no axis hides a cell or a curve. @param {View} view @returns {(of: import("./axes.js").Placed) => boolean} */
export function showing(view) {
  const hidden = [...view.hidden].filter(([, values]) => values.size);
  return (of) => hidden.every(([axis, values]) => !values.has(valueOn(of, axis) ?? ""));
}

/** A text that changes when what is hidden does. @param {View} view */
export function hiddenText(view) {
  return JSON.stringify([...view.hidden].map(([axis, values]) => [axis, ...values]));
}

/** What to set so that a cell is in the grid, selected. @param {View} view @param {Cell} cell @returns {Record<string, string | null>} */
export function selecting(view, cell) {
  const place = placeOf(cell, view.axes);
  const pins = view.pinned.filter(({ name }) => name in place).map(({ name }) => [name, place[name] ?? null]);
  return { ...Object.fromEntries(pins), cell: String(cell.position) };
}

/** What to set so that a value of an axis is shown or hidden; the last one that is shown stays. @param {View} view @param {string} axis @param {string} value @returns {Record<string, string | null>} */
export function toggling(view, axis, value) {
  const values = view.axes.find(({ name }) => name === axis)?.values ?? [];
  const hidden = new Set(view.hidden.get(axis));
  if (!hidden.delete(value)) hidden.add(value);
  if (hidden.size === values.length) return {};
  return { [`hide.${axis}`]: [...hidden].map(escaped).join("~") || null };
}

/** What to set so that only one value of an axis is shown; all of them if it is the only one already. @param {View} view @param {string} axis @param {string} value @returns {Record<string, string | null>} */
export function isolating(view, axis, value) {
  const others = (view.axes.find(({ name }) => name === axis)?.values ?? []).filter((other) => other !== value);
  const alone = others.every((other) => view.hidden.get(axis)?.has(other));
  return { [`hide.${axis}`]: alone ? null : others.map(escaped).join("~") || null };
}

/** @param {URLSearchParams} params @param {Axis} axis @returns {Set<string>} */
function hiddenOn(params, axis) {
  const named = (params.get(`hide.${axis.name}`) ?? "").split("~").map(unescaped);
  const hidden = new Set(named.filter((value) => axis.values.includes(value)));
  return hidden.size < axis.values.length ? hidden : new Set();
}

/** A label may hold the character that separates labels. @param {string} value */
function escaped(value) {
  return value.replaceAll("%", "%25").replaceAll("~", "%7E");
}

/** @param {string} text */
function unescaped(text) {
  return text.replaceAll("%7E", "~").replaceAll("%25", "%");
}

/** @param {URLSearchParams} params @param {readonly Axis[]} axes @returns {[Axis, Axis]} */
function gridAxes(params, axes) {
  const [rows, cols] = defaultAxes(axes);
  const named = [params.get("rows"), params.get("cols")].map((name) => axes.find((axis) => axis.name === name));
  if (named[0] && named[1] && named[0] !== named[1]) return [named[0], named[1]];
  if (named[0]) return [named[0], named[0] === cols ? rows : cols];
  if (named[1]) return [named[1] === rows ? cols : rows, named[1]];
  return [rows, cols];
}

/**
 * Samplers × integrators, as the question is put. Where there is one integrator, spp takes the columns; where there is one
 * sampler, two swept parameters make the better grid.
 * @param {readonly Axis[]} axes @returns {[Axis, Axis]}
 */
export function defaultAxes(axes) {
  const [scene, integrator, sampler, spp, ...sweeps] = /** @type {[Axis, Axis, Axis, Axis, ...Axis[]]} */ (axes);
  const [first, second] = sweeps.filter((axis) => axis.values.length > 1);
  if (sampler.values.length === 1 && first && second) return [first, second];
  const cols = integrator.values.length > 1 ? integrator : spp;
  const rows = [sampler, first, scene].find((axis) => axis && axis.values.length > 1 && axis !== cols);
  return [rows ?? sampler, cols];
}

/** @param {URLSearchParams} params @param {ExperimentDetail} detail @returns {MetricInfo} */
function metricOf(params, detail) {
  /** @param {string | null} name */
  const find = (name) => detail.metrics.find((metric) => metric.name === name);
  return /** @type {MetricInfo} */ (find(params.get("metric")) ?? find(detail.default_metric) ?? detail.metrics[0]);
}

/** @param {URLSearchParams} params @param {readonly Axis[]} axes @returns {View["baseline"]} */
function baselineOf(params, axes) {
  const text = params.get("base") ?? "";
  if (text === "none") return null;
  const [, name, value] = /^(\w+):(.*)$/.exec(text) ?? [];
  const axis = axes.find((known) => known.name === name && METHODS.includes(known.name));
  if (axis && value !== undefined && axis.values.includes(value)) return { axis: axis.name, value };
  const usual = METHODS.map((method) => axes.find((known) => known.name === method)).find((known) => known && known.values.length > 1);
  return usual ? { axis: usual.name, value: /** @type {string} */ (usual.values[0]) } : null;
}

/** What a baseline may be: every value of the axes along which errors are compared. @param {View} view */
export function baselines(view) {
  return view.axes.filter((axis) => METHODS.includes(axis.name) && axis.values.length > 1);
}

/** @param {number} value @param {number} low @param {number} high */
function clamp(value, low, high) {
  return Math.min(high, Math.max(low, value));
}
