// @ts-check
/**
 * The image grid: two axes on rows and columns, one picture a cell, its reference beside it.
 *
 * Only what is visible is in the page, so that 10 000 cells scroll smoothly. The grid itself has the focus and names the
 * selected cell (aria-activedescendant): arrow keys work the same for cells that are not drawn.
 */
import { html, useLayoutEffect, useMemo, useRef } from "../../vendor/preact-htm.js";
import { useKeys } from "../../keys.js";
import { styleOf } from "../../plots/plan.js";
import { useTheme } from "../../theme.js";
import { valueOn } from "./axes.js";
import { rankedAlong, ranks, ratioTo } from "./compare.js";
import { referencesOf } from "./references.js";
import { ReferenceTile } from "./reference.js";
import { Replay } from "./replay.js";
import { sourceOf } from "./sources.js";
import { Tile } from "./tile.js";
import { placeAt } from "./view.js";
import { usePort, windowOf } from "./window.js";

/** @typedef {import("../../api.js").Cell} Cell */
/** @typedef {import("../../model.js").ExperimentModel} ExperimentModel */
/** @typedef {import("./view.js").View} View */
/**
 * @typedef {object} Props
 * @property {ExperimentModel} model
 * @property {View} view
 * @property {number | null} max end of the colours of error maps and false colours
 * @property {(cell: Cell) => void} onSelect
 * @property {(cell: Cell) => void} onOpen
 * @property {(cell: Cell) => void} onLog
 */

const GAP = 12; // px between tiles
const CAPTION = 44; // px: two lines under a picture
const LABEL = 136; // px: the row's label, where there is room for a column of them
const LINE = 26; // px: the row's label above the row, where there is not
const HEAD = 34; // px: the line of column labels
const NARROW = 480; // px: a phone
const FITTED = { narrowest: 112, least: 144, most: 240 }; // px: the width of a picture that follows the size of the grid
const OUTSIDE = 200; // px of the window's height that the grid leaves to header and bar, as its style sheet says

