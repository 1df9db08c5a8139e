// @ts-check
/**
 * The TOML that the server writes for a grid, read back for the form. Not all of TOML: what is unknown here gives null,
 * and the text itself is edited instead.
 */

/** @typedef {Record<string, unknown>} Table */

/** Keys, texts, numbers and the signs between them; a comment or space between tokens is skipped. */
const TOKEN = /[ \t]*(?:#[^\n]*)?(?:("(?:[^"\\\n]|\\.)*")|([A-Za-z0-9_+.-]+)|([[\]{}=,]|\r?\n))/y;

/** The tables of a text, null where it uses what this does not read. @param {string} text @returns {Table | null} */
export function readToml(text) {
  try {
    return new Reader(`${text.trimEnd()}\n`).document();
  } catch {
    return null;
  }
}

class Reader {
  /** @param {string} text */
  constructor(text) {
    /** @type {string[]} */
    this.tokens = [];
    this.at = 0;
    TOKEN.lastIndex = 0;
    while (TOKEN.lastIndex < text.length) {
      const found = TOKEN.exec(text);
      if (!found) throw new SyntaxError("a sign that is not read here");
      this.tokens.push((found[1] ?? found[2] ?? found[3] ?? "").replace("\r", ""));
    }
  }

  get next() {
    return this.tokens[this.at];
  }

  /** @param {string} [wanted] */
  take(wanted) {
    const token = this.tokens[this.at++];
    if (token === undefined || token !== (wanted ?? token)) throw new SyntaxError(`${wanted} is missing`);
    return token;
  }

  /** @returns {Table} */
  document() {
    /** @type {Table} */
    const root = {};
    let table = root;
    while (this.next !== undefined) {
      if (this.next === "\n") this.take();
      else if (this.next === "[") table = this.header(root);
      else {
        this.pair(table);
        this.take("\n");
      }
    }
    return root;
  }

  /** `[[sweep]]`: one more table of a list. @param {Table} root @returns {Table} */
  item(root) {
    this.take("[");
    const key = this.take();
    this.take("]");
    this.take("]");
    this.take("\n");
    const list = Object.hasOwn(root, key) ? root[key] : (root[key] = []);
    if (!Array.isArray(list) || !/^[A-Za-z0-9_-]+$/.test(key)) throw new SyntaxError(`${key} is no list of tables`);
    /** @type {Table} */
    const table = {};
    list.push(table);
    return table;
  }

  /** `[scene."glass"]`: the table that the following pairs belong to. @param {Table} root @returns {Table} */
  header(root) {
    this.take("[");
    if (this.next === "[") return this.item(root);
    let table = root;
    for (let key = this.take(); key !== "]"; key = this.take()) {
      for (const part of key.startsWith('"') ? [JSON.parse(key)] : key.split(".").filter(Boolean)) {
        const inner = Object.hasOwn(table, part) ? table[part] : (table[part] = {});
        if (typeof inner !== "object" || Array.isArray(inner)) throw new SyntaxError(`${part} is no table`);
        table = /** @type {Table} */ (inner);
      }
    }
    this.take("\n");
    return table;
  }

  /** @param {Table} table */
  pair(table) {
    const key = this.take();
    if (!/^[A-Za-z0-9_-]+$/.test(key)) throw new SyntaxError("a key that is not read here");
    this.take("=");
    table[key] = this.value();
  }

  /** @returns {unknown} */
  value() {
    const token = this.take();
    if (token === "[") return this.list();
    if (token === "{") return this.inline();
    if (token.startsWith('"')) return JSON.parse(token);
    if (token === "true" || token === "false") return token === "true";
    const number = Number(token.replaceAll("_", ""));
    if (Number.isNaN(number)) throw new SyntaxError(`${token} is not read here`);
    return number;
  }

  /** @returns {unknown[]} */
  list() {
    const values = [];
    for (;;) {
      while (this.next === "\n" || this.next === ",") this.take();
      if (this.next === "]") break;
      values.push(this.value());
    }
    this.take("]");
    return values;
  }

  /** @returns {Table} */
  inline() {
    /** @type {Table} */
    const table = {};
    while (this.next !== "}") {
      this.pair(table);
      if (this.next === ",") this.take();
    }
    this.take("}");
    return table;
  }
}
