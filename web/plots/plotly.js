// @ts-check
/**
 * The vendored Plotly, loaded when the page has nothing better to do, at the latest when the first plot is about to be
 * seen: it is most of what the page weighs.
 */

/** @type {Promise<Plotly.Static> | null} */
let loading = null;

/** Rejects where the script cannot be fetched; the next call tries again. @returns {Promise<Plotly.Static>} */
export function plotly() {
  loading ??= new Promise((resolve, reject) => {
    const script = document.createElement("script");
    script.src = new URL("../vendor/plotly-basic.min.js", import.meta.url).href;
    // Its first plot is another task: starting the library alone takes a tenth of a second.
    script.onload = () => setTimeout(() => (window.Plotly ? resolve(window.Plotly) : reject(new Error("the plotting library did not start"))));
    script.onerror = () => {
      loading = null;
      script.remove();
      reject(new Error("the plotting library could not be loaded from the server"));
    };
    document.head.append(script);
  });
  return loading;
}
