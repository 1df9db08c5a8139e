// @ts-check
/**
 * The table of an experiment as data: its columns, what a filter leaves, an order, and the text to copy or download.
 * Pure: the table on the page and the file hold the same rows in the same order.
 */
import { number } from "../../format.js";
import { valueOn } from "./axes.js";
import { estimateOf, meanText } from "./compare.js";

/** @typedef {import("../../api.js").Cell} Cell */
/** @typedef {import("../../api.js").ExperimentDetail} ExperimentDetail */
/**
 * @typedef {object} Column
 * @property {string} name in addresses and files
 * @property {string} title
 * @property {string} [hint]
 * @property {boolean} numeric
 * @property {number} width least, px
 * @property {(cell: Cell) => string | number | null} value what is sorted by and written to files
 * @property {(cell: Cell) => string} [show] default: the value
 * @property {{name: string, value: (cell: Cell) => string | number | null}[]} [more] columns that a file has beside it
 */

/** @param {ExperimentDetail} detail @returns {Column[]} */
export function columnsOf(detail) {
  return [
    { name: "scene", title: "scene", numeric: false, width: widthOf(detail.scenes.map((scene) => scene.name)), value: (cell) => cell.scene },
    { name: "integrator", title: "integrator", numeric: false, width: widthOf(detail.integrators), value: (cell) => cell.integrator },
    { name: "sampler", title: "sampler", numeric: false, width: widthOf(detail.samplers, detail.replays.length ? 300 : 190), value: (cell) => cell.sampler },
    ...Object.entries(detail.sweeps).map(([parameter, values]) => ({
      name: parameter,
      title: shortName(parameter, Object.keys(detail.sweeps)),
      hint: parameter,
      numeric: values.every((value) => typeof value === "number"),
      width: widthOf([shortName(parameter, Object.keys(detail.sweeps)), ...values.map(String)], 190, 60),
      value: (/** @type {Cell} */ cell) => sorted(valueOn(cell, `sweep.${parameter}`)),
    })),
    {
      name: "spp",
      title: "spp",
      hint: "samples per pixel: asked → rendered",
      numeric: true,
      width: 80,
      value: (cell) => cell.spp,
      show: (cell) => (cell.spp === cell.spp_actual ? String(cell.spp) : `${cell.spp} → ${cell.spp_actual}`),
      more: [{ name: "spp_actual", value: (cell) => cell.spp_actual }],
    },
    {
      name: "n",
      title: "n",
      hint: "replicates rendered, of those wanted",
      numeric: true,
      width: 44,
      value: (cell) => cell.had,
      show: (cell) => (cell.had === cell.wanted ? String(cell.had) : `${cell.had}/${cell.wanted}`),
    },
    ...detail.metrics.map((metric) => ({
      name: metric.name,
      title: metric.name,
      hint: `${metric.formula}: ${metric.line}`,
      numeric: true,
      width: 128,
      value: (/** @type {Cell} */ cell) => estimateOf(cell, metric.name)?.mean ?? null,
      show: (/** @type {Cell} */ cell) => {
        const estimate = estimateOf(cell, metric.name);
        if (!estimate) return "–";
        const mean = meanText(estimate, metric);
        return (estimate.se === null ? mean : `${mean} ± ${estimate.se.toExponential(1)}`).replaceAll("e+", "e");
      },
      more: [{ name: `${metric.name}_se`, value: (/** @type {Cell} */ cell) => estimateOf(cell, metric.name)?.se ?? null }],
    })),
    {
      name: "seconds",
      title: "seconds",
      hint: "mean render time of a picture, without compiling",
      numeric: true,
      width: 80,
      value: (cell) => cell.seconds ?? null,
      show: (cell) => number(cell.seconds),
    },
    { name: "state", title: "state", numeric: false, width: detail.failed || detail.cells.cancelled ? 128 : 84, value: (cell) => cell.state },
  ];
}

/** px for the longest of some texts, within reason. @param {readonly string[]} texts */
function widthOf(texts, most = 190, least = 84) {
  return Math.min(most, Math.max(least, 20 + 7.6 * Math.max(...texts.map((text) => text.length))));
}

