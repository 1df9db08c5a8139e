// @ts-check
/**
 * The boxes that pictures are seen in: large panes with a caption, small tiles in the strip, the handle of the wipe.
 *
 * Only elements: pictures are drawn on a canvas under them (`stage.js`), found by `data-view`.
 */
import { html } from "../vendor/preact-htm.js";
import { number } from "../format.js";
import { clamp01 } from "./maths.js";

/** @typedef {import("../vendor/preact-htm.js").VNode} VNode */
/** @typedef {import("./seen.js").Seen} Seen */
/** @typedef {import("./viewer.js").ViewerPicture} ViewerPicture */
/** @typedef {import("./viewer.js").ViewerProps["metric"]} Metric */

const WIPE_STEP = 0.02; // of the box, for the arrow keys

/**
 * The key that shows a picture: its number up to 9, R for a reference.
 * @param {{index: number}} props @returns {VNode}
 */
export function Badge({ index }) {
  return html`<span class="viewer-badge">${index < 0 ? "R" : index + 1}</span>`;
}

/**
 * What the label leaves to say, and nothing twice: "64 spp · path · cornell_box". Where the sampler rendered another
 * number of samples than was asked, both.
 * @param {ViewerPicture} picture @returns {string}
 */
export function about({ label, detail = "", spp, sppAsked = spp }) {
  const rendered = spp === sppAsked ? `${spp} spp` : `${spp} spp (${sppAsked} asked)`;
  const said = new Set([label, `${sppAsked} spp`, ...(spp === undefined ? [] : [rendered])]);
  const rest = detail.split(" · ").filter((part) => part && !said.has(part));
  return [...(spp === undefined || rendered === label ? [] : [rendered]), ...rest].join(" · ");
}

/**
 * First what it is, then how wrong it is.
 * @param {{seen: Seen, metric: Metric, best: boolean, right?: Seen}} props `right`: what the wipe shows on the right
 * @returns {VNode}
 */
export function Caption({ seen, metric, best, right }) {
  const { picture, index } = seen;
  const details = about(picture);
  return html`<header class="viewer-caption">
    <${Badge} index=${index} />
    <strong class="viewer-line" title=${picture.label}>${picture.label}</strong>
    <span class="viewer-detail viewer-line" title=${details}>${details}</span>
    <span class="viewer-spacer"></span>
    ${
      index < 0
        ? html`<span class="viewer-what">reference</span>`
        : html`<${ErrorValue} picture=${picture} metric=${metric} best=${best} />`
    }
    ${right && html`<${Right} seen=${right} />`}
  </header>`;
}

/** @param {{seen: Seen}} props @returns {VNode} */
function Right({ seen: { index, picture } }) {
  return html`<span class="viewer-right"><${Badge} index=${index} /><strong class="viewer-line">${picture.label}</strong></span>`;
}

/** @param {{picture: ViewerPicture, metric: Metric, best: boolean}} props @returns {VNode | null} */
export function ErrorValue({ picture: { error, spread }, metric, best }) {
  if (!metric || error === undefined || error === null) return null;
  const { line, formula } = metric;
  const title = [`${line}: ${formula}`, spread && "± standard error", best && "the lowest of the row"].filter(Boolean);
  return html`<span class="viewer-error number ${best ? "viewer-best" : ""}" title=${title.join("; ")}>
    <span class="viewer-metric">${metric.name}</span> ${number(error)}
    ${spread ? html`<small> ± ${number(spread, 2)}</small>` : null}
  </span>`;
}

/**
 * Words where a picture would be.
 * @param {{seen: Seen, onRetry: (url: string) => void, small?: boolean}} props @returns {VNode | null}
 */
