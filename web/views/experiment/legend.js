// @ts-check
/**
 * The legend of the curves: samplers down, integrators across, the fitted slope of each curve between them. It stays
 * readable with many curves, and its names show and hide: the same filter that the pictures and the table obey.
 */
import { html } from "../../vendor/preact-htm.js";
import { slopeText } from "../../plots/convergence.js";
import { styleOf } from "../../plots/plan.js";
import { Replay } from "./replay.js";
import { isolating, toggling } from "./view.js";

/** @typedef {import("../../api.js").Series} Series */
/** @typedef {import("../../plots/plan.js").Options} Options */
/** @typedef {import("./view.js").View} View */

const DASHARRAY = /** @type {Record<string, string>} */ ({
  solid: "", dash: "6 4", dot: "1.5 3.5", dashdot: "7 3 1.5 3", longdash: "10 4", longdashdot: "11 3 1.5 3",
}); // prettier-ignore
const MARKERS = /** @type {Record<string, string>} */ ({
  circle: "M14 2.5a3.5 3.5 0 1 1 0 7 3.5 3.5 0 0 1 0-7z",
  square: "M10.8 2.8h6.4v6.4h-6.4z",
  diamond: "M14 1.4l4.6 4.6-4.6 4.6L9.4 6z",
  "triangle-up": "M14 1.6l4.4 7.6H9.6z",
  x: "M11 3l3 3 3-3 1 1-3 2 3 3-1 1-3-3-3 3-1-1 3-3-3-2z",
  pentagon: "M14 1.5l4.4 3.2-1.7 5.2h-5.4L9.6 4.7z",
});

/**
 * @param {{series: readonly Series[], sloped: boolean, view: View, options: Options, set: typeof import("../../address.js").setParams,
 *   onEmphasis: (of: {sampler?: string, integrator?: string} | null) => void}} props
 */
export function Legend({ series, sloped, view, options, set, onEmphasis }) {
  const integrators = view.axes.find(({ name }) => name === "integrator")?.values ?? [];
  const samplers = view.axes.find(({ name }) => name === "sampler")?.values ?? [];
  const replays = new Set(series.filter((one) => one.replay).map((one) => one.sampler));
  const of = new Map(series.map((one) => [`${one.sampler}\n${one.integrator}`, one]));
  /** @param {"sampler" | "integrator"} axis @param {string} value */
  const toggle = (axis, value) => {
    const hidden = view.hidden.get(axis)?.has(value) ?? false;
    const style = styleOf({ sampler: samplers[0] ?? "", integrator: integrators[0] ?? "", [axis]: value }, options);
    return html`<button
      class="legend-name"
      aria-pressed=${!hidden}
      title=${`${value}: click to ${hidden ? "show" : "hide"}, double-click to show it alone`}
      onClick=${() => (onEmphasis(null), set(toggling(view, axis, value)))}
      onDblClick=${() => set(isolating(view, axis, value))}
      onMouseEnter=${() => onEmphasis(hidden ? null : { [axis]: value })}
      onMouseLeave=${() => onEmphasis(null)}
    >
      ${axis === "sampler"
        ? html`<${Swatch} colour=${style.colour} broken=${replays.has(value)} />`
        : html`<${Swatch} colour="currentColor" dash=${style.dash} symbol=${style.symbol} />`}
      <span class="name">${value}</span>${axis === "sampler" && replays.has(value) && html`<${Replay} />`}
    </button>`;
  };
  return html`<div class="legend-scroller">
    <table class="legend">
      <caption class="unseen">Legend, with the slope of each curve and half of its 95 % interval</caption>
      <thead>
        <tr>
          <th scope="col" class="legend-corner" title="exponent b of error ~ spp^b, with half of its 95 % interval">${sloped && "slope ± 95 %"}</th>
          ${integrators.map((integrator) => html`<th scope="col" key=${integrator}>${toggle("integrator", integrator)}</th>`)}
        </tr>
      </thead>
      <tbody>
        ${samplers.map(
          (sampler) => html`<tr key=${sampler}>
            <th scope="row">${toggle("sampler", sampler)}</th>
            ${integrators.map((integrator) => {
              const hidden = view.hidden.get("sampler")?.has(sampler) || view.hidden.get("integrator")?.has(integrator);
              const slope = slopeText(of.get(`${sampler}\n${integrator}`)?.slope ?? null);
              return html`<td
                key=${integrator}
                class=${`number ${hidden ? "off" : ""}`}
                onMouseEnter=${() => onEmphasis(hidden ? null : { sampler, integrator })}
                onMouseLeave=${() => onEmphasis(null)}
              >
                ${sloped && (slope || "–")}
              </td>`;
            })}
          </tr>`,
        )}
      </tbody>
    </table>
  </div>`;
}

/**
 * A piece of line with its marker; without a marker, only the colour, in two pieces where the curve is finely dashed.
 * @param {{colour: string, dash?: string, symbol?: string, broken?: boolean}} props
 */
function Swatch({ colour, dash, symbol, broken }) {
  if (!symbol) {
    return html`<svg width="16" height="12" viewBox="0 0 16 12" aria-hidden="true">
      <path d="M2.5 6h11" stroke=${colour} stroke-width="5" stroke-linecap=${broken ? "butt" : "round"} stroke-dasharray=${broken ? "4.5 2" : null} />
    </svg>`;
  }
  return html`<svg width="28" height="12" viewBox="0 0 28 12" aria-hidden="true">
    <path d="M0 6h28" stroke=${colour} stroke-width="2" stroke-dasharray=${DASHARRAY[dash ?? "solid"] || null} fill="none" />
    <path d=${MARKERS[symbol] ?? MARKERS["circle"]} fill=${colour} />
  </svg>`;
}
