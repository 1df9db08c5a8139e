// @ts-check
/**
 * What can be said for certain from the numbers of an experiment, in plain words. Pure.
 *
 * A finding is no guess: it is counted, or chance would produce it less than once in a hundred such experiments.
 */
import { counted } from "../../format.js";
import { estimateOf } from "./compare.js";
import { combined, tail } from "./chance.js";

/** @typedef {import("../../api.js").Cell} Cell */
/** @typedef {import("../../api.js").ExperimentDetail} ExperimentDetail */
/** @typedef {import("../../api.js").Series} Series */
/** @typedef {{kind: "bad" | "warn" | "note", text: string, cell?: number, filter?: string}} Finding
 * `cell`: position of a cell that shows it; `filter`: words that leave its rows in the table */

const CHANCE = 0.01; // of one false alarm in the whole experiment
const LEAST = 3; // standard errors from 1 that a brightness must be, somewhere on its curve
const MOST = 4; // curves that are named before "and 3 more"

/** @param {ExperimentDetail} detail @param {readonly (Cell | undefined)[]} all @param {readonly Series[]} series @returns {Finding[]} */
export function findings(detail, all, series) {
  const cells = /** @type {Cell[]} */ (all.filter((cell) => cell?.role === "cell"));
  const everything = /** @type {Cell[]} */ (all.filter(Boolean));
  return [
    ...failures(everything),
    ...biases(cells),
    ...timings(series),
    ...missingReferences(detail),
    ...ownReferences(cells),
    ...roundings(cells),
    ...(detail.replicates === 1
      ? [/** @type {Finding} */ ({ kind: "note", text: "one replicate a cell: how sure the errors are is not known; two or more would tell" })]
      : []),
  ];
}

/** @param {readonly Cell[]} cells @returns {Finding[]} */
function failures(cells) {
  const failed = cells.filter((cell) => cell.state === "failed");
  if (!failed.length) return [];
  /** @type {Map<string, number>} */
  const classes = new Map();
  for (const { error_class } of failed) classes.set(error_class ?? "unknown", (classes.get(error_class ?? "unknown") ?? 0) + 1);
  const causes = [...classes].map(([name, number]) => `${number} ${name.replaceAll("_", " ")}`).join(", ");
  const text = `${counted(failed.length, "cell")} failed: ${causes}`;
  return [{ kind: "bad", text, filter: "failed", ...(failed.length === 1 && failed[0] ? { cell: failed[0].position } : {}) }];
}

/**
 * Curves whose brightness chance does not explain. Where it is most curves of a reference, and all on one side, the
 * reference is to blame: its own noise shifts them together.
 * @param {readonly Cell[]} cells @returns {Finding[]}
 */
function biases(cells) {
  const curves = brightnesses(cells);
  const suspects = curves.filter(({ off, chance }) => off > LEAST && chance * curves.length < CHANCE);
  /** @type {Finding[]} */
  const told = [];
  for (const reference of new Set(suspects.map((curve) => curve.reference))) {
    const company = curves.filter((curve) => curve.reference === reference);
    const off = suspects.filter((curve) => curve.reference === reference);
    const brighter = off.filter((curve) => curve.ratio.mean > 1).length;
    if (company.length > 1 && 2 * off.length > company.length && (brighter === 0 || brighter === off.length)) {
      told.push({ kind: "warn", text: referenceText(company, off), cell: off[0]?.cell.position });
    } else {
      told.push(...off.slice(0, MOST).map((curve) => ({ kind: /** @type {const} */ ("warn"), text: biasText(curve), cell: curve.cell.position })));
      if (off.length > MOST) told.push({ kind: "warn", text: `and ${counted(off.length - MOST, "more curve")} like that` });
    }
  }
  return told;
}

/** @typedef {{reference: number | null, cell: Cell, ratio: import("./compare.js").Estimate, off: number, chance: number}} Brightness
 * of a curve: its cell that is farthest off, in standard errors, and the probability that chance alone does that to the curve */

