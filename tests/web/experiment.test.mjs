// The laws of the experiment page that need no browser: places, views, comparisons, findings, rows, curves, and the model.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";

import { layout, traces, unplottable } from "../../web/plots/convergence.js";
import { REPLAY_DASH } from "../../web/plots/plan.js";
import { axesOf, CellIndex, placeOf } from "../../web/views/experiment/axes.js";
import { combined, tail } from "../../web/views/experiment/chance.js";
import { asText, columnsOf, matching, nextSort, ordered } from "../../web/views/experiment/columns.js";
import { rankedAlong, ranks, ratioTo, sharedMaximum } from "../../web/views/experiment/compare.js";
import { findings } from "../../web/views/experiment/findings.js";
import { referencesOf } from "../../web/views/experiment/references.js";
import { sourceOf, tokenOf } from "../../web/views/experiment/sources.js";
import { isolating, placeAt, selecting, showing, toggling, viewOf } from "../../web/views/experiment/view.js";
import { windowOf } from "../../web/views/experiment/window.js";

const close = (a, b, tolerance = 1e-9) => assert.ok(Math.abs(a - b) <= tolerance, `${a} is not ${b} ± ${tolerance}`);
const RELMSE = { name: "relmse", line: "", formula: "", epsilon: 0.01, lower_is_better: true };
const RATIO = { name: "mean_ratio", line: "", formula: "", epsilon: 0, lower_is_better: null };
const SCENES = ["box", "~odd%name"];

const DETAIL = {
  id: 1, name: "grid", state: "done", created_at: "2026-01-01T00:00:00Z", cells: {}, references: {}, had: 0, wanted: 0,
  failed: 0, seconds_left: null, revision: 1, toml: "", paths: {}, points: {}, replays: [], replicates: 4,
  scenes: SCENES.map((name) => ({ name, width: 64, height: 48, reference: "path, independent, 2 × 512 spp" })),
  integrators: ["path", "direct"], samplers: ["independent", "stratified", "halton:a=1,b=2"], spp: [4, 16],
  sweeps: { "sphere.nu": [10, 1000] }, metrics: [RELMSE, RATIO], default_metric: "relmse",
}; // prettier-ignore

/** Every cell of DETAIL; the sweep applies to the first scene only, path and direct have references of their own. */
function grid(change = (cell) => cell) {
  const cells = [];
  for (const scene of SCENES)
    for (const nu of scene === "box" ? [10, 1000] : [undefined])
      for (const integrator of DETAIL.integrators)
        for (const sampler of DETAIL.samplers)
          for (const spp of DETAIL.spp) {
            const position = cells.length;
            const cell = {
              position, cell: 100 + position, role: "cell", scene, integrator, sampler, spp, spp_actual: spp, state: "done",
              sweep: nu === undefined ? {} : { "sphere.nu": nu }, had: 4, wanted: 4, seconds: spp / 100, error: null,
              error_class: null, reference: integrator === "path" ? 1 : 2,
              metrics: { relmse: [1 / spp, 0.01 / spp, 4], mean_ratio: [1, 0.001, 4] },
            }; // prettier-ignore
            cells.push(change(cell));
          }
  return cells;
}

function indexed(cells) {
  const index = new CellIndex(axesOf(DETAIL));
  for (const cell of cells) index.put(cell);
  return index;
}

const view = (query = "", detail = DETAIL) => viewOf(new URLSearchParams(query), detail, "16");

// -- places -----------------------------------------------------------------------------------------------------------

test("every cell is found at its place, whatever a sweep is set to that does not concern it", () => {
  const cells = grid();
  const index = indexed(cells);
  for (const cell of cells) {
    assert.equal(index.at({ "sweep.sphere.nu": "10", ...placeOf(cell, index.axes) }), cell);
    assert.equal(index.at({ "sweep.sphere.nu": "1000", ...placeOf(cell, index.axes) }), cell);
  }
  assert.equal(index.at({ ...placeOf(cells[0], index.axes), sampler: "sobol" }), undefined);
});

