// @ts-check
/**
 * What a page shows when it has nothing to show: it loads, is empty, does not exist, was deleted, cannot be reached,
 * or broke. Each says what is the matter and the way on.
 */
import { html, useEffect, useRef, useState } from "../vendor/preact-htm.js";
import { ApiProblem, experiments, Unreachable } from "../api.js";
import { navigate } from "../address.js";
import { useLive } from "../events.js";
import { told } from "../parts/toast.js";

/** @typedef {import("../vendor/preact-htm.js").Child} Child */

const PATIENCE_MS = 200; // what is there sooner should not flash a placeholder

/** A large calm message in the middle of the page. @param {{title: string, mark?: string, children?: Child}} props */
export function Message({ title, mark = "miss", children }) {
  return html`<section class="message">
    <${Mark} kind=${mark} />
    <h1>${title}</h1>
    ${children}
  </section>`;
}

/** The dartboard: hit in the middle, missed, or not yet thrown at. @param {{kind: string}} props */
function Mark({ kind }) {
  return html`<svg class="mark" width="72" height="72" viewBox="0 0 72 72" aria-hidden="true">
    <g fill="none" stroke="var(--line)" stroke-width="4">
      ${[30, 20, 10].map((r) => html`<circle key=${r} cx="36" cy="36" r=${r} />`)}
    </g>
    ${kind === "miss" && html`<circle cx="59" cy="12" r="5" fill="var(--bad)" />`}
    ${kind === "hit" && html`<circle cx="36" cy="36" r="5" fill="var(--accent)" />`}
  </svg>`;
}

/**
 * Shows `children` (a placeholder of the right size) once loading takes longer than a blink.
 * @param {{children?: Child}} props
 */
export function Loading({ children }) {
  const [late, setLate] = useState(false);
  useEffect(() => {
    const timer = setTimeout(() => setLate(true), PATIENCE_MS);
    return () => clearTimeout(timer);
  }, []);
  return html`<div class="loading" role="status" aria-busy="true" style=${{ visibility: late ? "visible" : "hidden" }}>
    <span class="unseen">Loading…</span>
    ${children ?? html`<div class="skeleton" style="height: 28px; width: 320px"></div>
      <div class="skeleton" style="height: 240px; margin-top: 16px"></div>`}
  </div>`;
}

/** An address that no view has. @param {{path: string}} props */
export function NotFound({ path }) {
  return html`<${Message} title="There is no such page">
    <p>Nothing is at <code class="name">${path}</code>. Perhaps a character of the address got lost.</p>
    <p class="row"><a class="button primary" href="/">All experiments</a></p>
  <//>`;
}

/**
 * The error of a view: refused, not found, deleted, unreachable, or a bug. `onRetry` asks again, where that can help.
 * @param {{error: unknown, id?: number, onRetry?: () => void}} props
 */
export function Failure({ error, id, onRetry }) {
  if (error instanceof Unreachable) return html`<${ServerGone} onRetry=${onRetry} />`;
  if (error instanceof ApiProblem && error.problem.type.endsWith("deleted") && id !== undefined)
    return html`<${DeletedExperiment} id=${id} detail=${error.message} onRestored=${onRetry} />`;
  if (error instanceof ApiProblem) return html`<${Refused} error=${error} onRetry=${onRetry} />`;
  return html`<${Crashed} error=${error} />`;
}

/** @param {{error: ApiProblem, onRetry?: () => void}} props */
function Refused({ error, onRetry }) {
  const { title, status, problems } = error.problem;
  const others = (problems ?? []).map(({ detail }) => detail).filter((detail) => detail !== error.message);
  return html`<${Message} title=${sentence(title)}>
    <p>${error.message}</p>
    <ul class="faults">
      ${others.map((detail) => html`<li key=${detail}>${detail}</li>`)}
    </ul>
    <p class="row">
      <a class="button primary" href="/">All experiments</a>
      ${onRetry && status !== 404 && html`<button class="button" onClick=${onRetry}>Try again</button>`}
    </p>
  <//>`;
}

/**
 * An experiment that was deleted while the page was open, or before.
 * @param {{id: number, name?: string, detail?: string, onRestored?: () => void}} props
 */
export function DeletedExperiment({ id, name, detail, onRestored }) {
  const undo = async () => {
    if (!(await told(experiments.act(id, "restore")))) return;
    if (onRestored) onRestored();
    else navigate(`/experiments/${id}`, { replace: true });
  };
  const what = html`<strong class="name">${name ?? `Experiment ${id}`}</strong>`;
  return html`<${Message} title="This experiment was deleted">
    <p>${detail ?? html`${what} is in the bin; its pictures are still here for a while.`}</p>
    <p class="row">
      <button class="button primary" onClick=${undo}>Undo the deletion</button>
      <a class="button" href="/">All experiments</a>
    </p>
  <//>`;
}

/** Asks again as soon as the server is back. @param {{onRetry?: () => void}} props */
export function ServerGone({ onRetry }) {
  const { status } = useLive();
  const away = useRef(false);
  useEffect(() => {
    if (status === "live" && away.current) onRetry?.();
    away.current = status !== "live";
  }, [status]);
  return html`<${Message} title="The server does not answer">
    <p>It has ended, or the network between is down. What is finished is safe on its disk.</p>
    <p class="muted">Start it again with <code>./dartboard up</code>; this page goes on by itself.</p>
    ${onRetry && html`<p class="row"><button class="button" onClick=${onRetry}>Try now</button></p>`}
  <//>`;
}

/** A bug of ours: honest about it, with what a report of it needs. @param {{error: unknown}} props */
export function Crashed({ error }) {
  const trace = error instanceof Error ? (error.stack ?? error.message) : String(error);
  const copy = () => told(navigator.clipboard.writeText(`${location.href}\n${trace}`));
  return html`<${Message} title="This page broke">
    <p>That is a bug of the dashboard. The experiments go on undisturbed, and nothing of them is lost.</p>
    <pre class="trace">${trace}</pre>
    <p class="row">
      <button class="button primary" onClick=${() => location.reload()}>Load the page again</button>
      <a class="button" href="/">All experiments</a>
      <button class="button" onClick=${copy}>Copy the report</button>
    </p>
  <//>`;
}

/** @param {string} text */
function sentence(text) {
  return text.charAt(0).toUpperCase() + text.slice(1);
}