/** @param {readonly Cell[]} cells @returns {Brightness[]} */
function brightnesses(cells) {
  /** @type {Map<string, Brightness & {points: number, logs: number}>} */
  const curves = new Map();
  for (const cell of cells) {
    const ratio = estimateOf(cell, "mean_ratio");
    if (!ratio || !ratio.se || ratio.n < 2) continue;
    const off = Math.abs(ratio.mean - 1) / ratio.se;
    const key = JSON.stringify([cell.scene, cell.integrator, cell.sampler, cell.sweep]);
    const curve = curves.get(key) ?? { reference: cell.reference ?? null, cell, ratio, off, chance: 1, points: 0, logs: 0 };
    curve.points += 1;
    curve.logs += Math.log(Math.max(Number.MIN_VALUE, tail(off, ratio.n - 1)));
    if (off > curve.off) Object.assign(curve, { cell, ratio, off });
    curves.set(key, curve);
  }
  return [...curves.values()].map((curve) => ({ ...curve, chance: combined(curve.logs, curve.points) })).sort((a, b) => b.off - a.off);
}

/** @param {Brightness} curve */
function biasText({ cell, ratio, off }) {
  return (
    `${cell.scene} · ${cell.integrator} · ${cell.sampler}: at ${cell.spp} spp mean_ratio ${ratio.mean.toFixed(4)} ± ` +
    `${Number(ratio.se).toPrecision(2)} is ${off.toFixed(1)} standard errors from 1 (n = ${ratio.n}), and chance does not explain ` +
    "the curve: its pictures or their reference are biased"
  );
}

/** @param {readonly Brightness[]} company @param {readonly Brightness[]} off */
function referenceText(company, off) {
  const [first] = off;
  const side = (first?.ratio.mean ?? 1) > 1 ? "brighter" : "darker";
  const percent = (100 * Math.abs((first?.ratio.mean ?? 1) - 1)).toPrecision(2);
  return (
    `${first?.cell.scene}: ${off.length} of ${company.length} curves are ${side} than their reference (${percent} %) by more than ` +
    "chance explains: more likely the reference is not exact enough than all of them biased"
  );
}

/** @param {readonly Series[]} series @returns {Finding[]} */
function timings(series) {
  const unlike = [...new Set(series.filter((one) => !one.alike).map(({ integrator, sampler }) => `${sampler} · ${integrator}`))];
  if (!unlike.length) return [];
  const text = `curves were timed under different conditions (machine, threads or neighbours), so their seconds cannot be compared: ${list(unlike)}`;
  return [{ kind: "warn", text }];
}

/** @param {ExperimentDetail} detail @returns {Finding[]} */
function missingReferences({ scenes }) {
  const without = scenes.filter((scene) => scene.reference === null).map((scene) => scene.name);
  if (!without.length) return [];
  return [{ kind: "note", text: `${list(without)}: the grid asks for no reference, so errors are not measured` }];
}

/** Integrators with expected pictures of their own. @param {readonly Cell[]} cells @returns {Finding[]} */
function ownReferences(cells) {
  /** @type {Map<string, Map<number, Set<string>>>} scene and sweep → reference → integrators */
  const scenes = new Map();
  for (const { scene, sweep, reference, integrator } of cells) {
    if (reference === null || reference === undefined) continue;
    const place = JSON.stringify([scene, sweep]);
    const references = scenes.get(place) ?? new Map();
    scenes.set(place, references);
    references.set(reference, (references.get(reference) ?? new Set()).add(integrator));
  }
  /** @type {Set<string>} */
  const told = new Set();
  for (const references of scenes.values()) {
    if (references.size < 2) continue;
    const groups = [...references.values()].map((integrators) => [...integrators].join(", "));
    told.add(`${groups.join(" and ")} count different paths: each has a reference of its own, and their errors are not compared`);
  }
  return [...told].map((text) => ({ kind: "note", text }));
}

/** @param {readonly Cell[]} cells @returns {Finding[]} */
function roundings(cells) {
  /** @type {Map<string, Map<number, number>>} sampler → asked → rendered */
  const rounded = new Map();
  for (const { sampler, spp, spp_actual } of cells) {
    if (spp !== spp_actual) rounded.set(sampler, (rounded.get(sampler) ?? new Map()).set(spp, spp_actual));
  }
  /** @type {Map<string, string[]>} how → samplers */
  const ways = new Map();
  for (const [sampler, how] of rounded) {
    const text = [...how].sort(([a], [b]) => a - b).map(([asked, rendered]) => `${asked} spp asked, ${rendered} rendered`).join("; ");
    ways.set(text, [...(ways.get(text) ?? []), sampler]);
  }
  return [...ways].map(([text, samplers]) => ({ kind: "note", text: `${list(samplers)}: ${text}` }));
}

/** @param {readonly string[]} names */
function list(names) {
  return names.length <= MOST ? names.join(", ") : `${names.slice(0, MOST).join(", ")} and ${names.length - MOST} more`;
}