test("a cell that changed replaces the one in its place", () => {
  const cells = grid();
  const index = indexed(cells);
  const changed = { ...cells[7], state: "failed" };
  index.put(changed);
  assert.equal(index.at(placeOf(cells[7], index.axes)), changed);
});

// -- the view ---------------------------------------------------------------------------------------------------------

test("samplers stand against integrators, against spp where there is one integrator, sweeps where there is one sampler", () => {
  const names = (detail) => [view("", detail).rows.name, view("", detail).cols.name];
  assert.deepEqual(names(DETAIL), ["sampler", "integrator"]);
  assert.deepEqual(names({ ...DETAIL, integrators: ["path"] }), ["sampler", "spp"]);
  const sweeps = { nu: [1, 2], nv: [1, 2] };
  assert.deepEqual(names({ ...DETAIL, samplers: ["halton"], integrators: ["path"], sweeps }), ["sweep.nu", "sweep.nv"]);
});

test("rows and columns are never the same axis, whatever an address says", () => {
  const axes = ["scene", "integrator", "sampler", "spp", "sweep.sphere.nu", "nonsense", ""];
  for (const rows of axes)
    for (const cols of axes) {
      const { rows: r, cols: c, pinned } = view(new URLSearchParams({ rows, cols }).toString());
      assert.notEqual(r.name, c.name, `${rows} × ${cols}`);
      assert.ok(pinned.every(({ name }) => name !== r.name && name !== c.name));
    }
});

test("what the grid does not have counts as not said", () => {
  const odd = view("scene=moon&spp=7&metric=flip&size=3&tone=x&ev=much&scale=-1&base=sampler:moon&hide.sampler=moon&sort=");
  const plain = view();
  for (const name of ["metric", "size", "tone", "ev", "scale", "baseline"]) assert.deepEqual(odd[name], plain[name], name);
  assert.equal(odd.at.scene, "box");
  assert.equal(odd.at.spp, "16");
});

test("hiding a value and showing it again leaves the address as it was, with any name", () => {
  for (const axis of ["scene", "sampler", "spp"])
    for (const value of view().axes.find(({ name }) => name === axis).values) {
      const hidden = toggling(view(), axis, value);
      const query = new URLSearchParams(Object.entries(hidden).filter(([, text]) => text !== null)).toString();
      const after = view(query);
      assert.deepEqual([...after.hidden.get(axis)], [value]);
      assert.ok(grid().filter(showing(after)).every((cell) => String(cell[axis]) !== value));
      assert.deepEqual(toggling(after, axis, value), { [`hide.${axis}`]: null });
    }
});

test("something is always shown: the last value of an axis cannot be hidden", () => {
  const alone = new URLSearchParams(isolating(view(), "sampler", "stratified")).toString();
  assert.deepEqual(view(alone).rows.values, ["stratified"]);
  assert.deepEqual(toggling(view(alone), "sampler", "stratified"), {});
  assert.deepEqual(isolating(view(alone), "sampler", "stratified"), { "hide.sampler": null });
  assert.equal(view("hide.spp=4~16").hidden.get("spp").size, 0);
});

test("selecting a cell brings it into the grid", () => {
  for (const cell of grid()) {
    const set = new URLSearchParams(selecting(view(), cell)).toString();
    const after = view(set);
    const place = placeAt(after, cell.sampler, cell.integrator);
    assert.equal(indexed(grid()).at(place).position, cell.position);
    assert.equal(after.selected, cell.position);
  }
});

// -- pictures ---------------------------------------------------------------------------------------------------------

test("references stand beside the rows or above the columns that they belong to", () => {
  const index = indexed(grid());
  assert.equal(referencesOf(index, view()).side, "column");
  assert.equal(referencesOf(index, view()).at("stratified", "direct"), 2);
  assert.equal(referencesOf(index, view("rows=integrator&cols=spp")).side, "row");
  assert.equal(referencesOf(index, view("cols=spp&integrator=path")).side, "one");
  assert.equal(referencesOf(indexed(grid((cell) => ({ ...cell, reference: null }))), view()).side, "none");
});

