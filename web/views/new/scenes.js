// @ts-check
/** Scenes to choose from: built in with what each is good for, and one's own, sent as a zip of its folder. */
import { html, useRef, useState } from "../../vendor/preact-htm.js";
import { scenes as api } from "../../api.js";
import { bytes, counted } from "../../format.js";
import { Icon } from "../../parts/icons.js";
import { faultsOf } from "./dryrun.js";
import { onText } from "./fields.js";

/** @typedef {import("../../vendor/preact-htm.js").Child} Child */
/** @typedef {import("../../api.js").Scene} Scene */
/** @typedef {import("./catalog.js").SceneEntry} SceneEntry */
/** @typedef {import("./form.js").SceneChoice} SceneChoice */

/**
 * @param {{entries: readonly SceneEntry[], known: readonly Scene[], chosen: readonly SceneChoice[],
 *   onChange: (chosen: readonly SceneChoice[]) => void, onUploaded: (scene: Scene) => void}} props
 */
export function Scenes({ entries, known, chosen, onChange, onUploaded }) {
  const own = known.filter(({ builtin }) => !builtin);
  /** @type {(scene: SceneChoice, other: SceneChoice) => boolean} */
  const same = (one, other) => one.name === other.name && one.digest === other.digest;
  /** @type {(scene: SceneChoice) => {on: boolean, onToggle: () => void}} */
  const choosing = (scene) => {
    const on = chosen.some((one) => same(one, scene));
    return { on, onToggle: () => onChange(on ? chosen.filter((one) => !same(one, scene)) : [...chosen, scene]) };
  };
  const here = [...entries.map(({ name }) => ({ name })), ...own.map(({ name, digest }) => ({ name, digest }))];
  const elsewhere = chosen.filter((one) => !here.some((other) => same(one, other)));
  return html`<ul class="scenes">
      ${entries.map((entry) => {
        const file = known.find(({ name, builtin }) => builtin && name === entry.name);
        return html`<${Builtin} key=${entry.name} entry=${entry} file=${file} ...${choosing({ name: entry.name })} />`;
      })}
      ${own.map((scene) => {
        const { name, digest } = scene;
        return html`<${Own} key=${digest} scene=${scene} ...${choosing({ name, digest })} />`;
      })}
      ${elsewhere.map(
        (one) => html`<${Card} key=${one.name + one.digest} title=${one.name} ...${choosing(one)}>
          <p class="hint">${one.digest ? `uploaded, ${one.digest.slice(0, 12)}` : "this server has no such scene"}</p>
        <//>`,
      )}
    </ul>
    <${Upload}
      onUploaded=${(/** @type {Scene} */ scene) => {
        onUploaded(scene);
        onChange([...chosen.filter(({ name }) => name !== scene.name), { name: scene.name, digest: scene.digest }]);
      }}
    />`;
}

/** What the server has said of the chosen scenes. @param {readonly SceneChoice[]} chosen @param {readonly Scene[]} known */
export function scenesOf(chosen, known) {
  return chosen.flatMap((one) =>
    known.filter(({ name, digest, builtin }) => (one.digest ? digest === one.digest : builtin && name === one.name)),
  );
}

/**
 * @param {{title: string, name?: string, on: boolean, onToggle: () => void, children?: Child}} props
 */
function Card({ title, name, on, onToggle, children }) {
  return html`<li class=${`scene ${on ? "on" : ""}`}>
    <label class="scene-head">
      <input type="checkbox" checked=${on} onChange=${onToggle} />
      <strong class="name" title=${title}>${title}</strong>
      ${name && html`<code class="muted">${name}</code>`}
    </label>
    <div class="scene-body">${children}</div>
  </li>`;
}

/** @param {{entry: SceneEntry, file?: Scene, on: boolean, onToggle: () => void}} props */
function Builtin({ entry, file, on, onToggle }) {
  const { name, title, line, good_for, hard_part, bad_for, lamp_in_frame } = entry;
  return html`<${Card} title=${title} name=${name} on=${on} onToggle=${onToggle}>
    <p>${line}</p>
    <dl class="scene-facts">
      <dt>Good for</dt>
      <dd>${good_for}</dd>
    </dl>
    <details>
      <summary>${lamp_in_frame ? html`Limits <span class="tag warn">a lamp is in the frame</span>` : "Limits"}</summary>
      <dl class="scene-facts">
        <dt>Hard part</dt>
        <dd>${hard_part}</dd>
        <dt>Cannot show</dt>
        <dd>${bad_for}</dd>
        ${lamp_in_frame && [html`<dt>Lamp</dt>`, html`<dd>${lamp_in_frame}</dd>`]}
      </dl>
    </details>
    ${file && html`<p class="hint">${size(file)}</p>`}
  <//>`;
}

