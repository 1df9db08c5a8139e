// @ts-check
/**
 * The part of the viewer that shows pictures: panes and strip as elements, and the two canvases that draw into them.
 *
 * One canvas lies under all boxes and shows pictures (WebGL), one lies over them and shows values and the linked cross.
 * Boxes are measured when a frame is drawn (`boxes.js`), so the layout is CSS alone.
 */
import { html, useCallback, useEffect, useLayoutEffect, useRef, useState } from "../vendor/preact-htm.js";
import { boxOf, drawingsOf, fitted, inner, viewOf } from "./boxes.js";
import { attachGestures } from "./gestures.js";
import { Painter } from "./gl.js";
import { bestColumns, place, toPicture } from "./maths.js";
import { drawOverlay } from "./overlay.js";
import { Pane, Tile, Wipe } from "./panes.js";

/** @typedef {import("../vendor/preact-htm.js").VNode} VNode */
/** @typedef {import("./maths.js").Size} Size */
/** @typedef {import("./maths.js").Spot} Spot */
/** @typedef {import("./seen.js").Seen} Seen */
/** @typedef {import("./settings.js").ViewerSettings} ViewerSettings */
/** @typedef {{id: string} & Spot} Hover  what the pointer is on: a box, and fractions of its picture */
/**
 * @typedef {object} StageProps
 * @property {readonly Seen[]} panes   large boxes; in a wipe the picture and then its reference, in one pane
 * @property {readonly Seen[]} tiles   the strip
 * @property {Seen} current            the large box that the zoom of the settings belongs to
 * @property {boolean} flipped         the reference is shown instead
 * @property {ViewerSettings} settings @property {number} max
 * @property {import("./viewer.js").ViewerProps["metric"]} metric
 * @property {number} best             index of the lowest error
 * @property {import("./signal.js").Signal<Hover | null>} hover
 * @property {(change: Partial<ViewerSettings>) => void} change
 * @property {(index: number) => void} pick   −1: the reference
 * @property {(url: string) => void} onRetry
 * @property {(update: (before: Size) => Size) => void} onBox  how large the current pane is
 */

const CAPTION = 34; // CSS pixels; as --viewer-caption in viewer.css

