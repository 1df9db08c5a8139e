// @ts-check
/** The picture that others are measured against, with how far it is. */
import { html } from "../../vendor/preact-htm.js";
import { fractionOf } from "../../model.js";
import { describe } from "./axes.js";
import { Picture } from "./picture.js";
import { sourceOf } from "./sources.js";

/** @typedef {import("./sources.js").How} How */

/** @param {{model: import("../../model.js").ExperimentModel, cell: number | undefined, how: How, sharp: boolean}} props */
export function ReferenceTile({ model, cell: id, how, sharp }) {
  const cell = id === undefined ? undefined : model.references.get(id);
  if (!cell) return html`<div class="tile"><div class="tile-box skeleton"></div></div>`;
  const progress = model.progressOf(cell);
  // An error map has no reference of its own: it is shown as the picture it is.
  const tone = how.metric === null ? how.tone : "srgb";
  const src = sourceOf(cell, progress, { ...how, metric: null, tone });
  const done = `${cell.had} of ${cell.wanted}`;
  return html`<div class="tile" data-state=${cell.state}>
    <div class="tile-box" title=${`reference: ${describe(cell)}`}>
      <${Picture} src=${src} alt=${`reference of ${cell.scene}: ${describe(cell)}`} sharp=${sharp} />
      ${!src && html`<p class="tile-state state" data-state=${cell.state}>${cell.state}</p>`}
      ${cell.state === "running" &&
      html`<div class="tile-progress" aria-hidden="true"><span style=${{ transform: `scaleX(${fractionOf(cell, progress)})` }}></span></div>`}
    </div>
    <div class="tile-caption">
      <p class="tile-value name" title=${`${cell.integrator} · ${cell.sampler}`}>${cell.integrator} · ${cell.sampler}</p>
      <p class="tile-notes">
        <span class="number">${cell.spp_actual * cell.wanted} spp</span>
        ${cell.state !== "done" && html`<span class="state number" data-state=${cell.state}>${cell.state === "running" ? done : cell.state}</span>`}
      </p>
    </div>
  </div>`;
}
