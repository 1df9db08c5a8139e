// @ts-check
/**
 * The list of experiments: how far each is, and what can be done with it. Live through the overview stream; the filter
 * is in the address.
 */
import { html, useEffect, useMemo, useRef, useState } from "../vendor/preact-htm.js";
import { overviewEvents } from "../api.js";
import { navigate, useParam } from "../address.js";
import { follow } from "../events.js";
import { counted } from "../format.js";
import { useKeys } from "../keys.js";
import { Icon } from "../parts/icons.js";
import { STATES } from "../parts/statebar.js";
import { DeleteDialog } from "./list/delete.js";
import { Row } from "./list/row.js";
import { Loading, Message, ServerGone } from "./states.js";

/** @typedef {import("../api.js").Experiment} Experiment */
/** @typedef {import("../api.js").State} State */

const COLUMNS = ["Name", "State", "Cells", "Pictures", "Time left", "Created"];

export function List() {
  const { experiments, status } = useOverview();
  const [text, setText] = useParam("q", "");
  const [state, setState] = useParam("state", "");
  const [deleting, setDeleting] = useState(/** @type {Experiment | null} */ (null));
  const search = useRef(/** @type {HTMLInputElement | null} */ (null));
  useKeys("Experiments", [{ keys: "/", does: "filter by name", run: () => search.current?.focus() }]);
  const shown = useMemo(() => filtered(experiments ?? [], text, state), [experiments, text, state]);

  if (!experiments) return status === "down" ? html`<${ServerGone} />` : html`<${Placeholder} />`;
  if (!experiments.length) return html`<${Empty} />`;
  return html`<div class="page list">
    <div class="list-head">
      <h1>Experiments</h1>
      <div class="search">
        <${Icon} name="search" />
        <input
          ref=${search}
          type="search"
          placeholder="Filter by name"
          aria-label="Filter by name"
          value=${text}
          onInput=${(/** @type {{currentTarget: HTMLInputElement}} */ event) => setText(event.currentTarget.value)}
        />
      </div>
      <${StateFilter} experiments=${experiments} state=${state} onState=${setState} />
      <a class="button primary" href="/new"><${Icon} name="plus" /> New experiment</a>
    </div>
    <p class="unseen" role="status">${counted(shown.length, "experiment")} shown</p>
    ${shown.length > 0
      ? html`<div class="rows panel" role="table" aria-label="Experiments">
          <div class="rows-head" role="row">
            ${COLUMNS.map((title) => html`<span role="columnheader" key=${title}>${title}</span>`)}
            <span role="columnheader"><span class="unseen">Actions</span></span>
          </div>
          ${shown.map((one) => html`<${Row} key=${one.id} experiment=${one} onDelete=${setDeleting} />`)}
        </div>`
      : html`<${Message} title="No experiment fits the filter" mark="none">
          <p class="row"><button class="button" onClick=${() => navigate("/", { replace: true })}>Show all</button></p>
        <//>`}
    ${deleting && html`<${DeleteDialog} experiment=${deleting} onClose=${() => setDeleting(null)} />`}
  </div>`;
}

/** Every experiment, live; null until the first news. */
function useOverview() {
  const [experiments, setExperiments] = useState(/** @type {Experiment[] | null} */ (null));
  const [status, setStatus] = useState(/** @type {import("../events.js").Status} */ ("live"));
  useEffect(() => {
    const stream = follow(overviewEvents, {
      update: (/** @type {import("../api.js").Overview} */ overview) =>
        setExperiments((before) => steady(before ?? [], overview.experiments)),
      status: setStatus,
    });
    return () => stream.close();
  }, []);
  return { experiments, status };
}

/**
 * The news, with the old object for every experiment that did not change: its row is then not drawn again.
 * @param {readonly Experiment[]} before @param {Experiment[]} news
 */
function steady(before, news) {
  const known = new Map(before.map((experiment) => [experiment.id, experiment]));
  return news.map((experiment) => {
    const old = known.get(experiment.id);
    return old && JSON.stringify(old) === JSON.stringify(experiment) ? old : experiment;
  });
}

/** @param {readonly Experiment[]} experiments @param {string} text name or #id @param {string} state "" is any */
function filtered(experiments, text, state) {
  const words = text.toLowerCase().split(/\s+/).filter(Boolean);
  return experiments.filter(({ id, name, state: its }) => {
    const searched = `${name.toLowerCase()} #${id}`;
    return (!state || its === state) && words.every((word) => searched.includes(word));
  });
}

/**
 * A chip for each state that occurs: legend of the bars and filter in one.
 * @param {{experiments: readonly Experiment[], state: string, onState: (state: string | null) => void}} props
 */
function StateFilter({ experiments, state, onState }) {
  const present = STATES.filter((one) => one === state || experiments.some((experiment) => experiment.state === one));
  return html`<div class="list-states" role="group" aria-label="Filter by state">
    ${present.map(
      (one) => html`<button
        key=${one}
        class="chip"
        aria-pressed=${one === state}
        onClick=${() => onState(one === state ? null : one)}
      >
        <span class="state" data-state=${one}>${one}</span>
        <span class="number muted">${experiments.filter((experiment) => experiment.state === one).length}</span>
      </button>`,
    )}
  </div>`;
}

function Placeholder() {
  return html`<div class="page list">
    <div class="list-head"><h1>Experiments</h1></div>
    <${Loading}>
      <div class="panel rows">
        ${[0, 1, 2, 3, 4].map((row) => html`<div class="rows-blank" key=${row}><div class="skeleton"></div></div>`)}
      </div>
    <//>
  </div>`;
}

function Empty() {
  return html`<${Message} title="Nothing has been thrown yet" mark="none">
    <p>
      An experiment renders every combination of scenes, samplers, integrators and samples per pixel, measures each
      picture against a reference, and shows which converges fastest.
    </p>
    <p class="row"><a class="button primary" href="/new"><${Icon} name="plus" /> New experiment</a></p>
    <p class="muted">Or from a terminal: <code>./dartboard submit examples/first.toml</code></p>
  <//>`;
}
