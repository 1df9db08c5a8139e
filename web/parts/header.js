// @ts-check
/**
 * The header: where one is, what renders now, the theme, the help.
 */
import { html } from "../vendor/preact-htm.js";
import { count } from "../format.js";
import { useTheme } from "../theme.js";
import { Icon } from "./icons.js";

/** @typedef {import("../api.js").Worker} Worker */

/** @param {{path: string, worker: Worker | null, status: import("../events.js").Status, onHelp: () => void}} props */
export function Header({ path, worker, status, onHelp }) {
  return html`<header class="header">
    <a class="brand" href="/" aria-label="Dartboard: all experiments">
      <svg width="22" height="22" viewBox="0 0 22 22" aria-hidden="true">
        <circle cx="11" cy="11" r="9.2" fill="none" stroke="currentColor" stroke-width="1.8" />
        <circle cx="11" cy="11" r="4.8" fill="none" stroke="currentColor" stroke-width="1.8" />
        <circle cx="13.4" cy="8.6" r="2.3" fill="var(--bad)" />
      </svg>
      <span>Dartboard</span>
    </a>
    <nav aria-label="Pages">
      <a href="/" aria-current=${path === "/" ? "page" : null}>Experiments</a>
      <a href="/new" aria-current=${path === "/new" ? "page" : null}>
        <span>New<span class="wide-only"> experiment</span></span>
      </a>
    </nav>
    <${Working} worker=${worker} status=${status} />
    <${ThemeButton} />
    <button class="button quiet icon" aria-label="Keyboard shortcuts" title="Keyboard shortcuts (?)" onClick=${onHelp}>
      ?
    </button>
  </header>`;
}

/** @param {{worker: Worker | null, status: import("../events.js").Status}} props */
function Working({ worker, status }) {
  if (status === "down") return html`<p class="working" data-worker="lost">not connected</p>`;
  if (!worker) return html`<p class="working" data-worker="unknown"></p>`;
  const { state, trouble, description, experiment, queued } = worker;
  const what = {
    idle: "idle",
    starting: "starting the renderer…",
    rendering: description ?? "rendering",
    stalled: `stalled: ${trouble ?? "no reason given"}`,
  }[state];
  const waiting = queued > 0 && html`<span class="working-queue number">${count(queued)} queued</span>`;
  const link = state === "rendering" && experiment !== null;
  const text = html`<span class="name">${what}</span>`;
  const title = state === "rendering" ? `Rendering on ${worker.device}: ${what}` : what;
  return html`<p class="working" data-worker=${state} title=${title} role=${state === "stalled" ? "alert" : null}>
    ${link ? html`<a href=${`/experiments/${experiment}`}>${text}</a>` : text} ${waiting}
  </p>`;
}

/** @typedef {import("../theme.js").Choice} Choice */
/** @type {Record<Choice, {next: Choice, icon: import("./icons.js").IconName, says: string}>} */
const THEMES = {
  auto: { next: "dark", icon: "auto", says: "as the system" },
  dark: { next: "light", icon: "moon", says: "dark" },
  light: { next: "auto", icon: "sun", says: "light" },
};

function ThemeButton() {
  const { choice, set } = useTheme();
  const { next, icon, says } = THEMES[choice];
  const label = `Theme: ${says}. Change to ${THEMES[next].says}`;
  return html`<button class="button quiet icon" aria-label=${label} title=${label} onClick=${() => set(next)}>
    <${Icon} name=${icon} />
  </button>`;
}
