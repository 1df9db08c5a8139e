// @ts-check
/**
 * A metric against samples per pixel or seconds: one curve per integrator × sampler, with its 95 % band.
 *
 * Both axes are logarithmic: independent samples fall with slope −1 in a mean squared error, and a better point set
 * shows as a steeper line. Colour tells samplers apart; dash and marker tell integrators apart. In small multiples every
 * panel repeats all curves in grey, so that each is read against the rest. Points lie at the spp that was rendered.
 *
 * Pure, and without any import at run time: the exported report inlines this very file.
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
export const SYMBOLS = ["circle", "square", "diamond", "triangle-up", "x", "pentagon"];
/** What a mean squared error may fall with: independent samples, and better point sets on smooth pictures. */
export const GUIDES = [-1, -1.5, -2];

const MARKED = 40; // curves: with more, markers are a blur and take most of the time to draw
const PANEL_WIDTH = 230; // px: below, the labels of two ticks meet
const PANEL_HEIGHT = 190; // px
const OVERLAY_HEIGHT = 430; // px
const COLUMN_GAP = 0.03; // of the plot's width
const TITLE = 26; // px above every row of panels
const LEFT = 66; // px: numbers and title of the error axis
const RIGHT = 26; // px: the labels of the guides
const LETTER = 6.6; // px: a letter of a panel's title, on average
const TICK = 34; // px: between the middles of two labels of the axis of samples
/** @type {{dark: Ink, light: Ink}} */
const INK = {
  dark: { text: "#d8dce4", muted: "#98a1b0", line: "#333a47", context: "rgba(152,161,176,0.3)" },
  light: { text: "#1c2330", muted: "#5b6575", line: "#d9dee6", context: "rgba(91,101,117,0.28)" },
};

/** Plotly's traces: guides and bands first, so that curves lie above them. @param {Convergence} convergence @param {Options} [options] @returns {Plotly.Data[]} */
export function traces(convergence, options = {}) {
  const plan = planOf(convergence, options);
  const below = plan.panels.flatMap((panel) => [
    guides(panel, plan),
    ...(options.arrange === "multiples" ? [context(panel, plan, options)] : []),
    ...(options.band === false ? [] : bands(panel, plan, options)),
  ]);
  const above = plan.panels.flatMap((panel) => panel.curves.map((curve) => line(curve, panel, convergence, plan, options)));
  return [...below, ...above];
}

/** Plotly's layout for the same convergence and options. @param {Convergence} convergence @param {Options} [options] @returns {Plotly.Layout} */
export function layout(convergence, options = {}) {
  const plan = planOf(convergence, options);
  const multiples = options.arrange === "multiples";
  const family = options.font ?? "system-ui, sans-serif";
  /** @type {Plotly.Layout} */
  const made = {
    autosize: true,
    height: heightOf(plan, options),
    margin: { l: LEFT, r: RIGHT, t: topOf(plan, options), b: 52 },
    paper_bgcolor: "rgba(0,0,0,0)",
    plot_bgcolor: "rgba(0,0,0,0)",
    font: { family, size: 12, color: plan.ink.text },
    modebar: { bgcolor: "rgba(0,0,0,0)", color: plan.ink.muted, activecolor: plan.ink.text },
    hovermode: "closest",
    hoverlabel: { align: "left", font: { family, size: 12 } },
    showlegend: options.legend !== false && !multiples,
    legend: { orientation: "h", x: 0, y: -0.16, yanchor: "top", tracegroupgap: 4 },
    // A zoom outlives new data, and ends when another quantity is drawn.
    uirevision: [convergence.metric.name, options.x, options.arrange, options.scene].join(" "),
    annotations: multiples ? panelTexts(plan, convergence, options) : guideLabels(plan),
    shapes: convergence.metric.name === "mean_ratio" ? plan.panels.map((panel) => unity(panel, plan)) : [],
  };
  for (let column = 0; column < plan.columns; column++) {
    made[axisKey("x", column)] = {
      ...axisOf(plan, true, plan.x),
      ...(options.x === "seconds" ? {} : sppTicks(plan, options)),
      domain: share(column, plan.columns, COLUMN_GAP),
      anchor: axisName("y", plan.rows - 1),
      ...(column ? { matches: "x" } : {}),
      ...(multiples ? {} : { title: { text: xTitle(options), standoff: 10 } }),
    };
  }
  for (let row = 0; row < plan.rows; row++) {
    const [top, bottom] = share(row, plan.rows, rowGap(plan));
    made[axisKey("y", row)] = {
      ...axisOf(plan, plan.log, plan.y),
      domain: [1 - bottom, 1 - top],
      anchor: "x",
      ...(row ? { matches: "y" } : {}),
      ...(multiples ? {} : { title: { text: convergence.metric.name, standoff: 12 } }),
    };
  }
  return made;
}

