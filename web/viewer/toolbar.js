// @ts-check
/**
 * The controls of the viewer in one slim row, each with its key. What a map ends at takes the place of the exposure.
 */
import { html } from "../vendor/preact-htm.js";
import { Icon } from "../parts/icons.js";
import { short } from "./maths.js";
import { ERROR_MODES, LAYOUTS, TONES, mapOf, signedNumber } from "./settings.js";

/** @typedef {import("../vendor/preact-htm.js").VNode} VNode */
/** @typedef {import("./actions.js").Actions} Actions */
/** @typedef {import("./settings.js").ViewerSettings} ViewerSettings */

/**
 * @param {object} props
 * @param {ViewerSettings} props.settings @param {number} props.max the maximum in use
 * @param {number} props.zoom the zoom in use
 * @param {boolean} props.comparable whether the current picture has a reference
 * @param {Actions} props.act @param {() => void} props.onClose
 * @returns {VNode}
 */
export function Toolbar({ settings, max, zoom, comparable, act, onClose }) {
  const { layout, tone, mode } = settings;
  const none = "; this picture has no reference";
  const maximum = `${settings.max === null ? "auto " : ""}${short(max)}`;
  const percent = `${zoom < 0.1 ? (zoom * 100).toFixed(1) : Math.round(zoom * 100)} %`;
  return html`<div class="viewer-tools" role="group" aria-label="How pictures are shown">
    <${Group} name="Show" keys="t">
      ${TONES.map(
        ({ name, label, line }) => html`<${Tool}
          on=${mode === "picture" && tone === name} label=${label} title="${line} (t)"
          onClick=${() => act.show("picture", name)}
        />`,
      )}
    <//>
    <${Group} name="Error" keys="d">
      ${ERROR_MODES.map(
        ({ name, label, title, formula, line }) => html`<${Tool}
          on=${mode === name} label=${label} title="${title}, ${formula}: ${line}${comparable ? " (d)" : none}"
          disabled=${!comparable && mode !== name} onClick=${() => act.show(mode === name ? "picture" : name)}
        />`,
      )}
    <//>
    ${
      mapOf(settings) === null
        ? html`<${Stepper}
          name="EV" keys="e" value=${signedNumber(settings.ev)}
          less="half a stop darker (Shift+e)" more="half a stop brighter (e)"
          onLess=${() => act.exposure(-0.5)} onMore=${() => act.exposure(0.5)}
        />`
        : html`<${Stepper}
          name="Max" keys="f" value=${maximum} less="smaller maximum (Shift+f)" more="larger maximum (f)"
          onLess=${() => act.maximum(-1)} onMore=${() => act.maximum(1)}
        />`
    }
    <div class="viewer-group">
      <${Tool} label="Normalise" title="99 % of the pixels below white, or below the maximum (n)" onClick=${act.normalise} />
      <${Tool} label="Reset" title="exposure 0, automatic maximum (r)" onClick=${act.reset} />
    </div>
    <${Group} name="Layout" keys="">
      ${LAYOUTS.map(
        ({ name, label, keys, line }) => html`<${Tool}
          on=${layout === name} label=${label} title="${line}${name === "wipe" && !comparable ? none : ` (${keys})`}"
          disabled=${name === "wipe" && !comparable && layout !== name} onClick=${() => act.layout(name)}
        />`,
      )}
    <//>
    <${Stepper}
      name="Zoom" keys="" value=${percent} less="smaller (-)" more="larger (=)"
      onLess=${() => act.zoom(-1)} onMore=${() => act.zoom(1)}
    />
    <div class="viewer-group">
      <${Tool} on=${settings.zoom === null} label="Fit" title="the whole picture (0)" onClick=${act.fit} />
      <${Tool} label="100 %" title="one screen pixel per pixel (double click)" onClick=${act.actual} />
    </div>
    <span class="viewer-spacer"></span>
    <button class="viewer-tool viewer-close" aria-label="Close" title="Close (Escape)" onClick=${onClose}>
      <${Icon} name="close" />
    </button>
  </div>`;
}

/** @param {{name: string, keys: string, children?: unknown}} props @returns {VNode} */
function Group({ name, keys, children }) {
  return html`<div class="viewer-group" role="group" aria-label=${name}>
    ${keys && html`<span class="viewer-label">${name} <kbd>${keys}</kbd></span>`}${children}
  </div>`;
}

/**
 * `on` makes it a choice that is taken or not.
 * @param {{label: string, title: string, on?: boolean, disabled?: boolean, onClick: () => void}} props @returns {VNode}
 */
function Tool({ label, title, on, disabled = false, onClick }) {
  return html`<button class="viewer-tool" aria-pressed=${on} title=${title} disabled=${disabled} onClick=${onClick}>
    ${label}
  </button>`;
}

/**
 * @param {object} props
 * @param {string} props.name @param {string} props.keys @param {string} props.value
 * @param {string} props.less what − does @param {string} props.more what + does
 * @param {() => void} props.onLess @param {() => void} props.onMore @returns {VNode}
 */
function Stepper({ name, keys, value, less, more, onLess, onMore }) {
  return html`<div class="viewer-group" role="group" aria-label=${name}>
    ${keys && html`<span class="viewer-label">${name} <kbd>${keys}</kbd></span>`}
    <button class="viewer-tool viewer-square" aria-label="${name}: ${less}" title=${less} onClick=${onLess}>−</button>
    <output class="viewer-value number">${value}</output>
    <button class="viewer-tool viewer-square" aria-label="${name}: ${more}" title=${more} onClick=${onMore}>+</button>
  </div>`;
}
