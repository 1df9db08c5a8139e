// @ts-check
/**
 * A value that changes with every move of the pointer: who listens redraws, the rest of the viewer does not.
 */
import { useEffect, useState } from "../vendor/preact-htm.js";

/** @template T */
export class Signal {
  /** @param {T} value */
  constructor(value) {
    this.value = value;
    /** @type {Set<() => void>} */
    this.listeners = new Set();
  }

  /** @param {T} value */
  set(value) {
    this.value = value;
    this.listeners.forEach((listener) => listener());
  }

  /** @param {() => void} listener @returns {() => void} ends it */
  listen(listener) {
    this.listeners.add(listener);
    return () => void this.listeners.delete(listener);
  }
}

/** The value, in a component that redraws when it changes. @template T @param {Signal<T>} signal @returns {T} */
export function useSignal(signal) {
  const [value, set] = useState(signal.value);
  useEffect(() => signal.listen(() => set(() => signal.value)), [signal]);
  return value;
}