/** @param {{scene: Scene, on: boolean, onToggle: () => void}} props */
function Own({ scene, on, onToggle }) {
  return html`<${Card} title=${scene.name} on=${on} onToggle=${onToggle}>
    <p>Your own: <code>${scene.main}</code> and ${counted(Math.max(0, scene.files.length - 1), "other file")}.</p>
    <p class="hint">${size(scene)}; the file itself uses ${scene.integrator}, ${scene.sampler}, ${scene.spp} spp</p>
  <//>`;
}

/** @param {Scene} scene */
function size({ width, height, max_depth }) {
  const paths = max_depth < 0 ? "paths of any length" : `paths of ${counted(max_depth, "edge")}`;
  return `${width} × ${height} pixels, ${paths}`;
}

/** @param {{onUploaded: (scene: Scene) => void}} props */
function Upload({ onUploaded }) {
  const input = useRef(/** @type {HTMLInputElement | null} */ (null));
  const [main, setMain] = useState("");
  const [busy, setBusy] = useState("");
  const [faults, setFaults] = useState(/** @type {readonly string[]} */ ([]));
  const [notes, setNotes] = useState(/** @type {readonly string[]} */ ([]));
  const [over, setOver] = useState(false);

  /** @param {File | undefined} file */
  async function send(file) {
    if (!file || busy) return;
    setFaults([]);
    setNotes([]);
    setBusy(`Sending ${file.name}, ${bytes(file.size)}…`);
    try {
      const scene = await api.upload(file, file.name.replace(/\.zip$/i, ""), main.trim());
      onUploaded(scene);
      setNotes(scene.notes ?? []);
      setMain("");
    } catch (error) {
      setFaults(faultsOf(error).map(({ detail }) => detail));
    }
    setBusy("");
    if (input.current) input.current.value = ""; // the same file can be sent again once it is mended
  }
  /** @param {DragEvent} event */
  const drop = (event) => {
    event.preventDefault();
    setOver(false);
    void send(event.dataTransfer?.files[0]);
  };
  /** @param {DragEvent} event */
  const drag = (event) => {
    event.preventDefault();
    setOver(true);
  };
  const leave = () => setOver(false);
  return html`<div class=${`upload ${over ? "over" : ""}`} onDrop=${drop} onDragOver=${drag} onDragLeave=${leave}>
    <input
      ref=${input}
      class="unseen"
      type="file"
      tabindex="-1"
      aria-hidden="true"
      accept=".zip,application/zip"
      onChange=${() => send(input.current?.files?.[0])}
    />
    <button class="button" type="button" disabled=${busy !== ""} onClick=${() => input.current?.click()}>
      <${Icon} name="upload" /> Your own scene…
    </button>
    <p class="hint">${busy || "A zip of a Mitsuba or pbrt-v3 scene's folder, at most 256 MiB; or drop it here."}</p>
    <span class="spacer"></span>
    <label class="parameter-line hint" title="Only where the folder has several scene files">
      <span>main file</span>
      <input type="text" placeholder="scene.xml" value=${main} onInput=${onText(setMain)} />
    </label>
    <div class="upload-faults" role="alert">
      ${faults.map((fault) => html`<p class="fault" key=${fault}>${fault}</p>`)}
    </div>
    ${
      notes.length > 0 &&
      html`<details class="upload-faults" open>
        <summary>${counted(notes.length, "thing")} not as in the file</summary>
        ${notes.map((note) => html`<p class="hint" key=${note}>${note}</p>`)}
      </details>`
    }
  </div>`;
}
