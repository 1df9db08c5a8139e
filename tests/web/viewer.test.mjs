// The laws of the viewer that need no browser: numbers, views, settings, and which pixels are fetched and kept.
import assert from "node:assert/strict";
import { test } from "node:test";

import { gradient, inferno, signed } from "../../web/viewer/colours.js";
import { automaticMax, displayed, isBright, normalisingEv, reach } from "../../web/viewer/looks.js";
import * as maths from "../../web/viewer/maths.js";
import { Pictures } from "../../web/viewer/pictures.js";
import { troubleOf, wants } from "../../web/viewer/seen.js";
import * as settings from "../../web/viewer/settings.js";

const close = (a, b, tolerance = 1e-9) => assert.ok(Math.abs(a - b) <= tolerance, `${a} is not ${b} ± ${tolerance}`);
const BOX = { x: 30, y: 50, width: 800, height: 600 };
const SIZE = { width: 256, height: 128 };
const views = [
  { zoom: null, x: 0.5, y: 0.5 },
  { zoom: 1, x: 0.25, y: 0.7 },
  { zoom: 7.3, x: 0.61, y: 0.33 },
];

/** A picture of one colour, given as bits of float16. */
function plain(bits, { width, height } = { width: 4, height: 4 }) {
  return { width, height, halves: Uint16Array.from({ length: width * height * 3 }, (_, i) => bits[i % 3]) };
}
const ONE = 0x3c00;
const HALF = 0x3800;

// -- numbers ----------------------------------------------------------------------------------------------------------

test("float16 is decoded exactly", () => {
  const known = {
    0x0000: 0,
    0x3c00: 1,
    0xbc00: -1,
    0x3555: 0.333251953125,
    0x7bff: 65504,
    0x0001: 2 ** -24,
    0x0400: 2 ** -14,
  };
  for (const [bits, value] of Object.entries(known)) assert.equal(maths.halfToFloat(Number(bits)), value);
  assert.equal(maths.halfToFloat(0x7c00), Infinity);
  assert.equal(maths.halfToFloat(0xfc00), -Infinity);
  assert.ok(Number.isNaN(maths.halfToFloat(0x7e00)));
  assert.ok(Object.is(maths.halfToFloat(0x8000), -0));
  const table = maths.halfTable();
  for (let bits = 0; bits < 65536; bits++) assert.ok(Object.is(table[bits], maths.halfToFloat(bits)), `bits ${bits}`);
});

test("the sRGB curve has its two branches, meets its ends and never leaves 0 to 1", () => {
  assert.equal(maths.srgb(0), 0);
  close(maths.srgb(1), 1);
  close(maths.srgb(0.0031308), 0.04045, 1e-5);
  assert.equal(Math.round(maths.srgb(0.25) * 255), 137);
  assert.equal(Math.round(maths.srgb(0.5) * 255), 188);
  for (const v of [-1, NaN, -Infinity]) assert.equal(maths.srgb(v), 0);
  close(maths.srgb(17), 1);
  close(maths.gamma22(0.5), 0.5 ** (1 / 2.2));
});

test("errors of a pixel are the metrics' formulas, averaged over its channels", () => {
  const c = [1, 2, 3];
  const r = [1, 1, 1];
  close(maths.pixelError("signed", c, r), 1);
  close(maths.pixelError("absolute", r, c), 1);
  close(maths.pixelError("squared", c, r), 5 / 3);
  close(maths.pixelError("relative", c, r), 5 / 1.01 / 3);
});

test("a pixel is found by any point in it, and nothing lies outside", () => {
  const picture = { width: 2, height: 1, halves: Uint16Array.of(ONE, 0, 0, 0, HALF, ONE) };
  assert.deepEqual(maths.pixelAt(picture, { x: 0.99, y: 0.5 }), [1, 0, 0]);
  assert.deepEqual(maths.pixelAt(picture, { x: 1, y: 0 }), [0, 0.5, 1]);
  for (const at of [
    { x: 2, y: 0 },
    { x: -0.01, y: 0 },
    { x: 0, y: 1 },
    { x: NaN, y: 0 },
  ])
    assert.equal(maths.pixelAt(picture, at), null);
});

