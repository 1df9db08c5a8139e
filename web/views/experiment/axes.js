// @ts-check
/**
 * The axes of an experiment, and its cells found by their place on them.
 *
 * A value of an axis is its label, as text: that is what stands in an address, on a row and in a legend, and
 * `16` and `"16"` cannot be confused. Pure: no page, no network.
 */
/** @typedef {import("../../api.js").Cell} Cell */
/** @typedef {import("../../api.js").ExperimentDetail} ExperimentDetail */
/** A cell, or a curve, which has no spp. @typedef {{scene: string, integrator: string, sampler: string, spp?: number, sweep?: Record<string, unknown>}} Placed */
/** @typedef {{name: string, title: string, values: readonly string[]}} Axis */
/** @typedef {Record<string, string>} Place axis name → value, one for every axis */

const SWEEP = "sweep.";

/** Every axis in the order of the grid; sweeps come last. @param {ExperimentDetail} detail @returns {Axis[]} */
export function axesOf(detail) {
  return [
    { name: "scene", title: "scene", values: detail.scenes.map((scene) => scene.name) },
    { name: "integrator", title: "integrator", values: detail.integrators },
    { name: "sampler", title: "sampler", values: detail.samplers },
    { name: "spp", title: "spp", values: detail.spp.map(String) },
    ...Object.entries(detail.sweeps).map(([parameter, values]) => ({
      name: SWEEP + parameter,
      title: parameter,
      values: values.map(text),
    })),
  ];
}

/** Where a cell lies on an axis; null where the axis does not concern it. @param {Placed} cell @param {string} axis @returns {string | null} */
export function valueOn(cell, axis) {
  switch (axis) {
    case "scene":
      return cell.scene;
    case "integrator":
      return cell.integrator;
    case "sampler":
      return cell.sampler;
    case "spp":
      return cell.spp === undefined ? null : String(cell.spp);
    default: {
      const value = cell.sweep?.[axis.slice(SWEEP.length)];
      return value === undefined || value === null ? null : text(value);
    }
  }
}

/** A swept value as people read it. @param {unknown} value */
function text(value) {
  return typeof value === "string" ? value : JSON.stringify(value);
}

/**
 * Cells by place. A sweep that does not apply to a scene is left out of the keys of that scene, so that its
 * cells are found whatever the sweep is set to.
 */
export class CellIndex {
  /** @type {Map<string, Cell>} */
  #cells = new Map();
  /** Sweep axes that some cell of a scene has: "scene\0axis". @type {Set<string>} */
  #applies = new Set();

  /** @param {readonly Axis[]} axes */
  constructor(axes) {
    this.axes = axes;
    this.sweeps = axes.filter((axis) => axis.name.startsWith(SWEEP)).map((axis) => axis.name);
  }

  /** Adds a cell, or replaces the one in its place. @param {Cell} cell */
  put(cell) {
    const place = placeOf(cell, this.axes);
    for (const sweep of this.sweeps) if (sweep in place) this.#applies.add(`${cell.scene}\0${sweep}`);
    this.#cells.set(this.#key(place), cell);
  }

  /** The cell at a place; undefined where the grid has none, or it is not loaded yet. @param {Place} place */
  at(place) {
    return this.#cells.get(this.#key(place));
  }

  /** @param {Place} place */
  #key(place) {
    let key = `${place["scene"]}\0${place["integrator"]}\0${place["sampler"]}\0${place["spp"]}`;
    for (const sweep of this.sweeps) {
      if (this.#applies.has(`${place["scene"]}\0${sweep}`)) key += `\0${place[sweep]}`;
    }
    return key;
  }
}

/** The place of a cell, without the sweeps that do not apply to it. @param {Placed} cell @param {readonly Axis[]} axes @returns {Place} */
export function placeOf(cell, axes) {
  /** @type {Place} */
  const place = {};
  for (const { name } of axes) {
    const value = valueOn(cell, name);
    if (value !== null) place[name] = value;
  }
  return place;
}

/** "cornell_box · path · stratified · 16 spp", as alternative texts and titles have it. @param {Cell} cell */
export function describe(cell) {
  const sweep = Object.entries(cell.sweep ?? {}).map(([name, value]) => `${name} = ${text(value)}`);
  return [cell.scene, ...sweep, cell.integrator, cell.sampler, `${cell.spp} spp`].join(" · ");
}
