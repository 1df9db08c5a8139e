// @ts-check
/**
 * What the form of a new experiment holds: pure values, and how they become a query, a grid and a submission.
 *
 * Whatever is typed stays as it was typed: the server says what is wrong with it, beside the field. The query holds
 * only what differs from the form's beginning, so that a link to a form is short.
 */

/** @typedef {import("../../api.js").Submission} Submission */
/** One value of an axis; parameters as they were typed, those that are the default left out. */
/** @typedef {{type: string, parameters: Readonly<Record<string, string>>}} Choice */
/** A file that was sent to the server. @typedef {{name: string, digest: string}} Upload */
/** A scene; `digest` says which upload is meant, built-in scenes have none. */
/** @typedef {{name: string, digest?: string}} SceneChoice */
/** A parameter of the scene and its values, as they were typed; no scenes: all of them. */
/** @typedef {{parameter: string, values: string, scenes: readonly string[]}} Sweep */
/** What pictures are measured against; "" is what each scene has. */
/** @typedef {{wanted: boolean, integrator: string, sampler: string, spp: string}} Reference */
/**
 * @typedef {object} Form
 * @property {string} name
 * @property {readonly SceneChoice[]} scenes
 * @property {readonly Choice[]} samplers
 * @property {readonly Upload[]} points point files that samplers name
 * @property {readonly Choice[]} integrators
 * @property {readonly string[]} spp
 * @property {readonly Sweep[]} sweeps
 * @property {string} replicates
 * @property {string} width "" with `height`: as each scene has it
 * @property {string} height
 * @property {string} depth "": as each scene has it
 * @property {Choice} rfilter of type "": as each scene has it
 * @property {string} colour
 * @property {Reference} reference
 */

/** A small grid that answers a question in a minute or two. @type {Form} */
export const START = {
  name: "",
  scenes: [{ name: "cornell_box" }],
  samplers: ["independent", "stratified", "multijitter"].map(choice),
  points: [],
  integrators: [choice("path")],
  spp: ["4", "16", "64"],
  sweeps: [],
  replicates: "4",
  width: "128",
  height: "128",
  depth: "",
  rfilter: choice(""),
  colour: "rgb",
  reference: { wanted: true, integrator: "", sampler: "", spp: "" },
};

/** `stratified:jitter=false` → a choice. @param {string} text @returns {Choice} */
export function choice(text) {
  const colon = text.indexOf(":");
  if (colon < 0) return { type: text, parameters: {} };
  const pairs = text.slice(colon + 1).split(",").map((pair) => {
    const equals = pair.indexOf("=");
    return equals < 0 ? [pair, ""] : [pair.slice(0, equals), pair.slice(equals + 1)];
  });
  return { type: text.slice(0, colon), parameters: Object.fromEntries(pairs) };
}

/** The way back. @param {Choice} choice */
export function label({ type, parameters }) {
  const pairs = Object.entries(parameters).map(([key, value]) => `${key}=${value}`);
  return type + (pairs.length ? `:${pairs.join(",")}` : "");
}

/** @param {SceneChoice} scene */
const sceneText = ({ name, digest }) => name + (digest ? `@${digest}` : "");

/** @param {string} text @returns {SceneChoice} */
function scene(text) {
  const [, name, digest] = /^(.*)@([0-9a-f]{64})$/.exec(text) ?? [];
  return name === undefined ? { name: text } : { name, digest };
}

/** A sweep as a link holds it; what nobody wrote here is left out. @param {string} text @returns {Sweep[]} */
function sweep(text) {
  try {
    const [parameter = "", values = "", ...scenes] = JSON.parse(text).map(String);
    return [{ parameter, values, scenes }];
  } catch {
    return [];
  }
}

/**
 * Every field of the form as a list of texts, by its name in the query.
 * @param {Form} form @returns {Record<string, readonly string[]>}
 */
function fields(form) {
  const { wanted, integrator, sampler, spp } = form.reference;
  return {
    name: [form.name],
    scene: form.scenes.map(sceneText),
    sampler: form.samplers.map(label),
    points: form.points.map(sceneText),
    integrator: form.integrators.map(label),
    spp: [form.spp.join(",")],
    sweep: form.sweeps.map(({ parameter, values, scenes }) => JSON.stringify([parameter, values, ...scenes])),
    replicates: [form.replicates],
    size: [form.width || form.height ? `${form.width}x${form.height}` : ""],
    depth: [form.depth],
    rfilter: [label(form.rfilter)],
    colour: [form.colour],
    reference: [wanted ? "" : "none"],
    reference_integrator: [integrator],
    reference_sampler: [sampler],
    reference_spp: [spp],
  };
}