/** How many points a logarithmic axis cannot show, because their mean is not above zero. @param {Convergence} convergence @param {Options} [options] */
export function unplottable(convergence, options = {}) {
  if (!isLog(convergence)) return 0;
  const points = chosen(convergence, options).flatMap((series) => series.points);
  return points.filter((point) => point.mean <= 0).length;
}

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

/** "−1.15 ± 0.02", half of the 95 % interval; empty where there is no fit. @param {Series["slope"]} slope */
export function slopeText(slope) {
  return slope ? `${minus(slope.value.toFixed(2))} ± ${((slope.high - slope.low) / 2).toFixed(2)}` : "";
}

/** @param {Convergence} convergence */
function isLog(convergence) {
  return convergence.metric.lower_is_better !== null;
}

/** @param {Convergence} convergence @param {Options} options */
function chosen(convergence, options) {
  return convergence.series.filter(
    (series) => (options.scene === undefined || series.scene === options.scene) && (options.only?.(series) ?? true),
  );
}

/** @param {Convergence} convergence @param {Options} options @returns {Plan} */
function planOf(convergence, options) {
  const log = isLog(convergence);
  const samplers = options.samplers ?? [...new Set(convergence.series.map((series) => series.sampler))];
  const integrators = options.integrators ?? [...new Set(convergence.series.map((series) => series.integrator))];
  const curves = chosen(convergence, options).map((series) => ({
    series,
    ...styleOf(series, { ...options, samplers, integrators }),
    fair: series.alike || options.x !== "seconds",
    points: series.points.filter((point) => xOf(point, options) > 0 && (point.mean > 0 || !log)),
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
    title: matrix || integrators.length === 1 ? sampler : samplers.length === 1 ? integrator : `${sampler} · ${integrator}`,
    row: Math.floor(i / columns),
    column: i % columns,
    curves: own,
  }));
  return { rows: Math.ceil(filled.length / columns), columns, heads: matrix ? integrators : [], panels };
}

/** @param {readonly Curve[]} curves @param {boolean} log @param {Options} options @returns {{x: [number, number], y: [number, number]}} */
function rangesOf(curves, log, options) {
  const points = curves.flatMap((curve) => curve.points);
  if (!points.length) return { x: [0, 2], y: log ? [-3, 0] : [0.9, 1.1] };
  const x = padded(points.map((point) => Math.log10(xOf(point, options))), 0.06, 0.12);
  if (log) return { x, y: padded(points.map((point) => Math.log10(point.mean)), 0.08, 0.15) };
  return { x, y: padded([1, ...points.flatMap((point) => [point.low ?? point.mean, point.high ?? point.mean])], 0.08, 0.01) };
}

/** @param {number[]} values @param {number} part of the span that is added on both sides @param {number} least @returns {[number, number]} */
function padded(values, part, least) {
  const [low, high] = [Math.min(...values), Math.max(...values)];
  const pad = Math.max(least, part * (high - low));
  return [low - pad, high + pad];
}

