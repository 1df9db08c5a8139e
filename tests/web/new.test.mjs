/** The form of a new experiment: what it holds goes into a link and a submission, and comes back. */
import assert from "node:assert/strict";
import { test } from "node:test";

import { allowed, isReplay, replayOf } from "../../web/views/new/catalog.js";
import { placeOf } from "../../web/views/new/fields.js";
import { choice, fromQuery, label, START, sweptValues, toQuery, toSubmission } from "../../web/views/new/form.js";
import { formOf } from "../../web/views/new/prefill.js";
import { readToml } from "../../web/views/new/toml.js";

const DIGEST = "0123456789abcdef".repeat(4);
const REPLAY = {
  name: "replay", type: "str", default: "", line: "", unit: "", minimum: null, maximum: null, required: false, unset: "",
  options: ["", "zeros", "truncated"], meanings: ["right", "at (0, 0)", "stops early"], replays: ["zeros", "truncated"],
}; // prettier-ignore
const SCRAMBLE = { ...REPLAY, name: "scramble", default: "shift", options: ["shift", "none"], replays: ["none"] };
const POISSON = { name: "poissondisk", line: "", source: "Dartboard", aliases: [], parameters: [REPLAY] };
const POINTSET = { ...POISSON, name: "pointset", parameters: [SCRAMBLE] };

/** The form after a link was opened. */
function linked(form) {
  const params = new URLSearchParams();
  for (const [key, values] of Object.entries(toQuery(form))) for (const value of values ?? []) params.append(key, value);
  return fromQuery(params);
}

test("a form with points and replays is in its link, and in what is submitted", () => {
  const samplers = ["pointset:file=my points.npz,scramble=owen", "poissondisk:replay=zeros", "poissondisk:min_dist=0.1"];
  const form = { ...START, samplers: samplers.map(choice), points: [{ name: "my points.npz", digest: DIGEST }] };
  assert.deepEqual(linked(form), form);
  const { grid, points } = toSubmission(linked(form));
  assert.deepEqual(grid.samplers, samplers);
  assert.deepEqual(points, { "my points.npz": DIGEST });
  assert.deepEqual(toSubmission(START).points, {});
});

test("a file that was never sent is named all the same, for the server to say so", () => {
  const params = new URLSearchParams([["sampler", "pointset:file=my.npz"], ["points", "my.npz"]]);
  assert.deepEqual(fromQuery(params).points, []);
  assert.deepEqual(toSubmission(fromQuery(params)).grid.samplers, ["pointset:file=my.npz"]);
});

test("another experiment's points come with its grid", () => {
  const toml = 'name = "a"\nscenes = ["cornell_box"]\nsamplers = ["pointset:file=my.npz"]\nspp = [4]\nreplicates = 2\n';
  const form = formOf({ toml, paths: {}, points: { "my.npz": DIGEST } });
  assert.deepEqual(form.samplers.map(label), ["pointset:file=my.npz"]);
  assert.deepEqual(form.points, [{ name: "my.npz", digest: DIGEST }]);
  assert.deepEqual(formOf({ toml }).points, [], "a server of before");
});

test("a replay is known by its parameter, and folds away only where leaving it out is right", () => {
  assert.equal(replayOf(POISSON), REPLAY);
  assert.equal(replayOf(POINTSET), undefined);
  assert.equal(replayOf(undefined), undefined);
  const is = (entry, text) => isReplay(entry, choice(text));
  assert.deepEqual(
    [is(POISSON, "poissondisk"), is(POISSON, "poissondisk:replay=zeros"), is(POINTSET, "pointset:scramble=none"), is(undefined, "x:y=z")],
    [false, true, true, false],
  );
});

test("what nobody said stays each scene's own: its filter, its reference", () => {
  const { grid } = toSubmission(linked(START));
  assert.equal("rfilter" in grid, false);
  assert.deepEqual(grid.reference, {});
  const toml = 'name = "a"\nscenes = ["hidden_lamp"]\nsamplers = ["sobol"]\nspp = [4]\nreplicates = 2\n';
  assert.equal("rfilter" in toSubmission(formOf({ toml })).grid, false);
  const form = { ...START, rfilter: choice("tent:radius=2"), reference: { ...START.reference, spp: "64" } };
  assert.deepEqual(linked(form), form);
  const said = toSubmission(form).grid;
  assert.deepEqual([said.rfilter, said.reference], ["tent:radius=2", { spp: 64 }]);
});

test("a text with options has no range", () => {
  assert.equal(allowed(REPLAY), "");
});

const SWEEPS = [
  { parameter: "sphere.bsdf.nu", values: "10, 100, 1000", scenes: [] },
  { parameter: "white.reflectance", values: "0.5, [0.1, 0.9, 0.2]", scenes: ["cornell_box", "my @ room"] },
];

test("sweeps are in the link as they were typed, and in what is submitted as numbers and colours", () => {
  const form = { ...START, sweeps: SWEEPS };
  assert.deepEqual(linked(form), form);
  assert.deepEqual(toSubmission(form).grid.sweep, [
    { parameter: "sphere.bsdf.nu", values: [10, 100, 1000] },
    { parameter: "white.reflectance", values: [0.5, [0.1, 0.9, 0.2]], scenes: ["cornell_box", "my @ room"] },
  ]);
  assert.equal("sweep" in toSubmission(START).grid, false);
});

test("what is no list of numbers goes to the server, which says so beside the field", () => {
  assert.deepEqual(sweptValues("10 100; x"), [10, 100, "x"]);
  assert.deepEqual(sweptValues(""), []);
  assert.deepEqual(sweptValues("1e3, .5"), ["1e3", ".5"]);
  const half = { ...START, sweeps: [{ parameter: "", values: "", scenes: [] }] };
  assert.deepEqual(toSubmission(linked(half)).grid.sweep, [{ parameter: "", values: [] }]);
  assert.deepEqual(fromQuery(new URLSearchParams([["sweep", "{nonsense"]])).sweeps, []);
  assert.equal(placeOf({ detail: "", field: "sweep" }), "sweep");
});

test("another experiment's sweeps come back into the form, whatever tables stand around them", () => {
  const toml = `name = "a"
scenes = ["cornell_box", "my @ room"]
samplers = ["independent"]
integrators = ["path"]
spp = [4]
replicates = 2
resolution = [9, 9]

[[sweep]]
parameter = "sphere.bsdf.nu"
values = [10, 100, 1000]

[[sweep]]
parameter = "white.reflectance"
values = [0.5, [0.1, 0.9, 0.2]]
scenes = ["cornell_box", "my @ room"]
`;
  const form = formOf({ toml });
  assert.deepEqual(form.sweeps.map(({ values, ...rest }) => ({ ...rest, values: values.replaceAll(",", ", ").replaceAll("  ", " ") })), SWEEPS);
  assert.deepEqual(toSubmission(form).grid.sweep, toSubmission({ ...START, sweeps: SWEEPS }).grid.sweep);
  assert.deepEqual(readToml("[[a]]\nb = 1\n[[a]]\nb = 2\n[c]\nd = 3\n"), { a: [{ b: 1 }, { b: 2 }], c: { d: 3 } });
  for (const text of ["[[a]\n", "[[a.b]]\n", "a = 1\n[[a]]\n", "[[a]\n]\n"]) assert.equal(readToml(text), null, text);
});
