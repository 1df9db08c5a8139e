// @ts-check
/** Asks before an experiment goes: what would go with it, what stays, and for how long it can be undone. */
import { html, useEffect, useState } from "../../vendor/preact-htm.js";
import { experiments } from "../../api.js";
import { bytes, counted, when } from "../../format.js";
import { Dialog } from "../../parts/dialog.js";
import { toast, told } from "../../parts/toast.js";

/** @typedef {import("../../api.js").Experiment} Experiment */
/** @typedef {import("../../api.js").Deleted} Deleted */

/** @param {{experiment: Experiment, onClose: () => void, onDeleted?: () => void}} props */
export function DeleteDialog({ experiment, onClose, onDeleted }) {
  const { id, name } = experiment;
  const [takes, setTakes] = useState(/** @type {Deleted | null} */ (null));
  const [error, setError] = useState("");
  useEffect(() => {
    experiments.remove(id, { dryRun: true }).then(setTakes, (problem) => setError(problem.message));
  }, [id]);

  async function remove() {
    onClose();
    if (!(await told(experiments.remove(id)))) return;
    const undo = () => void told(experiments.act(id, "restore"));
    toast({ text: `Deleted “${name}”`, action: { label: "Undo", run: undo } });
    onDeleted?.();
  }

  return html`<${Dialog} title="Delete this experiment?" onClose=${onClose}>
    <p class="dialog-name">${name}</p>
    <div class="dialog-facts">
      ${error && html`<p class="fault">${error}</p>`} ${takes && html`<${Takes} takes=${takes} />`}
      ${!error && !takes && html`<p class="muted">Counting…</p>`}
    </div>
    <div class="dialog-buttons">
      <button class="button" autofocus onClick=${onClose}>Keep it</button>
      <button class="button danger" disabled=${!takes} onClick=${remove}>Delete</button>
    </div>
  <//>`;
}

/** @param {{takes: Deleted}} props */
function Takes({ takes: { cells, pictures, disk_bytes, final_at } }) {
  const lost = `${counted(pictures, "picture")} in ${counted(cells, "cell")}`;
  return html`<p>
      ${pictures > 0
        ? `${lost} that no other experiment wants would go with it, and free ${bytes(disk_bytes)}.`
        : "No picture would go with it: other experiments want all of them, or there are none yet."}
    </p>
    <p class="muted">It can be undone until <time datetime=${final_at} title=${final_at}>${when(final_at)}</time>.</p>`;
}
