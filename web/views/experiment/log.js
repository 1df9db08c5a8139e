// @ts-check
/** What happened to a cell: every attempt with its outcome and the last words of its render process. */
import { html, useEffect, useState } from "../../vendor/preact-htm.js";
import { cells as cellsApi, experiments } from "../../api.js";
import { duration, when } from "../../format.js";
import { Dialog } from "../../parts/dialog.js";
import { Icon } from "../../parts/icons.js";
import { toast, told } from "../../parts/toast.js";
import { describe } from "./axes.js";

/** @typedef {import("../../api.js").Attempt} Attempt */
/** @typedef {import("../../api.js").Cell} Cell */

/** @param {{experiment: number, cell: Cell, onClose: () => void}} props */
export function Log({ experiment, cell, onClose }) {
  const [attempts, setAttempts] = useState(/** @type {Attempt[] | null} */ (null));
  const [error, setError] = useState("");
  useEffect(() => {
    cellsApi.attempts(cell.cell).then(
      (answer) => setAttempts(answer.attempts),
      (problem) => setError(problem.message),
    );
  }, [cell.cell, cell.state, cell.had]);

  const copy = async () => {
    await navigator.clipboard.writeText(asReport(cell, attempts ?? []));
    toast({ text: "Copied the log" });
  };
  const retry = async () => {
    if (await told(experiments.act(experiment, "retry"))) onClose();
  };
  return html`<${Dialog} title="Log of a cell" wide onClose=${onClose}>
    <p class="dialog-name">${describe(cell)}</p>
    <p class="row">
      <span class="state" data-state=${cell.state}>${cell.state}</span>
      <span class="muted number">${cell.had} of ${cell.wanted} pictures</span>
    </p>
    ${cell.error && html`<p class="fault">${cell.error_class?.replaceAll("_", " ")}: ${cell.error}</p>`}
    <div class="attempts">
      ${error && html`<p class="fault">${error}</p>`} ${!error && !attempts && html`<p class="muted">Fetching…</p>`}
      ${attempts?.length === 0 && html`<p class="muted">No attempt yet: it waits for its turn.</p>`}
      ${[...(attempts ?? [])].reverse().map((attempt, i) => html`<${One} key=${attempt.id} attempt=${attempt} open=${i === 0} />`)}
    </div>
    <div class="dialog-buttons">
      <button class="button" disabled=${!attempts} onClick=${() => told(copy())}><${Icon} name="copy" /> Copy</button>
      ${(cell.state === "failed" || cell.state === "cancelled") &&
      html`<button class="button" title="Queues every failed and cancelled cell of the experiment" onClick=${retry}>
        <${Icon} name="retry" /> Retry what is missing
      </button>`}
      <button class="button primary" autofocus onClick=${onClose}>Close</button>
    </div>
  <//>`;
}

/** @param {{attempt: Attempt, open: boolean}} props */
function One({ attempt, open }) {
  const { started_at, ended_at, outcome, error, log, machine, device } = attempt;
  const seconds = ended_at ? (Date.parse(ended_at) - Date.parse(started_at)) / 1000 : null;
  return html`<details class="attempt" open=${open}>
    <summary>
      <span class="state" data-state=${stateOf(outcome)}>${outcome?.replaceAll("_", " ") ?? "running"}</span>
      <time class="number" datetime=${started_at} title=${started_at}>${when(started_at)}</time>
      <span class="muted number">${seconds === null ? "" : duration(seconds)}</span>
      <span class="muted name">${machine} · ${device}</span>
    </summary>
    ${error && html`<p class="fault">${error}</p>`}
    ${log ? html`<pre class="log" tabindex="0">${log}</pre>` : html`<p class="muted">Its render process said nothing.</p>`}
  </details>`;
}

/** @param {string | null} outcome @returns {import("../../api.js").State} */
function stateOf(outcome) {
  if (outcome === null) return "running";
  if (outcome === "done" || outcome === "released") return "done";
  return outcome === "cancelled" || outcome === "owner_lost" ? "cancelled" : "failed";
}

/** @param {Cell} cell @param {readonly Attempt[]} attempts */
function asReport(cell, attempts) {
  const parts = attempts.map((attempt) =>
    [
      `attempt ${attempt.id}: ${attempt.started_at} … ${attempt.ended_at ?? "running"} on ${attempt.machine}, ${attempt.device}: ${attempt.outcome ?? "running"}`,
      attempt.error ?? "",
      attempt.log ?? "",
    ]
      .filter(Boolean)
      .join("\n"),
  );
  return [`${describe(cell)} (cell ${cell.cell}): ${cell.state}`, ...parts].join("\n\n") + "\n";
}
