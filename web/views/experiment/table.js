// @ts-check
/**
 * Every cell that the filters leave, as a table: sorted, searched, copied, downloaded. Rows out of sight are not drawn.
 */
import { html, useMemo, useRef } from "../../vendor/preact-htm.js";
import { experiments } from "../../api.js";
import { count, counted } from "../../format.js";
import { Icon } from "../../parts/icons.js";
import { toast, told } from "../../parts/toast.js";
import { asText, columnsOf, matching, nextSort, ordered } from "./columns.js";
import { Replay } from "./replay.js";
import { hiddenText, showing } from "./view.js";
import { usePort, windowOf } from "./window.js";

/** @typedef {import("../../api.js").Cell} Cell */
/** @typedef {import("./columns.js").Column} Column */
/** @typedef {import("./view.js").View} View */
/**
 * @typedef {object} Props
 * @property {import("../../model.js").ExperimentModel} model
 * @property {View} view
 * @property {number} revision of the cells that are shown; grows about once a second while they change
 * @property {typeof import("../../address.js").setParams} set
 * @property {(cell: Cell) => void} onSelect
 * @property {(cell: Cell) => void} onOpen
 * @property {(cell: Cell) => void} onLog
 */

const ROW = 32; // px
const ACTIONS = 92; // px: the last column

/** @param {Props} props */
export function Table({ model, view, revision, set, onSelect, onOpen, onLog }) {
  const scroller = useRef(/** @type {HTMLElement | null} */ (null));
  const port = usePort(scroller);
  const detail = /** @type {import("../../api.js").ExperimentDetail} */ (model.detail);
  const columns = useMemo(() => columnsOf(detail), [detail]);
  const shown = useMemo(
    () => {
      const shows = showing(view);
      return /** @type {Cell[]} */ (model.cells.filter((cell) => cell?.role === "cell" && shows(cell)));
    },
    [model, revision, hiddenText(view)],
  );
  const inOrder = useMemo(() => ordered(shown, columns, view.sort), [shown, columns, view.sort]);
  const cells = useMemo(
    () => (view.filter ? inOrder.filter(matching(columns, view.filter)) : inOrder),
    [inOrder, columns, view.filter],
  );
  const [first, last] = windowOf(port.top - ROW, port.height, ROW, cells.length, 6);

  const copy = async () => {
    await navigator.clipboard.writeText(asText(cells, columns, "\t"));
    toast({ text: `Copied ${counted(cells.length, "row")}, to paste into a spreadsheet` });
  };
  const download = () => {
    const blob = new Blob([asText(cells, columns, ",")], { type: "text/csv" });
    const link = document.createElement("a");
    link.href = URL.createObjectURL(blob);
    link.download = `experiment-${model.id}-shown.csv`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
  };

  return html`<section class="panel part" id="table" aria-labelledby="table-title">
    <div class="part-head">
      <h2 id="table-title">Table</h2>
      <div class="search">
        <${Icon} name="search" />
        <input
          type="search"
          placeholder="halton spp=16"
          aria-label="Filter the rows"
          title="Words that a row must hold; spp=16 or sampler=halton ask for a whole value"
          value=${view.filter}
          onInput=${(/** @type {{currentTarget: HTMLInputElement}} */ event) => set({ q: event.currentTarget.value })}
        />
      </div>
      <span class="muted number" role="status">
        ${cells.length === shown.length ? counted(cells.length, "row") : `${count(cells.length)} of ${counted(shown.length, "row")}`}
      </span>
      <span class="spacer"></span>
      <button class="button quiet" onClick=${() => told(copy())}><${Icon} name="copy" /> Copy</button>
      <button class="button quiet" onClick=${download} title="Exactly the rows shown, in this order">CSV of these rows</button>
      <span class="muted">all replicates:</span>
      <a href=${experiments.csvUrl(model.id)} download>CSV</a>
      <a href=${experiments.jsonUrl(model.id)} download>JSON</a>
    </div>
    <div class="table-scroller" ref=${scroller} tabindex="0" role="group" aria-label="Rows">
      <table style=${{ minWidth: `${columns.reduce((sum, column) => sum + column.width, ACTIONS)}px` }} aria-rowcount=${cells.length + 1}>
        <colgroup>
          ${columns.map((column) => html`<col key=${column.name} style=${{ width: `${column.width}px` }} />`)}
          <col style=${{ width: `${ACTIONS}px` }} />
        </colgroup>
        <thead>
          <tr>
            ${columns.map((column) => html`<${Heading} key=${column.name} column=${column} sort=${view.sort} set=${set} />`)}
            <th><span class="unseen">Actions</span></th>
          </tr>
        </thead>
        <tbody>
          ${first > 0 && html`<tr aria-hidden="true" style=${{ height: `${first * ROW}px` }}></tr>`}
          ${cells.slice(first, last).map(
            (cell, i) => html`<${Line}
              key=${cell.position}
              cell=${cell}
              columns=${columns}
              index=${first + i + 2}
              selected=${cell.position === view.selected}
              onSelect=${onSelect}
              onOpen=${onOpen}
              onLog=${onLog}
            />`,
          )}
          ${last < cells.length && html`<tr aria-hidden="true" style=${{ height: `${(cells.length - last) * ROW}px` }}></tr>`}
        </tbody>
      </table>
      ${!cells.length && html`<p class="table-empty muted">${shown.length ? "No row holds these words." : "No cells are shown."}</p>`}
    </div>
  </section>`;
}

/** @param {{column: Column, sort: string, set: Props["set"]}} props */
function Heading({ column, sort, set }) {
  const way = sort === column.name ? "ascending" : sort === `-${column.name}` ? "descending" : "none";
  return html`<th class=${column.numeric ? "numeric" : ""} aria-sort=${way} scope="col">
    <button title=${column.hint ?? null} onClick=${() => set({ sort: nextSort(sort, column.name) })}>
      <span class="name">${column.title}</span><span aria-hidden="true">${{ ascending: "▲", descending: "▼", none: "" }[way]}</span>
    </button>
  </th>`;
}

/** @param {{cell: Cell, columns: readonly Column[], index: number, selected: boolean, onSelect: (cell: Cell) => void, onOpen: (cell: Cell) => void, onLog: (cell: Cell) => void}} props */
function Line({ cell, columns, index, selected, onSelect, onOpen, onLog }) {
  return html`<tr aria-rowindex=${index} aria-selected=${selected} onClick=${() => onSelect(cell)} onDblClick=${() => onOpen(cell)}>
    ${columns.map((column) => {
      const text = column.show?.(cell) ?? column.value(cell) ?? "–";
      if (column.name === "state") {
        return html`<td key="state" title=${cell.error ?? null}>
          <span class="state" data-state=${cell.state}>${cell.error_class?.replaceAll("_", " ") ?? cell.state}</span>
        </td>`;
      }
      return html`<td key=${column.name} class=${column.numeric ? "numeric" : ""} title=${column.numeric ? null : text}>${column.name === "sampler" && cell.replay && html`<${Replay} /> `}${text}</td>`;
    })}
    <td class="table-actions">
      <button class="link" disabled=${cell.had === 0} onClick=${() => onOpen(cell)} aria-label=${`Picture of row ${index - 1}`}>view</button>
      <button class="link" onClick=${(/** @type {Event} */ event) => (event.stopPropagation(), onLog(cell))} aria-label=${`Log of row ${index - 1}`}>log</button>
    </td>
  </tr>`;
}
