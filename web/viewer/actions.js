// @ts-check
/**
 * Everything that one can do in the viewer, by name, and the keys that do it. Buttons and keys call the same functions.
 */
import { EV_LIMIT, nextMax, nextMode, nextTone, mapOf } from "./settings.js";
import { nextStop, pan, zoomOf, zoomTo } from "./maths.js";
import { normalisingEv, reach } from "./looks.js";

/** @typedef {import("../keys.js").Shortcut} Shortcut */
/** @typedef {import("./maths.js").Box} Box */
/** @typedef {import("./seen.js").Seen} Seen */
/** @typedef {import("./settings.js").Layout} Layout */
/** @typedef {import("./settings.js").Mode} Mode */
/** @typedef {import("./settings.js").Tone} Tone */
/** @typedef {import("./settings.js").ViewerSettings} ViewerSettings */
/**
 * What actions work on, as it is at the moment of the key.
 * @typedef {object} Now
 * @property {() => ViewerSettings} settings
 * @property {(change: Partial<ViewerSettings>) => void} change
 * @property {() => Seen} shown      the current picture, its reference if that is shown instead
 * @property {() => boolean} comparable
 * @property {() => number} max
 * @property {() => Box} box         of the large picture
 * @property {() => {index: number, count: number}} row
 * @property {(index: number) => void} pick
 * @property {(rows: number) => void} rows
 */
/** @typedef {ReturnType<typeof makeActions>} Actions */

const PAN_SHARE = 0.1; // of the box, for a key

/** @param {Now} now */
export function makeActions(now) {
  const { settings, change, shown, comparable, max, box, row } = now;
  const actions = {
    /** @param {number} index */
    pick: (index) => void (index < row().count && now.pick(index)),
    /** @param {number} by */
    step: (by) => now.pick(Math.min(Math.max(row().index + by, 0), row().count - 1)),
    /** @param {number} by */
    row: (by) => now.rows(by),

    /** @param {Mode} mode @param {Tone} [tone] */
    show: (mode, tone = settings().tone) => change({ mode, tone, max: null }),
    tone: () => change(nextTone(settings())),
    /** @param {1 | -1} by */
    mode: (by) => (comparable() ? change(nextMode(settings(), by)) : actions.show("picture")),
    /** In a map, brighter is a smaller maximum. @param {number} by stops */
    exposure: (by) =>
      mapOf(settings())
        ? actions.maximum(by > 0 ? -1 : 1)
        : change({ ev: Math.min(Math.max(settings().ev + by, -EV_LIMIT), EV_LIMIT) }),
    /** @param {1 | -1} by */
    maximum: (by) => {
      if (mapOf(settings())) change({ max: nextMax(max(), by) });
      else actions.show("picture", "falsecolour");
    },
    reset: () => change({ ev: 0, max: null }),
    normalise: () => {
      const { pixels, reference, mode } = shown();
      if (!pixels) return;
      const most = mapOf(settings()) ? reach(mode, pixels, reference) : null;
      const ev = normalisingEv(pixels);
      if (most !== null) void (most > 0 && change({ max: most }));
      else if (ev !== null) change({ ev });
    },

    /** The layout that is on goes back to one picture. @param {Layout} layout */
    layout: (layout) => {
      if (layout === "wipe" && !comparable() && settings().layout !== "wipe") return;
      change({ layout: settings().layout === layout ? "single" : layout });
    },
    fit: () => change({ zoom: null, x: 0.5, y: 0.5 }),
    actual: () => change(zoomTo(settings(), shown().size, box(), 1)),
    /** @param {1 | -1} by */
    zoom: (by) =>
      change(zoomTo(settings(), shown().size, box(), nextStop(zoomOf(settings(), shown().size, box()), by))),
    /** @param {number} x @param {number} y to which side, −1 to 1 */
    pan: (x, y) => {
      const { width, height } = box();
      change(pan(settings(), shown().size, box(), -x * width * PAN_SHARE, -y * height * PAN_SHARE));
    },
  };
  return actions;
}

const ARROWS = /** @type {const} */ ({ ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] });

/**
 * The keys, as `keys.js` wants them. Shift and Escape are only listed: one is held, the other belongs to the dialog.
 * @param {Actions} act @returns {Shortcut[]}
 */
export function shortcuts(act) {
  const towards = (/** @type {KeyboardEvent} */ { key }) => ARROWS[/** @type {keyof typeof ARROWS} */ (key)];
  return [
    {
      keys: [..."123456789"],
      shown: "1 … 9",
      does: "picture n of the row",
      run: ({ key }) => act.pick(Number(key) - 1),
    },
    { shown: "Shift", does: "the reference while held, back on release" },
    {
      keys: ["ArrowLeft", "ArrowRight"],
      shown: "← / →",
      does: "previous, next picture",
      run: (event) => act.step(towards(event)[0]),
    },
    {
      keys: ["ArrowUp", "ArrowDown"],
      shown: "↑ / ↓",
      does: "the row above, below",
      run: (event) => act.row(towards(event)[1]),
    },
    { keys: "e", does: "half a stop brighter", run: () => act.exposure(0.5) },
    { keys: "Shift+e", does: "half a stop darker", run: () => act.exposure(-0.5) },
    { keys: "n", does: "normalise: 99 % of the pixels below white", run: act.normalise },
    { keys: "r", does: "reset exposure and maximum", run: act.reset },
    { keys: "t", does: "tone map: sRGB, gamma 2.2, false colour", run: act.tone },
    { keys: "d", does: "error: signed, absolute, squared, relative", run: () => act.mode(1) },
    { keys: "Shift+d", does: "the same backwards", run: () => act.mode(-1) },
    { keys: "f", does: "maximum of false colour or error up", run: () => act.maximum(1) },
    { keys: "Shift+f", does: "maximum down", run: () => act.maximum(-1) },
    { keys: "s", does: "all pictures side by side", run: () => act.layout("side") },
    { keys: "w", does: "wipe between picture and reference", run: () => act.layout("wipe") },
    { keys: ["=", "+"], shown: "=", does: "zoom in; the wheel: at the cursor", run: () => act.zoom(1) },
    { keys: "-", does: "zoom out", run: () => act.zoom(-1) },
    { keys: "0", does: "the whole picture; double click: 100 %", run: act.fit },
    {
      keys: Object.keys(ARROWS).map((key) => `Shift+${key}`),
      shown: "Shift+← ↑ → ↓",
      does: "move the picture; or drag it",
      run: (event) => act.pan(towards(event)[0], towards(event)[1]),
    },
    { shown: "Escape", does: "close the viewer" },
  ];
}
