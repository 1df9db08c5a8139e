// @ts-check
/** The viewer on the row of the selected cell. It is loaded when it is first opened. */
import { html, useEffect, useState } from "../../vendor/preact-htm.js";
import { toast } from "../../parts/toast.js";
import { useRoute } from "../../address.js";
import { fromParams, toParams } from "../../viewer/settings.js";
import { describe, placeOf, valueOn } from "./axes.js";
import { estimateOf } from "./compare.js";
import { whereIs } from "./grid.js";
import { tokenOf } from "./sources.js";
import { placeAt } from "./view.js";

/** @typedef {import("../../api.js").Cell} Cell */
/** @typedef {import("../../model.js").ExperimentModel} ExperimentModel */
/** @typedef {import("../../viewer/viewer.js").ViewerPicture} ViewerPicture */
/** @typedef {import("./view.js").View} View */
/** @typedef {(props: import("../../viewer/viewer.js").ViewerProps) => import("../../vendor/preact-htm.js").VNode} ViewerComponent */

/** @param {{model: ExperimentModel, view: View, selected: Cell, set: typeof import("../../address.js").setParams, onSelect: (cell: Cell) => void}} props */
export function RowViewer({ model, view, selected, set, onSelect }) {
  const { params } = useRoute();
  const close = () => set({ viewer: null });
  const Viewer = useViewer(close);
  const at = whereIs(view, selected);
  if (!Viewer) return null;
  const row = at ? rowOf(model, view, at.row) : [selected];
  const pictures = row.map((cell) => pictureOf(model, view, cell));
  /** @param {number} by rows */
  const move = (by) => {
    if (!at) return;
    const next = rowOf(model, view, at.row + by);
    const same = next.find((cell) => valueOn(cell, view.cols.name) === valueOn(selected, view.cols.name)) ?? next[0];
    if (same) onSelect(same);
  };
  return html`<${Viewer}
    pictures=${pictures}
    index=${Math.max(0, row.indexOf(selected))}
    onIndex=${(/** @type {number} */ index) => row[index] && onSelect(row[index])}
    metric=${alike(row) ? view.metric : { ...view.metric, lower_is_better: null }}
    settings=${fromParams((name) => params.get(name))}
    onSettings=${(/** @type {import("../../viewer/settings.js").ViewerSettings} */ settings) => set(toParams(settings))}
    onRow=${move}
    onClose=${close}
  />`;
}

/** The viewer's component once its module is there. @param {() => void} onMissing @returns {ViewerComponent | null} */
function useViewer(onMissing) {
  const [found, setFound] = useState(/** @type {{Viewer: ViewerComponent} | null} */ (null));
  useEffect(() => {
    import("../../viewer/viewer.js").then(setFound, () => {
      toast({ text: "The viewer could not be loaded from the server; try again", tone: "bad" });
      onMissing();
    });
  }, []);
  return found?.Viewer ?? null;
}

/** Whether errors may be compared: the viewer marks the lowest one. @param {readonly Cell[]} row */
function alike(row) {
  return new Set(row.map((cell) => cell.reference)).size === 1;
}

/** The cells of a row that are in the grid. @param {ExperimentModel} model @param {View} view @param {number} row @returns {Cell[]} */
function rowOf(model, view, row) {
  const value = view.rows.values[row];
  if (value === undefined) return [];
  return /** @type {Cell[]} */ (view.cols.values.map((col) => model.index?.at(placeAt(view, value, col))).filter(Boolean));
}

/** @param {ExperimentModel} model @param {View} view @param {Cell} cell @returns {ViewerPicture} */
function pictureOf(model, view, cell) {
  const scene = model.detail?.scenes.find(({ name }) => name === cell.scene);
  const size = { width: scene?.width ?? 1, height: scene?.height ?? 1 };
  const place = placeOf(cell, view.axes);
  const label = place[view.cols.name] ?? "";
  const estimate = estimateOf(cell, view.metric.name);
  const reference = cell.reference === null || cell.reference === undefined ? undefined : model.references.get(cell.reference);
  return {
    key: String(cell.position),
    label: view.cols.name === "spp" ? `${label} spp` : label,
    detail: describe(cell),
    cell: cell.cell,
    k: 0,
    v: tokenOf(cell, model.progressOf(cell)),
    ...size,
    spp: cell.spp_actual,
    sppAsked: cell.spp,
    error: estimate?.mean ?? null,
    spread: estimate?.se ?? null,
    missing: cell.had > 0 ? null : `No finished picture yet: ${cell.state}`,
    reference: reference ? referenceOf(reference, size) : null,
  };
}

/** @param {Cell} cell @param {{width: number, height: number}} size @returns {ViewerPicture} */
function referenceOf(cell, size) {
  return {
    key: `reference ${cell.cell}`,
    label: "reference",
    detail: [cell.scene, cell.integrator, cell.sampler, ...(cell.had < cell.wanted ? [`${cell.had} of ${cell.wanted} pictures`] : [])].join(" · "),
    cell: cell.cell,
    role: "reference",
    v: tokenOf(cell, undefined),
    ...size,
    spp: cell.spp_actual * cell.had,
    missing: cell.had > 0 ? null : `No reference yet: ${cell.state}`,
  };
}
