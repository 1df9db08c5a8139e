// @ts-check
/**
 * A picture that may change while one looks at it.
 *
 * It is fetched once it comes near the visible part of the page, and the old picture stays until the new one is decoded, so
 * nothing flashes. While a picture is under way only the newest wish is kept: a preview that is renewed faster than
 * it loads still shows progress.
 */
import { Component, html } from "../../vendor/preact-htm.js";

/** @typedef {{src: string | null, alt: string, sharp?: boolean}} Props sharp: enlarged pixels stay squares */

const MARGIN = "240px"; // fetched before it is seen
const AGAIN_MS = 2500; // after a failure: the server may be away for a moment
const TRIES = 4;

/** @type {WeakMap<Element, (near: boolean) => void>} */
const watched = new WeakMap();
const observer = new IntersectionObserver(
  (entries) => entries.forEach((entry) => watched.get(entry.target)?.(entry.isIntersecting)),
  { rootMargin: MARGIN },
);

/** @extends {Component<Props>} */
export class Picture extends Component {
  /** @type {HTMLElement | null} */
  box = null;
  near = false;
  shown = "";
  tries = 0;
  /** @type {HTMLImageElement | null} */
  loading = null;
  timer = 0;

  /** @override */
  componentDidMount() {
    if (!this.box) return;
    watched.set(this.box, (near) => {
      this.near = near;
      this.#load();
    });
    observer.observe(this.box);
  }

  /** @override @param {Props} next */
  shouldComponentUpdate(next) {
    const { src, alt, sharp } = this.props;
    return next.src !== src || next.alt !== alt || next.sharp !== sharp;
  }

  /** @override @param {Props} before */
  componentDidUpdate(before) {
    if (before.src !== this.props.src) this.tries = 0;
    const image = this.box?.querySelector("img");
    if (image) image.alt = this.props.alt;
    this.#load();
  }

  /** @override */
  componentWillUnmount() {
    if (this.box) observer.unobserve(this.box);
    clearTimeout(this.timer);
    if (this.loading) this.loading.src = ""; // stops the transfer
    this.near = false;
  }

  async #load() {
    const { src, alt } = this.props;
    if (!src) {
      this.shown = "";
      this.box?.replaceChildren();
      return;
    }
    if (!this.near || this.loading || src === this.shown || this.tries >= TRIES) return;
    const image = new Image();
    this.loading = image;
    image.alt = alt;
    image.draggable = false;
    image.src = src;
    const fine = await image.decode().then(
      () => true,
      () => false,
    );
    this.loading = null;
    if (!this.near && !fine) return;
    if (fine && this.props.src) {
      this.shown = src;
      image.alt = this.props.alt;
      this.box?.replaceChildren(image);
    } else if (src === this.props.src) {
      this.tries++;
      clearTimeout(this.timer);
      this.timer = window.setTimeout(() => this.#load(), AGAIN_MS);
      return;
    }
    this.#load();
  }

  /** @override */
  render() {
    const { sharp } = this.props;
    return html`<div
      class=${sharp ? "picture sharp" : "picture"}
      ref=${(/** @type {HTMLElement | null} */ box) => (this.box = box)}
    ></div>`;
  }
}
