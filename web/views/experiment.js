// @ts-check
/**
 * One experiment: pictures, curves and table of the same cells, under one filter, live while it renders.
 *
 * The model holds what the service says, the address what the page is set to; everything here is drawn from the two.
 */
import { html, useEffect, useMemo, useReducer, useRef, useState } from "../vendor/preact-htm.js";
import { setParams as set, useRoute } from "../address.js";
import { ExperimentModel } from "../model.js";
import { toast } from "../parts/toast.js";
import { sharedMaximum } from "./experiment/compare.js";
import { Bar } from "./experiment/bar.js";
import { useCurves } from "./experiment/curves.js";
import { Findings } from "./experiment/findinglist.js";
import { findings } from "./experiment/findings.js";
import { ImageGrid } from "./experiment/grid.js";
import { Head } from "./experiment/header.js";
import { useNear, useSlowly } from "./experiment/hooks.js";
import { Log } from "./experiment/log.js";
import { Plot } from "./experiment/plot.js";
import { Table } from "./experiment/table.js";
import { Toolbar } from "./experiment/toolbar.js";
import { placeAt, selecting, viewOf } from "./experiment/view.js";
import { RowViewer } from "./experiment/viewing.js";
import { DeletedExperiment, Failure, Loading } from "./states.js";

/** @typedef {import("../api.js").Cell} Cell */
/** @typedef {import("../api.js").ExperimentDetail} ExperimentDetail */
/** @typedef {import("./experiment/view.js").View} View */

const FEW = 3; // columns of pictures that leave room for the curves beside them
const SLOW_MS = 1000; // what reads every cell is renewed so often while they change

/** @param {{id: number}} props */
export function Experiment({ id }) {
  const [tries, again] = useReducer((/** @type {number} */ count) => count + 1, 0);
  return html`<${Followed} key=${`${id} ${tries}`} id=${id} onAgain=${again} />`;
}

/** @param {{id: number, onAgain: () => void}} props */
function Followed({ id, onAgain }) {
  const [, redraw] = useReducer((/** @type {number} */ count) => count + 1, 0);
  const model = useMemo(() => new ExperimentModel(id), [id]);
  useEffect(() => {
    const unsubscribe = model.subscribe(() => redraw(undefined));
    model.open();
    return () => {
      unsubscribe();
      model.close();
    };
  }, [model]);
  const name = model.experiment?.name;
  useEffect(() => {
    document.title = `${name ?? `Experiment ${id}`} · Dartboard`;
  }, [name, id]);

  const [deleted, setDeleted] = useState(false);
  if (deleted || model.gone) return html`<${DeletedExperiment} id=${id} name=${name} onRestored=${onAgain} />`;
  if (model.problem && !model.detail) return html`<${Failure} error=${model.problem} id=${id} onRetry=${onAgain} />`;
  if (!model.detail) return html`<${Placeholder} />`;
  return html`<${Page} model=${model} detail=${model.detail} onDeleted=${() => setDeleted(true)} />`;
}

/** @param {{model: ExperimentModel, detail: ExperimentDetail, onDeleted: () => void}} props */
function Page({ model, detail, onDeleted }) {
  const slow = useSlowly(model.revision, SLOW_MS);
  // By the first page until all have come: else the grid would jump from spp to spp, and fetch pictures of each.
  const known = model.complete ? slow : model.cells.length ? "first page" : "nothing";
  const spp = useMemo(() => usualSpp(model, detail), [model, detail, known]);
  const { params } = useRoute();
  const text = params.toString();
  const view = useMemo(() => viewOf(new URLSearchParams(text), detail, spp), [text, detail, spp]);
  const [logged, setLogged] = useState(/** @type {number | null} */ (null));
  const [near, watch] = useNear();
  const curves = useCurves(model.id, { metric: view.metric.name, scene: view.at["scene"] ?? "", revision: model.seen, near });
  const found = useMemo(
    () => findings(detail, model.cells, curves.convergence?.series ?? []),
    [detail, model, slow, curves.convergence],
  );
  const shared = useMemo(
    () => (view.errors ? sharedMaximum(shownCells(model, view), view.metric.name) : 1),
    [view, model, slow],
  );
  const max = view.scale ?? shared;

  const act = useActions({ model, view, setLogged });
  const log = logged === null ? undefined : model.cells[logged];
  const at = view.selected === null ? undefined : model.cells[view.selected];
  const selected = at?.role === "cell" ? at : undefined; // an address may name a reference, which is no picture of the grid
  return html`<div class="page experiment">
    <${Head} detail=${detail} experiment=${model.experiment} onDeleted=${onDeleted} />
    <${Findings} findings=${found} onCell=${(/** @type {number} */ position) => act.openAt(position)} onFilter=${(/** @type {string} */ q) => act.filter(q)} />
    <${Bar} view=${view} metrics=${detail.metrics} set=${set} />
    <div class=${view.cols.values.length <= FEW ? "parts few" : "parts"}>
      <section class="panel part" id="pictures" aria-label="Pictures">
        <div class="part-head"><${Toolbar} view=${view} max=${max} shared=${shared} set=${set} /></div>
        <${ImageGrid} model=${model} view=${view} max=${max} onSelect=${act.select} onOpen=${act.open} onLog=${act.log} />
      </section>
      <${Plot} view=${view} curves=${curves} selected=${selected?.cell ?? null} near=${near} onElement=${watch} set=${set} onPoint=${act.openCell} />
    </div>
    <${Table} model=${model} view=${view} revision=${slow} set=${set} onSelect=${act.select} onOpen=${act.open} onLog=${act.log} />
    ${log && html`<${Log} experiment=${model.id} cell=${log} onClose=${() => setLogged(null)} />`}
    ${view.open && selected && html`<${RowViewer} model=${model} view=${view} selected=${selected} set=${set} onSelect=${act.select} />`}
  </div>`;
}

