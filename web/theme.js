// @ts-check
/**
 * Dark, light, or as the system is: written to `<html data-theme>` before the first paint, remembered in the browser.
 */
import { useEffect, useState } from "./vendor/preact-htm.js";

/** @typedef {"auto" | "dark" | "light"} Choice */

const KEY = "dartboard.theme";
const light = matchMedia("(prefers-color-scheme: light)");
/** @type {Set<() => void>} */
const watchers = new Set();
let choice = stored();

/** @returns {Choice} */
function stored() {
  try {
    const value = localStorage.getItem(KEY);
    return value === "dark" || value === "light" ? value : "auto";
  } catch {
    return "auto"; // storage is blocked: the page works, it just does not remember
  }
}

function apply() {
  document.documentElement.dataset.theme = isDark() ? "dark" : "light";
  watchers.forEach((watcher) => watcher());
}

/** Whether the page is dark now. */
export function isDark() {
  return choice === "auto" ? !light.matches : choice === "dark";
}

/** @param {Choice} next */
export function setTheme(next) {
  choice = next;
  try {
    if (next === "auto") localStorage.removeItem(KEY);
    else localStorage.setItem(KEY, next);
  } catch {
    // not remembered, see `stored`
  }
  apply();
}

/**
 * The choice, what it comes to, and how to change it; redraws on a change.
 * @returns {{choice: Choice, dark: boolean, set: (next: Choice) => void}}
 */
export function useTheme() {
  const [, redraw] = useState(0);
  useEffect(() => {
    const watcher = () => redraw((count) => count + 1);
    watchers.add(watcher);
    return () => void watchers.delete(watcher);
  }, []);
  return { choice, dark: isDark(), set: setTheme };
}

light.addEventListener("change", apply);
apply();
