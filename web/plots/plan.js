// @ts-check
/**
 * What a convergence plot shows: which curves in which panels, over which ranges, with which guides and noise floors.
 *
 * Colour tells samplers apart; dash and marker tell integrators apart. A replay, a sampler that shows a published mistake, has a
 * dash of its own and stands at the spp that was asked, as its authors read it. Ranges follow the means, so that one wide interval does
 * not flatten every curve. Pure; `convergence.js` draws it.
 */
/** @typedef {import("../api.js").Convergence} Convergence */
/** @typedef {import("../api.js").Series} Series */
/** @typedef {import("../api.js").Point} Point */
/**
 * @typedef {object} Options
 * @property {"spp" | "seconds"} [x] default "spp"
 * @property {"overlay" | "multiples"} [arrange] default "overlay"; in multiples rows are samplers, columns integrators
 * @property {string} [scene] only this scene; needed where the convergence holds several
 * @property {(series: Series) => boolean} [only] which curves to draw
 * @property {boolean} [band] the 95 % interval over replicates; default true
 * @property {boolean} [slopes] faint lines of slope −1, −1.5 and −2; default true
 * @property {boolean} [legend] Plotly's own legend, with slopes; default true, never in multiples
 * @property {boolean} [dark] default false
 * @property {number} [width] px that the plot has; decides how many panels stand side by side
 * @property {readonly string[]} [samplers] every sampler in the grid's order, which fixes the colours
 * @property {readonly string[]} [integrators] every integrator in the grid's order, which fixes dash and marker
 * @property {number} [selected] the `cell` of a point to mark
 * @property {{sampler?: string, integrator?: string}} [emphasis] curves that are not of these step back
 * @property {string} [font] font family
 */
/** @typedef {{series: Series, points: Point[], colour: string, dash: string, symbol: string, fair: boolean}} Curve */
/** @typedef {{title: string, row: number, column: number, curves: Curve[]}} Panel */
/** @typedef {{text: string, muted: string, line: string, context: string}} Ink */
/**
 * What both halves of a figure are made from. Ranges are as Plotly wants them: logarithms to base 10 on log axes.
 * @typedef {object} Plan
 * @property {Curve[]} curves
 * @property {Panel[]} panels
 * @property {readonly string[]} heads over the columns of panels: integrators, or nothing
 * @property {number} rows
 * @property {number} columns
 * @property {boolean} log whether errors have a logarithmic axis
 * @property {[number, number]} x
 * @property {[number, number]} y
 * @property {{slope: number, x: [number, number], y: [number, number], cut: boolean}[]} guides
 * @property {Ink} ink
 */

/** Ten colours that differ in lightness as well as hue, 3:1 or more against their background. */
export const PALETTE = {
  dark: ["#8fb8ff", "#ffb454", "#4fd1a5", "#f48fb1", "#e3d26f", "#b79cff", "#ff7f66", "#6fdcf0", "#b9c0cc", "#a8d84e"],
  light: ["#1f63c9", "#b35900", "#007a57", "#b8246b", "#7d6a00", "#6f3bd1", "#c0341d", "#00788c", "#59616e", "#4c7a00"],
};
export const DASHES = ["solid", "dash", "dot", "dashdot", "longdash", "longdashdot"];
/** Of replays, whatever their integrator. */
export const REPLAY_DASH = "5px,4px";
export const SYMBOLS = ["circle", "square", "diamond", "triangle-up", "x", "pentagon"];
/** What a mean squared error may fall with: independent samples, and better point sets on smooth pictures. */
export const GUIDES = [-1, -1.5, -2];

const PANEL_WIDTH = 230; // px: below, the labels of two ticks meet
/** @type {{dark: Ink, light: Ink}} */
const INK = {
  dark: { text: "#d8dce4", muted: "#98a1b0", line: "#333a47", context: "rgba(152,161,176,0.3)" },
  light: { text: "#1c2330", muted: "#5b6575", line: "#d9dee6", context: "rgba(91,101,117,0.28)" },
};

/** Colour, dash and marker of a curve, the same in every scene. @param {{sampler: string, integrator: string}} of @param {Options} options */
export function styleOf(of, options) {
  const colours = PALETTE[options.dark ? "dark" : "light"];
  const sampler = Math.max(0, options.samplers?.indexOf(of.sampler) ?? 0);
  const integrator = Math.max(0, options.integrators?.indexOf(of.integrator) ?? 0);
  return {
    colour: /** @type {string} */ (colours[sampler % colours.length]),
    dash: /** @type {string} */ (DASHES[integrator % DASHES.length]),
    symbol: /** @type {string} */ (SYMBOLS[integrator % SYMBOLS.length]),
  };
}

/** @param {Convergence} convergence */
export function isLog(convergence) {
  return convergence.metric.lower_is_better !== null;
}

/** @param {Convergence} convergence @param {Options} options */
export function chosen(convergence, options) {
  return convergence.series.filter(
    (series) => (options.scene === undefined || series.scene === options.scene) && (options.only?.(series) ?? true),
  );
}