test("percentiles are linear between ranks and pass over what is not finite", () => {
  const values = Float32Array.of(3, NaN, 1, Infinity, 2, 4, -Infinity, 5);
  assert.equal(maths.percentile(values, 0), 1);
  assert.equal(maths.percentile(values, 0.5), 3);
  assert.equal(maths.percentile(values, 1), 5);
  close(maths.percentile(values, 0.9), 4.6, 1e-6);
  assert.ok(Number.isNaN(maths.percentile(Float32Array.of(NaN), 0.5)));
});

test("a sample of a large picture is spread over all of it", () => {
  const values = maths.sample(1000, (start) => start, 10);
  assert.deepEqual([...values], [0, 300, 600, 900, 1200, 1500, 1800, 2100, 2400, 2700]);
  assert.equal(maths.sample(5, () => 1, 10).length, 5);
});

test("round numbers are 1, 2 or 5 × 10ⁿ, never below what they round", () => {
  for (const [value, round] of [
    [1, 1],
    [1.01, 2],
    [0.0042, 0.005],
    [0.05, 0.05],
    [6, 10],
    [17, 20],
    [2e-7, 2e-7],
  ]) {
    assert.equal(maths.niceCeil(value), round);
  }
  for (const value of [0, -3, NaN, Infinity]) assert.equal(maths.niceCeil(value), 1);
});

test("numbers on pixels and in the line below never get long", () => {
  const shown = [0, 0.1234, -0.1234, 1.5, 17.25, 255.4, 65504, 0.00123, -3.2e-8, Infinity, NaN].map((v) =>
    maths.compact(v),
  );
  assert.deepEqual(shown, [
    "0",
    "0.123",
    "−0.123",
    "1.500",
    "17.25",
    "255.4",
    "65504",
    "1.2e−3",
    "−3.2e−8",
    "inf",
    "NaN",
  ]);
  for (const text of shown) assert.ok(text.length <= 7, text);
  assert.deepEqual([0.5, 2, 1e-4, 0, -5, 2500, 0.483398].map(maths.short), [
    "0.5",
    "2",
    "1e−4",
    "0",
    "−5",
    "2500",
    "0.483",
  ]);
});

// -- views ------------------------------------------------------------------------------------------------------------

test("a picture that fits touches two sides of the box and is in its middle", () => {
  const at = maths.place(views[0], SIZE, BOX);
  close(at.scale, 800 / 256);
  close(at.left, 30);
  close(at.top + (128 * at.scale) / 2, 50 + 300);
});

test("screen and picture coordinates are inverse to each other", () => {
  for (const view of views) {
    const at = maths.place(view, SIZE, BOX);
    const back = maths.toScreen(at, maths.toPicture(at, { x: 123, y: 456 }));
    close(back.x, 123, 1e-9);
    close(back.y, 456, 1e-9);
  }
});

test("zooming keeps what is under the cursor, in and out, from any view", () => {
  const anchor = { x: 417, y: 333 };
  for (const view of views) {
    const under = maths.toPicture(maths.place(view, SIZE, BOX), anchor);
    for (const factor of [0.8, 1.25, 9]) {
      const after = maths.zoomAt(view, SIZE, BOX, factor, anchor);
      const now = maths.toPicture(maths.place(after, SIZE, BOX), anchor);
      close(now.x, under.x, 1e-9);
      close(now.y, under.y, 1e-9);
      close(after.zoom, maths.zoomOf(view, SIZE, BOX) * factor, 1e-9);
    }
  }
});

test("the middle of the box stays on the picture, and zoom within its limits", () => {
  let view = views[2];
  for (let i = 0; i < 50; i++) view = maths.zoomAt(view, SIZE, BOX, 3, { x: 829, y: 649 });
  assert.equal(view.zoom, maths.MAX_ZOOM);
  for (let i = 0; i < 50; i++) view = maths.pan(view, SIZE, BOX, -1e4, 1e4);
  assert.deepEqual([view.x, view.y], [1, 0]);
  for (let i = 0; i < 50; i++) view = maths.zoomAt(view, SIZE, BOX, 0.1, { x: 40, y: 60 });
  assert.equal(view.zoom, maths.MIN_ZOOM);
});