test("the address of a picture changes when the picture does, and only then", () => {
  const [cell] = grid();
  assert.equal(tokenOf(cell, undefined), tokenOf({ ...cell, had: 2 }, { preview: 7 }));
  const running = { ...cell, had: 0, state: "running" };
  assert.equal(tokenOf(running, undefined), "");
  assert.notEqual(tokenOf(running, { preview: 1 }), tokenOf(running, { preview: 2 }));
  const reference = { ...cell, role: "reference" };
  assert.notEqual(tokenOf({ ...reference, had: 1 }), tokenOf({ ...reference, had: 2 }));
  const how = { metric: null, pixels: 200, ev: 1, tone: "srgb", max: null };
  assert.equal(sourceOf(running, undefined, how), null);
  assert.match(sourceOf(cell, undefined, how), /^\/api\/cells\/100\/preview\.png\?.*size=256.*ev=1/);
  assert.match(sourceOf(cell, undefined, { ...how, metric: "relmse", max: 0.5 }), /error\/relmse\.png\?reference=1.*max=0\.5/);
  assert.equal(sourceOf({ ...cell, metrics: {} }, undefined, { ...how, metric: "relmse", max: 0.5 }), null);
});

test("a window holds what is visible and never leaves the list", () => {
  for (const [from, extent] of [[0, 500], [-80, 500], [990, 500], [1e6, 500], [310, 0]]) { // prettier-ignore
    const [first, last] = windowOf(from, extent, 100, 12);
    assert.ok(first >= 0 && last <= 12 && first <= 12, `${first} … ${last}`);
    for (let i = 0; i < 12; i++) {
      const visible = i * 100 + 100 > from && i * 100 < from + extent;
      if (visible) assert.ok(i >= first && i < last, `${i} of ${first} … ${last}`);
    }
  }
});

// -- comparing --------------------------------------------------------------------------------------------------------

test("only cells with the same reference are compared", () => {
  const [a, b] = grid();
  const better = { ...b, spp: 4, spp_actual: 4, metrics: { relmse: [0.001, 0.0001, 4] } };
  assert.equal(ranks([a, better], RELMSE).get(better.position), "best");
  assert.equal(ranks([a, { ...better, reference: 9 }], RELMSE).size, 0);
  assert.equal(ranks([a, { ...better, spp_actual: 25 }], RELMSE).size, 0);
  assert.equal(ratioTo({ ...better, reference: 9 }, a, RELMSE), null);
  close(ratioTo(better, a, RELMSE), 0.001 / a.metrics.relmse[0]);
  assert.equal(ratioTo(a, a, RELMSE), 1);
  assert.equal(ratioTo(a, b, RATIO), null);
});

test("who cannot be told from the best is tied with it, and a ratio near 1 has no best", () => {
  const [a, b, c] = grid((cell) => ({ ...cell, spp_actual: 25 }));
  const errors = [[1.0, 0.1], [1.2, 0.1], [1.4, 0.1]]; // prettier-ignore
  const cells = [a, b, c].map((cell, i) => ({ ...cell, metrics: { relmse: [...errors[i], 4], mean_ratio: [1, 0.1, 4] } }));
  const found = ranks(cells, RELMSE);
  assert.deepEqual(cells.map((cell) => found.get(cell.position)), ["best", "tied", undefined]);
  assert.equal(ranks(cells, RATIO).size, 0);
  assert.equal(rankedAlong("sampler", "spp"), "column");
  assert.equal(rankedAlong("sampler", "integrator"), "row");
  assert.equal(rankedAlong("scene", "spp"), null);
});

test("one maximum for all error maps, at least twice every mean, and there only once there is a number", () => {
  assert.equal(sharedMaximum([], "relmse"), null);
  const cells = grid();
  const max = sharedMaximum(cells, "relmse");
  assert.ok(cells.every((cell) => max >= 2 * cell.metrics.relmse[0]));
  assert.equal(max, 0.5);
});