/** @param {StageProps} props @returns {VNode} */
export function Stage(props) {
  const body = useRef(/** @type {HTMLDivElement | null} */ (null));
  const under = useRef(/** @type {HTMLCanvasElement | null} */ (null));
  const over = useRef(/** @type {HTMLCanvasElement | null} */ (null));
  const painter = useRef(/** @type {Painter | null} */ (null));
  const latest = useRef(props);
  latest.current = props;
  const frame = useRef({ id: 0, pictures: false });
  const pointed = useRef(/** @type {Spot | null} */ (null)); // where the pointer is over the pictures
  const gestures = useRef(host(latest, pointed));
  const [failure, setFailure] = useState(/** @type {string | null} */ (null));
  const [area, setArea] = useState({ width: 0, height: 0 });
  const { panes, tiles, current, flipped, settings, metric, best, hover, change, pick, onRetry, onBox } = props;

  const schedule = useCallback((/** @type {boolean} */ pictures) => {
    frame.current.pictures ||= pictures;
    frame.current.id ||= requestAnimationFrame(() => {
      const all = frame.current.pictures;
      frame.current = { id: 0, pictures: false };
      if (body.current && under.current && over.current) {
        draw(body.current, under.current, over.current, all ? painter.current : null, latest.current);
      }
    });
  }, []);

  useLayoutEffect(() => {
    if (!body.current || !under.current) return;
    try {
      painter.current = new Painter(under.current, (lost) => {
        setFailure(lost ? "The graphics driver took the picture away; waiting to get it back …" : null);
        schedule(true);
      });
    } catch (error) {
      setFailure(`${error instanceof Error ? error.message : error}. The image grid works without.`);
    }
    const element = body.current;
    const resized = new ResizeObserver(() => {
      const stage = element.querySelector(".viewer-panes")?.getBoundingClientRect();
      if (stage) setArea({ width: stage.width, height: stage.height });
      schedule(true);
    });
    resized.observe(element);
    const moved = () => schedule(true);
    element.addEventListener("scroll", moved, { capture: true, passive: true });
    const theme = new MutationObserver(moved);
    theme.observe(document.documentElement, { attributeFilter: ["data-theme"] });
    const ended = [hover.listen(() => schedule(false)), attachGestures(element, gestures.current)];
    return () => {
      ended.forEach((end) => end());
      resized.disconnect();
      theme.disconnect();
      cancelAnimationFrame(frame.current.id);
      painter.current?.close();
    };
  }, []);

  useLayoutEffect(() => {
    const box = body.current && boxOf(body.current, current.id);
    const { width, height } = inner(box ?? area);
    onBox((before) => (before.width === width && before.height === height ? before : { width, height }));
    if (pointed.current) {
      // The picture may have moved under a pointer that rests.
      const spot = pointed.current;
      const pane = gestures.current.paneAt(document.elementFromPoint(spot.x, spot.y));
      if (pane) gestures.current.hover({ pane, spot });
    }
    schedule(true);
  });

  const wipe = settings.layout === "wipe" && panes.length === 2 && !flipped;
  const move = (/** @type {number} */ split) => change({ split });
  const columns = wipe ? 1 : bestColumns(panes.length, current.size, area, CAPTION);
  return html`<div class="viewer-body" ref=${body}>
    <canvas class="viewer-canvas" ref=${under} aria-hidden="true"></canvas>
    <div class="viewer-panes" data-layout=${settings.layout} style=${{ gridTemplateColumns: `repeat(${columns}, minmax(0, 1fr))` }}>
      ${(wipe ? panes.slice(0, 1) : panes).map(
        (seen) => html`<${Pane}
          key=${seen.id} seen=${seen} right=${wipe ? panes[1] : undefined} metric=${metric} best=${seen.index === best}
          current=${panes.length > 1 && !wipe && seen.id === current.id} onRetry=${onRetry}
        >${wipe && html`<${Wipe} split=${settings.split} onSplit=${move} />`}<//>`,
      )}
    </div>
    ${
      tiles.length > 0 &&
      html`<nav class="viewer-strip" aria-label="Pictures">
      ${tiles.map(
        (seen) => html`<${Tile}
          key=${seen.id} seen=${seen} metric=${metric} best=${seen.index === best}
          pressed=${flipped ? seen.index < 0 : seen.index === current.index} onPick=${() => pick(seen.index)}
        />`,
      )}
    </nav>`
    }
    <canvas class="viewer-canvas viewer-over" ref=${over} aria-hidden="true"></canvas>
    ${failure && html`<div class="viewer-failure" role="alert"><p>${failure}</p></div>`}
  </div>`;
}

/**
 * What gestures may ask and change.
 * @param {{current: StageProps}} latest @param {{current: Spot | null}} pointed @returns {import("./gestures.js").Host}
 */
function host(latest, pointed) {
  const seenBy = (/** @type {string} */ id) => latest.current.panes.find((seen) => seen.id === id);
  return {
    paneAt(target) {
      const element = target instanceof Element ? target.closest(".viewer-picture[data-view]") : null;
      const id = element?.getAttribute("data-view");
      const seen = id ? seenBy(id) : undefined;
      if (!element || !seen || (target instanceof Element && target.closest("button"))) return null;
      const { x, y, width, height } = element.getBoundingClientRect();
      return { id: seen.id, element, size: seen.size, box: fitted({ x, y, width, height }) };
    },
    view({ id, box }) {
      const { settings, current } = latest.current;
      const seen = seenBy(id) ?? current;
      return viewOf(settings, current, box, seen, box, false);
    },
    setView({ id }, { zoom, x, y }) {
      const { change, current } = latest.current;
      const size = (seenBy(id) ?? current).size;
      change({ zoom: zoom === null ? null : (zoom * size.width) / current.size.width, x, y });
    },
    hover(at) {
      const { settings, current, hover } = latest.current;
      pointed.current = at && at.spot;
      let next = null;
      if (at) {
        const { id, size, box } = at.pane;
        const view = viewOf(settings, current, box, seenBy(id) ?? current, box, false);
        const spot = toPicture(place(view, size, box, devicePixelRatio), at.spot);
        if (spot.x >= 0 && spot.y >= 0 && spot.x < size.width && spot.y < size.height) {
          next = { id, x: spot.x / size.width, y: spot.y / size.height };
        }
      }
      const { value } = hover;
      if (next?.id !== value?.id || next?.x !== value?.x || next?.y !== value?.y) hover.set(next);
    },
    tap(id) {
      const seen = seenBy(id);
      if (seen && seen.index >= 0 && latest.current.settings.layout === "side") latest.current.pick(seen.index);
    },
  };
}

/**
 * @param {HTMLElement} body @param {HTMLCanvasElement} under @param {HTMLCanvasElement} over
 * @param {Painter | null} painter null: only what lies over the pictures @param {StageProps} props
 */
function draw(body, under, over, painter, props) {
  const ratio = devicePixelRatio;
  const whole = body.getBoundingClientRect();
  const { width, height } = whole;
  for (const canvas of painter ? [under, over] : [over]) {
    const size = [Math.round(width * ratio), Math.round(height * ratio)];
    if (canvas.width !== size[0] || canvas.height !== size[1])
      [canvas.width, canvas.height] = /** @type {[number, number]} */ (size);
  }
  const { hover } = props;
  const drawings = drawingsOf(body, whole, ratio, props);
  painter?.paint(drawings, ratio);
  const context = over.getContext("2d");
  if (!context) return;
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  const style = getComputedStyle(body);
  drawOverlay(context, whole, drawings, hover.value, {
    line: style.getPropertyValue("--line"),
    mono: style.getPropertyValue("--mono") || "monospace",
  });
}
