// @ts-check
/**
 * An experiment as the beginning of another: its grid in the form, or as text where the form has no field for it.
 */
import { choice } from "./form.js";
import { FIELDS } from "./fields.js";
import { readToml } from "./toml.js";

/** @typedef {import("./form.js").Form} Form */
/** @typedef {import("../../api.js").ExperimentDetail} ExperimentDetail */

const COPY = / \(copy(?: (\d+))?\)$/;

/**
 * The form of an experiment's grid, null where the form cannot say all of it.
 * @param {ExperimentDetail} experiment @returns {Form | null}
 */
export function formOf({ toml, paths = {}, points = {} }) {
  const grid = readToml(toml);
  if (!grid || Object.keys(grid).some((key) => !FIELDS.includes(key))) return null;
  const reference = grid.reference;
  if (isTable(reference) && "replicates" in reference && reference.replicates !== 2) return null;
  const [width, height] = texts(grid.resolution);
  /** @param {string} name */
  const said = (name) => (isTable(reference) && name in reference ? String(reference[name]) : "");
  return {
    name: copied(String(grid.name ?? "")),
    scenes: texts(grid.scenes).map((name) => (paths[name] ? { name, digest: paths[name] } : { name })),
    samplers: texts(grid.samplers).map(choice),
    points: Object.entries(points).map(([name, digest]) => ({ name, digest })),
    integrators: texts(grid.integrators).map(choice),
    spp: texts(grid.spp),
    sweeps: tables(grid.sweep).map((sweep) => ({
      parameter: String(sweep.parameter ?? ""),
      values: texts(sweep.values, JSON.stringify).join(", "),
      scenes: texts(sweep.scenes),
    })),
    replicates: String(grid.replicates ?? ""),
    width: width ?? "",
    height: height ?? "",
    depth: String(grid.max_depth ?? ""),
    rfilter: choice(String(grid.rfilter ?? "")),
    colour: String(grid.colour ?? "rgb"),
    reference: {
      wanted: reference !== false,
      integrator: said("integrator"),
      sampler: said("sampler"),
      spp: said("spp"),
    },
  };
}

/** The text of an experiment's grid under the name of a copy. @param {ExperimentDetail} experiment */
export function tomlOf({ toml, name }) {
  return toml.replace(/^name = .*$/m, () => `name = ${JSON.stringify(copied(name))}`);
}

/** @param {unknown} value @returns {value is Record<string, unknown>} */
function isTable(value) {
  return typeof value === "object" && value !== null && !Array.isArray(value);
}

/** @param {unknown} value @returns {Record<string, unknown>[]} */
function tables(value) {
  return Array.isArray(value) ? value.filter(isTable) : [];
}

/** A list as texts. @param {unknown} value @param {(one: unknown) => string} [text] @returns {string[]} */
function texts(value, text = String) {
  return Array.isArray(value) ? value.map((one) => text(one)) : [];
}

/** "x" → "x (copy)" → "x (copy 2)". @param {string} name */
function copied(name) {
  const found = COPY.exec(name);
  return found ? name.replace(COPY, ` (copy ${Number(found[1] ?? 1) + 1})`) : `${name} (copy)`;
}
