// @ts-check
/** The few icons of the page: 16 × 16 strokes in the colour of the text. Decoration only: the button has the words. */
import { html } from "../vendor/preact-htm.js";

const PATHS = {
  pause: "M5.5 3.5v9M10.5 3.5v9",
  play: "M5 3.2v9.6L12.5 8z",
  stop: "M4 4h8v8H4z",
  retry: "M13 8a5 5 0 1 1-1.6-3.7M13 2v3h-3",
  copy: "M6 6h7v7H6zM10 3.5V3H3v7h.5",
  trash: "M3 4.5h10M6.2 4.5V3h3.6v1.5M4.5 4.5l.6 8.5h5.8l.6-8.5",
  more: "M3.5 8h.01M8 8h.01M12.5 8h.01",
  plus: "M8 3v10M3 8h10",
  close: "M4 4l8 8M12 4l-8 8",
  check: "M3 8.5l3.2 3.2L13 4.8",
  search: "M7 2.5a4.5 4.5 0 1 1 0 9 4.5 4.5 0 0 1 0-9zM10.4 10.4l3.1 3.1",
  warn: "M8 2.5l6 10.7H2zM8 6.5v3M8 11.4h.01",
  moon: "M12.8 9.6A5.3 5.3 0 0 1 6.4 3.2a5.3 5.3 0 1 0 6.4 6.4z",
  sun:
    "M8 5.2a2.8 2.8 0 1 1 0 5.6 2.8 2.8 0 0 1 0-5.6zM8 1.5v1.2M8 13.3v1.2M1.5 8h1.2M13.3 8h1.2" +
    "M3.4 3.4l.9.9M11.7 11.7l.9.9M3.4 12.6l.9-.9M11.7 4.3l.9-.9",
  auto: "M8 2.5a5.5 5.5 0 1 1 0 11zM8 2.5a5.5 5.5 0 0 0 0 11",
  upload: "M8 10.5V3M5 5.8L8 3l3 2.8M3 10.5V13h10v-2.5",
  open: "M6 3l5 5-5 5",
};

/** @typedef {keyof typeof PATHS} IconName */

/** @param {{name: IconName}} props */
export function Icon({ name }) {
  const filled = name === "play" || name === "stop" ? "currentColor" : "none";
  return html`<svg width="16" height="16" viewBox="0 0 16 16" aria-hidden="true">
    <path
      d=${PATHS[name]}
      fill=${filled}
      stroke="currentColor"
      stroke-width=${name === "more" ? 2.2 : 1.5}
      stroke-linecap="round"
      stroke-linejoin="round"
    />
    ${name === "auto" && html`<path d="M8 2.5a5.5 5.5 0 1 1 0 11z" fill="currentColor" />`}
  </svg>`;
}