test("dragging moves the picture with the pointer", () => {
  const before = maths.place(views[2], SIZE, BOX);
  const after = maths.place(maths.pan(views[2], SIZE, BOX, 12, -7), SIZE, BOX);
  close(after.left - before.left, 12, 1e-9);
  close(after.top - before.top, -7, 1e-9);
});

test("two fingers keep the points under them", () => {
  const before = [
    { x: 300, y: 300 },
    { x: 400, y: 350 },
  ];
  const after = [
    { x: 280, y: 310 },
    { x: 480, y: 410 },
  ]; // twice as far apart, in the same direction
  const from = maths.place(views[2], SIZE, BOX);
  const to = maths.place(maths.pinch(views[2], SIZE, BOX, before, after), SIZE, BOX);
  close(to.scale, from.scale * 2);
  for (const i of [0, 1]) {
    const now = maths.toScreen(to, maths.toPicture(from, before[i]));
    close(now.x, after[i].x, 1e-9);
    close(now.y, after[i].y, 1e-9);
  }
});

test("at whole zooms pixels lie on device pixels; else nothing is rounded", () => {
  const whole = maths.place({ zoom: 2, x: 0.3331, y: 0.777 }, SIZE, BOX, 1.5);
  for (const v of [whole.left, whole.top]) close((v * 1.5) % 1, 0, 1e-9);
  const between = { zoom: 2.3, x: 0.3331, y: 0.777 };
  assert.deepEqual(maths.place(between, SIZE, BOX, 1), maths.place(between, SIZE, BOX));
});

test("stops of the zoom go on from any zoom, and end", () => {
  assert.equal(maths.nextStop(1, 1), 1.5);
  assert.equal(maths.nextStop(1, -1), 2 / 3);
  assert.equal(maths.nextStop(2.43, 1), 3);
  assert.equal(maths.nextStop(2.43, -1), 2);
  assert.equal(maths.nextStop(maths.MAX_ZOOM, 1), maths.MAX_ZOOM);
});

test("a tile shows what the large box shows, whatever the size of its picture", () => {
  const large = { width: 800, height: 400 };
  const small = { width: 80, height: 40 };
  const tile = maths.shrunk(views[2], SIZE, large, small, { width: 512, height: 256 });
  close((small.width / tile.zoom) * 2, (large.width / views[2].zoom) * 4, 1e-9); // in pixels of 512 and of 256
  assert.equal(maths.shrunk(views[0], SIZE, large, small), views[0]);
});

test("columns make the pictures as large as they can be", () => {
  assert.equal(maths.bestColumns(6, { width: 1, height: 1 }, { width: 1280, height: 640 }, 0), 3);
  assert.equal(maths.bestColumns(6, { width: 1, height: 1 }, { width: 400, height: 700 }, 0), 2);
  assert.equal(maths.bestColumns(1, SIZE, BOX, 34), 1);
  assert.equal(maths.bestColumns(3, SIZE, { width: 0, height: 0 }, 34) >= 1, true);
});

// -- colours ----------------------------------------------------------------------------------------------------------

test("maps begin and end where they should and are clamped", () => {
  const bytes = (c) => c.map((v) => Math.round(v * 255));
  assert.deepEqual(bytes(inferno(0)), [0, 0, 4]);
  assert.deepEqual(bytes(inferno(7)), [252, 255, 164]);
  assert.deepEqual(bytes(inferno(NaN)), [0, 0, 4]);
  assert.deepEqual(bytes(signed(0)), [255, 255, 255]);
  assert.ok(signed(1)[0] > signed(1)[2] && signed(-9)[2] > signed(-9)[0]);
  assert.match(
    gradient("signed"),
    /^linear-gradient\(to right, rgb\(33 102 172\), rgb\(255 255 255\), rgb\(178 24 43\)\)$/,
  );
});

test("brightness grows along inferno, so that it can be read without colours", () => {
  let before = -1;
  for (let i = 0; i <= 100; i++) {
    const now = maths.luminance(inferno(i / 100));
    assert.ok(now > before - 1e-3, `at ${i} %`);
    before = now;
  }
});

