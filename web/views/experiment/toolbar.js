// @ts-check
/** How the pictures of the grid are shown: as they are or their error, how bright, in which tones, how large. */
import { html } from "../../vendor/preact-htm.js";
import { number } from "../../format.js";
import { useKeys } from "../../keys.js";
import { INFERNO_STOPS } from "../../viewer/colours.js";
import { EV_LIMIT, nextMax, signedNumber, TONES } from "../../viewer/settings.js";
import { Segmented, Select, Slider } from "./controls.js";
import { SIZES } from "./view.js";

/** @typedef {import("./view.js").View} View */

const STEP = 0.5; // stops
const REACH = 8; // stops that the slider goes; keys and the viewer go on to EV_LIMIT
const INFERNO = `linear-gradient(to right, ${INFERNO_STOPS.map((rgb) => `rgb(${rgb.map((c) => Math.round(c * 255)).join(" ")})`).join(", ")})`;

/**
 * @param {{view: View, max: number | null, shared: number | null, set: typeof import("../../address.js").setParams}} props
 * max: end of the colours; shared: what it is when nobody chose it
 */
export function Toolbar({ view, max, shared, set }) {
  const coloured = view.errors || view.tone === "falsecolour";
  /** @param {number} ev */
  const expose = (ev) => set({ ev: ev === 0 ? null : String(Math.min(EV_LIMIT, Math.max(-EV_LIMIT, ev))) });
  /** @param {1 | -1} by */
  const stretch = (by) => {
    if (coloured && max) set({ scale: String(nextMax(max, by)) });
  };
  const tones = TONES.map((tone) => tone.name);
  useKeys("Pictures", [
    { keys: "e", does: "half a stop brighter", run: () => expose(view.ev + STEP) },
    { keys: "Shift+e", does: "half a stop darker", run: () => expose(view.ev - STEP) },
    { keys: "r", does: "reset exposure and maximum", run: () => set({ ev: null, scale: null }) },
    { keys: "f", does: "maximum of false colours or errors up", run: () => stretch(1) },
    { keys: "Shift+f", does: "maximum down", run: () => stretch(-1) },
    { keys: "t", does: "tone map: sRGB, gamma 2.2, false colour", run: () => set({ tone: tones[(tones.indexOf(view.tone) + 1) % tones.length] ?? null, scale: null }) },
    { keys: "m", does: "error maps instead of pictures", run: () => set({ show: view.errors ? null : "errors", scale: null }) },
  ]);
  return html`<div class="toolbar">
    <${Segmented}
      label="pictures or errors"
      choices=${[
        { value: "pictures", label: "Pictures", title: "the first replicate of each cell" },
        { value: "errors", label: "Error maps", title: `${view.metric.name} of every pixel of the first replicate` },
      ]}
      value=${view.errors ? "errors" : "pictures"}
      onChange=${(/** @type {string} */ value) => set({ show: value === "errors" ? value : null, scale: null })}
    />
    ${!view.errors &&
    html`<${Segmented}
        label="tone"
        choices=${TONES.map((tone) => ({ value: tone.name, label: tone.label, title: tone.line }))}
        value=${view.tone}
        onChange=${(/** @type {string} */ tone) => set({ tone: tone === "srgb" ? null : tone, scale: null })}
      />`}
    ${!coloured &&
    html`<${Slider}
      label="EV"
      title="Exposure in stops: e brighter, Shift+e darker, r or a double click resets"
      min=${-REACH}
      max=${REACH}
      step=${STEP}
      value=${view.ev}
      text=${signedNumber(view.ev)}
      onInput=${expose}
      onReset=${() => expose(0)}
    />`}
    ${coloured && html`<${ColourBar} title=${view.errors ? view.metric.name : "luminance"} max=${max} chosen=${view.scale !== null} shared=${shared} onStretch=${stretch} onReset=${() => set({ scale: null })} />`}
    <span class="spacer"></span>
    <${Select}
      label="size"
      choices=${[{ value: "", label: "fitted" }, ...SIZES.map((size) => ({ value: String(size), label: `${size} px` }))]}
      value=${view.size === null ? "" : String(view.size)}
      onChange=${(/** @type {string} */ size) => set({ size })}
    />
  </div>`;
}

/** @param {{title: string, max: number | null, chosen: boolean, shared: number | null, onStretch: (by: 1 | -1) => void, onReset: () => void}} props */
function ColourBar({ title, max, chosen, shared, onStretch, onReset }) {
  const end = number(max, 2);
  return html`<div class="colourbar" role="group" aria-label=${`${title}: colours from 0 to ${end}, the same for all pictures`}>
    <span class="control-label">${title}</span>
    <button class="button quiet icon small" aria-label="Lower the maximum" title="Lower the maximum (Shift+f)" disabled=${max === null} onClick=${() => onStretch(-1)}>−</button>
    <span class="colourbar-scale" aria-hidden="true">
      <span class="colourbar-colours" style=${{ background: INFERNO }}></span>
      <span class="colourbar-numbers number"><span>0</span><span>${max === null ? "" : number(max / 2, 2)}</span><span>${max === null ? "–" : `≥ ${end}`}</span></span>
    </span>
    <button class="button quiet icon small" aria-label="Raise the maximum" title="Raise the maximum (f)" disabled=${max === null} onClick=${() => onStretch(1)}>+</button>
    <button class="link" disabled=${!chosen} title=${`One maximum for all pictures shown: ${number(shared, 2)}`} onClick=${onReset}>auto</button>
  </div>`;
}