// -- chance and findings ----------------------------------------------------------------------------------------------

test("Student's t has its textbook quantiles, and Fisher's method leaves one test as it is", () => {
  const quantiles = { 1: 12.706, 2: 4.303, 3: 3.182, 4: 2.776, 7: 2.365, 30: 2.042, 100: 1.984 };
  for (const [degrees, t] of Object.entries(quantiles)) close(tail(t, Number(degrees)), 0.05, 1e-4);
  for (const p of [0.5, 0.05, 1e-9]) close(combined(Math.log(p), 1), p, 1e-12);
  close(combined(2 * Math.log(0.05), 2), 0.0175, 1e-4);
});

/** A small generator, so that a failure can be repeated (mulberry32). */
function random(seed) {
  return () => {
    seed = (seed + 0x6d2b79f5) | 0;
    let t = Math.imul(seed ^ (seed >>> 15), 1 | seed);
    t = (t + Math.imul(t ^ (t >>> 7), 61 | t)) ^ t;
    return ((t ^ (t >>> 14)) >>> 0) / 2 ** 32;
  };
}

/** Cells whose brightness was measured with four replicates; `bias` is added to one sampler. Two references. */
function simulated(seed, bias) {
  const uniform = random(seed);
  const normal = () => Math.sqrt(-2 * Math.log(1 - uniform())) * Math.cos(2 * Math.PI * uniform());
  const spread = (spp) => 0.05 / Math.sqrt(spp);
  const off = { 1: normal() * spread(4096), 2: normal() * spread(4096) }; // the reference's own noise, for all together
  const cells = grid((cell) => {
    const values = [0, 0, 0, 0].map(() => 1 + off[cell.reference] + normal() * spread(cell.spp) + (cell.sampler === "stratified" ? bias : 0));
    const mean = values.reduce((a, b) => a + b) / 4;
    const se = Math.sqrt(values.reduce((sum, v) => sum + (v - mean) ** 2, 0) / 3 / 4);
    return { ...cell, metrics: { mean_ratio: [mean, se, 4] } };
  });
  const reference = { ...cells[0], role: "reference", had: 2, wanted: 2, spp: 2048, spp_actual: 2048, metrics: {}, reference: null };
  return [...cells, { ...reference, position: 98, cell: 1 }, { ...reference, position: 99, cell: 2 }];
}

test("a bias is found, and unbiased pictures against a noisy reference raise no alarm", () => {
  const warned = (bias) => Array.from({ length: 60 }, (_, seed) => findings(DETAIL, simulated(seed + 1, bias), [])
    .filter(({ kind }) => kind === "warn")); // prettier-ignore
  assert.equal(warned(0).flat().length, 0);
  const found = warned(0.5);
  assert.ok(found.filter((one) => one.length).length >= 50, "a bias of a half is seen in most experiments");
  const named = found.flat().filter(({ cell }) => cell !== undefined);
  assert.ok(named.every(({ text }) => text.includes("stratified")));
});

test("findings say what was counted", () => {
  const cells = grid((cell) => (cell.sampler === "stratified" && cell.spp === 4 ? { ...cell, spp_actual: 9 } : cell));
  cells[3] = { ...cells[3], state: "failed", error_class: "out_of_memory" };
  const texts = findings({ ...DETAIL, replicates: 1 }, cells, [
    { scene: "box", integrator: "path", sampler: "halton", points: [], slope: null, alike: false },
  ]).map(({ text }) => text.replaceAll("\u00a0", " "));
  assert.ok(texts.includes("stratified: 4 spp asked, 9 rendered"), texts.join("\n"));
  assert.ok(texts.includes("1 cell failed: 1 out of memory"));
  assert.ok(texts.some((text) => text.startsWith("path and direct count different paths")));
  assert.ok(texts.some((text) => text.includes("timed under different conditions") && text.includes("halton · path")));
  assert.ok(texts.some((text) => text.startsWith("one replicate a cell")));
  assert.deepEqual(findings({ ...DETAIL, integrators: ["path"] }, [undefined], []), []);
});

