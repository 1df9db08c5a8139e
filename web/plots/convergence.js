// @ts-check
/**
 * A metric against samples per pixel or seconds: one curve per integrator × sampler, with its 95 % band.
 *
 * Both axes are logarithmic: independent samples fall with slope −1 in a mean squared error, and a better point set
 * shows as a steeper line. In small multiples every panel repeats all curves in grey, unless they are many, so that each is read
 * against the rest. Points lie at the spp that was rendered, those of replays at what was asked; a point in the reference's own
 * noise is hollow.
 *
 * Pure; the exported report inlines this very file and `plan.js`.
 */
import { along, chosen, isLog, isNoise, planOf, xOf } from "./plan.js";

/** @typedef {import("../api.js").Convergence} Convergence */
/** @typedef {import("../api.js").Series} Series */
/** @typedef {import("../api.js").Point} Point */
/** @typedef {import("./plan.js").Options} Options */
/** @typedef {import("./plan.js").Curve} Curve */
/** @typedef {import("./plan.js").Panel} Panel */
/** @typedef {import("./plan.js").Plan} Plan */

const MARKED = 40; // curves: with more, markers and the grey curves of other panels are a blur, and most of the drawing
const PANEL_HEIGHT = 190; // px
const OVERLAY_HEIGHT = 430; // px
const COLUMN_GAP = 0.03; // of the plot's width
const TITLE = 26; // px above every row of panels
const LEFT = 66; // px: numbers and title of the error axis
const RIGHT = 26; // px: the labels of the guides
const LETTER = 6.6; // px: a letter of a panel's title, on average
const TICK = 34; // px: between the middles of two labels of the axis of samples

/** Plotly's traces: guides and bands first, so that curves lie above them. @param {Convergence} convergence @param {Options} [options] @returns {Plotly.Data[]} */
export function traces(convergence, options = {}) {
  const plan = planOf(convergence, options);
  const below = plan.panels.flatMap((panel) => [
    guides(panel, plan),
    ...(options.arrange === "multiples" && plan.curves.length <= MARKED ? [context(panel, plan, options)] : []),
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
    annotations: multiples ? panelTexts(plan, convergence, options) : [...guideLabels(plan), ...floorLabel(plan)],
    shapes: plan.log ? plan.panels.flatMap((panel) => floors(panel, plan)) : plan.panels.map((panel) => unity(panel, plan)),
  };
  for (let column = 0; column < plan.columns; column++) {
    made[axisKey("x", column)] = {
      ...axisOf(plan, true, plan.x),
      ...(options.x === "seconds" ? {} : sppTicks(plan, options)),
      domain: share(column, plan.columns, COLUMN_GAP),
      anchor: axisName("y", plan.rows - 1),
      ...(column ? { matches: "x" } : {}),
      ...(multiples ? {} : { title: { text: xTitle(plan, options), standoff: 10 } }),
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

/** "−1.15 ± 0.02", half of the 95 % interval; empty where there is no fit. @param {Series["slope"]} slope */
export function slopeText(slope) {
  return slope ? `${minus(slope.value.toFixed(2))} ± ${((slope.high - slope.low) / 2).toFixed(2)}` : "";
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
    x: others.flatMap((curve) => [...along([curve], options), null]),
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
    const x = points.map((point) => xOf(curve.series, point, options));
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
  const noise = points.map((point) => plan.log && isNoise(series, point));
  return {
    type: "scatter",
    mode: plan.curves.length > MARKED ? "lines" : "lines+markers",
    ...axesOf(panel),
    name: `${safe(nameOf(series))}  ${plan.log ? slopeText(series.slope) : ""}`.trimEnd(),
    x: along([curve], options),
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
      symbol: noise.map((is) => (is ? `${curve.symbol}-open` : curve.symbol)),
      line: { color: plan.ink.text, width: marked.map((is, i) => (is ? 2 : noise[i] ? 1.5 : 0)) },
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
    ...(isLog(convergence) && isNoise(series, point) ? ["mostly the noise of the reference"] : []),
    ...(fair ? [] : ["timed under different conditions: not comparable"]),
  ].join("<br>");
}

/** @param {Series} series */
function nameOf(series) {
  const sweep = Object.entries(series.sweep ?? {}).map(([name, value]) => `${name} = ${JSON.stringify(value)}`);
  return [series.sampler, series.integrator, ...sweep].join(" · ") + (series.replay ? " (replay)" : "");
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

/** Labels at the spp that the points have, as far as there is room. @param {Plan} plan @param {Options} options */
function sppTicks(plan, options) {
  const spp = [...new Set(along(plan.curves, options))].sort((a, b) => a - b);
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
    { ...common, text: xTitle(plan, options), x: 0.5, y: 0, xanchor: "center", yanchor: "top", yshift: -28 },
    { ...common, text: convergence.metric.name, x: 0, y: 0.5, xanchor: "right", yanchor: "middle", xshift: -44, textangle: -90 },
  ];
}

/** What the reference's own noise covers, one area for each reference that reaches into the plot. @param {Panel} panel @param {Plan} plan */
function floors(panel, plan) {
  const { xaxis, yaxis } = axesOf(panel);
  const bottom = 10 ** plan.y[0];
  return seenFloors(panel.curves, plan).map((floor) => ({
    type: "rect", xref: `${xaxis} domain`, yref: yaxis, x0: 0, x1: 1, y0: bottom, y1: floor, layer: "below",
    fillcolor: translucent(plan.ink.muted, 0.14), line: { width: 0 },
  }));
}

/** Different noise floors that lie above the lower edge, lowest first. @param {readonly Curve[]} curves @param {Plan} plan @returns {number[]} */
function seenFloors(curves, plan) {
  const found = curves.flatMap(({ series: { floor } }) => (floor != null && floor > 10 ** plan.y[0] ? [floor] : []));
  return [...new Set(found)].sort((a, b) => a - b);
}

/** @param {Plan} plan */
function floorLabel(plan) {
  const highest = seenFloors(plan.curves, plan).at(-1);
  if (highest === undefined) return [];
  const place = { xref: "x domain", x: 0.01, xanchor: "left", y: Math.log10(highest), yanchor: "bottom", showarrow: false };
  return [{ ...place, text: "noise of the reference", font: { size: 11, color: plan.ink.muted } }];
}

/** The line on which a picture is as bright as its reference. @param {Panel} panel @param {Plan} plan */
function unity(panel, plan) {
  const { xaxis, yaxis } = axesOf(panel);
  const line = { color: plan.ink.muted, width: 1, dash: "dot" };
  return { type: "line", xref: `${xaxis} domain`, yref: yaxis, x0: 0, x1: 1, y0: 1, y1: 1, line, layer: "below" };
}

/** @param {Plan} plan @param {Options} options */
function xTitle({ curves }, options) {
  if (options.x === "seconds") return "seconds a picture, without compiling";
  return `samples per pixel, as rendered${curves.some(({ series }) => series.replay) ? " (replays: as asked)" : ""}`;
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
