// @ts-check
/**
 * The viewer: a row of float pictures and their reference, large, in linear light, compared pixel by pixel.
 *
 * It fills the window as a modal dialog. Give it the row, and keep what it reports in the address:
 *
 *     <${Viewer} pictures=${row} reference=${reference} index=${index} onIndex=${setIndex} metric=${metric}
 *       settings=${fromParams(get)} onSettings=${(s) => setParams(toParams(s))} onClose=${close} />
 *
 * (`fromParams` and `toParams` are in `settings.js`.) What it shows changes at once; `onIndex` and `onSettings` follow
 * when it has been still for a moment. New `pictures` with the same keys and another `v` are fetched while the old
 * pixels stay on. This file holds the state; `stage.js` draws it, `actions.js` changes it.
 */
import { html, useState } from "../vendor/preact-htm.js";
import { useKeys } from "../keys.js";
import { makeActions, shortcuts } from "./actions.js";
import { useHeldShift, useLoaded, useModal, useOwn } from "./hooks.js";
import { Inspector } from "./inspector.js";
import { automaticMax, comparable } from "./looks.js";
import { zoomOf } from "./maths.js";
import { troubleOf, urlOf } from "./seen.js";
import { complete, mapOf, rounded, same } from "./settings.js";
import { Signal } from "./signal.js";
import { Stage } from "./stage.js";
import { Toolbar } from "./toolbar.js";

/** @typedef {import("./pictures.js").Pixels} Pixels */
/** @typedef {import("./seen.js").Seen} Seen */
/** @typedef {import("./settings.js").ViewerSettings} ViewerSettings */
/**
 * A picture that can be shown.
 * @typedef {object} ViewerPicture
 * @property {string} key       its identity in the row, kept when its pixels change
 * @property {string} label     what tells it from its neighbours: "stratified"
 * @property {string} [detail]  the rest of what it is: "path · cornell_box"; parts that the label says are left out
 * @property {number} cell
 * @property {"cell" | "reference"} [role]
 * @property {number | "mean"} [k] replicate; default: the server's (0 of a cell, the mean of a reference)
 * @property {string | number} [v] changes when there are newer pixels, e.g. the number of replicates had
 * @property {number} width     pixels
 * @property {number} height
 * @property {number} [spp]     rendered
 * @property {number} [sppAsked]
 * @property {number | null} [error]  value of `metric`
 * @property {number | null} [spread] its standard error
 * @property {string | null} [missing] why there are no pixels to fetch yet, as a sentence: "No picture yet: queued"
 * @property {ViewerPicture | null} [reference] its own one, where the row has several; default: the row's
 */
/** @typedef {Pick<import("../api.js").MetricInfo, "name" | "line" | "formula" | "lower_is_better">} Metric */
/**
 * @typedef {object} ViewerProps
 * @property {readonly ViewerPicture[]} pictures  the row, at least one
 * @property {ViewerPicture | null} [reference]   of the row
 * @property {number} index                       of the current picture
 * @property {(index: number) => void} [onIndex]
 * @property {Metric | null} [metric]             what `error` is
 * @property {Partial<ViewerSettings>} [settings]
 * @property {(settings: ViewerSettings) => void} [onSettings]
 * @property {(rows: number) => void} [onRow]     up (−1) or down (+1) was pressed: give it the pictures of that row
 * @property {() => void} onClose
 */

