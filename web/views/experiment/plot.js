// @ts-check
/**
 * The convergence plot: what is drawn is decided in `plots/convergence.js`; this fetches, draws and listens.
 */
import { html, useEffect, useMemo, useRef, useState } from "../../vendor/preact-htm.js";
import { layout, reachesZero, traces, unplottable } from "../../plots/convergence.js";
import { isNoise } from "../../plots/plan.js";
import { plotly } from "../../plots/plotly.js";
import { counted } from "../../format.js";
import { useTheme } from "../../theme.js";
import { valueOn } from "./axes.js";
import { Pin, Segmented } from "./controls.js";
import { whenIdle } from "./hooks.js";
import { Legend } from "./legend.js";
import { showing } from "./view.js";

/** @typedef {import("../../api.js").Convergence} Convergence */
/** @typedef {import("../../api.js").Series} Series */
/** @typedef {import("../../plots/plan.js").Options} Options */
/** @typedef {import("./view.js").View} View */
/**
 * @typedef {object} Props
 * @property {View} view
 * @property {{convergence: Convergence | null, stale: boolean, error: Error | null}} curves
 * @property {number | null} selected `cell` of the selected picture
 * @property {boolean} near whether the plot is about to be seen
 * @property {(element: HTMLElement | null) => void} onElement
 * @property {typeof import("../../address.js").setParams} set
 * @property {(cell: number) => void} onPoint
 */

const CONFIG = {
  displaylogo: false,
  responsive: false, // its own observer tells the width
  doubleClick: "reset",
  modeBarButtons: [["zoom2d", "pan2d", "resetScale2d", "toImage"]], // named one by one: others would leave this host
  toImageButtonOptions: { format: "svg", filename: "convergence" },
};

/** @param {Props} props */
export function Plot({ view, curves, selected, near, onElement, set, onPoint }) {
  const { stale, error } = curves;
  const hidden = view.hidden.get("spp");
  const convergence = useMemo(() => (curves.convergence && hidden?.size ? without(curves.convergence, hidden) : curves.convergence), [curves.convergence, hidden]);
  const { dark } = useTheme();
  const [emphasis, setEmphasis] = useState(/** @type {Options["emphasis"] | null} */ (null));
  const [width, setWidth] = useState(0);
  const options = useMemo(
    () => optionsOf(view, { dark, width, selected, emphasis }),
    [view, dark, width, selected, emphasis],
  );
  const shown = (convergence?.series ?? []).filter((series) => options.only?.(series));
  const pins = view.axes.filter(
    (axis) => (axis.name === "scene" || axis.name.startsWith("sweep.")) && axis.values.length > 1 && !view.pinned.some(({ name }) => name === axis.name),
  );
  return html`<section class="panel part" id="curves" aria-labelledby="curves-title" ref=${onElement}>
    <div class="part-head">
      <h2 id="curves-title">Convergence${pins.length === 0 && html` <span class="muted head-scene">${view.at["scene"]}</span>`}</h2>
      ${pins.map(
        (axis) => html`<${Pin} key=${axis.name} label=${axis.title} values=${axis.values} value=${view.at[axis.name]} onChange=${(/** @type {string} */ value) => set({ [axis.name]: value })} />`,
      )}
      <span class="spacer"></span>
      <${Segmented}
        label="against"
        choices=${[
          { value: "spp", label: "samples", title: "error against samples per pixel, as rendered; of replays as asked" },
          { value: "seconds", label: "seconds", title: "error against the mean render time of a picture" },
        ]}
        value=${view.against}
        onChange=${(/** @type {string} */ value) => set({ against: value === "spp" ? null : value })}
      />
      <${Segmented}
        label="arrangement"
        choices=${[
          { value: "overlay", label: "overlay", title: "all curves in one plot" },
          { value: "multiples", label: "small multiples", title: "one plot a curve: rows are samplers, columns integrators" },
        ]}
        value=${view.arrange}
        onChange=${(/** @type {string} */ value) => set({ arrange: value === "overlay" ? null : value })}
      />
    </div>
    <p class="part-line">
      ${convergence && html`<code>${convergence.metric.name} = ${convergence.metric.formula}</code> <span class="muted">${convergence.metric.line}</span>`}
    </p>
    <div class=${`curves ${stale ? "stale" : ""} ${(options.integrators?.length ?? 1) === 1 ? "beside" : ""}`}>
      <${Figure} convergence=${convergence} options=${options} near=${near} onWidth=${setWidth} onPoint=${onPoint}>
        ${convergence && !shown.some((series) => series.points.length) && html`<p class="figure-empty muted">No curve yet: a point appears once a cell and its reference are rendered and measured.</p>`}
      <//>
      ${convergence && html`<${Legend} series=${convergence.series.filter((series) => isPinned(view, series))} sloped=${convergence.metric.lower_is_better !== null} view=${view} options=${options} set=${set} onEmphasis=${setEmphasis} />`}
    </div>
    <ul class="part-notes">
      ${notesOn(convergence, shown, view, options).map((note) => html`<li key=${note}>${note}</li>`)}
      ${error && html`<li class="fault">${error.message}</li>`}
    </ul>
  </section>`;
}

