// @ts-check
/**
 * A new experiment: choose values for each axis and see at once what that would render and cost.
 *
 * The query is the only state of the form, so a link reproduces it. What can be run, and what is wrong, is the
 * server's word alone: every change is a dry run.
 */
import { html, useEffect, useRef, useState } from "../vendor/preact-htm.js";
import { ApiProblem, experiments } from "../api.js";
import { navigate, setParams, useParam, useRoute } from "../address.js";
import { useKeys } from "../keys.js";
import { toast } from "../parts/toast.js";
import { readCatalog } from "./new/catalog.js";
import { faultsOf, useDryRun } from "./new/dryrun.js";
import { Section, TextField } from "./new/fields.js";
import { fromQuery, suggestedName, toQuery, toSubmission, uploads } from "./new/form.js";
import { Panel } from "./new/panel.js";
import { Plugins } from "./new/plugins.js";
import { formOf, tomlOf } from "./new/prefill.js";
import { Replays } from "./new/replays.js";
import { Scenes, scenesOf } from "./new/scenes.js";
import { Sweeps } from "./new/sweeps.js";
import { GridEditor } from "./new/text.js";
import { Pictures, ReferenceFields, Spp } from "./new/values.js";
import { Failure, Loading } from "./states.js";

/** @typedef {import("../api.js").Fault} Fault */
/** @typedef {import("../api.js").Scene} Scene */
/** @typedef {import("../api.js").Submission} Submission */
/** @typedef {import("./new/catalog.js").Catalog} Catalog */
/** @typedef {import("./new/form.js").Form} Form */

const HINTS = {
  samplers: "where random numbers come from",
  integrators: "how light is followed",
  spp: "each is a point of every curve",
  sweep: "what is set in a scene, value by value: a material, a lamp, a lens",
  reference: "what errors are measured against",
};
const LINKABLE = 6000; // characters of a grid that an address may carry

export function New() {
  const { params } = useRoute();
  const from = params.get("from");
  const [loaded, setLoaded] = useState(/** @type {{catalog: Catalog, known: Scene[]} | null} */ (null));
  const [error, setError] = useState(/** @type {unknown} */ (null));
  const [tries, setTries] = useState(0);
  useEffect(() => {
    readCatalog().then(setLoaded, setError);
  }, [tries]);
  useEffect(() => {
    if (from !== null) experiments.get(from).then(prefill, setError);
  }, [from, tries]);

  const retry = () => {
    setError(null);
    setTries(tries + 1);
  };
  if (error) return html`<${Failure} error=${error} onRetry=${retry} />`;
  if (!loaded || from !== null) return html`<${Placeholder} />`;
  return html`<${Editor} catalog=${loaded.catalog} scenes=${loaded.known} />`;
}

/** Turns `?from=7` into what experiment 7 was. @param {import("../api.js").ExperimentDetail} experiment */
function prefill(experiment) {
  const form = formOf(experiment);
  const text = form ? null : tomlOf(experiment);
  const points = Object.entries(experiment.points).map(([name, digest]) => `${name}@${digest}`);
  setParams({ from: null, points, ...(form && toQuery(form)), tab: text && "toml", toml: text });
}

/** @param {{catalog: Catalog, scenes: readonly Scene[]}} props */
function Editor({ catalog, scenes }) {
  const { params } = useRoute();
  const [tab, setTab] = useParam("tab", "form");
  const [known, setKnown] = useState(scenes);
  const [long, setLong] = useState("");
  const [sending, setSending] = useState(false);
  const key = useRef({ of: "", key: "" });
  const form = fromQuery(params);
  const typing = tab === "toml";
  const text = params.get("toml") ?? long;
  const submission = typing ? textSubmission(text, known, form.points) : toSubmission(form);
  const estimate = useDryRun(submission);
  const [formText, setFormText] = useState(/** @type {string | null} */ (null));
  useEffect(() => {
    if (!typing && estimate.result && !estimate.stale && !estimate.faults.length) setFormText(estimate.result.toml);
  }, [typing, estimate.result, estimate.stale]);

  /** @param {Partial<Form>} next */
  const change = (next) => setParams(toQuery({ ...form, ...next }));
  /** @param {Scene} scene */
  const onUploaded = (scene) => setKnown([...known.filter(({ digest }) => digest !== scene.digest), scene]);
  /** @param {string} next */
  const write = (next) => {
    const linkable = next.length <= LINKABLE;
    setLong(linkable ? "" : next);
    setParams({ toml: linkable ? next : null });
  };
  /** @param {string} next */
  const turn = (next) => {
    if (next === "toml" && !text && formText) write(formText);
    setTab(next);
  };

  async function submit() {
    if (!submission || !estimate.result || estimate.stale || estimate.faults.length || sending) return;
    setSending(true);
    const content = JSON.stringify(submission);
    if (key.current.of !== content) key.current = { of: content, key: random() }; // sent again, it is the same request
    try {
      const { id } = await experiments.submit(submission, key.current.key);
      navigate(`/experiments/${id}`);
    } catch (error) {
      setSending(false);
      for (const { detail } of error instanceof ApiProblem ? faultsOf(error).slice(0, 3) : [{ detail: String(error) }])
        toast({ text: detail, tone: "bad" });
    }
  }
  useKeys("New experiment", [{ shown: "Ctrl+Enter", does: "queue it, from any field" }]);
  /** @param {KeyboardEvent} event */
  const pressed = (event) => {
    if (event.key === "Enter" && (event.ctrlKey || event.metaKey)) void submit();
  };

  return html`<div class="page new" onKeyDown=${pressed}>
    <div class="new-head">
      <h1>New experiment</h1>
      <div class="tabs" role="group" aria-label="Edit as">
        <button class="chip" aria-pressed=${!typing} onClick=${() => turn("form")}>Form</button>
        <button class="chip" aria-pressed=${typing} onClick=${() => turn("toml")}>TOML</button>
      </div>
    </div>
    <div class="new-body">
      ${typing
        ? html`<${GridEditor} text=${text} onText=${write} fromForm=${formText} linkable=${text.length <= LINKABLE} />`
        : html`<${FormFields} ...${{ form, change, catalog, known, faults: estimate.faults, onUploaded }} />`}
      <${Panel} estimate=${estimate} beside=${!typing} sending=${sending} onSubmit=${submit} />
    </div>
  </div>`;
}