// -- the table --------------------------------------------------------------------------------------------------------

test("rows are ordered by number, what has no value stands last, and the third click gives the plan's order back", () => {
  const columns = columnsOf(DETAIL);
  const cells = grid((cell) => (cell.position % 5 ? cell : { ...cell, metrics: {} }));
  for (const sort of ["relmse", "-relmse", "spp", "-sampler"]) {
    const rows = ordered(cells, columns, sort);
    assert.equal(new Set(rows).size, cells.length);
    const values = rows.map(columns.find(({ name }) => name === sort.replace("-", "")).value);
    const known = values.filter((value) => value !== null);
    assert.deepEqual(values.slice(0, known.length), known);
    const rising = [...known].sort((a, b) => (a < b ? -1 : a > b ? 1 : 0));
    assert.deepEqual(known, sort.startsWith("-") ? rising.reverse() : rising);
  }
  assert.equal(ordered(cells, columns, "nonsense"), cells);
  assert.deepEqual([nextSort("", "spp"), nextSort("spp", "spp"), nextSort("-spp", "spp")], ["spp", "-spp", null]);
});

test("a table with two sweeps and every metric fits into a window of 1440 px; its files have the whole names", () => {
  const sweeps = { "sphere.bsdf.nu": [10, 10000], "sphere.bsdf.nv": [10, 10000] };
  const metrics = ["mse", "mse_cross", "relmse", "mean_ratio"].map((name) => ({ ...RELMSE, name }));
  const scenes = ["sphere_figure", "sphere_cosine/scene.xml"].map((name) => ({ ...DETAIL.scenes[0], name }));
  const detail = { ...DETAIL, scenes, samplers: ["independent"], integrators: ["path"], sweeps, metrics };
  const columns = columnsOf(detail);
  const least = columns.reduce((sum, { width }) => sum + width, 92);
  assert.ok(least <= 1390, `${least} px`); // what the page leaves of 1440
  assert.deepEqual(columns.slice(3, 5).map(({ title, hint }) => [title, hint]), [["nu", "sphere.bsdf.nu"], ["nv", "sphere.bsdf.nv"]]);
  assert.ok(asText([], columns, ",").includes("sphere.bsdf.nu,sphere.bsdf.nv"));
  const titles = (...names) => columnsOf({ ...detail, sweeps: Object.fromEntries(names.map((name) => [name, [1]])) }).slice(3, 3 + names.length).map(({ title }) => title);
  assert.deepEqual(titles("a.bsdf.nu", "b.bsdf.nu", "b.menu"), ["a.bsdf.nu", "b.bsdf.nu", "menu"]);
  assert.deepEqual(titles("nu", "a.nu"), ["nu", "a.nu"]);
});

test("the filter takes words, and whole values with =", () => {
  const columns = columnsOf(DETAIL);
  const found = (filter) => grid().filter(matching(columns, filter)).length;
  const all = grid().length;
  assert.equal(found(""), all);
  assert.equal(found("HALTON box"), grid().filter((cell) => cell.sampler.startsWith("halton") && cell.scene === "box").length);
  assert.equal(found("spp=4"), all / 2);
  assert.equal(found("sampler=halton"), 0);
  assert.equal(found("sampler=halton:a=1,b=2"), all / 3);
  assert.equal(found("1"), grid().filter((cell) => /1/.test(cell.sampler)).length);
});

test("a file of rows reads back: names with commas, quotes and tabs, numbers as the same double", () => {
  const columns = columnsOf(DETAIL);
  const [cell] = grid((one) => ({ ...one, scene: 'a "b",\tc', metrics: { relmse: [0.1 + 0.2, null, 1] } }));
  const [head, line] = asText([cell], columns, ",").split("\n");
  assert.ok(head.includes("spp,spp_actual") && head.includes("relmse,relmse_se"));
  assert.ok(line.startsWith('"a ""b"",\tc",path,'));
  assert.ok(line.includes(String(0.1 + 0.2)));
  const cells = asText([cell], columns, "\t").split("\n").map((row) => row.split("\t").length);
  assert.equal(cells[0], cells[1]);
});

