// @ts-check
/**
 * The curves of an experiment, fetched when they are looked at and again when cells have changed since, but never more than
 * every two seconds: the service reads all points of a metric for it.
 */
import { useEffect, useRef, useState } from "../../vendor/preact-htm.js";
import { experiments, Unreachable } from "../../api.js";

/** @typedef {import("../../api.js").Convergence} Convergence */

const EVERY_MS = 2000;

/**
 * The newest curves there are; while those of another metric or scene are under way, the old ones with `stale`. `revision`
 * is the service's: curves that are as new are not fetched again.
 * @param {number} id @param {{metric: string, scene: string, revision: number, near: boolean}} wanted
 * @returns {{convergence: Convergence | null, stale: boolean, error: Error | null}}
 */
export function useCurves(id, { metric, scene, revision, near }) {
  const key = `${metric}\n${scene}`;
  const [found, setFound] = useState({ key: "", asked: -1, convergence: /** @type {Convergence | null} */ (null) });
  const [error, setError] = useState(/** @type {Error | null} */ (null));
  const [answers, setAnswers] = useState(0);
  const asked = useRef({ key: "", time: -EVERY_MS, busy: false });

  useEffect(() => {
    const other = asked.current.key !== key;
    // A revision that falls is another database's, in which these curves never were.
    const same = found.key === key && found.asked <= revision;
    const there = same && found.convergence !== null && found.convergence.revision >= revision;
    if (!near || there || (asked.current.busy && !other)) return;
    const wait = other ? 0 : Math.max(0, asked.current.time + EVERY_MS - performance.now());
    const timer = setTimeout(async () => {
      asked.current = { key, time: performance.now(), busy: true };
      try {
        const convergence = await experiments.convergence(id, { metric, scene });
        if (asked.current.key !== key) return; // another was asked for meanwhile
        setFound({ key, asked: revision, convergence });
        setError(null);
      } catch (problem) {
        if (asked.current.key !== key) return;
        if (!(problem instanceof Unreachable)) setError(/** @type {Error} */ (problem));
      }
      asked.current.busy = false;
      setAnswers((count) => count + 1);
    }, wait);
    return () => clearTimeout(timer);
  }, [id, key, revision, near, answers, found]);

  return { convergence: found.convergence, stale: found.key !== key, error };
}
