// @ts-check
/** The badge of a replay: a sampler that shows a published mistake on purpose. */
import { html } from "../../vendor/preact-htm.js";

export const REPLAY_TITLE = "a replay: it shows a published mistake on purpose, and is no sampler to choose";

export function Replay() {
  return html`<span class="tag replay" title=${REPLAY_TITLE}>replay</span>`;
}