/** @param {Props} props */
export function ImageGrid({ model, view, max, onSelect, onOpen, onLog }) {
  const scroller = useRef(/** @type {HTMLElement | null} */ (null));
  const port = usePort(scroller);
  const { rows, cols } = view;
  const narrow = port.width > 0 && port.width < NARROW;
  const index = model.index;
  const replays = model.detail?.replays ?? [];
  const references = useMemo(() => referencesOf(index, view), [index, view, model.complete, model.cells.length]);
  const rank = useRanks(model, view);
  const { dark } = useTheme();
  const beside = references.side === "one" || references.side === "row";
  const above = references.side === "column";
  const shape = shapeOf(model, view, { width: port.width, narrow, beside, above });
  const left = (narrow ? 0 : LABEL) + (beside ? shape.width : 0);
  const top = HEAD + (above ? shape.height : 0);
  const [firstRow, lastRow] = windowOf(port.top - top, port.height, shape.height, rows.values.length);
  const [firstCol, lastCol] = windowOf(port.left - left, port.width, shape.width, cols.values.length);
  const shownCols = cols.values.slice(firstCol, lastCol);

  const selected = view.selected === null ? undefined : model.cells[view.selected];
  const at = selected && selected.role === "cell" ? whereIs(view, selected) : null;
  const key = useArrows({ model, view, at, page: Math.max(1, Math.floor(port.height / shape.height) - 1), onSelect, onOpen });
  useLayoutEffect(() => {
    if (at && scroller.current?.matches(":focus")) reveal(scroller.current, at, shape, { left, top });
  }, [at?.row, at?.col]);

  const how = {
    metric: view.errors ? view.metric.name : null,
    pixels: shape.size * devicePixelRatio,
    ev: view.ev,
    tone: view.tone,
    max,
  };
  const common = { errors: view.errors, metric: view.metric, sharp: shape.sharp, along: rankedAlong(rows.name, cols.name), onOpen, onLog };
  /** @param {string | undefined} row @param {string | undefined} col */
  const reference = (row, col) =>
    html`<${ReferenceTile} key="reference" model=${model} cell=${references.at(row, col)} how=${how} sharp=${shape.sharp} />`;

  /** @param {string} row @param {number} r */
  function line(row, r) {
    const cells = shownCols.map((col) => index?.at(placeAt(view, row, col)));
    return html`<div class="grid-row" role="row" aria-rowindex=${r + 2} key=${row} style=${{ top: `${top + r * shape.height}px`, height: `${shape.height}px` }}>
      <div class="grid-label" role="rowheader" title=${`${rows.title}: ${row}`}><${Label} axis=${rows.name} value=${row} view=${view} dark=${dark} replays=${replays} /></div>
      ${beside && html`<div class="grid-reference" role="gridcell">${references.side === "row" && reference(row, undefined)}</div>`}
      <div class="grid-cells" role="presentation" style=${{ paddingLeft: `${firstCol * shape.width}px` }}>
        ${cells.map((cell, c) => {
          const column = firstCol + c;
          if (!cell) return html`<${Absent} key=${shownCols[c]} column=${column} loading=${!model.complete} />`;
          const progress = cell.state === "running" ? model.progressOf(cell) : undefined;
          const baseline = view.baseline && index?.at({ ...placeAt(view, row, shownCols[c] ?? ""), [view.baseline.axis]: view.baseline.value });
          return html`<${Tile}
            key=${shownCols[c]}
            id=${`cell-${cell.position}`}
            cell=${cell}
            progress=${progress}
            src=${sourceOf(cell, progress, how)}
            ratio=${baseline ? ratioTo(cell, baseline, view.metric) : null}
            baseline=${view.baseline?.value ?? ""}
            rank=${rank(row, shownCols[c] ?? "", cell)}
            selected=${cell === selected}
            column=${column}
            ...${common}
          />`;
        })}
      </div>
    </div>`;
  }

  const height = top + rows.values.length * shape.height;
  return html`<div
    class=${`image-grid ${narrow ? "narrow" : ""}`}
    ref=${scroller}
    role="grid"
    tabindex="0"
    aria-label=${`Pictures: ${rows.title} on rows, ${cols.title} on columns`}
    aria-rowcount=${rows.values.length + 1}
    aria-colcount=${cols.values.length + 1}
    aria-activedescendant=${at && selected ? `cell-${selected.position}` : null}
    onKeyDown=${key}
    style=${{
      "--tile": `${shape.size}px`,
      "--tile-step": `${shape.width}px`,
      "--picture": `${shape.picture}px`,
      "--label": `${narrow ? 0 : LABEL}px`,
      "--gap": `${GAP}px`,
      "--content": `${height + 2}px`,
    }}
  >
    <div class="grid-content" role="presentation" style=${{ height: `${height}px`, width: `${left + cols.values.length * shape.width}px` }}>
      <div class="grid-head" role="row" aria-rowindex="1" style=${{ height: `${HEAD}px` }}>
        <div class="grid-label" role="columnheader"><span class="muted">${rows.title}</span></div>
        ${beside && html`<div class="grid-reference" role="columnheader">reference</div>`}
        <div class="grid-cells" role="presentation" style=${{ paddingLeft: `${firstCol * shape.width}px` }}>
          ${shownCols.map((col, c) => html`<div class="grid-column" role="columnheader" aria-colindex=${firstCol + c + 2} key=${col} title=${`${cols.title}: ${col}`}>
            <${Label} axis=${cols.name} value=${col} view=${view} dark=${dark} replays=${replays} />
          </div>`)}
        </div>
      </div>
      ${above && html`<div class="grid-row" role="row" style=${{ top: `${HEAD}px`, height: `${shape.height}px` }}>
        <div class="grid-label" role="rowheader"><span>reference</span></div>
        <div class="grid-cells" role="presentation" style=${{ paddingLeft: `${firstCol * shape.width}px` }}>
          ${shownCols.map((col) => html`<div class="grid-above" role="gridcell" key=${col}>${reference(undefined, col)}</div>`)}
        </div>
      </div>`}
      ${references.side === "one" && html`<div class="grid-one" role="row" style=${{ top: `${HEAD + (narrow ? LINE : 0)}px` }}>
        <div role="gridcell">${reference(undefined, undefined)}</div>
      </div>`}
      ${rows.values.slice(firstRow, lastRow).map((row, i) => line(row, firstRow + i))}
    </div>
  </div>`;
}

