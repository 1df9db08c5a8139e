// @ts-check
/** The points of a `pointset`: a .npz file of one's own, sent when it is chosen. */
import { html, useRef, useState } from "../../vendor/preact-htm.js";
import { points as api } from "../../api.js";
import { counted } from "../../format.js";
import { Icon } from "../../parts/icons.js";
import { faultsOf } from "./dryrun.js";

/** @typedef {import("../../api.js").PointFile} PointFile */
/** @typedef {import("./form.js").Upload} Upload */

/**
 * @param {{value: string, points: readonly Upload[], onSent: (file: PointFile) => void}} props
 * `value`: the name of the file that is chosen; `points`: those that were sent
 */
export function PointFileField({ value, points, onSent }) {
  const input = useRef(/** @type {HTMLInputElement | null} */ (null));
  const [busy, setBusy] = useState("");
  const [told, setTold] = useState("");
  const [fault, setFault] = useState("");
  async function send() {
    const file = input.current?.files?.[0];
    if (!file || busy) return;
    setFault("");
    setBusy(file.name);
    try {
      const sent = await api.upload(file, file.name);
      setTold(`${counted(sent.sets, "set")} of ${counted(sent.count, "point")}`);
      onSent(sent);
    } catch (error) {
      setFault(faultsOf(error).map(({ detail }) => detail).join(" "));
    }
    setBusy("");
    if (input.current) input.current.value = ""; // the same file can be sent again once it is mended
  }
  const there = points.some(({ name }) => name === value);
  return html`<span class="parameter-line">
      <code>file</code>
      <input ref=${input} class="unseen" type="file" tabindex="-1" aria-hidden="true" accept=".npz" onChange=${send} />
      <button class="button small" type="button" disabled=${busy !== ""} onClick=${() => input.current?.click()}>
        <${Icon} name="upload" /> ${value || "Your own points…"}
      </button>
    </span>
    <span class="hint">
      ${busy ? `Sending ${busy}…` : there ? told : value ? "not sent to this server yet" : "a .npz of numpy, at most 64 MiB"}
    </span>
    ${fault && html`<span class="fault" role="alert">${fault}</span>`}`;
}