/**
 * What a click does. The functions stay the same from draw to draw, so that tiles need not be drawn again for them.
 * @param {{model: ExperimentModel, view: View, setLogged: (position: number | null) => void}} of
 */
function useActions(of) {
  const now = useRef(of);
  now.current = of;
  return useMemo(() => {
    /** @param {Cell} cell */
    const select = (cell) => set(selecting(now.current.view, cell));
    /** @param {Cell} cell */
    const open = (cell) => {
      if (cell.had === 0 && !now.current.model.progressOf(cell)) return select(cell);
      set({ ...selecting(now.current.view, cell), viewer: "open" }, { push: true });
    };
    /** @param {number} position */
    const openAt = (position) => {
      const cell = now.current.model.cells[position];
      if (cell?.state === "failed") log(cell);
      else if (cell) open(cell);
    };
    /** A point of a curve. @param {number} id its `cell` */
    const openCell = (id) => {
      const cell = now.current.model.cells.find((one) => one?.cell === id && one.role === "cell");
      if (cell) open(cell);
      else toast({ text: "The picture of this point is not loaded yet" });
    };
    /** @param {Cell} cell */
    const log = (cell) => now.current.setLogged(cell.position);
    /** Rows of the table, wherever they are hidden. @param {string} q */
    const filter = (q) => {
      const shown = now.current.view.axes.map(({ name }) => [`hide.${name}`, null]);
      set({ ...Object.fromEntries(shown), q });
      document.getElementById("table")?.scrollIntoView({ block: "start" });
    };
    return { select, open, openAt, openCell, log, filter };
  }, []);
}

/** The cells of the grid as it is set. @param {ExperimentModel} model @param {View} view */
function shownCells(model, view) {
  const places = view.rows.values.flatMap((row) => view.cols.values.map((col) => placeAt(view, row, col)));
  return /** @type {Cell[]} */ (places.map((place) => model.index?.at(place)).filter(Boolean));
}

/**
 * The spp that a grid is shown at while nobody chose one: the highest that has at least half of its pictures, so that a
 * grid which fills is neither empty nor stuck at its first samples.
 * @param {ExperimentModel} model @param {ExperimentDetail} detail
 */
function usualSpp(model, detail) {
  /** @type {Map<number, {all: number, seen: number}>} */
  const levels = new Map();
  for (const cell of model.cells) {
    if (cell?.role !== "cell") continue;
    const level = levels.get(cell.spp) ?? { all: 0, seen: 0 };
    levels.set(cell.spp, { all: level.all + 1, seen: level.seen + Number(cell.had > 0) });
  }
  const shown = detail.spp.filter((spp) => {
    const level = levels.get(spp);
    return level && 2 * level.seen >= level.all;
  });
  return String(shown.length ? Math.max(...shown) : detail.spp[0]);
}

function Placeholder() {
  return html`<div class="page experiment">
    <${Loading}>
      <div class="panel skeleton" style="height: 148px"></div>
      <div class="panel skeleton" style="height: 48px; margin-top: 12px"></div>
      <div class="panel skeleton" style="height: 560px; margin-top: 12px"></div>
    <//>
  </div>`;
}
