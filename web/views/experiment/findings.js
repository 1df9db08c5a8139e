// @ts-check
/**
 * What can be said for certain from the numbers of an experiment, in plain words. Pure.
 *
 * A finding is no guess: it is counted, or chance would produce it less than once in a thousand such experiments.
 */
import { counted } from "../../format.js";
import { estimateOf } from "./compare.js";
import { combined, tail } from "./chance.js";

/** @typedef {import("../../api.js").Cell} Cell */
/** @typedef {import("../../api.js").ExperimentDetail} ExperimentDetail */
/** @typedef {import("../../api.js").Series} Series */
/** @typedef {import("./compare.js").Estimate} Estimate */
/** @typedef {{kind: "bad" | "warn" | "note", text: string, cell?: number, filter?: string}} Finding
 * `cell`: position of a cell that shows it; `filter`: words that leave its rows in the table */

const CHANCE = 0.001; // of one false alarm in the whole experiment: a page that is live asks many times
const LEAST = 3; // standard errors from 1 that a brightness must be, somewhere on its curve
const MOST = 4; // curves that are named before "and 3 more"

/** @param {ExperimentDetail} detail @param {readonly (Cell | undefined)[]} all @param {readonly Series[]} series @returns {Finding[]} */
export function findings(detail, all, series) {
  const cells = /** @type {Cell[]} */ (all.filter((cell) => cell?.role === "cell"));
  const references = /** @type {Cell[]} */ (all.filter((cell) => cell?.role === "reference"));
  return [
    ...failures([...cells, ...references]),
    ...biases(cells, references),
    ...timings(series),
    ...missingReferences(detail),
    ...ownReferences(cells),
    ...replays(cells),
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

/** Curves whose brightness chance does not explain; replays are left out, which are wrong on purpose. @param {readonly Cell[]} cells @param {readonly Cell[]} references @returns {Finding[]} */
function biases(cells, references) {
  const curves = brightnesses(cells, references);
  const suspects = curves.filter(({ off, chance }) => off > LEAST && chance * curves.length < CHANCE);
  /** @type {Finding[]} */
  const told = suspects.slice(0, MOST).map((curve) => ({ kind: "warn", text: biasText(curve), cell: curve.cell.position }));
  if (suspects.length > MOST) told.push({ kind: "warn", text: `and ${counted(suspects.length - MOST, "more curve")} like that` });
  return told;
}

/** @typedef {{cell: Cell, ratio: Estimate, off: number, chance: number}} Brightness
 * of a curve: its cell that is farthest off, in standard errors, and the probability that chance alone does that to the curve */

/** Farthest off first. @param {readonly Cell[]} cells @param {readonly Cell[]} references @returns {Brightness[]} */
function brightnesses(cells, references) {
  const measured = cells.flatMap((cell) => {
    const ratio = estimateOf(cell, "mean_ratio");
    return ratio?.se && ratio.n > 1 && !cell.replay ? [{ cell, ratio, se: ratio.se }] : [];
  });
  const noise = referenceNoise(measured, references);
  /** @type {Map<string, Brightness & {points: number, logs: number}>} */
  const curves = new Map();
  for (const { cell, ratio, se } of measured) {
    const own = noise.get(cell.reference ?? NaN);
    if (own === undefined) continue;
    const off = Math.abs(ratio.mean - 1) / Math.hypot(se, own);
    const key = JSON.stringify([cell.scene, cell.integrator, cell.sampler, cell.sweep]);
    const curve = curves.get(key) ?? { cell, ratio, off, chance: 1, points: 0, logs: 0 };
    curve.points += 1;
    curve.logs += Math.log(Math.max(Number.MIN_VALUE, tail(off, ratio.n - 1)));
    if (off > curve.off) Object.assign(curve, { cell, ratio, off });
    curves.set(key, curve);
  }
  return [...curves.values()].map((curve) => ({ ...curve, chance: combined(curve.logs, curve.points) })).sort((a, b) => b.off - a.off);
}

/**
 * By the `cell` of a reference, how noisy its brightness is at most, relative: as noisy as the noisiest curve would be
 * with as many samples. All cells that are measured against it are off by that together.
 * @param {readonly {cell: Cell, ratio: Estimate, se: number}[]} measured @param {readonly Cell[]} references
 */
function referenceNoise(measured, references) {
  /** @type {Map<number, number>} */
  const variances = new Map(); // of one sample per pixel
  for (const { cell, ratio, se } of measured) {
    if (cell.reference === null || cell.reference === undefined) continue;
    variances.set(cell.reference, Math.max(variances.get(cell.reference) ?? 0, se * se * ratio.n * cell.spp_actual));
  }
  /** @type {Map<number, number>} */
  const noise = new Map();
  for (const { cell, had, spp_actual } of references) {
    const variance = variances.get(cell);
    if (variance !== undefined && had > 0) noise.set(cell, Math.sqrt(variance / (had * spp_actual)));
  }
  return noise;
}

/** @param {Brightness} curve */
function biasText({ cell, ratio, off }) {
  const se = Number(ratio.se);
  const digits = Math.min(6, Math.max(3, 1 - Math.floor(Math.log10(se))));
  return (
    `${cell.scene} · ${cell.integrator} · ${cell.sampler}: at ${cell.spp} spp mean_ratio ${ratio.mean.toFixed(digits)} ± ` +
    `${se.toFixed(digits)} (n = ${ratio.n}) is ${off.toFixed(1)} standard errors from 1, the reference's own noise included; ` +
    "chance does not explain the curve: its pictures or their reference are biased"
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

/** Samplers that are wrong on purpose. @param {readonly Cell[]} cells @returns {Finding[]} */
function replays(cells) {
  const named = [...new Set(cells.filter(({ replay }) => replay).map(({ sampler }) => sampler))];
  if (!named.length) return [];
  const shows = named.length === 1 ? "is a replay: it shows" : "are replays: they show";
  return [{ kind: "note", text: `${list(named)} ${shows} a published mistake on purpose, plotted at the samples that were asked, and never best` }];
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