/** Lines of known slope, from above the first points to the last or to the lower edge. @param {readonly Curve[]} curves @param {{y: [number, number]}} ranges @param {Options} options @returns {Plan["guides"]} */
function guidesIn(curves, ranges, options) {
  const points = curves.flatMap((curve) => curve.points);
  const along = points.map((point) => xOf(point, options));
  const [x0, x1] = [Math.min(...along), Math.max(...along)];
  if (!(x1 > x0)) return [];
  const y0 = 1.25 * Math.max(...points.map((point) => point.mean));
  const floor = 10 ** ranges.y[0];
  return GUIDES.map((slope) => {
    const x = Math.min(x1, x0 * (floor / y0) ** (1 / slope));
    return { slope, x: [x0, x], y: [y0, y0 * (x / x0) ** slope], cut: x < x1 };
  });
}

/** @param {Panel} panel @param {Plan} plan @returns {Plotly.Data} */
function guides(panel, plan) {
  return {
    ...quiet(panel),
    x: plan.guides.flatMap((guide) => [...guide.x, null]),
    y: plan.guides.flatMap((guide) => [...guide.y, null]),
    line: { color: plan.ink.muted, width: 1, dash: "dot" },
    opacity: 0.55,
  };
}

/** The curves of all other panels. @param {Panel} panel @param {Plan} plan @param {Options} options @returns {Plotly.Data} */
function context(panel, plan, options) {
  const others = plan.curves.filter((curve) => !panel.curves.includes(curve));
  return {
    ...quiet(panel),
    x: others.flatMap((curve) => [...curve.points.map((point) => xOf(point, options)), null]),
    y: others.flatMap((curve) => [...curve.points.map((point) => point.mean), null]),
    line: { color: plan.ink.context, width: 1.2 },
  };
}

/** The 95 % intervals as filled outlines, one trace a colour: many curves would take long to draw. @param {Panel} panel @param {Plan} plan @param {Options} options @returns {Plotly.Data[]} */
function bands(panel, plan, options) {
  /** @type {Map<string, {x: (number | null)[], y: (number | null)[]}>} */
  const fills = new Map();
  for (const curve of panel.curves) {
    const points = curve.points.filter((point) => point.low !== null && point.high !== null);
    if (points.length < 2) continue;
    const colour = translucent(curve.colour, !curve.fair || stepsBack(curve.series, options) ? 0.04 : 0.17);
    const fill = fills.get(colour) ?? { x: [], y: [] };
    fills.set(colour, fill);
    const low = points.map((point) => (plan.log && reachesZero(point) ? point.mean ** 2 / Number(point.high) : Number(point.low)));
    const x = points.map((point) => xOf(point, options));
    fill.x.push(...x, ...x.toReversed(), null);
    fill.y.push(...points.map((point) => point.high), ...low.reverse(), null);
  }
  return [...fills].map(([fillcolor, { x, y }]) => ({ ...quiet(panel), x, y, fill: "toself", fillcolor, line: { width: 0 } }));
}

/** @param {Curve} curve @param {Panel} panel @param {Convergence} convergence @param {Plan} plan @param {Options} options @returns {Plotly.Data} */
function line(curve, panel, convergence, plan, options) {
  const { series, points, fair } = curve;
  const colour = fair ? curve.colour : plan.ink.muted;
  const marked = points.map((point) => point.cell === options.selected);
  return {
    type: "scatter",
    mode: plan.curves.length > MARKED ? "lines" : "lines+markers",
    ...axesOf(panel),
    name: `${safe(nameOf(series))}  ${plan.log ? slopeText(series.slope) : ""}`.trimEnd(),
    x: points.map((point) => xOf(point, options)),
    y: points.map((point) => point.mean),
    customdata: points.map((point) => point.cell),
    text: points.map((point) => hover(series, point, convergence, fair)),
    hovertemplate: "%{text}<extra></extra>",
    opacity: stepsBack(series, options) ? 0.15 : fair ? 1 : 0.6,
    line: { color: colour, width: 2, dash: curve.dash },
    marker: {
      color: colour,
      opacity: 1,
      size: marked.map((is) => (is ? 12 : 7)),
      symbol: curve.symbol,
      line: { color: plan.ink.text, width: marked.map((is) => (is ? 2 : 0)) },
    },
  };
}