export function Message({ seen, onRetry, small = false }) {
  const { trouble } = seen;
  if (!trouble) return null;
  const { kind, text, url } = trouble;
  if (small) {
    const word = {
      wait: "loading",
      missing: "none yet",
      alone: "no reference",
      failed: "failed",
      skipped: "not loaded",
    }[kind];
    return html`<span class="viewer-message" data-kind=${kind} title=${text}>${word}</span>`;
  }
  const again =
    url &&
    html`<button class="button" onClick=${() => onRetry(url)}>${kind === "skipped" ? "Load it" : "Try again"}</button>`;
  const role = kind === "failed" ? "alert" : "status";
  return html`<div class="viewer-message" data-kind=${kind} role=${role}><p>${text}</p>${again}</div>`;
}

/**
 * @param {object} props
 * @param {Seen} props.seen @param {Seen} [props.right] the other side of a wipe
 * @param {boolean} props.current @param {boolean} props.best @param {Metric} props.metric
 * @param {(url: string) => void} props.onRetry @param {unknown} [props.children]
 * @returns {VNode}
 */
export function Pane({ seen, right, current, best, metric, onRetry, children }) {
  const of = seen.index < 0 ? "reference" : "picture";
  return html`<section class="viewer-pane" data-of=${of} aria-current=${current} aria-label=${seen.picture.label}>
    <${Caption} seen=${seen} metric=${metric} best=${best} right=${right} />
    <div class="viewer-picture" data-view=${seen.id}>
      <${Message} seen=${seen} onRetry=${onRetry} />
      ${children}
    </div>
  </section>`;
}

/** @param {object} props
 * @param {Seen} props.seen @param {boolean} props.pressed @param {boolean} props.best @param {Metric} props.metric
 * @param {() => void} props.onPick @returns {VNode}
 */
export function Tile({ seen, pressed, best, metric, onPick }) {
  const { picture, index } = seen;
  const title = index < 0 ? "The reference (hold Shift)" : `${picture.label}${index < 9 ? ` (${index + 1})` : ""}`;
  const shape = { aspectRatio: `${seen.size.width} / ${seen.size.height}` };
  return html`<button
    class="viewer-tile" data-of=${index < 0 ? "reference" : "picture"} aria-pressed=${pressed} title=${title} onClick=${onPick}
  >
    <span class="viewer-thumb" data-view=${seen.id} style=${shape}>
      <${Message} seen=${seen} onRetry=${onPick} small />
    </span>
    <span class="viewer-about">
      <span class="viewer-name"><${Badge} index=${index} /> <strong>${picture.label}</strong></span>
      <small class="viewer-detail">${about(picture)}</small>
      <${ErrorValue} picture=${picture} metric=${metric} best=${best} />
    </span>
  </button>`;
}

/**
 * The split of a wipe, to drag or to move with the arrow keys.
 * @param {{split: number, onSplit: (split: number) => void}} props @returns {VNode}
 */
export function Wipe({ split, onSplit }) {
  /** @param {PointerEvent} event */
  const move = (event) => {
    const handle = /** @type {HTMLElement} */ (event.currentTarget);
    if (!handle.hasPointerCapture(event.pointerId)) return;
    event.stopPropagation();
    const box = /** @type {HTMLElement} */ (handle.parentElement).getBoundingClientRect();
    onSplit(clamp01((event.clientX - box.left) / box.width));
  };
  /** @param {PointerEvent} event */
  const grab = (event) => {
    if (event.button) return;
    event.stopPropagation(); // else the picture would move with it
    /** @type {HTMLElement} */ (event.currentTarget).setPointerCapture(event.pointerId);
  };
  /** @param {KeyboardEvent} event */
  const step = (event) => {
    const towards = { ArrowLeft: split - WIPE_STEP, ArrowRight: split + WIPE_STEP, Home: 0, End: 1 }[event.key];
    if (towards === undefined) return;
    event.preventDefault(); // the arrows would go to another picture
    onSplit(clamp01(towards));
  };
  return html`<div
    class="viewer-wipe" role="slider" tabindex="0" aria-label="Split between picture and reference"
    aria-valuemin="0" aria-valuemax="100" aria-valuenow=${Math.round(split * 100)} style=${{ left: `${split * 100}%` }}
    onPointerDown=${grab} onPointerMove=${move} onKeyDown=${step}
  ></div>`;
}