/**
 * A grid as text, with every uploaded scene and point file that it may name; null without any text.
 * @param {string} text @param {readonly Scene[]} known @param {Form["points"]} points @returns {Submission | null}
 */
function textSubmission(text, known, points) {
  const scenes = uploads(known.filter(({ builtin }) => !builtin));
  return text.trim() ? { toml: text, origin: "grid.toml", scenes, points: uploads(points) } : null;
}

/**
 * @param {{form: Form, change: (change: Partial<Form>) => void, catalog: Catalog, known: readonly Scene[],
 *   faults: readonly Fault[], onUploaded: (scene: Scene) => void}} props
 */
function FormFields({ form, change, catalog, known, faults, onUploaded }) {
  /** @type {(key: keyof Form) => (value: unknown) => void} */
  const set = (key) => (value) => change({ [key]: value });
  /** @param {readonly unknown[]} values */
  const chosen = (values) => html`<span class="hint number">${values.length} chosen</span>`;
  const { name, scenes, samplers, integrators, spp, sweeps, reference } = form;
  return html`<div class="new-form">
    <section class="form-section panel">
      <${TextField}
        label="Name"
        field="name"
        wide
        value=${name}
        faults=${faults}
        placeholder=${suggestedName(form)}
        onInput=${set("name")}
      />
    </section>
    <${Section} id="scenes" title="Scenes" hint="what is rendered" faults=${faults} aside=${chosen(scenes)}>
      <${Scenes}
        entries=${catalog.scenes}
        known=${known}
        chosen=${scenes}
        onUploaded=${onUploaded}
        onChange=${set("scenes")}
      />
    <//>
    <${Section} id="samplers" title="Samplers" hint=${HINTS.samplers} faults=${faults} aside=${chosen(samplers)}>
      <${Plugins}
        entries=${catalog.samplers}
        chosen=${samplers}
        points=${form.points}
        onChange=${(/** @type {Form["samplers"]} */ next, sent = form.points) => change({ samplers: next, points: sent })}
      />
      <${Replays} entries=${catalog.samplers} chosen=${samplers} onChange=${set("samplers")} />
    <//>
    <${Section}
      id="integrators"
      title="Integrators"
      hint=${HINTS.integrators}
      faults=${faults}
      aside=${chosen(integrators)}
    >
      <${Plugins} entries=${catalog.integrators} chosen=${integrators} onChange=${set("integrators")} />
    <//>
    <${Section} id="spp" title="Samples per pixel" hint=${HINTS.spp} faults=${faults} aside=${chosen(spp)}>
      <${Spp} spp=${spp} onChange=${set("spp")} />
    <//>
    <${Section} id="sweep" title="Sweeps" hint=${HINTS.sweep} faults=${faults} aside=${chosen(sweeps)}>
      <${Sweeps} sweeps=${sweeps} scenes=${scenes} known=${known} colour=${form.colour} onChange=${set("sweeps")} />
    <//>
    <section class="form-section panel" aria-label="Pictures">
      <div class="form-title"><h2>Pictures</h2></div>
      <${Pictures} form=${form} change=${change} catalog=${catalog} faults=${faults} />
    </section>
    <${Section} id="reference" title="Reference" hint=${HINTS.reference} faults=${faults}>
      <${ReferenceFields}
        reference=${reference}
        own=${scenesOf(scenes, known)}
        catalog=${catalog}
        onChange=${set("reference")}
      />
    <//>
  </div>`;
}

function Placeholder() {
  return html`<div class="page new">
    <div class="new-head"><h1>New experiment</h1></div>
    <${Loading}>
      <div class="new-body">
        <div class="new-form">
          <div class="skeleton" style="height: 88px"></div>
          <div class="skeleton" style="height: 360px"></div>
          <div class="skeleton" style="height: 240px"></div>
        </div>
        <div class="skeleton" style="height: 320px"></div>
      </div>
    <//>
  </div>`;
}

/** A key that nobody else has; `randomUUID` is missing where the page does not come from this machine. */
function random() {
  return [...crypto.getRandomValues(new Uint8Array(16))].map((byte) => byte.toString(16).padStart(2, "0")).join("");
}
