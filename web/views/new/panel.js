// @ts-check
/** What submitting would do: how many cells, how long, how much disk, the grid as text; and the button that does it. */
import { html, useState } from "../../vendor/preact-htm.js";
import { bytes, count, counted, duration } from "../../format.js";
import { Icon } from "../../parts/icons.js";
import { told } from "../../parts/toast.js";
import { placeOf } from "./fields.js";

/** @typedef {import("../../api.js").DryRun} DryRun */
/** @typedef {import("../../api.js").Fault} Fault */
/** @typedef {import("../../vendor/preact-htm.js").Child} Child */
/** @typedef {import("./dryrun.js").Estimate} Estimate */

const COPIED_MS = 1500;

/**
 * `beside`: whether the form is there, with faults beside its fields; else the grid is edited as text.
 * @param {{estimate: Estimate, beside: boolean, sending: boolean, onSubmit: () => void}} props
 */
export function Panel({ estimate, beside, sending, onSubmit }) {
  const { result, faults, stale } = estimate;
  const good = faults.length === 0 ? result : null;
  return html`<aside class="plan panel" aria-label="What this will do">
    <div class=${`plan-facts ${stale ? "stale" : ""}`} aria-busy=${stale}>
      ${faults.length > 0 && html`<${FaultList} faults=${faults} beside=${beside} />`}
      ${good && html`<${Facts} result=${good} />`} ${!result && !faults.length && html`<${Blank} waiting=${stale} />`}
    </div>
    <div class="plan-submit">
      ${good && html`<p class="hint number narrow-only">about ${duration(good.seconds)}, ${bytes(good.disk_bytes)}</p>`}
      <${Submit} estimate=${estimate} sending=${sending} onSubmit=${onSubmit} />
    </div>
    ${beside && good && html`<${GridText} toml=${good.toml} />`}
  </aside>`;
}

/** @param {{estimate: Estimate, sending: boolean, onSubmit: () => void}} props */
function Submit({ estimate: { result, faults, stale }, sending, onSubmit }) {
  if (faults.length > 0)
    return html`<button class="button large" type="button" onClick=${() => show(faults)}>
      Show ${counted(faults.length, "problem")}
    </button>`;
  if (result && !stale && result.experiment !== null)
    return html`<a class="button primary large" href=${`/experiments/${result.experiment}`}>
        Open experiment ${result.experiment}
      </a>
      <p class="hint">This very grid is there already.</p>`;
  const ready = result !== null && !stale && !sending;
  const look = "button primary large";
  return html`<button class=${look} type="button" disabled=${!ready} title="Ctrl+Enter" onClick=${onSubmit}>
    ${sending ? "Sending…" : intent(result)}
  </button>`;
}

/** What the button will do, in its own words. @param {DryRun | null} result */
function intent(result) {
  if (!result) return "Queue";
  if (result.replicates === result.reused) return "Add it: every picture is there";
  return `Queue ${counted(result.cells, "cell")}`;
}

/** Brings the first fault into view: beside its field, or in the list. @param {readonly Fault[]} faults */
function show(faults) {
  const places = faults.map((fault) => document.getElementById(`fault-${placeOf(fault)}`));
  const place = places.find((element) => element?.hasChildNodes()) ?? document.querySelector(".fault-list");
  place?.scrollIntoView({ block: "center", behavior: "smooth" });
}

/** @param {{result: DryRun}} props */
function Facts({ result }) {
  const { axes, cells, references, replicates, reused, seconds, disk_bytes, rough, rounded } = result;
  const todo = replicates > reused;
  const guess = todo && rough && html`<span class="tag warn">a guess</span> nothing like it was timed here yet`;
  const sweeps = Object.entries(axes).filter(([axis]) => axis.includes("."));
  const product = [
    counted(axes.scenes ?? 0, "scene"),
    ...sweeps.map(([parameter, values]) => `${count(values)} ${parameter}`),
    counted(axes.integrators ?? 0, "integrator"),
    counted(axes.samplers ?? 0, "sampler"),
    counted(axes.spp ?? 0, "spp", "spp"),
  ];
  const each = `${counted(axes.replicates ?? 0, "replicate")} a cell`;
  return html`<p class="plan-cells number"><strong>${count(cells)}</strong> ${cells === 1 ? "cell" : "cells"}</p>
    <p class="muted">= ${product.join(" × ")}</p>
    <dl class="facts">
      <${Fact} name="Pictures" value=${count(replicates)}>
        ${references > 0 ? `${each}, ${counted(references, "reference")}` : each}
      <//>
      ${reused > 0 && html`<${Fact} name="Reused" value=${count(reused)}>are rendered already<//>`}
      <${Fact} name="Time" value=${todo ? `about ${duration(seconds)}` : "nothing to render"}>${guess}<//>
      <${Fact} name="Disk" value=${`about ${bytes(disk_bytes)}`} />
    </dl>
    ${rounded.length > 0 && html`<${Rounded} rounded=${rounded} />`}`;
}

/** @param {{name: string, value: string, children?: Child}} props */
function Fact({ name, value, children }) {
  return html`<div>
    <dt>${name}</dt>
    <dd class="number">${value}<span class="hint">${children}</span></dd>
  </div>`;
}

/** @param {{rounded: DryRun["rounded"]}} props */
function Rounded({ rounded }) {
  const samplers = [...new Set(rounded.map(({ sampler }) => sampler))];
  /** @param {string} sampler */
  const of = (sampler) => rounded.filter((one) => one.sampler === sampler);
  return html`<div class="rounded">
    <h3>Rounded samples per pixel</h3>
    ${samplers.map(
      (sampler) => html`<p key=${sampler}>
        <code>${sampler}</code>
        ${of(sampler).map(({ asked, rendered }) => html`<span class="number">${asked} → ${rendered}</span>`)}
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
          ${place && html`<button class="link" type="button" onClick=${() => show([fault])}>${place}</button>`}
          <p class="fault">${fault.detail}</p>
        </li>`;
      })}
    </ul>
  </div>`;
}

/** As large as the facts, so that nothing moves when they come. @param {{waiting: boolean}} props */
function Blank({ waiting }) {
  if (!waiting) return html`<p class="muted">What a grid would render and cost is told here once there is one.</p>`;
  return html`<div class="plan-blank">
    <div class="skeleton" style="height: 34px; width: 45%"></div>
    ${["80%", "60%", "70%", "50%"].map((width) => html`<div class="skeleton" key=${width} style=${{ width }}></div>`)}
  </div>`;
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