test("letters contrast with what they stand on", () => {
  const look = { mode: "picture", tone: "srgb", ev: 0, max: 1 };
  assert.equal(isBright(displayed(look, [1, 1, 1], null)), true);
  assert.equal(isBright(displayed(look, [0.05, 0.05, 0.05], null)), false);
  assert.equal(isBright(displayed({ ...look, ev: 4 }, [0.05, 0.05, 0.05], null)), true);
  assert.deepEqual(displayed(look, [NaN, 0, 0], null), [1, 0, 1]);
});

test("the automatic maximum holds 99 % of every picture, and is measured once", () => {
  const grey = plain([HALF, HALF, HALF]);
  const white = plain([ONE, ONE, ONE]);
  const memory = new WeakMap();
  assert.equal(automaticMax("squared", [{ pixels: grey, reference: white }], memory), 0.5);
  assert.equal(
    automaticMax(
      "picture",
      [
        { pixels: grey, reference: white },
        { pixels: white, reference: null },
      ],
      memory,
    ),
    1,
  );
  assert.equal(memory.get(grey).get("squared").reach, 0.25);
  assert.equal(automaticMax("squared", [{ pixels: grey, reference: grey }], memory), 1); // a new reference; no error at all
  assert.ok(Number.isNaN(reach("signed", grey, plain([ONE, ONE, ONE], { width: 2, height: 2 }))));
});

test("normalising makes the brightest channel white, and leaves black alone", () => {
  close(normalisingEv(plain([HALF, 0, 0])), 1);
  assert.equal(normalisingEv(plain([0, 0, 0])), null);
});

// -- settings ---------------------------------------------------------------------------------------------------------

test("an address brings back the settings it was made from, and says nothing of defaults", () => {
  const changed = settings.complete({
    ev: -1.5,
    tone: "gamma22",
    mode: "squared",
    max: 0.05,
    layout: "wipe",
    zoom: 3.3333333,
    x: 0.123456789,
  });
  const params = settings.toParams(changed);
  const back = settings.fromParams((name) => params[name] ?? null);
  assert.ok(settings.same(back, changed));
  assert.deepEqual(settings.toParams(back), params);
  assert.deepEqual(
    Object.values(settings.toParams(settings.complete())).filter((v) => v !== null),
    [],
  );
});

test("what an address cannot mean is a default", () => {
  const odd = {
    ev: "NaN",
    tone: "<script>",
    mode: "toString",
    max: "-1",
    layout: "",
    split: "9",
    zoom: "0",
    x: "-3",
    y: "Infinity",
  };
  const read = settings.fromParams((name) => odd[name]);
  assert.deepEqual(read, { ...settings.DEFAULTS, split: 1, x: 0 });
});

test("tone maps and error modes go round, and a new map has an automatic maximum", () => {
  let now = settings.complete({ max: 3 });
  const tones = Array.from({ length: 3 }, () => (now = { ...now, ...settings.nextTone(now) }).tone);
  assert.deepEqual(tones, ["gamma22", "falsecolour", "srgb"]);
  assert.equal(now.max, null);
  const modes = Array.from({ length: 5 }, () => (now = { ...now, ...settings.nextMode(now, 1) }).mode);
  assert.deepEqual(modes, ["signed", "absolute", "squared", "relative", "picture"]);
  assert.equal(settings.nextMode(now, -1).mode, "relative");
});

test("maxima step through 1, 2, 5 both ways, and on from any number", () => {
  let max = 0.01;
  const up = Array.from({ length: 7 }, () => (max = settings.nextMax(max, 1)));
  assert.deepEqual(up, [0.02, 0.05, 0.1, 0.2, 0.5, 1, 2]);
  const down = Array.from({ length: 7 }, () => (max = settings.nextMax(max, -1)));
  assert.deepEqual(down, [1, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01]);
  assert.equal(settings.nextMax(0.483, 1), 0.5);
  assert.equal(settings.nextMax(0.483, -1), 0.2);
});

test("exposures are written with their sign", () => {
  assert.deepEqual([0, 1.5, -0.5, -0.001, 2.367].map(settings.signedNumber), ["0", "+1.5", "−0.5", "0", "+2.37"]);
});

// -- pictures ---------------------------------------------------------------------------------------------------------

const row = Array.from({ length: 5 }, (_, i) => ({ key: `${i}`, label: `${i}`, cell: i, width: 10, height: 10 }));
const reference = { ...row[0], key: "r", cell: 9, role: "reference" };

