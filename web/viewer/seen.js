// @ts-check
/**
 * Which picture is seen in which box: the row of pictures, their references and the layout become a list of boxes.
 *
 * Pure. Every box has at most one picture and, to compare with, at most one reference.
 */
import { pixelsUrl } from "../api.js";
import { comparable } from "./looks.js";

/** @typedef {import("./pictures.js").Entry} Entry */
/** @typedef {import("./pictures.js").Pixels} Pixels */
/** @typedef {import("./pictures.js").Want} Want */
/** @typedef {import("./settings.js").Layout} Layout */
/** @typedef {import("./settings.js").Mode} Mode */
/** @typedef {import("./viewer.js").ViewerPicture} ViewerPicture */
/**
 * @typedef {object} Seen  a box and its picture
 * @property {string} id
 * @property {number} index  place in the row from 0; −1 for a reference
 * @property {ViewerPicture} picture
 * @property {import("./maths.js").Size} size
 * @property {Pixels | null} pixels
 * @property {Pixels | null} reference to compare with, where there is one of the same size
 * @property {Mode} mode
 * @property {Trouble | null} trouble instead of a picture
 */
/** @typedef {{text: string, kind: "wait" | "missing" | "alone" | "failed" | "skipped", url?: string}} Trouble */

/**
 * Where a picture's pixels are; null while there are none.
 * @param {ViewerPicture | null | undefined} picture @returns {string | null}
 */
export function urlOf(picture) {
  if (!picture || picture.missing) return null;
  const url = pixelsUrl(picture.cell, { role: picture.role, k: picture.k });
  if (picture.v === undefined) return url;
  return `${url}${url.includes("?") ? "&" : "?"}v=${encodeURIComponent(picture.v)}`;
}

/**
 * What to fetch, most needed first: the current picture, its reference, then the others by distance.
 * @param {readonly ViewerPicture[]} row @param {number} index
 * @param {(picture: ViewerPicture) => ViewerPicture | null} referenceOf @returns {Want[]}
 */
export function wants(row, index, referenceOf) {
  const current = row[index];
  const others = row.map((picture, i) => ({ picture, away: Math.abs(i - index) })).sort((a, b) => a.away - b.away);
  const order = current ? [current, referenceOf(current), ...others.map(({ picture }) => picture)] : [];
  order.push(...others.map(({ picture }) => referenceOf(picture)));
  const wanted = new Map();
  for (const picture of order) {
    const url = urlOf(picture);
    if (url && picture && !wanted.has(url)) wanted.set(url, { url, bytes: picture.width * picture.height * 6 });
  }
  return [...wanted.values()];
}

/**
 * Why there is no picture to draw, in a sentence; null where there is one.
 * @param {ViewerPicture} picture @param {Entry} entry @param {Pixels | null} pixels @param {Mode} mode
 * @param {{picture: ViewerPicture | null, entry: Entry, pixels: Pixels | null}} other the reference
 * @returns {Trouble | null}
 */
export function troubleOf(picture, entry, pixels, mode, other) {
  if (!pixels) return absent(picture, entry, picture.label);
  if (mode === "picture") return null;
  if (!other.picture)
    return { kind: "alone", text: "There is no reference to compare with. Press t to see the picture." };
  if (!other.pixels) return absent(other.picture, other.entry, "the reference");
  if (comparable(pixels, other.pixels)) return null;
  const size = (/** @type {Pixels} */ p) => `${p.width} × ${p.height}`;
  return {
    kind: "alone",
    text: `The picture is ${size(pixels)}, its reference ${size(other.pixels)}: there is no difference pixel by pixel.`,
  };
}

/** @param {ViewerPicture} picture @param {Entry} entry @param {string} name @returns {Trouble} */
function absent(picture, entry, name) {
  if (picture.missing) return { kind: "missing", text: picture.missing };
  const url = urlOf(picture) ?? undefined;
  if (entry.status === "failed") return { kind: "failed", text: entry.error.message, url };
  const megabytes = Math.ceil((picture.width * picture.height * 6) / 1e6);
  if (entry.status === "skipped")
    return { kind: "skipped", text: `Not loaded: ${megabytes} MB, and memory is full`, url };
  return { kind: "wait", text: `Loading ${name} …` };
}
