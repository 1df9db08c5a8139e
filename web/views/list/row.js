// @ts-check
/** One experiment in the list. Drawn again only when it changed: two hundred rows stay cheap while one renders. */
import { Component, html } from "../../vendor/preact-htm.js";
import { experiments } from "../../api.js";
import { navigate } from "../../address.js";
import { count, counted, duration, when } from "../../format.js";
import { Icon } from "../../parts/icons.js";
import { Menu } from "../../parts/menu.js";
import { StateBar } from "../../parts/statebar.js";
import { told } from "../../parts/toast.js";

/** @typedef {import("../../api.js").Experiment} Experiment */
/** @typedef {{experiment: Experiment, onDelete: (experiment: Experiment) => void}} Props */
/** @typedef {import("../../parts/menu.js").Action} Action */

/** @extends {Component<Props>} */
export class Row extends Component {
  /** @override @param {Props} next */
  shouldComponentUpdate(next) {
    return next.experiment !== this.props.experiment;
  }

  /** @override */
  render() {
    const { experiment, onDelete } = this.props;
    const { id, name, state, created_at, had, wanted, failed, seconds_left } = experiment;
    const actions = actionsFor(experiment, onDelete);
    const quick = actions.find(({ icon }) => icon === "pause" || icon === "play" || icon === "retry");
    return html`<div class="rows-row" role="row">
      <span class="rows-name" role="cell">
        <a class="name" href=${`/experiments/${id}`} title=${name}>${name}</a>
        <span class="hint number">#${id} · ${contents(experiment)}</span>
      </span>
      <span class="rows-state" role="cell"><span class="state" data-state=${state}>${state}</span></span>
      <span class="rows-bar" role="cell"><${StateBar} experiment=${experiment} /></span>
      <span class="rows-pictures number" role="cell">
        <span>${count(had)}<span class="muted"> of ${count(wanted)}</span></span>
        ${failed > 0 && html`<span class="fault">${counted(failed, "cell")} failed</span>`}
      </span>
      <span class="rows-left number" role="cell">${duration(seconds_left)}</span>
      <span class="rows-created number muted" role="cell">
        <time datetime=${created_at} title=${created_at}>${when(created_at)}</time>
      </span>
      <span class="rows-actions" role="cell">
        ${quick &&
        html`<button
          class="button quiet icon"
          title=${quick.label}
          aria-label=${`${quick.label}: ${name}`}
          onClick=${quick.run}
        >
          <${Icon} name=${quick.icon} />
        </button>`}
        <${Menu} label="Actions" actions=${actions} />
      </span>
    </div>`;
  }
}

/** @param {Experiment} experiment */
function contents({ cells, references }) {
  const [own, others] = [cells, references].map((numbers) => Object.values(numbers).reduce((sum, one) => sum + one, 0));
  return counted(own ?? 0, "cell") + (others ? ` + ${counted(others, "reference")}` : "");
}

/**
 * What can be done in this state.
 * @param {Experiment} experiment @param {(experiment: Experiment) => void} onDelete @returns {Action[]}
 */
function actionsFor(experiment, onDelete) {
  const { id, state, failed } = experiment;
  /** @type {(action: "pause" | "resume" | "cancel" | "retry") => () => void} */
  const act = (action) => () => void told(experiments.act(id, action));
  const live = state === "running" || state === "queued";
  const paused = state === "paused";
  /** @type {(Action | false)[]} */
  const all = [
    { label: "Open", icon: "open", run: () => navigate(`/experiments/${id}`) },
    live && { label: "Pause", icon: "pause", run: act("pause") },
    paused && { label: "Resume", icon: "play", run: act("resume") },
    (failed > 0 || state === "cancelled") && { label: "Retry what is missing", icon: "retry", run: act("retry") },
    (live || paused) && { label: "Cancel", icon: "stop", run: act("cancel") },
    { label: "Duplicate and change", icon: "copy", run: () => navigate(`/new?from=${id}`) },
    { label: "Delete…", icon: "trash", danger: true, run: () => onDelete(experiment) },
  ];
  return all.filter((action) => action !== false);
}