/** Plotly's element; it survives every redraw of the page. @param {{convergence: Convergence | null, options: Options, near: boolean, onWidth: (width: number) => void, onPoint: (cell: number) => void, children?: unknown}} props */
function Figure({ convergence, options, near, onWidth, onPoint, children }) {
  const box = useRef(/** @type {HTMLDivElement | null} */ (null));
  const [error, setError] = useState("");
  const point = useRef(onPoint);
  point.current = onPoint;

  useEffect(() => {
    const element = box.current;
    if (!element) return;
    const resizes = new ResizeObserver(([entry]) => onWidth(Math.round(entry?.contentRect.width ?? 0)));
    resizes.observe(element);
    return () => {
      resizes.disconnect();
      window.Plotly?.purge(element);
    };
  }, []);

  useEffect(() => whenIdle(() => plotly().catch(() => {})), []); // what fails here is tried again, and told, when drawing

  useEffect(() => {
    const element = box.current;
    if (!element || !convergence || !near || !options.width) return;
    let wanted = true;
    plotly()
      .then(async (library) => {
        if (!wanted) return;
        const fresh = !("_fullLayout" in element);
        const drawn = { ...layout(convergence, options), width: options.width };
        const figure = await library.react(element, traces(convergence, options), drawn, CONFIG);
        if (fresh) {
          figure.on("plotly_click", ({ points }) => {
            const cell = points?.[0]?.customdata;
            if (typeof cell === "number") point.current(cell);
          });
        }
      })
      .catch((problem) => wanted && setError(problem.message));
    return () => {
      wanted = false;
    };
  }, [convergence, options, near]);

  return html`<div class="figure">
    <div ref=${box} class=${convergence ? "figure-box" : "figure-box skeleton"}></div>
    ${children} ${error && html`<p class="fault">${error}</p>`}
  </div>`;
}

/** @param {View} view @param {{dark: boolean, width: number, selected: number | null, emphasis: Options["emphasis"] | null}} of @returns {Options} */
function optionsOf(view, { dark, width, selected, emphasis }) {
  const shows = showing(view);
  return {
    x: view.against,
    arrange: view.arrange,
    only: (series) => isPinned(view, series) && shows(series),
    legend: false,
    dark,
    width,
    samplers: view.axes.find(({ name }) => name === "sampler")?.values,
    integrators: view.axes.find(({ name }) => name === "integrator")?.values,
    ...(selected === null ? {} : { selected }),
    ...(emphasis ? { emphasis } : {}),
  };
}

/** The curves without the points of some spp. @param {Convergence} convergence @param {Set<string>} spp @returns {Convergence} */
function without(convergence, spp) {
  const series = convergence.series.map((one) => ({ ...one, points: one.points.filter((point) => !spp.has(String(point.spp))) }));
  return { ...convergence, series };
}

/** Whether a curve is of the scene and the swept values that are looked at. @param {View} view @param {Series} series */
function isPinned(view, series) {
  return view.axes
    .filter((axis) => axis.name === "scene" || axis.name.startsWith("sweep."))
    .every((axis) => [null, view.at[axis.name]].includes(valueOn(series, axis.name)));
}

/** @param {Convergence | null} convergence @param {readonly Series[]} shown @param {View} view @param {Options} options */
function notesOn(convergence, shown, view, options) {
  if (!convergence) return [];
  const notes = [];
  const n = shown.flatMap((series) => series.points.map((point) => point.n));
  const [least, most] = [Math.min(...n), Math.max(...n)];
  if (!n.length) return [];
  if (most > 1) notes.push(`Bands: 95 % interval of the mean over n = ${least === most ? most : `${least} to ${most}`} replicates. Click a point to see its picture.`);
  else notes.push("One replicate a point: there is no interval to draw. Click a point to see its picture.");
  if (convergence.metric.lower_is_better !== null && shown.some((series) => series.points.some(reachesZero))) {
    notes.push("Where an interval reaches zero, which a logarithmic axis does not have, its band goes as far down as up.");
  }
  if (view.against === "seconds" && shown.some((series) => !series.alike)) {
    notes.push("Grey curves: their pictures were timed under different conditions (machine, threads or neighbours), so their seconds cannot be compared.");
  }
  if (shown.some((series) => series.replay)) {
    notes.push("Finely dashed: replays. Each shows a published mistake on purpose, at the samples that were asked, as its authors plotted it.");
  }
  const lost = unplottable(convergence, options);
  if (convergence.metric.lower_is_better !== null && shown.some((series) => series.points.some((point) => isNoise(series, point)))) {
    notes.push("Hollow points: more than half of the error is the reference's own noise (shaded). mse_cross has no such floor; a reference of more spp lowers it.");
  }
  if (lost) notes.push(`${counted(lost, "point")} at or below zero: a logarithmic axis cannot show them; the table does.`);
  if (convergence.metric.lower_is_better !== null) notes.push("Dotted: slopes −1, −1.5 and −2.");
  return notes;
}