/** @param {ViewerProps} props */
export function Viewer({
  pictures,
  reference = null,
  index: given,
  onIndex,
  metric = null,
  settings: asked,
  onSettings,
  onRow,
  onClose,
}) {
  const last = pictures.length - 1;
  const [settings, change, settingsNow] = useOwn(complete(asked), same, (s) => onSettings?.(rounded(s)));
  const [index, setIndex, indexNow] = useOwn(
    { index: given },
    (a, b) => a.index === b.index,
    (own) => onIndex?.(own.index),
  );
  const current = Math.min(Math.max(index.index, 0), last);
  const [pinned, setPinned] = useState(false);
  const held = useHeldShift();
  const [box, setBox] = useState({ width: 1, height: 1 }); // of the large picture, CSS pixels
  const [hover] = useState(() => new Signal(/** @type {import("./stage.js").Hover | null} */ (null)));
  const dialog = useModal(onClose);

  const referenceOf = (/** @type {ViewerPicture} */ picture) =>
    picture.reference === undefined ? reference : picture.reference;
  const loaded = useLoaded(pictures, current, referenceOf);
  const flipped = (held || pinned) && referenceOf(/** @type {ViewerPicture} */ (pictures[current])) !== null;

  /** @param {string} id @param {ViewerPicture} picture @param {number} place @returns {Seen} */
  const see = (id, picture, place) => {
    const entry = loaded.entry(picture);
    const pixels = loaded.pixels(picture);
    const other = place < 0 ? null : referenceOf(picture);
    const compared = { picture: other, entry: loaded.entry(other), pixels: loaded.pixels(other) };
    const mode = place < 0 ? "picture" : settings.mode;
    const size = pixels ?? picture;
    const usable = comparable(size, compared.pixels) ? compared.pixels : null;
    return {
      id,
      index: place,
      picture,
      size,
      pixels,
      reference: usable,
      mode,
      trouble: troubleOf(picture, entry, pixels, mode, compared),
    };
  };
  /** The picture in a large box, or its reference while that is shown. @param {string} id @param {number} place */
  const large = (id, place) => {
    const picture = /** @type {ViewerPicture} */ (pictures[place]);
    const other = flipped ? referenceOf(picture) : null;
    return other ? see(id, other, -1) : see(id, picture, place);
  };
  const own = referenceOf(/** @type {ViewerPicture} */ (pictures[current]));
  const side = settings.layout === "side";
  const wipe = settings.layout === "wipe" && own !== null;
  const shared = pictures.every((picture) => urlOf(referenceOf(picture)) === urlOf(own)) ? own : null;
  const panes = side ? pictures.map((picture, i) => large(`pane ${picture.key}`, i)) : [large("pane", current)];
  if (side && shared && !flipped) panes.push(see("pane reference", shared, -1));
  if (wipe && !flipped) panes.push(see("pane right", own, -1));
  const tiles = side ? [] : pictures.map((picture, i) => see(`tile ${picture.key}`, picture, i));
  if (!side && own) tiles.push(see("tile reference", own, -1));
  const shown = /** @type {Seen} */ (panes[side ? current : 0]);

  const [measured] = useState(() => new WeakMap());
  const comparisons = pictures.flatMap((picture) => {
    const pixels = loaded.pixels(picture);
    return pixels ? [{ pixels, reference: loaded.pixels(referenceOf(picture)) }] : [];
  });
  const max = settings.max ?? (mapOf(settings) ? automaticMax(settings.mode, comparisons, measured) : 1);

  const pick = (/** @type {number} */ place) => {
    if (place < 0) return setPinned((on) => !on);
    setPinned(false);
    setIndex({ index: place });
  };
  const act = makeActions({
    settings: settingsNow,
    change,
    shown: () => shown,
    comparable: () => own !== null,
    max: () => max,
    box: () => ({ x: 0, y: 0, ...box }),
    row: () => ({ index: indexNow().index, count: pictures.length }),
    pick,
    rows: (by) => onRow?.(by),
  });
  useKeys("Viewer", shortcuts(act));

  return html`<dialog class="viewer" ref=${dialog} data-keys aria-label="Picture viewer" tabindex="-1">
    <${Toolbar}
      settings=${settings} max=${max} zoom=${zoomOf(settings, shown.size, box)} comparable=${own !== null}
      act=${act} onClose=${onClose}
    />
    <${Stage}
      panes=${panes} tiles=${tiles} current=${shown} flipped=${flipped} settings=${settings} max=${max} metric=${metric}
      best=${lowest(pictures, metric)} hover=${hover} change=${change} pick=${pick}
      onRetry=${loaded.retry} onBox=${setBox}
    />
    <${Inspector}
      panes=${panes} current=${shown} hover=${hover} settings=${settings} max=${max}
      referenceOf=${(/** @type {Seen} */ seen) => (seen.index < 0 ? null : seen.reference)}
    />
  </dialog>`;
}

/**
 * Place of the lowest error in the row; −2 where that says nothing.
 * @param {readonly ViewerPicture[]} pictures @param {ViewerProps["metric"]} metric @returns {number}
 */
function lowest(pictures, metric) {
  const errors = pictures.map(({ error }) => error ?? Infinity);
  const known = errors.filter(Number.isFinite);
  if (known.length < 2 || metric?.lower_is_better !== true) return -2;
  return errors.indexOf(Math.min(...known));
}
