// @ts-check
/**
 * The line at the bottom: what the pixel under the pointer holds, and what the colours of a map mean.
 *
 * All its places are there from the start, so nothing moves when numbers come and go.
 */
import { html } from "../vendor/preact-htm.js";
import { css, gradient } from "./colours.js";
import { displayed, lookOf, mapped } from "./looks.js";
import { compact, pixelAt, short } from "./maths.js";
import { ERROR_MODES, mapOf } from "./settings.js";
import { useSignal } from "./signal.js";

/** @typedef {import("../vendor/preact-htm.js").VNode} VNode */
/** @typedef {import("./looks.js").Look} Look */
/** @typedef {import("./maths.js").Rgb} Rgb */
/** @typedef {import("./pictures.js").Pixels} Pixels */
/** @typedef {import("./seen.js").Seen} Seen */
/** @typedef {import("./stage.js").Hover} Hover */

/**
 * @param {object} props
 * @param {readonly Seen[]} props.panes @param {Seen} props.current
 * @param {(seen: Seen) => Pixels | null} props.referenceOf
 * @param {import("./signal.js").Signal<Hover | null>} props.hover
 * @param {import("./settings.js").ViewerSettings} props.settings @param {number} props.max
 * @returns {VNode}
 */
export function Inspector({ panes, current, referenceOf, hover, settings, max }) {
  const at = useSignal(hover);
  const seen = (at && panes.find(({ id }) => id === at.id)) ?? current;
  const reference = referenceOf(seen);
  const value = at && seen.pixels && pixelOf(seen.pixels, at);
  const other = at && reference && pixelOf(reference, at);
  const look = lookOf(seen, settings, max);
  const number = value && mapped(look, value, other);
  const mappedText = typeof number === "number" ? compact(number, 4) : "";
  const x = at ? Math.floor(at.x * seen.size.width) : null;
  const y = at ? Math.floor(at.y * seen.size.height) : null;
  /** @type {Rgb | null} */
  const difference = value && other && [value[0] - other[0], value[1] - other[1], value[2] - other[2]];
  return html`<footer class="viewer-foot">
    <div class="viewer-pixel" aria-label="Pixel under the pointer">
      <span class="viewer-swatch" style=${{ background: value ? css(displayed(look, value, other)) : "none" }}></span>
      <span class="viewer-place number">${x === null ? html`<i>point at a pixel</i>` : `${x}, ${y}`}</span>
      <${Channels} name=${seen.index < 0 ? "reference" : `picture ${seen.index + 1}`} value=${value} />
      ${seen.index >= 0 && html`<${Channels} name="reference" value=${other} />`}
      ${seen.index >= 0 && html`<${Channels} name="difference" value=${difference} signed />`}
      ${mapOf(look) && html`<span class="viewer-channels" data-of="map"><small>shown</small><b>${mappedText}</b></span>`}
    </div>
    <${ColourBar} look=${lookOf(current, settings, max)} />
  </footer>`;
}

/** @param {Pixels} pixels @param {Hover} at @returns {Rgb | null} */
function pixelOf(pixels, { x, y }) {
  return pixelAt(pixels, { x: x * pixels.width, y: y * pixels.height });
}

/** @param {{name: string, value: Rgb | null, signed?: boolean}} props @returns {VNode} */
function Channels({ name, value, signed = false }) {
  const text = (/** @type {number} */ v) => (signed && v > 0 ? "+" : "") + compact(v, 4);
  return html`<span class="viewer-channels" data-of=${name}>
    <small>${name}</small>
    ${["r", "g", "b"].map((channel, i) => html`<b class=${channel}>${value ? text(value[i] ?? NaN) : ""}</b>`)}
  </span>`;
}

/** @param {{look: Look}} props @returns {VNode | null} */
function ColourBar({ look }) {
  const map = mapOf(look);
  if (!map) return null;
  const error = ERROR_MODES.find(({ name }) => name === look.mode);
  const title = error ? `${error.title}, ${error.formula}` : "luminance";
  const low = map === "signed" ? -look.max : 0;
  const middle = map === "signed" ? 0 : look.max / 2;
  const ends = (/** @type {number} */ v) => (v > 0 && map === "signed" ? "+" : "") + short(v);
  return html`<figure class="viewer-bar" aria-label="${title}: from ${short(low)} to ${short(look.max)}">
    <figcaption title=${error ? `${error.line}; the mean over R, G and B` : "of linear radiance"}>${title}</figcaption>
    <div class="viewer-ramp" style=${{ background: gradient(map) }}></div>
    <div class="viewer-ticks number">
      <span>${ends(low)}</span><span>${ends(middle)}</span><span>${ends(look.max)}${map === "inferno" && "+"}</span>
    </div>
  </figure>`;
}
