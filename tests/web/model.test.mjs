// The model of an experiment against a service that pages, streams and fails: what is shown is what the service has.
import assert from "node:assert/strict";
import { beforeEach, test } from "node:test";

const frames = [];
let answer = (/** @type {string} */ _path) => ({});
let streams = [];

class Stream {
  constructor(url) {
    this.url = url;
    this.handlers = {};
    streams.push(this);
  }
  addEventListener(name, handler) {
    this.handlers[name] = handler;
  }
  close() {
    this.closed = true;
  }
  send(name, data) {
    this.handlers[name]?.({ data: JSON.stringify(data) });
  }
}

const quiet = { addEventListener() {}, removeEventListener() {}, hidden: false };
Object.assign(globalThis, {
  window: { ...quiet, setTimeout: (...args) => setTimeout(...args) },
  document: quiet,
  EventSource: Stream,
  requestAnimationFrame: (draw) => frames.push(draw),
  cancelAnimationFrame() {},
  async fetch(path) {
    const found = await answer(path);
    return new Response(JSON.stringify(found), { status: found.status ?? 200 });
  },
});
const { ExperimentModel, fractionOf } = await import("../../web/model.js");

const WORKER = { state: "idle", device: "", trouble: null, experiment: null, cell: null, description: null, queued: 0 };
const EXPERIMENT = { id: 7, name: "grid", state: "running", cells: {}, references: {}, had: 0, wanted: 9, failed: 0, seconds_left: null };
const DETAIL = {
  ...EXPERIMENT, scenes: [{ name: "box", width: 8, height: 8, reference: null }], integrators: ["path"],
  samplers: ["independent"], spp: Array.from({ length: 500 }, (_, i) => i + 1), sweeps: {}, metrics: [], replicates: 1,
}; // prettier-ignore
const cell = (position, more = {}) => ({
  position, cell: 1000 + position, role: "cell", scene: "box", integrator: "path", sampler: "independent", spp: position + 1,
  spp_actual: position + 1, sweep: {}, state: "queued", had: 0, wanted: 1, metrics: {}, ...more,
}); // prettier-ignore
const update = (revision, cells, more = {}) => ({ revision, experiment: EXPERIMENT, worker: WORKER, reload: false, cells, ...more });
const tick = () => new Promise((resolve) => setTimeout(resolve, 5));

/** Pages of 500 cells as they are when they are asked for; `before` may act first. */
function service(before = async (_start) => {}) {
  return async (path) => {
    if (path === "/api/experiments/7") return DETAIL;
    const query = new URL(path, "http://x").searchParams;
    const [start, limit] = [Number(query.get("start") ?? 0), Number(query.get("limit"))];
    const cells = Array.from({ length: Math.min(limit, 500 - start) }, (_, i) => cell(start + i));
    await before(start);
    return { revision: 40, next: start + limit < 500 ? start + limit : null, cells };
  };
}

beforeEach(() => {
  frames.length = 0;
  streams = [];
});

test("every page is fetched, and the stream goes on where the first page was taken", async () => {
  answer = service();
  const model = new ExperimentModel(7);
  await model.open();
  assert.equal(model.cells.filter(Boolean).length, 500);
  assert.ok(model.complete);
  assert.equal(streams.length, 1);
  assert.ok(streams[0].url.endsWith("/api/experiments/7/events?after=40"));
  model.close();
  assert.ok(streams[0].closed);
});

test("a page that was under way does not put an older cell back", async () => {
  answer = service(async (start) => {
    if (start > 0) streams[0].send("update", update(41, [cell(450, { state: "done", had: 1 })]));
  });
  const model = new ExperimentModel(7);
  await model.open();
  assert.equal(model.cells[450].state, "done");
  assert.equal(model.index.at({ scene: "box", integrator: "path", sampler: "independent", spp: "451" }).state, "done");
  model.close();
});

test("any number of events is one notice a frame, and a closed model is silent", async () => {
  answer = service();
  const model = new ExperimentModel(7);
  await model.open();
  frames.splice(0).forEach((draw) => draw());
  let heard = 0;
  model.subscribe(() => heard++);
  for (let i = 0; i < 100; i++) streams[0].send("update", update(50 + i, [cell(i, { state: "running" })]));
  assert.equal(frames.length, 1);
  frames.splice(0).forEach((draw) => draw());
  assert.equal(heard, 1);
  model.close();
  streams[0].send("update", update(200, [cell(0)]));
  frames.splice(0).forEach((draw) => draw());
  assert.equal(heard, 1);
});

test("what was read at a revision stays true until cells of the experiment change", async () => {
  answer = service();
  const model = new ExperimentModel(7);
  await model.open();
  assert.equal(model.seen, 40);
  streams[0].send("update", update(45, [])); // of another experiment
  assert.equal(model.seen, 40);
  streams[0].send("update", update(46, [cell(1, { state: "running" })]));
  assert.equal(model.seen, 46);
  streams[0].send("update", update(47, [], { reload: true }));
  assert.equal(model.seen, 47);
  model.close();
});

test("progress ends with its cell, and belongs to the role that is drawn", async () => {
  answer = service();
  const model = new ExperimentModel(7);
  await model.open();
  const progress = { cell: 1003, role: "cell", replicate: 0, done: 1, passes: 4, seconds: 1, preview: 2 };
  streams[0].send("progress", progress);
  assert.deepEqual(model.progressOf(cell(3)), progress);
  assert.equal(model.progressOf(cell(3, { role: "reference" })), undefined);
  assert.equal(fractionOf(cell(3, { wanted: 2 }), progress), 1 / 8);
  streams[0].send("update", update(41, [cell(3, { state: "done", had: 1 })]));
  assert.equal(model.progressOf(cell(3)), undefined);
  model.close();
});

test("`reload` fetches everything again, once more if it comes while that is under way", async () => {
  let fetched = 0;
  answer = service(async (start) => void (start === 0 && fetched++));
  const model = new ExperimentModel(7);
  await model.open();
  streams[0].send("update", update(41, [], { reload: true }));
  streams[0].send("update", update(42, [], { reload: true }));
  await tick();
  assert.equal(fetched, 3);
  assert.equal(streams.length, 1);
  model.close();
});

test("an experiment that is not there is a problem, one that goes while it is open is gone", async () => {
  answer = () => ({ type: "urn:dartboard:not-found", title: "no such thing", status: 404, detail: "", instance: "" });
  const missing = new ExperimentModel(8);
  await missing.open();
  assert.equal(missing.problem.problem.status, 404);
  answer = service();
  const model = new ExperimentModel(7);
  await model.open();
  streams.at(-1).send("gone", {});
  assert.ok(model.gone);
  assert.ok(streams.at(-1).closed);
  model.close();
});
