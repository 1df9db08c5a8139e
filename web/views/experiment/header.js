// @ts-check
/** The top of an experiment: its name, how far it is, what can be done with it, and what it is. */
import { html, useState } from "../../vendor/preact-htm.js";
import { experiments } from "../../api.js";
import { navigate } from "../../address.js";
import { count, counted, duration, when } from "../../format.js";
import { Icon } from "../../parts/icons.js";
import { Menu } from "../../parts/menu.js";
import { StateBar } from "../../parts/statebar.js";
import { toast, told } from "../../parts/toast.js";
import { DeleteDialog } from "../list/delete.js";

/** @typedef {import("../../api.js").Experiment} Experiment */
/** @typedef {import("../../api.js").ExperimentDetail} ExperimentDetail */

/** @param {{detail: ExperimentDetail, experiment: Experiment, onDeleted: () => void}} props */
export function Head({ detail, experiment, onDeleted }) {
  const [deleting, setDeleting] = useState(false);
  const { id, name, state, had, wanted, seconds_left, created_at } = experiment;
  /** @param {string} path */
  const download = (path) => {
    const link = document.createElement("a");
    link.href = path;
    link.download = "";
    link.click();
  };
  return html`<header class="head panel">
    <div class="head-title">
      <h1 class="name" title=${name}>${name}</h1>
      <span class="hint number">#${id}</span>
      <span class="state" data-state=${state}>${state}</span>
      <span class="spacer"></span>
      <${Actions} experiment=${experiment} />
      <a class="button" href=${experiments.reportUrl(id)} target="_blank" rel="noopener" title="One self-contained file, in a new tab">Report</a>
      <${Menu}
        label="More"
        actions=${[
          { label: "Duplicate and change", icon: "copy", run: () => navigate(`/new?from=${id}`) },
          { label: "Results as CSV", icon: "open", run: () => download(experiments.csvUrl(id)) },
          { label: "Results as JSON", icon: "open", run: () => download(experiments.jsonUrl(id)) },
          { label: "Delete…", icon: "trash", danger: true, run: () => setDeleting(true) },
        ]}
      />
    </div>
    <${StateBar} experiment=${experiment} />
    <p class="head-facts number">
      <span>${count(had)} <span class="muted">of ${counted(wanted, "picture")}</span></span>
      ${seconds_left !== null && html`<span>${duration(seconds_left)} <span class="muted">left</span></span>`}
      <span class="muted">since <time datetime=${created_at} title=${created_at}>${when(created_at)}</time></span>
      <span class="spacer"></span>
      <span class="head-jump"><a href="#pictures">Pictures</a> <a href="#curves">Convergence</a> <a href="#table">Table</a></span>
    </p>
    <${About} detail=${detail} />
    ${deleting && html`<${DeleteDialog} experiment=${experiment} onClose=${() => setDeleting(false)} onDeleted=${onDeleted} />`}
  </header>`;
}

/** What its state allows. @param {{experiment: Experiment}} props */
function Actions({ experiment: { id, state, failed } }) {
  const live = state === "running" || state === "queued";
  /** @param {"pause" | "resume" | "cancel" | "retry"} action @param {string} label @param {import("../../parts/icons.js").IconName} icon @param {string} title */
  const button = (action, label, icon, title) =>
    html`<button key=${action} class="button" title=${title} onClick=${() => void told(experiments.act(id, action))}>
      <${Icon} name=${icon} /> ${label}
    </button>`;
  return [
    live && button("pause", "Pause", "pause", "What is being drawn is stopped; nothing finished is lost"),
    state === "paused" && button("resume", "Resume", "play", "Go on with what is missing"),
    (live || state === "paused") && button("cancel", "Cancel", "stop", "Give up what is missing; what is finished stays"),
    (failed > 0 || state === "cancelled") && button("retry", "Retry what is missing", "retry", "Queue failed and cancelled cells again"),
  ];
}

/** What this is, in a line, and in full when opened. @param {{detail: ExperimentDetail}} props */
function About({ detail }) {
  const { scenes, integrators, samplers, spp, sweeps, replicates, toml } = detail;
  const line = [
    counted(scenes.length, "scene"),
    ...Object.entries(sweeps).map(([name, values]) => `${values.length} ${name}`),
    counted(integrators.length, "integrator"),
    counted(samplers.length, "sampler"),
    `${spp.length} spp`,
    counted(replicates, "replicate"),
  ].join(" × ");
  const copy = async () => {
    await navigator.clipboard.writeText(toml);
    toast({ text: "Copied the grid; save it as grid.toml and run ./dartboard run grid.toml" });
  };
  return html`<details class="about">
    <summary>${line}</summary>
    <div class="about-body">
      <dl>
        <dt>Scenes</dt>
        <dd>
          <table>
            ${scenes.map(
              (scene) => html`<tr key=${scene.name}>
                <th scope="row">${scene.name}</th>
                <td class="number">${scene.width} × ${scene.height}</td>
                <td>${scene.reference ? `reference: ${scene.reference}` : "no reference: errors are not measured"}</td>
              </tr>`,
            )}
          </table>
        </dd>
        <dt>Integrators</dt>
        <dd>${integrators.join(", ")}</dd>
        <dt>Samplers</dt>
        <dd>${samplers.join(", ")}</dd>
        <dt>Samples per pixel</dt>
        <dd class="number">${spp.join(", ")}</dd>
        ${Object.entries(sweeps).map(([name, values]) => [html`<dt>${name}</dt>`, html`<dd class="number">${values.map((value) => JSON.stringify(value)).join(", ")}</dd>`])}
      </dl>
      <div class="about-toml">
        <p class="row"><span class="control-label">The grid, to run again</span><span class="spacer"></span><button class="button quiet" onClick=${() => told(copy())}><${Icon} name="copy" /> Copy TOML</button></p>
        <pre tabindex="0">${toml}</pre>
      </div>
    </div>
  </details>`;
}