// -- curves -----------------------------------------------------------------------------------------------------------

function convergence(metric = RELMSE, change = (series) => series) {
  const series = DETAIL.integrators.flatMap((integrator) =>
    DETAIL.samplers.map((sampler) =>
      change({
        scene: "box", integrator, sampler, sweep: {}, alike: true, slope: { value: -1.149, low: -1.17, high: -1.13 },
        points: [4, 9, 16].map((spp, i) => ({
          cell: i, spp, spp_actual: spp === 4 ? 5 : spp, n: 4, mean: 1 / spp, error: 0.1 / spp, low: 0.7 / spp, high: 1.3 / spp, seconds: spp / 7,
        })),
      }),
    ),
  ); // prettier-ignore
  return { metric, revision: 1, series };
}
const curves = (data) => data.filter(({ customdata }) => customdata);

test("curves lie at the spp that was rendered, one for each series, on axes that the layout has", () => {
  for (const arrange of ["overlay", "multiples"])
    for (const width of [300, 700, 2000])
      for (const x of ["spp", "seconds"]) {
        const options = { arrange, width, x };
        const data = traces(convergence(), options);
        const figure = layout(convergence(), options);
        assert.equal(curves(data).length, 6);
        for (const { xaxis, yaxis } of data) {
          assert.ok(figure[xaxis.replace("x", "xaxis")] && figure[yaxis.replace("y", "yaxis")], `${arrange} ${xaxis} ${yaxis}`);
        }
        const places = new Set(curves(data).map(({ xaxis, yaxis }) => xaxis + yaxis));
        assert.equal(places.size, arrange === "multiples" ? 6 : 1);
        if (x === "spp") assert.deepEqual(curves(data)[0].x, [5, 9, 16]);
      }
});

test("a replay lies at the spp that was asked, dashed and named, whatever it rendered", () => {
  const wrong = (series) => ({
    ...series,
    replay: series.sampler !== "stratified",
    points: series.points.map((point) => ({ ...point, spp_actual: 16 })),
  });
  for (const arrange of ["overlay", "multiples"]) {
    const data = convergence(RELMSE, wrong);
    const drawn = curves(traces(data, { arrange }));
    assert.equal(drawn.length, 6);
    for (const one of drawn) {
      const replay = !one.name.startsWith("stratified");
      assert.deepEqual(one.x, replay ? [4, 9, 16] : [16, 16, 16]);
      assert.equal(one.line.dash === REPLAY_DASH, replay);
      for (const text of [one.name, ...one.text]) assert.equal(text.includes("(replay)"), replay, text);
    }
    const figure = layout(data, { arrange, width: 2000 });
    assert.match(JSON.stringify(figure), /replays: as asked/);
    assert.doesNotMatch(JSON.stringify(layout(convergence(), { arrange })), /replay/);
    assert.deepEqual(figure.xaxis.tickvals, [4, 9, 16]);
    const timed = curves(traces(data, { arrange, x: "seconds" }));
    assert.deepEqual(timed[0].x, timed[1].x, "seconds are seconds");
  }
});

test("a replay is never the best, nor tied with it", () => {
  const cells = grid().filter(({ scene, integrator, spp, sweep }) => scene === SCENES[1] && integrator === "path" && spp === 16);
  const [one, two, three] = cells;
  one.metrics.relmse = [0.001, 0.0001, 4];
  one.replay = true;
  two.metrics.relmse = [0.002, 0.0001, 4];
  three.metrics.relmse = [0.004, 0.0001, 4];
  assert.deepEqual([...ranks(cells, RELMSE)], [[two.position, "best"]]);
});