/** Whether an interval has no lower end on a logarithmic axis; it is drawn as far down as up. @param {Point} point */
export function reachesZero(point) {
  return point.low !== null && point.low <= 0;
}

/** @param {Series} series @param {Options} options */
function stepsBack(series, { emphasis = {} }) {
  const { sampler = series.sampler, integrator = series.integrator } = emphasis;
  return sampler !== series.sampler || integrator !== series.integrator;
}

/** What every line that is no curve has in common. @param {Panel} panel @returns {Plotly.Data} */
function quiet(panel) {
  return { type: "scatter", mode: "lines", ...axesOf(panel), hoverinfo: "skip", showlegend: false };
}

/** @param {Series} series @param {Point} point @param {Convergence} convergence @param {boolean} fair */
function hover(series, point, convergence, fair) {
  const spread = point.error === null ? "" : ` ± ${point.error.toExponential(1)}`;
  const interval = point.low === null || point.high === null ? "" : `95 %: ${point.low.toExponential(2)} … ${point.high.toExponential(2)}, `;
  return [
    `<b>${safe(nameOf(series))}</b>`,
    `${convergence.metric.name} ${isLog(convergence) ? point.mean.toExponential(2) : point.mean.toPrecision(4)}${spread}`,
    `${interval}n = ${point.n}`,
    point.spp === point.spp_actual ? `${point.spp} spp` : `${point.spp} spp asked, ${point.spp_actual} rendered`,
    point.seconds === null ? "not timed" : `${point.seconds.toPrecision(3)} s a picture`,
    ...(series.slope && isLog(convergence) ? [`slope ${slopeText(series.slope)}`] : []),
    ...(fair ? [] : ["timed under different conditions: not comparable"]),
  ].join("<br>");
}

/** @param {Series} series */
function nameOf(series) {
  const sweep = Object.entries(series.sweep ?? {}).map(([name, value]) => `${name} = ${JSON.stringify(value)}`);
  return [series.sampler, series.integrator, ...sweep].join(" · ");
}

/** px. @param {Plan} plan @param {Options} options */
function heightOf(plan, options) {
  return options.arrange === "multiples" ? plan.rows * PANEL_HEIGHT + topOf(plan, options) + 52 : OVERLAY_HEIGHT;
}

/** px above the panels. @param {Plan} plan @param {Options} options */
function topOf({ heads }, options) {
  if (options.arrange !== "multiples") return 12;
  return heads.length ? 2 * TITLE : TITLE;
}

/** px. @param {Plan} plan @param {Options} options */
function panelWidth({ columns }, options) {
  return ((options.width ?? 900) - LEFT - RIGHT) * share(0, columns, COLUMN_GAP)[1];
}

/** Labels at the spp that were rendered, as far as there is room. @param {Plan} plan @param {Options} options */
function sppTicks(plan, options) {
  const spp = [...new Set(plan.curves.flatMap((curve) => curve.points.map((point) => point.spp_actual)))].sort((a, b) => a - b);
  const least = (TICK * (plan.x[1] - plan.x[0])) / panelWidth(plan, options);
  /** @type {number[]} */
  const kept = [];
  for (const value of spp) {
    const before = kept.at(-1);
    if (before === undefined || Math.log10(value / before) >= least) kept.push(value);
  }
  return { tickmode: "array", tickvals: kept, ticktext: kept.map(String), minor: {} };
}

/** @param {Plan} plan @param {boolean} log @param {[number, number]} range */
function axisOf({ ink }, log, range) {
  const ticks = log ? { dtick: range[1] - range[0] > 1.7 ? 1 : "D2", exponentformat: "power" } : { tickformat: ".4~g", nticks: 7 };
  return {
    type: log ? "log" : "linear",
    range,
    ...ticks,
    minor: log ? { dtick: "D1", ticks: "outside", ticklen: 2, tickcolor: ink.line } : {},
    gridcolor: ink.line,
    linecolor: ink.line,
    showline: true,
    zeroline: false,
    ticks: "outside",
    ticklen: 4,
    tickcolor: ink.line,
    tickfont: { color: ink.muted, size: 11 },
  };
}