/**
 * The form as the values of the query; null where it is as it began, [""] where a list is empty.
 * @param {Form} form @returns {Record<string, readonly string[] | null>}
 */
export function toQuery(form) {
  const begun = fields(START);
  const now = Object.entries(fields(form)).map(([key, values]) => {
    const same = JSON.stringify(values) === JSON.stringify(begun[key]);
    return [key, same ? null : values.length ? values : [""]];
  });
  return Object.fromEntries(now);
}

/** @param {URLSearchParams} params @returns {Form} */
export function fromQuery(params) {
  const begun = fields(START);
  /** @param {string} key */
  const all = (key) => (params.has(key) ? params.getAll(key) : (begun[key] ?? [])).filter((text) => text !== "");
  /** @param {string} key */
  const one = (key) => (params.has(key) ? params.get(key) : begun[key]?.[0]) ?? "";
  const [width = "", height = ""] = one("size").split("x");
  return {
    name: one("name"),
    scenes: all("scene").map(scene),
    samplers: all("sampler").map(choice),
    points: all("points").map(scene).flatMap(({ name, digest }) => (digest ? [{ name, digest }] : [])),
    integrators: all("integrator").map(choice),
    spp: one("spp").split(",").filter(Boolean),
    sweeps: all("sweep").flatMap(sweep),
    replicates: one("replicates"),
    width,
    height,
    depth: one("depth"),
    rfilter: choice(one("rfilter")),
    colour: one("colour"),
    reference: {
      wanted: one("reference") !== "none",
      integrator: one("reference_integrator"),
      sampler: one("reference_sampler"),
      spp: one("reference_spp"),
    },
  };
}

/** A number where one was typed, else the text, for the server to say what is wrong with it. @param {string} text */
function value(text) {
  const trimmed = text.trim();
  return /^-?\d{1,15}(\.\d+)?$/.test(trimmed) ? Number(trimmed) : trimmed;
}

/** Numbers and colours, `10, 100` or `[0.8, 0.2, 0.1], 0.5`; else texts, for the server to say what is wrong. @param {string} text */
export function sweptValues(text) {
  try {
    return JSON.parse(`[${text}]`);
  } catch {
    return text.split(/[\s,;]+/).filter(Boolean).map(value);
  }
}

/** The grid that the form asks for, as the server reads it. @param {Form} form */
export function toSubmission(form) {
  const { reference } = form;
  const asked = Object.entries(reference).filter(([key, text]) => key !== "wanted" && text !== "");
  const grid = {
    name: form.name.trim() || suggestedName(form),
    scenes: form.scenes.map(({ name }) => name),
    samplers: form.samplers.map(label),
    integrators: form.integrators.map(label),
    spp: form.spp.map(value),
    ...(form.sweeps.length > 0 && {
      sweep: form.sweeps.map(({ parameter, values, scenes }) => ({
        parameter,
        values: sweptValues(values),
        ...(scenes.length > 0 && { scenes }),
      })),
    }),
    ...(form.replicates !== "" && { replicates: value(form.replicates) }),
    ...((form.width !== "" || form.height !== "") && { resolution: [value(form.width), value(form.height)] }),
    ...(form.depth !== "" && { max_depth: value(form.depth) }),
    ...(form.rfilter.type !== "" && { rfilter: label(form.rfilter) }),
    colour: form.colour,
    reference: reference.wanted
      ? Object.fromEntries(asked.map(([key, text]) => [key, key === "spp" ? value(String(text)) : text]))
      : false,
  };
  return { grid, origin: "the form", scenes: uploads(form.scenes), points: uploads(form.points) };
}

/** @param {readonly SceneChoice[]} files @returns {Record<string, string>} */
export function uploads(files) {
  return Object.fromEntries(files.flatMap(({ name, digest }) => (digest ? [[name, digest]] : [])));
}

const MAX_NAME = 120; // characters that a list still shows whole

/** A name that says what is compared, for who gives none. @param {Form} form */
export function suggestedName({ samplers, integrators, scenes }) {
  const axis = samplers.length > 1 || integrators.length <= 1 ? samplers : integrators;
  const compared = list(axis.map(label)) || "Nothing";
  const name = `${compared} on ${list(scenes.map((scene) => scene.name)) || "no scene"}`;
  if (name.length <= MAX_NAME) return name;
  return `${axis.length} ${axis === samplers ? "samplers" : "integrators"} on ${scenes.length} scenes`;
}

/** "a, b and c". @param {readonly string[]} words */
function list(words) {
  return words.length < 2 ? words.join() : `${words.slice(0, -1).join(", ")} and ${words.at(-1)}`;
}
