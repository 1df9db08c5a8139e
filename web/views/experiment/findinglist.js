// @ts-check
/** The findings, each with the way to what it is about; what is more than a few can be unfolded. */
import { html } from "../../vendor/preact-htm.js";

/** @typedef {import("./findings.js").Finding} Finding */
/** @typedef {{onCell: (position: number) => void, onFilter: (words: string) => void}} Ways */

const FEW = 4;

/** @param {{findings: readonly Finding[]} & Ways} props */
export function Findings({ findings, onCell, onFilter }) {
  if (!findings.length) return null;
  const shown = findings.length > FEW + 1 ? FEW : findings.length;
  const rest = findings.slice(shown);
  /** @param {Finding} finding */
  const one = (finding) => html`<${One} key=${finding.text} finding=${finding} onCell=${onCell} onFilter=${onFilter} />`;
  return html`<section class="findings" aria-label="Findings">
    <ul>${findings.slice(0, shown).map(one)}</ul>
    ${rest.length > 0 &&
    html`<details>
      <summary>${rest.length} more findings</summary>
      <ul>${rest.map(one)}</ul>
    </details>`}
  </section>`;
}

/** @param {{finding: Finding} & Ways} props */
function One({ finding: { kind, text, cell, filter }, onCell, onFilter }) {
  return html`<li data-kind=${kind}>
    <span>${text}</span>
    ${cell !== undefined && html`<button class="link" onClick=${() => onCell(cell)}>${kind === "bad" ? "log" : "show"}</button>`}
    ${filter !== undefined && html`<button class="link" onClick=${() => onFilter(filter)}>in the table</button>`}
  </li>`;
}
