// @ts-check
/**
 * The frame around every page: header, the view that the address names, and what must be sayable anywhere
 * (a note, a lost server, the keyboard help, a bug).
 *
 * Views are found by the path alone. The experiment's view is the large one (plots, viewer) and is loaded when first
 * needed, so that the list is there at once.
 */
import { html, render, useEffect, useErrorBoundary, useLayoutEffect, useRef, useState } from "./vendor/preact-htm.js";
import { captureLinks, navigate, useRoute } from "./address.js";
import { useLive } from "./events.js";
import { Header } from "./parts/header.js";
import { toast, Toasts } from "./parts/toast.js";
import { useKeys } from "./keys.js";
import { Help } from "./views/help.js";
import { List } from "./views/list.js";
import { New } from "./views/new.js";
import { Crashed, Loading, NotFound, ServerGone } from "./views/states.js";

/** @typedef {import("./vendor/preact-htm.js").Child} Child */

const EXPERIMENT = /^\/experiments\/(\d{1,15})\/?$/;

function App() {
  const { path } = useRoute();
  const live = useLive();
  const [help, setHelp] = useState(false);
  useKeys("Everywhere", [
    { keys: "?", does: "these shortcuts", run: () => setHelp(true) },
    { keys: "g", does: "all experiments", run: () => navigate("/") },
    { keys: "c", does: "a new experiment", run: () => navigate("/new") },
  ]);
  return html`<a class="skip" href="#content">Skip to the content</a>
    <${Header} path=${path} worker=${live.worker} status=${live.status} onHelp=${() => setHelp(true)} />
    <${Main} path=${path} />
    ${help && html`<${Help} onClose=${() => setHelp(false)} />`}
    <${Toasts}><${Lost} status=${live.status} /><//>`;
}

/**
 * The view, under the one place where a bug in it ends. Another address starts afresh.
 * @param {{path: string}} props
 */
function Main({ path }) {
  const element = useRef(/** @type {HTMLElement | null} */ (null));
  const first = useRef(true);
  useEffect(() => {
    // Who navigates by keyboard or ear goes on at the top of the new view, not at the link that led there.
    if (!first.current) element.current?.focus({ preventScroll: true });
    first.current = false;
  }, [path]);
  return html`<main id="content" tabindex="-1" ref=${element}>
    <${Boundary} key=${path}><${View} path=${path} /><//>
  </main>`;
}

/** @param {{children?: Child}} props */
function Boundary({ children }) {
  const [error] = useErrorBoundary((caught) => console.error(caught));
  return error === undefined ? children : html`<${Crashed} error=${error} />`;
}

/** @param {{path: string}} props */
function View({ path }) {
  const id = EXPERIMENT.exec(path)?.[1];
  useLayoutEffect(() => {
    const title = { "/": "Experiments", "/new": "New experiment" }[path];
    if (!id) document.title = title ? `${title} · Dartboard` : "Dartboard"; // an experiment's view puts its name there
  }, [path]);
  if (path === "/") return html`<${List} />`;
  if (path === "/new") return html`<${New} />`;
  if (id) return html`<${ExperimentPage} id=${Number(id)} />`;
  return html`<${NotFound} path=${path} />`;
}

/** @param {{id: number}} props */
function ExperimentPage({ id }) {
  const [view, setView] = useState(/** @type {{Experiment: unknown} | null} */ (null));
  const [error, setError] = useState(/** @type {unknown} */ (null));
  useEffect(() => {
    import("./views/experiment.js").then(setView, setError);
  }, []);
  // A file that does not come is a TypeError; browsers remember it, so only loading the page again asks for it again.
  if (error instanceof TypeError) return html`<${ServerGone} onRetry=${() => location.reload()} />`;
  if (error) throw error;
  return view ? html`<${view.Experiment} id=${id} />` : html`<${Loading} />`;
}

/**
 * Over the page, not above it: nothing moves when it comes and goes.
 * @param {{status: import("./events.js").Status}} props
 */
function Lost({ status }) {
  return status === "down" && html`<p class="lost"><span class="pulse"></span>The server is gone; trying again…</p>`;
}

/** A failure that nothing handled, told once instead of hidden in the console. @param {unknown} reason */
function unhandled(reason) {
  if (reason instanceof DOMException && reason.name === "AbortError") return;
  toast({ text: reason instanceof Error ? reason.message : String(reason), tone: "bad" });
}

addEventListener("unhandledrejection", (event) => unhandled(event.reason));
captureLinks();
const root = document.getElementById("app");
root?.replaceChildren();
if (root) render(html`<${App} />`, root);
