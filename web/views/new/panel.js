// @ts-check
/** What submitting would do: how many cells, how long, how much disk, the grid as text; and the button that does it. */
import { html, useState } from "../../vendor/preact-htm.js";
import { bytes, count, counted, duration } from "../../format.js";
import { Icon } from "../../parts/icons.js";
import { told } from "../../parts/toast.js";
import { placeOf } from "./fields.js";

/** @typedef {import("../../api.js").DryRun} DryRun */
/** @typedef {import("../../api.js").Fault} Fault */
/** @typedef {import("./dryrun.js").Estimate} Estimate */

const COPIED_MS = 1500;

/**
 * `beside`: whether the form is there, with faults beside its fields; else the grid is edited as text.
 * @param {{estimate: Estimate, beside: boolean, sending: boolean, onSubmit: () => void}} props
 */
export function Panel({ estimate, beside, sending, onSubmit }) {
  const { result, faults, stale } = estimate;
  return html`<aside class="plan panel" aria-label="What this will do">
    <div class=${`plan-facts ${stale ? "stale" : ""}`} aria-busy=${stale}>
      ${faults.length > 0 ? html`<${FaultList} faults=${faults} beside=${beside} />` : result ? html`<${Facts} result=${result} />` : html`<${Blank} />`}
    </div>
    <div class="plan-submit">
      ${result && faults.length === 0 && html`<p class="hint number narrow-only">about ${duration(result.seconds)}, ${bytes(result.disk_bytes)}</p>`}
      <${Submit} estimate=${estimate} sending=${sending} onSubmit=${onSubmit} />
    </div>
    ${beside && result && faults.length === 0 && html`<${GridText} toml=${result.toml} />`}
  </aside>`;
}

/** @param {{estimate: Estimate, sending: boolean, onSubmit: () => void}} props */
function Submit({ estimate: { result, faults, stale }, sending, onSubmit }) {
  const ready = result !== null && faults.length === 0;
  if (ready && !stale && result.experiment !== null)
    return html`<a class="button primary large" href=${`/experiments/${result.experiment}`}>Open experiment ${result.experiment}</a>
      <p class="hint">This very grid is there already.</p>`;
  const todo = ready && result.replicates > result.reused;
  const words = sending
    ? "Sending…"
    : faults.length > 0
      ? `Mend ${counted(faults.length, "problem")} first`
      : !ready
        ? "Queue"
        : todo
          ? `Queue ${counted(result.cells, "cell")}`
          : "Add it: every picture is there";
  return html`<button class="button primary large" type="button" disabled=${!ready || stale || sending} title="Ctrl+Enter" onClick=${onSubmit}>${words}</button>`;
}

/** @param {{result: DryRun}} props */
function Facts({ result }) {
  const { axes, cells, references, replicates, reused, seconds, disk_bytes, rough, rounded } = result;
  const todo = replicates > reused;
  /** @type {(key: string, one: string, many?: string) => string} */
  const axis = (key, one, many) => counted(axes[key] ?? 0, one, many);
  const product = [axis("scenes", "scene"), axis("integrators", "integrator"), axis("samplers", "sampler"), axis("spp", "spp", "spp")];
  return html`<p class="plan-cells number"><strong>${count(cells)}</strong> ${cells === 1 ? "cell" : "cells"}</p>
    <p class="muted">= ${product.join(" × ")}</p>
    <dl class="facts">
      <dt>Pictures</dt>
      <dd class="number">
        ${count(replicates)}<span class="hint">${axis("replicates", "replicate")} a cell${references > 0 && `, ${counted(references, "reference")}`}</span>
      </dd>
      ${reused > 0 && [html`<dt>Reused</dt>`, html`<dd class="number">${count(reused)}<span class="hint">are rendered already</span></dd>`]}
      <dt>Time</dt>
      <dd class="number">
        ${todo ? `about ${duration(seconds)}` : "nothing to render"}
        ${todo && rough && html`<span class="hint"><span class="tag warn">a guess</span> nothing like it was timed here yet</span>`}
      </dd>
      <dt>Disk</dt>
      <dd class="number">about ${bytes(disk_bytes)}</dd>
    </dl>
    ${rounded.length > 0 && html`<${Rounded} rounded=${rounded} />`}`;
}

/** @param {{rounded: DryRun["rounded"]}} props */
function Rounded({ rounded }) {
  const samplers = [...new Set(rounded.map(({ sampler }) => sampler))];
  return html`<div class="rounded">
    <h3>Rounded samples per pixel</h3>
    ${samplers.map(
      (sampler) => html`<p key=${sampler}>
        <code>${sampler}</code>
        ${rounded.filter((one) => one.sampler === sampler).map(({ asked, rendered }) => html`<span class="number">${asked} → ${rendered}</span>`)}
      </p>`,
    )}
  </div>`;
}

/** @param {{faults: readonly Fault[], beside: boolean}} props */
function FaultList({ faults, beside }) {
  return html`<div role="status">
    <h3>This cannot be run yet</h3>
    <ul class="fault-list">
      ${faults.map((fault) => {
        const place = beside ? placeOf(fault) : null;
        return html`<li key=${fault.detail}>
          ${place && html`<a href=${`#fault-${place}`}>${place}</a>`}
          <p class="fault">${fault.detail}</p>
        </li>`;
      })}
    </ul>
  </div>`;
}

/** As large as the facts, so that nothing moves when they come. */
function Blank() {
  return html`<div class="plan-blank"><div class="skeleton" style="height: 34px; width: 45%"></div>
    ${[80, 60, 70, 60].map((width, row) => html`<div class="skeleton" key=${row} style=${{ height: "16px", width: `${width}%` }}></div>`)}</div>`;
}

/** @param {{toml: string}} props */
function GridText({ toml }) {
  const [copied, setCopied] = useState(false);
  async function copy() {
    await told(navigator.clipboard.writeText(toml));
    setCopied(true);
    setTimeout(() => setCopied(false), COPIED_MS);
  }
  return html`<details class="grid-text">
    <summary>The grid as TOML</summary>
    <pre tabindex="0">${toml}</pre>
    <div class="grid-text-foot">
      <button class="button" type="button" onClick=${copy}>
        <${Icon} name=${copied ? "check" : "copy"} /> ${copied ? "Copied" : "Copy"}
      </button>
      <span class="hint">a grid file for <code>./dartboard run</code></span>
    </div>
  </details>`;
}
