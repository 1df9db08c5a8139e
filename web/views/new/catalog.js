// @ts-check
/** What can be chosen: the catalog of the server, and the scenes it has. */
import { getJson, scenes } from "../../api.js";

/** @typedef {import("../../api.js").Scene} Scene */
/**
 * @typedef {object} Parameter
 * @property {string} name
 * @property {"bool" | "int" | "float" | "str"} type
 * @property {boolean | number | string | null} default null: not set
 * @property {string} unset what null comes to
 * @property {string} unit
 * @property {number | null} minimum
 * @property {number | null} maximum
 * @property {string} line
 * @property {readonly string[]} options of a text; empty: any text
 * @property {readonly string[]} meanings of the options
 * @property {readonly string[]} replays those of the options that show a published mistake
 * @property {boolean} required
 */
/**
 * @typedef {object} Entry
 * @property {string} name
 * @property {string} line
 * @property {string} source
 * @property {readonly string[]} aliases
 * @property {readonly Parameter[]} parameters
 * @property {string} [rounding] samplers only
 * @property {number | null} [limit] samplers only: the most samples per pixel
 */
/**
 * @typedef {object} SceneEntry
 * @property {string} name
 * @property {string} line
 * @property {string} title
 * @property {string} good_for
 * @property {string} hard_part
 * @property {string} bad_for
 * @property {string | null} lamp_in_frame
 */
/**
 * @typedef {object} Catalog
 * @property {readonly Entry[]} samplers
 * @property {readonly Entry[]} integrators
 * @property {readonly Entry[]} rfilters
 * @property {readonly SceneEntry[]} scenes
 */

/** @returns {Promise<{catalog: Catalog, known: Scene[]}>} */
export async function readCatalog() {
  const [catalog, known] = await Promise.all([getJson("/api/catalog"), scenes.list()]);
  return { catalog, known };
}

/** The entry that a name or an alias means. @param {readonly Entry[]} entries @param {string} type */
export function entryOf(entries, type) {
  return entries.find(({ name, aliases }) => name === type || aliases.includes(type));
}

/** The parameter by which a sampler becomes a replay, where it is none without it. @param {Entry | undefined} entry */
export function replayOf(entry) {
  return entry?.parameters.find(({ replays, default: usual }) => replays.length > 0 && usual === "");
}

/** Whether a choice shows a published mistake. @param {Entry | undefined} entry @param {import("./form.js").Choice} choice */
export function isReplay(entry, { parameters }) {
  return entry?.parameters.some(({ name, replays }) => replays.includes(parameters[name] ?? "")) ?? false;
}

/** The range of a parameter in words. @param {Parameter} parameter */
export function allowed({ type, minimum, maximum, unit }) {
  if (type === "bool" || type === "str") return "";
  const words = unit && ` ${unit}`;
  if (maximum !== null) return `${minimum ?? "any"} to ${maximum}${words}`;
  return minimum === null ? `any number${words && ` of${words}`}` : `${minimum}${words} or more`;
}