/** A place that the grid does not have, or whose cell is not loaded yet. @param {{column: number, loading: boolean}} props */
function Absent({ column, loading }) {
  return html`<div class="tile" role="gridcell" aria-colindex=${column + 2}>
    <div class=${loading ? "tile-box skeleton" : "tile-box absent"}>${!loading && html`<p class="muted">not in the grid</p>`}</div>
  </div>`;
}

/** A value of an axis; samplers have the colour of their curves. @param {{axis: string, value: string, view: View, dark: boolean, replays: readonly string[]}} props */
function Label({ axis, value, view, dark, replays }) {
  if (axis === "spp") return html`<span>${value} spp</span>`;
  if (axis !== "sampler") return html`<span>${value}</span>`;
  const samplers = view.axes.find(({ name }) => name === axis)?.values ?? [];
  const { colour } = styleOf({ sampler: value, integrator: "" }, { samplers, dark });
  return html`<span><i class="dot" style=${{ background: colour }}></i>${replays.includes(value) && html`<${Replay} /> `}${breakable(value)}</span>`;
}

/** A label that may break where its parts meet, as may the one name that is too long. @param {string} value */
function breakable(value) {
  return value.split(/(?<=[:,=]|^relaxed)/).flatMap((part) => [part, html`<wbr />`]);
}

/** @typedef {{width: number, narrow: boolean, beside: boolean, above: boolean}} Room width in px; where references stand */

/** px: what was chosen, or the largest at which the whole grid is seen. @param {View} view @param {number} aspect @param {Room} room */
function sizeOf(view, aspect, { width, narrow, beside, above }) {
  if (view.size !== null) return view.size;
  const columns = narrow ? 2 : view.cols.values.length + Number(beside);
  const rows = view.rows.values.length + Number(above);
  const wide = Math.floor((width - (narrow ? GAP : LABEL)) / columns) - GAP;
  const high = Math.floor(((innerHeight - OUTSIDE - HEAD) / rows - CAPTION - GAP) / aspect);
  const fitted = narrow ? wide : Math.min(wide, Math.max(FITTED.least, high));
  return Math.min(FITTED.most, Math.max(FITTED.narrowest, fitted));
}

/** Sizes in px; equal for all tiles, so that places can be computed. @param {ExperimentModel} model @param {View} view @param {Room} room */
function shapeOf(model, view, room) {
  const scenes = model.detail?.scenes ?? [];
  const onAxis = [view.rows, view.cols].find((axis) => axis.name === "scene");
  const shown = scenes.filter((scene) => (onAxis ? onAxis.values.includes(scene.name) : scene.name === view.at["scene"]));
  const aspect = Math.min(1.6, Math.max(0.2, ...shown.map((scene) => scene.height / scene.width)));
  const size = sizeOf(view, aspect, room);
  const picture = Math.round(size * aspect);
  const widest = Math.max(1, ...shown.map((scene) => scene.width));
  return {
    size,
    width: size + GAP,
    height: picture + CAPTION + GAP + (room.narrow ? LINE : 0),
    picture,
    sharp: widest < size * devicePixelRatio,
  };
}