test("a replay is a finding once, and its bias none", () => {
  const name = "poissondisk:replay=zeros";
  const cells = grid((cell) => (cell.sampler === "stratified" ? { ...cell, sampler: name, replay: true, metrics: { ...cell.metrics, mean_ratio: [0.5, 0.001, 4] } } : cell));
  const found = findings(DETAIL, cells, []).filter(({ text }) => text.includes("replay"));
  assert.deepEqual(found.map(({ kind }) => kind), ["note"]);
  assert.match(found[0].text, /published mistake on purpose/);
});

test("what a logarithmic axis cannot show is left out and counted", () => {
  const data = convergence(RELMSE, (series) => ({ ...series, points: series.points.map((point, i) => (i ? point : { ...point, mean: -1, low: -2 })) }));
  assert.equal(unplottable(data), 6);
  assert.ok(curves(traces(data)).every(({ y }) => y.length === 2 && y.every((value) => value > 0)));
  for (const { y } of traces(data)) assert.ok(y.every((value) => value === null || value > 0));
  const ratio = convergence(RATIO);
  assert.equal(unplottable(ratio), 0);
  assert.equal(layout(ratio).yaxis.type, "linear");
});

test("colours and dashes are those of the grid, however little of it is drawn", () => {
  const options = { samplers: DETAIL.samplers, integrators: DETAIL.integrators };
  const all = curves(traces(convergence(), options));
  const [few] = curves(traces(convergence(), { ...options, only: (series) => series.sampler === "stratified" && series.integrator === "direct" }));
  const same = all.find(({ name }) => name.startsWith("stratified · direct"));
  assert.equal(few.line.color, same.line.color);
  assert.equal(few.line.dash, same.line.dash);
  assert.ok(few.name.endsWith("−1.15 ± 0.02"), few.name);
});

test("a name is text, not markup, and no data draw an empty plot", () => {
  const hostile = convergence(RELMSE, (series) => ({ ...series, sampler: '<a href="//x">' }));
  const text = JSON.stringify([traces(hostile), layout(hostile, { arrange: "multiples" })]);
  assert.ok(!text.includes("<a"), "escaped");
  for (const arrange of ["overlay", "multiples"]) {
    const nothing = { metric: RELMSE, revision: 0, series: [] };
    assert.equal(curves(traces(nothing, { arrange })).length, 0);
    assert.ok(layout(nothing, { arrange }).xaxis);
  }
});

test("the plot's modules import only each other at run time: the report inlines them", () => {
  for (const file of ["plan.js", "convergence.js"]) {
    const source = readFileSync(new URL(`../../web/plots/${file}`, import.meta.url), "utf8");
    for (const [, from] of source.matchAll(/^\s*import\b[^"]*"([^"]*)"/gm)) assert.equal(from, "./plan.js");
  }
});

test("panels repeat the other curves only while these can be told apart", () => {
  const some = convergence();
  const copies = (count) => Array.from({ length: count }, (_, i) => ({ ...some.series[0], sampler: `s${i}` }));
  const points = (count) => traces({ ...some, series: copies(count) }, { arrange: "multiples" }).reduce((sum, { x }) => sum + x.length, 0);
  assert.ok(points(40) > 40 * 39 * 3);
  assert.ok(points(50) < 50 * 50 * 2);
});

test("a point that is mostly the reference's noise is hollow, and the noise is shaded", () => {
  const noisy = convergence(RELMSE, (series) => ({ ...series, floor: 0.05 }));
  for (const { marker } of curves(traces(noisy))) {
    const open = marker.symbol.map((symbol) => symbol.endsWith("-open"));
    assert.deepEqual(open, [false, false, true]); // means 1/4, 1/9 and 1/16
  }
  const [shade, ...more] = layout(noisy).shapes;
  assert.equal(more.length, 0);
  assert.equal(shade.y1, 0.05);
  assert.ok(shade.y0 < 0.05);
  const clean = convergence(RELMSE, (series) => ({ ...series, floor: 1e-9 }));
  assert.deepEqual(layout(clean).shapes, []);
});