/** The last parts of a parameter's name that no other one ends with: "sphere.bsdf.nu" is "nu". @param {string} parameter @param {readonly string[]} all */
function shortName(parameter, all) {
  const parts = parameter.split(".");
  const ends = parts.map((_, i) => parts.slice(parts.length - 1 - i).join("."));
  const told = (/** @type {string} */ end) => all.some((other) => other !== parameter && `.${other}`.endsWith(`.${end}`));
  return ends.find((end) => !told(end)) ?? parameter;
}

/** Swept numbers sort as numbers. @param {string | null} value */
function sorted(value) {
  return value !== null && value.trim() !== "" && Number.isFinite(Number(value)) ? Number(value) : value;
}

/** Whether a row holds every word of the filter; "spp=16" and "sampler=halton" ask for a whole value. @param {readonly Column[]} columns @param {string} filter @returns {(cell: Cell) => boolean} */
export function matching(columns, filter) {
  const words = filter.toLowerCase().split(/\s+/).filter(Boolean);
  const tests = words.map((word) => {
    const [, name, wanted] = /^([^=]+)=(.+)$/.exec(word) ?? [];
    const column = columns.find((one) => one.name.toLowerCase() === name);
    if (!column) return (/** @type {Cell} */ cell) => textOf(cell, columns).includes(word);
    return (/** @type {Cell} */ cell) => String(column.value(cell)).toLowerCase() === wanted;
  });
  return (cell) => tests.every((test) => test(cell));
}

/** A cell that changes is another object, so its text can be kept. @type {WeakMap<Cell, string>} */
const texts = new WeakMap();

/** Everything in a row that is no number, in small letters. @param {Cell} cell @param {readonly Column[]} columns */
function textOf(cell, columns) {
  const known = texts.get(cell);
  if (known !== undefined) return known;
  const words = columns.filter((column) => !column.numeric).map((column) => column.value(cell));
  const text = [...words, cell.error_class, cell.error].filter(Boolean).join(" ").toLowerCase();
  texts.set(cell, text);
  return text;
}

/** By the column that `sort` names, "-" in front for falling; what has no value stands last. @param {Cell[]} cells @param {readonly Column[]} columns @param {string} sort @returns {Cell[]} */
export function ordered(cells, columns, sort) {
  const falling = sort.startsWith("-");
  const column = columns.find(({ name }) => name === (falling ? sort.slice(1) : sort));
  if (!column) return cells;
  const keyed = cells.map((cell) => ({ cell, key: column.value(cell) }));
  keyed.sort((a, b) => {
    if (a.key === null || b.key === null) return Number(a.key === null) - Number(b.key === null) || a.cell.position - b.cell.position;
    const order = a.key < b.key ? -1 : a.key > b.key ? 1 : 0;
    return (falling ? -order : order) || a.cell.position - b.cell.position;
  });
  return keyed.map(({ cell }) => cell);
}

/** A click on a column: rising, falling, then the order of the plan. @param {string} sort @param {string} name @returns {string | null} */
export function nextSort(sort, name) {
  if (sort === name) return `-${name}`;
  return sort === `-${name}` ? null : name;
}

/** The rows as text, with full precision, in the order given. @param {readonly Cell[]} cells @param {readonly Column[]} columns @param {"\t" | ","} separator */
export function asText(cells, columns, separator) {
  const all = columns.flatMap((column) => [{ name: column.name, value: column.value }, ...(column.more ?? [])]);
  const rows = cells.map((cell) => all.map((column) => field(column.value(cell), separator)).join(separator));
  return [all.map((column) => field(column.name, separator)).join(separator), ...rows].join("\n") + "\n";
}

/** @param {string | number | null} value @param {"\t" | ","} separator */
function field(value, separator) {
  if (value === null) return "";
  const text = String(value);
  if (separator === "\t") return text.replace(/[\t\r\n]+/g, " ");
  return /[",\r\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
}