/** The rank of a cell in its row or column; lines are ranked when first asked for. @param {ExperimentModel} model @param {View} view */
function useRanks(model, view) {
  return useMemo(() => {
    const along = rankedAlong(view.rows.name, view.cols.name);
    /** @type {Map<string, ReturnType<typeof ranks>>} */
    const lines = new Map();
    /** @param {string} row @param {string} col @param {Cell} cell */
    return (row, col, cell) => {
      if (!along) return "";
      const line = along === "row" ? row : col;
      if (!lines.has(line)) {
        const values = along === "row" ? view.cols.values : view.rows.values;
        const cells = values.map((value) => model.index?.at(along === "row" ? placeAt(view, row, value) : placeAt(view, value, col)));
        lines.set(line, ranks(/** @type {Cell[]} */ (cells.filter(Boolean)), view.metric));
      }
      return lines.get(line)?.get(cell.position) ?? "";
    };
  }, [model, model.revision, view]);
}

/** Row and column of a cell; null where it is not in the grid as it is set. @param {View} view @param {Cell} cell */
export function whereIs(view, cell) {
  const row = view.rows.values.indexOf(valueOn(cell, view.rows.name) ?? "");
  const col = view.cols.values.indexOf(valueOn(cell, view.cols.name) ?? "");
  const pinned = view.pinned.every(({ name }) => (valueOn(cell, name) ?? view.at[name]) === view.at[name]);
  return row >= 0 && col >= 0 && pinned ? { row, col } : null;
}

/** @param {{model: ExperimentModel, view: View, at: {row: number, col: number} | null, page: number, onSelect: (cell: Cell) => void, onOpen: (cell: Cell) => void}} of */
function useArrows({ model, view, at, page, onSelect, onOpen }) {
  const { rows, cols } = view;
  useKeys("Pictures", [
    { shown: "← → ↑ ↓", does: "move along the columns and rows" },
    { shown: "Home End", does: "first and last picture of the row" },
    { shown: "Enter", does: "open the viewer on the selected picture" },
  ]);
  /** @param {KeyboardEvent} event */
  return (event) => {
    if (event.target !== event.currentTarget || event.ctrlKey || event.metaKey || event.altKey) return;
    /** @type {Record<string, [number, number]>} */
    const moves = {
      ArrowLeft: [0, -1], ArrowRight: [0, 1], ArrowUp: [-1, 0], ArrowDown: [1, 0],
      PageUp: [-page, 0], PageDown: [page, 0], Home: [0, -cols.values.length], End: [0, cols.values.length],
    }; // prettier-ignore
    const move = moves[event.key];
    const now = at && model.index?.at(placeAt(view, rows.values[at.row] ?? "", cols.values[at.col] ?? ""));
    if (event.key === "Enter" && now) {
      event.preventDefault();
      onOpen(now);
    }
    if (!move) return;
    event.preventDefault();
    const row = at ? Math.min(rows.values.length - 1, Math.max(0, at.row + move[0])) : 0;
    const col = at ? Math.min(cols.values.length - 1, Math.max(0, at.col + move[1])) : 0;
    const next = model.index?.at(placeAt(view, rows.values[row] ?? "", cols.values[col] ?? ""));
    if (next) onSelect(next);
  };
}

/** Scrolls as little as it takes to see a tile. @param {HTMLElement} scroller @param {{row: number, col: number}} at @param {{width: number, height: number}} shape @param {{left: number, top: number}} head */
function reveal(scroller, at, shape, head) {
  const [x, y] = [at.col * shape.width, at.row * shape.height];
  const wide = scroller.clientWidth - head.left;
  const high = scroller.clientHeight - head.top;
  scroller.scrollLeft = Math.min(x, Math.max(scroller.scrollLeft, x + shape.width - wide));
  scroller.scrollTop = Math.min(y, Math.max(scroller.scrollTop, y + shape.height - high));
  scroller.scrollIntoView({ block: "nearest" });
}