/** @param {Convergence} convergence @param {Options} options @returns {Plan} */
export function planOf(convergence, options) {
  const log = isLog(convergence);
  const samplers = options.samplers ?? [...new Set(convergence.series.map((series) => series.sampler))];
  const integrators = options.integrators ?? [...new Set(convergence.series.map((series) => series.integrator))];
  const curves = chosen(convergence, options).map((series) => ({
    series,
    ...styleOf(series, { ...options, samplers, integrators }),
    ...(series.replay ? { dash: REPLAY_DASH } : {}),
    fair: series.alike || options.x !== "seconds",
    points: series.points.filter((point) => xOf(series, point, options) > 0 && (point.mean > 0 || !log)),
  }));
  const grid = options.arrange === "multiples" && curves.length ? panelsOf(curves, options) : overlay(curves);
  const ranges = rangesOf(curves, log, options);
  const ink = INK[options.dark ? "dark" : "light"];
  return { curves, log, ink, ...grid, ...ranges, guides: log && options.slopes !== false ? guidesIn(curves, ranges, options) : [] };
}

/** @param {Curve[]} curves */
function overlay(curves) {
  return { rows: 1, columns: 1, heads: [], panels: [{ title: "", row: 0, column: 0, curves }] };
}

/** Rows of samplers and columns of integrators; with one of either, panels wrap to the width. @param {Curve[]} curves @param {Options} options */
function panelsOf(curves, options) {
  const samplers = [...new Set(curves.map((curve) => curve.series.sampler))];
  const integrators = [...new Set(curves.map((curve) => curve.series.integrator))];
  const fit = Math.max(1, Math.floor((options.width ?? 900) / PANEL_WIDTH));
  const matrix = integrators.length > 1 && samplers.length > 1 && integrators.length <= fit;
  const pairs = samplers.flatMap((sampler) => integrators.map((integrator) => ({ sampler, integrator })));
  const filled = pairs
    .map((pair) => ({ ...pair, curves: curves.filter(({ series }) => series.sampler === pair.sampler && series.integrator === pair.integrator) }))
    .filter((pair) => matrix || pair.curves.length);
  const columns = matrix ? integrators.length : Math.min(fit, filled.length);
  const panels = filled.map(({ sampler, integrator, curves: own }, i) => ({
    title: replayed(own) + (matrix || integrators.length === 1 ? sampler : samplers.length === 1 ? integrator : `${sampler} · ${integrator}`),
    row: Math.floor(i / columns),
    column: i % columns,
    curves: own,
  }));
  return { rows: Math.ceil(filled.length / columns), columns, heads: matrix ? integrators : [], panels };
}

/** The word before the title of a panel that shows a mistake: first, since long titles are cut. @param {readonly Curve[]} curves */
function replayed(curves) {
  return curves.some(({ series }) => series.replay) ? "replay: " : "";
}

/** @param {readonly Curve[]} curves @param {boolean} log @param {Options} options @returns {{x: [number, number], y: [number, number]}} */
function rangesOf(curves, log, options) {
  const points = curves.flatMap((curve) => curve.points);
  if (!points.length) return { x: [0, 2], y: log ? [-3, 0] : [0.9, 1.1] };
  const x = padded(along(curves, options).map(Math.log10), 0.06, 0.12);
  if (log) {
    // The noise of a reference belongs into the picture where it has swallowed a point.
    const noise = curves.flatMap(({ series, points: own }) => (own.some((point) => isNoise(series, point)) ? [Number(series.floor)] : []));
    return { x, y: padded([...points.map((point) => point.mean), ...noise].map(Math.log10), 0.08, 0.15) };
  }
  return { x, y: padded([1, ...points.flatMap((point) => [point.low ?? point.mean, point.high ?? point.mean])], 0.08, 0.01) };
}

/** @param {number[]} values @param {number} part of the span that is added on both sides @param {number} least @returns {[number, number]} */
function padded(values, part, least) {
  const [low, high] = [Math.min(...values), Math.max(...values)];
  const pad = Math.max(least, part * (high - low));
  return [low - pad, high + pad];
}

/** Whether more than half of a point's error is the reference's own noise. @param {Series} series @param {Point} point */
export function isNoise(series, point) {
  return series.floor != null && point.mean < 2 * series.floor;
}

/** Lines of known slope, from above the first points to the last or to the lower edge. @param {readonly Curve[]} curves @param {{y: [number, number]}} ranges @param {Options} options @returns {Plan["guides"]} */
function guidesIn(curves, ranges, options) {
  const points = curves.flatMap((curve) => curve.points);
  const places = along(curves, options);
  const [x0, x1] = [Math.min(...places), Math.max(...places)];
  if (!(x1 > x0)) return [];
  const y0 = 1.25 * Math.max(...points.map((point) => point.mean));
  const floor = 10 ** ranges.y[0];
  return GUIDES.map((slope) => {
    const x = Math.min(x1, x0 * (floor / y0) ** (1 / slope));
    return { slope, x: [x0, x], y: [y0, y0 * (x / x0) ** slope], cut: x < x1 };
  });
}

/** Of all points of some curves. @param {readonly Curve[]} curves @param {Options} options @returns {number[]} */
export function along(curves, options) {
  return curves.flatMap(({ series, points }) => points.map((point) => xOf(series, point, options)));
}

/** @param {Series} series @param {Point} point of it @param {Options} options @returns {number} NaN where it was not timed */
export function xOf(series, point, options) {
  if (options.x === "seconds") return point.seconds ?? NaN;
  return series.replay ? point.spp : point.spp_actual;
}

