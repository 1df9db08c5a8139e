// @ts-check
/**
 * One cell of the image grid: its picture, what is being done to it, its error and how that compares.
 *
 * A tile has the same size in every state, so nothing moves while a grid fills. It is drawn again only when one of its
 * properties changed.
 */
import { Component, html } from "../../vendor/preact-htm.js";
import { fractionOf } from "../../model.js";
import { describe } from "./axes.js";
import { estimateOf, meanText } from "./compare.js";
import { Picture } from "./picture.js";

/** @typedef {import("../../api.js").Cell} Cell */
/** @typedef {import("../../api.js").MetricInfo} MetricInfo */
/** @typedef {import("../../api.js").Progress} Progress */
/**
 * @typedef {object} Props
 * @property {string} id of the element
 * @property {Cell} cell
 * @property {Progress | undefined} progress
 * @property {string | null} src
 * @property {boolean} sharp pixels are shown enlarged
 * @property {boolean} errors
 * @property {MetricInfo} metric
 * @property {number | null} ratio to the baseline
 * @property {string} baseline label
 * @property {import("./compare.js").Rank} rank
 * @property {"row" | "column" | null} along what the rank is about
 * @property {boolean} selected
 * @property {number} column its number among all columns, from 1
 * @property {(cell: Cell) => void} onOpen
 * @property {(cell: Cell) => void} onLog
 */

/** @extends {Component<Props>} */
export class Tile extends Component {
  /** @override @param {Props} next */
  shouldComponentUpdate(next) {
    const now = /** @type {Record<string, unknown>} */ (/** @type {unknown} */ (this.props));
    return Object.entries(next).some(([name, value]) => now[name] !== value);
  }

  /** @override @param {Props} props */
  render(props) {
    const { cell, progress, src, selected, column, onOpen } = props;
    const running = cell.state === "running";
    return html`<div
      id=${props.id}
      class="tile"
      role="gridcell"
      aria-colindex=${column + 1}
      aria-selected=${selected}
      data-state=${cell.state}
      data-cell=${cell.cell}
      data-rank=${props.rank}
    >
      <div class="tile-box" title=${titleOf(props)} onClick=${() => onOpen(cell)}>
        <${Picture} src=${src} alt=${altOf(props)} sharp=${props.sharp} />
        ${!src && html`<${Waiting} ...${props} />`}
        ${running &&
        html`<div class="tile-progress" aria-hidden="true">
          <span style=${{ transform: `scaleX(${fractionOf(cell, progress)})` }}></span>
        </div>`}
      </div>
      <${Caption} ...${props} />
    </div>`;
  }
}

/** Two lines under the picture. @param {Props} props */
function Caption(props) {
  const { cell, metric, ratio, rank, along, baseline } = props;
  const estimate = estimateOf(cell, metric.name);
  return html`<div class="tile-caption">
    <p class="tile-value">
      ${estimate
        ? html`<span class="number" title=${`${metric.name} ± standard error, n = ${estimate.n}`}
            ><b>${meanText(estimate, metric)}</b>${estimate.se !== null && html`<span class="muted"> ± ${estimate.se.toExponential(1)}</span>`}</span
          >`
        : html`<span class="muted">${cell.had > 0 ? "not measured yet" : " "}</span>`}
    </p>
    <p class="tile-notes">
      ${ratio !== null && html`<span class="number" title=${`error relative to ${baseline}, at the samples that each rendered`}>${ratio === 1 ? "baseline" : `× ${ratio.toPrecision(3)}`}</span>`}
      ${cell.spp !== cell.spp_actual &&
      html`<span class="number tile-rounded" title=${`${cell.spp} spp were asked; ${cell.sampler} ${cell.replay ? "ignores that" : "rounds them"}`}>${cell.spp_actual} spp</span>`}
      <${State} ...${props} />
      ${rank && html`<span class="tile-rank" title=${rankText(rank, along)}>${rank === "best" ? "best" : "≈ best"}</span>`}
    </p>
  </div>`;
}

/** What is the matter with a cell that is not done. @param {Props} props */
function State({ cell, progress, onLog }) {
  if (cell.state === "done") return null;
  if (cell.state === "failed") {
    return html`<span class="state" data-state="failed" title=${cell.error ?? null}>${cell.error_class?.replaceAll("_", " ") ?? "failed"}</span>
      <button class="link" tabindex="-1" onClick=${() => onLog(cell)}>log</button>`;
  }
  if (cell.state === "running") {
    const replicate = Math.min(cell.wanted, (progress?.replicate ?? cell.had) + 1);
    return html`<span class="state number" data-state="running">${replicate} of ${cell.wanted}</span>`;
  }
  // Without a picture the box says it already.
  return cell.had > 0 && html`<span class="state number" data-state=${cell.state}>${cell.state}, ${cell.had} of ${cell.wanted}</span>`;
}

/** Instead of a picture. @param {Props} props */
function Waiting({ cell, errors }) {
  if (errors && cell.had > 0) return html`<p class="tile-state muted">${cell.reference ? "not measured yet" : "no reference"}</p>`;
  return html`<p class="tile-state state" data-state=${cell.state}>${cell.state}</p>`;
}

/** @param {Props} props */
function altOf({ cell, metric, errors }) {
  const estimate = estimateOf(cell, metric.name);
  const value = estimate ? `, ${metric.name} ${meanText(estimate, metric)}` : "";
  return `${errors ? "error of " : ""}${describe(cell)}${value}`;
}

/** @param {Props} props */
function titleOf({ cell }) {
  return cell.state === "failed" ? `${describe(cell)}\n${cell.error_class}: ${cell.error}` : describe(cell);
}

/** @param {import("./compare.js").Rank} rank @param {"row" | "column" | null} along */
function rankText(rank, along) {
  return rank === "best"
    ? `lowest error of the ${along}, among cells with the same reference and as many samples`
    : `less than 2 standard errors from the lowest of the ${along}: they cannot be told apart`;
}