test("the current picture is fetched first, then its reference, then its neighbours", () => {
  const order = wants(row, 3, () => reference).map(({ url }) => Number(/cells\/(\d+)/.exec(url)[1]));
  assert.deepEqual(order, [3, 9, 2, 4, 1, 0]);
  const missing = wants([{ ...row[0], missing: "queued" }], 0, () => null);
  assert.deepEqual(missing, []);
});

test("newer pixels have another address", () => {
  const [before] = wants([{ ...row[0], v: 1 }], 0, () => null);
  const [after] = wants([{ ...row[0], v: 2 }], 0, () => null);
  assert.notEqual(before.url, after.url);
});

test("where nothing can be shown a sentence says why", () => {
  const pixels = plain([ONE, ONE, ONE]);
  const ready = { status: "ready", pixels };
  const none = { picture: null, entry: { status: "waiting" }, pixels: null };
  assert.equal(troubleOf(row[0], ready, pixels, "picture", none), null);
  assert.equal(troubleOf(row[0], ready, pixels, "squared", none).kind, "alone");
  const other = plain([ONE, ONE, ONE], { width: 2, height: 2 });
  const wrong = { picture: reference, entry: { status: "ready", pixels: other }, pixels: other };
  assert.match(troubleOf(row[0], ready, pixels, "squared", wrong).text, /4 × 4, its reference 2 × 2/);
  assert.equal(
    troubleOf({ ...row[0], missing: "No picture yet: queued" }, none.entry, null, "picture", none).text,
    "No picture yet: queued",
  );
});

/** A store whose requests are answered by hand. */
function store({ keep = 1000 } = {}) {
  const asked = new Map();
  const load = (url) =>
    new Promise((done, fail) => asked.set(url, { done: () => done(plain([0, 0, 0], { width: 10, height: 5 })), fail }));
  const pictures = new Pictures(() => {}, { load, keep }); // each is 300 bytes
  const settle = () => new Promise((done) => setImmediate(done));
  return { pictures, asked, settle };
}
const wanted = (...urls) => urls.map((url) => ({ url, bytes: 300 }));

test("few pictures are on their way at a time, in the order of need", async () => {
  const { pictures, asked, settle } = store();
  pictures.want(wanted("a", "b", "c", "d", "e"));
  assert.deepEqual([...asked.keys()], ["a", "b", "c"]);
  asked.get("b").done();
  await settle();
  assert.equal(pictures.get("b").status, "ready");
  assert.equal(pictures.get("d").status, "skipped"); // 1200 bytes would push out what is needed more
  pictures.close();
});

test("what was not used for longest is dropped when memory is full, what is needed stays", async () => {
  const { pictures, asked, settle } = store();
  for (const url of ["a", "b", "c", "d"]) {
    pictures.want(wanted(url));
    asked.get(url).done();
    await settle();
    pictures.want(wanted("a"));
  }
  assert.deepEqual(
    ["a", "b", "c", "d"].map((url) => pictures.get(url).status),
    ["ready", "waiting", "ready", "ready"],
  );
  pictures.close();
});

test("a picture larger than all memory is shown all the same", async () => {
  const { pictures, asked, settle } = store({ keep: 10 });
  pictures.want(wanted("a", "b"));
  asked.get("a").done();
  asked.get("b").done();
  await settle();
  assert.deepEqual(
    ["a", "b"].map((url) => pictures.get(url).status),
    ["ready", "ready"],
  );
  pictures.close();
});

test("a refused picture stays refused until it is asked for again", async () => {
  const { pictures, asked, settle } = store();
  pictures.want(wanted("a"));
  asked.get("a").fail(new Error("no such cell"));
  await settle();
  assert.equal(pictures.get("a").error.message, "no such cell");
  asked.clear();
  pictures.want(wanted("a"));
  assert.equal(asked.size, 0);
  pictures.retry("a");
  asked.get("a").done();
  await settle();
  assert.equal(pictures.get("a").status, "ready");
  pictures.close();
});

test("after closing nothing comes back", async () => {
  const { pictures, asked, settle } = store();
  pictures.want(wanted("a"));
  pictures.close();
  asked.get("a").done();
  await settle();
  assert.equal(pictures.get("a").status, "waiting");
});