/** @param {Plan} plan */
function guideLabels({ guides: lines, ink }) {
  return lines.map(({ slope, x, y, cut }) => ({
    text: minus(String(slope)),
    x: Math.log10(x[1]),
    y: Math.log10(y[1]),
    xanchor: "left",
    yanchor: cut ? "bottom" : "middle",
    xshift: 3,
    showarrow: false,
    font: { size: 11, color: ink.muted },
  }));
}

/** A title over each panel, and the titles of the axes that all of them share. @param {Plan} plan @param {Convergence} convergence @param {Options} options */
function panelTexts(plan, convergence, options) {
  const common = { xref: "paper", yref: "paper", showarrow: false, font: { size: 12, color: plan.ink.text } };
  const letters = Math.floor(panelWidth(plan, options) / LETTER);
  /** @param {string} text @param {number} column @param {number} row */
  const title = (text, column, row) => ({
    ...common,
    text: safe(text.length > letters ? `${text.slice(0, letters - 1)}…` : text),
    x: share(column, plan.columns, COLUMN_GAP)[0],
    y: 1 - share(row, plan.rows, rowGap(plan))[0],
    xanchor: "left",
    yanchor: "bottom",
    yshift: 2,
  });
  return [
    ...plan.panels.map((panel) => title(panel.title, panel.column, panel.row)),
    ...plan.heads.map((head, column) => ({ ...title(head, column, 0), yshift: TITLE, font: { size: 12, color: plan.ink.muted } })),
    { ...common, text: xTitle(options), x: 0.5, y: 0, xanchor: "center", yanchor: "top", yshift: -28 },
    { ...common, text: convergence.metric.name, x: 0, y: 0.5, xanchor: "right", yanchor: "middle", xshift: -44, textangle: -90 },
  ];
}

/** The line on which a picture is as bright as its reference. @param {Panel} panel @param {Plan} plan */
function unity(panel, plan) {
  const { xaxis, yaxis } = axesOf(panel);
  const line = { color: plan.ink.muted, width: 1, dash: "dot" };
  return { type: "line", xref: `${xaxis} domain`, yref: yaxis, x0: 0, x1: 1, y0: 1, y1: 1, line, layer: "below" };
}

/** @param {Point} point @param {Options} options @returns {number} NaN where it was not timed */
function xOf(point, options) {
  return options.x === "seconds" ? point.seconds ?? NaN : point.spp_actual;
}

/** @param {Options} options */
function xTitle(options) {
  return options.x === "seconds" ? "seconds a picture, without compiling" : "samples per pixel, as rendered";
}

/** @param {Panel} panel */
function axesOf({ row, column }) {
  return { xaxis: axisName("x", column), yaxis: axisName("y", row) };
}

/** Plotly counts x, x2, x3. @param {"x" | "y"} letter @param {number} index */
function axisName(letter, index) {
  return letter + (index ? index + 1 : "");
}

/** @param {"x" | "y"} letter @param {number} index */
function axisKey(letter, index) {
  return `${letter}axis${index ? index + 1 : ""}`;
}

/** Part `index` of `count` equal parts of 0 … 1. @param {number} index @param {number} count @param {number} gap @returns {[number, number]} */
function share(index, count, gap) {
  const size = (1 - gap * (count - 1)) / count;
  return [index * (size + gap), index * (size + gap) + size];
}

/** @param {Plan} plan */
function rowGap(plan) {
  return TITLE / (plan.rows * PANEL_HEIGHT);
}

/** @param {string} colour #rrggbb @param {number} alpha */
function translucent(colour, alpha) {
  return `rgba(${[1, 3, 5].map((at) => parseInt(colour.slice(at, at + 2), 16)).join(",")},${alpha})`;
}

/** With a true minus. @param {string} text */
function minus(text) {
  return text.replace("-", "−");
}

/** Plotly reads a little HTML in its texts. @param {string} text */
function safe(text) {
  return text.replaceAll("&", "&amp;").replaceAll("<", "&lt;").replaceAll(">", "&gt;");
}
