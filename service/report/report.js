// @ts-check
/**
 * The moving parts of a report: plots that are drawn when they come into view, copy and save.
 *
 * Everything is drawn from the JSON in the page; nothing is fetched. On paper the plots are redrawn for a white page of
 * its width, without controls.
 */
import { layout, traces, unplottable } from "../../web/plots/convergence.js";
import { styleOf } from "../../web/plots/plan.js";

/** @typedef {import("../../web/api.js").Convergence} Convergence */
/** @typedef {{scene: string, integrators: string[], sweep: Record<string, unknown>}} Panel */
/**
 * @typedef {object} Numbers what service/report/numbers.py writes
 * @property {string} toml
 * @property {string} metric
 * @property {{integrators: string[], samplers: string[]}} axes
 * @property {Record<string, Convergence>} convergence
 * @property {Record<string, Panel>} panels
 */

const PAPER_WIDTH = 660; // px: A4 without its margins
const PAPER_HEIGHT = 350; // px: with its table and words above it less than a page
const NEAR = "400px"; // before a plot comes into view

const block = /** @type {HTMLElement} */ (document.getElementById("data"));
const data = /** @type {Numbers} */ (JSON.parse(block.textContent ?? ""));
const night = matchMedia("(prefers-color-scheme: dark)");
let printing = false;

class Plot {
  metric = data.metric;
  /** @type {"spp" | "seconds"} */
  x = "spp";
  /** @type {"overlay" | "multiples"} */
  arrange = "overlay";
  drawn = false;

  /** @param {HTMLElement} figure */
  constructor(figure) {
    this.panel = /** @type {Panel} */ (data.panels[figure.dataset.plot ?? ""]);
    this.target = /** @type {HTMLElement} */ (figure.querySelector(".drawing"));
    const controls = /** @type {HTMLElement} */ (figure.querySelector(".controls"));
    controls.hidden = false;
    controls.addEventListener("click", (event) => {
      const button = event.target instanceof Element ? event.target.closest("button") : null;
      if (!button) return;
      if (button.dataset.metric) this.metric = button.dataset.metric;
      else if (button.dataset.arrange) this.arrange = button.dataset.arrange === "multiples" ? "multiples" : "overlay";
      else this.x = button.dataset.x === "seconds" ? "seconds" : "spp";
      for (const one of button.parentElement?.children ?? []) one.setAttribute("aria-pressed", String(one === button));
      this.draw();
    });
  }

  draw() {
    const convergence = /** @type {Convergence} */ (data.convergence[this.metric]);
    const { scene, integrators } = this.panel;
    const sweep = JSON.stringify(this.panel.sweep);
    const width = printing ? PAPER_WIDTH : this.target.clientWidth;
    /** @type {import("../../web/plots/plan.js").Options} */
    const options = {
      x: this.x,
      arrange: this.arrange,
      scene,
      only: (series) => integrators.includes(series.integrator) && JSON.stringify(series.sweep ?? {}) === sweep,
      dark: night.matches && !printing,
      width,
      samplers: data.axes.samplers,
      integrators: data.axes.integrators,
      font: getComputedStyle(this.target).fontFamily,
    };
    const hidden = unplottable(convergence, options);
    this.target.title = hidden ? `${hidden} points are not above zero and cannot be drawn on a logarithmic axis` : "";
    const curves = traces(convergence, options);
    const { autosize, ...rest } = layout(convergence, options);
    const overlay = this.arrange === "overlay";
    const height = (overlay && printing ? PAPER_HEIGHT : Number(rest.height)) + (overlay ? legendHeight(curves, width) : 0);
    window.Plotly?.react(this.target, curves, { ...rest, width, height }, {
      displaylogo: false,
      displayModeBar: printing ? false : "hover",
      staticPlot: printing,
      showSendToCloud: false,
      plotlyServerURL: "",
      modeBarButtonsToRemove: ["select2d", "lasso2d", "autoScale2d"],
      // A vector, as papers want it; a PNG would pass through a blob URL, which this page does not allow.
      toImageButtonOptions: { format: "svg", filename: `${scene} ${integrators.join(" ")} ${this.metric}` },
    });
    this.target.style.minHeight = "0";
    this.drawn = true;
  }
}

/** px that a legend has beyond its first row. @param {Plotly.Data[]} curves @param {number} width */
function legendHeight(curves, width) {
  const names = curves.filter((curve) => curve.showlegend !== false).map((curve) => curve.name?.length ?? 0);
  const columns = Math.max(1, Math.floor((width - 90) / (45 + 6.5 * Math.max(...names))));
  return 19 * (Math.ceil(names.length / columns) - 1);
}

const plots = new Map([...document.querySelectorAll("[data-plot]")].map((figure) => [figure, new Plot(/** @type {HTMLElement} */ (figure))]));
const watch = new IntersectionObserver(
  (entries) => {
    for (const entry of entries) {
      const plot = plots.get(entry.target);
      if (entry.isIntersecting && plot && !plot.drawn) plot.draw();
    }
  },
  { rootMargin: NEAR },
);
for (const figure of plots.keys()) watch.observe(figure);

/** @param {boolean} all those that nobody has seen yet, too */
function redraw(all) {
  for (const plot of plots.values()) if (all || plot.drawn) plot.draw();
  paint();
}

/** The colours of the curves, beside their names. */
function paint() {
  for (const swatch of /** @type {NodeListOf<HTMLElement>} */ (document.querySelectorAll(".swatch"))) {
    const { sampler = "", integrator = "" } = swatch.dataset;
    const { colour } = styleOf({ sampler, integrator }, { ...data.axes, dark: night.matches && !printing });
    swatch.style.setProperty("--swatch", colour);
  }
}

/** @param {boolean} now */
function print(now) {
  if (now === printing) return;
  printing = now;
  redraw(now);
}

let waiting = 0;
addEventListener("resize", () => {
  clearTimeout(waiting);
  waiting = setTimeout(() => printing || redraw(false), 150);
});
addEventListener("beforeprint", () => print(true));
addEventListener("afterprint", () => print(false));
night.addEventListener("change", () => redraw(false));
paint();

for (const button of /** @type {NodeListOf<HTMLButtonElement>} */ (document.querySelectorAll("[data-copy]"))) {
  button.hidden = false;
  button.addEventListener("click", async () => {
    const source = /** @type {HTMLElement} */ (document.getElementById(button.dataset.copy ?? ""));
    try {
      await navigator.clipboard.writeText(source.textContent ?? "");
      button.textContent = "copied";
    } catch {
      getSelection()?.selectAllChildren(source); // the reader's own Ctrl+C is always allowed
      button.textContent = "selected: press Ctrl+C";
    }
  });
}

for (const button of /** @type {NodeListOf<HTMLButtonElement>} */ (document.querySelectorAll("[data-save]"))) {
  button.hidden = false;
  button.addEventListener("click", () => {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([block.textContent ?? ""], { type: "application/json" }));
    link.download = "numbers.json";
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  });
}
