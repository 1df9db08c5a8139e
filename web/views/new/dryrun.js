// @ts-check
/**
 * What a grid would render and cost, asked again a moment after it changed. The answer before stays until then, marked
 * as stale, so that nothing jumps while somebody types.
 */
import { useEffect, useState } from "../../vendor/preact-htm.js";
import { ApiProblem, experiments, Unreachable } from "../../api.js";

/** @typedef {import("../../api.js").DryRun} DryRun */
/** @typedef {import("../../api.js").Fault} Fault */
/** @typedef {import("../../api.js").Submission} Submission */
/** @typedef {{result: DryRun | null, faults: readonly Fault[], stale: boolean}} Estimate */
/** To the submission `of`. @typedef {{of: string, result: DryRun | null, faults: readonly Fault[]}} Answer */

const PAUSE_MS = 300;
const RETRY_MS = 2000;

/** @param {Submission | null} submission null: nothing to ask yet @returns {Estimate} */
export function useDryRun(submission) {
  const [answer, setAnswer] = useState(/** @type {Answer} */ ({ of: "", result: null, faults: [] }));
  const asked = JSON.stringify(submission);
  useEffect(() => {
    if (!submission) return undefined;
    const control = new AbortController();
    /** @type {number | undefined} */
    let timer;
    async function ask() {
      try {
        const result = await experiments.dryRun(/** @type {Submission} */ (submission), control.signal);
        setAnswer({ of: asked, result, faults: [] });
      } catch (error) {
        if (control.signal.aborted) return;
        if (error instanceof Unreachable) timer = window.setTimeout(ask, RETRY_MS);
        else setAnswer((before) => ({ of: asked, result: before.result, faults: faultsOf(error) }));
      }
    }
    timer = window.setTimeout(ask, PAUSE_MS);
    return () => {
      control.abort();
      clearTimeout(timer);
    };
  }, [asked]);
  if (!submission) return { result: null, faults: [], stale: false };
  return { result: answer.result, faults: answer.faults, stale: answer.of !== asked };
}

/** What an error says is wrong, sentence by sentence. @param {unknown} error @returns {readonly Fault[]} */
export function faultsOf(error) {
  if (error instanceof ApiProblem && error.problem.problems?.length) return error.problem.problems;
  return [{ detail: error instanceof Error ? error.message : String(error), field: null }];
}
