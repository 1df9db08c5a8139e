/** The form of a new experiment: what it holds goes into a link and a submission, and comes back. */
import assert from "node:assert/strict";
import { test } from "node:test";

import { allowed, isReplay, replayOf } from "../../web/views/new/catalog.js";
import { choice, fromQuery, label, START, toQuery, toSubmission } from "../../web/views/new/form.js";
import { formOf } from "../../web/views/new/prefill.js";

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

test("a text with options has no range", () => {
  assert.equal(allowed(REPLAY), "");
});
