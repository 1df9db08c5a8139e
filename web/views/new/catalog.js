// @ts-check
/** What can be chosen: the catalog of the server, and the scenes it has. */
import { getJson, scenes } from "../../api.js";

/** @typedef {import("../../api.js").Scene} Scene */
/**
 * @typedef {object} Parameter
 * @property {string} name
 * @property {"bool" | "int" | "float" | "str"} type
 * @property {boolean | number | string | null} default null: taken from the grid or the scene
 * @property {string} unit
 * @property {number | null} minimum
 * @property {number | null} maximum
 * @property {string} line
 */
/**
 * @typedef {object} Entry
 * @property {string} name
 * @property {string} line
 * @property {string} source
 * @property {readonly string[]} aliases
 * @property {readonly Parameter[]} parameters
 * @property {string} [rounding] samplers only
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

/** The range of a parameter in words. @param {Parameter} parameter */
export function allowed({ type, minimum, maximum, unit }) {
  if (type === "bool" || type === "str") return "";
  const words = unit && ` ${unit}`;
  if (maximum !== null) return `${minimum ?? "any"} to ${maximum}${words}`;
  return minimum === null ? `any number${words && ` of${words}`}` : `${minimum}${words} or more`;
}
