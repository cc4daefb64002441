// The panel: file properties, and sizes of its parts.

import { createElement } from "../player/dom.js";
import { fillRows, byId } from "./page.js";
import type { Reel } from "./facts.js";

/** Fill the panel with the properties of a file. */
export function fillPanel({ rows, budget }: Reel): void {
  fillRows(byId("rows"), rows);
  byId("budget-title").hidden = budget.length === 0; // of a damaged file
  fillBudget(budget);
}

/** Format a size in bytes with one decimal place and a unit. */
function formatBytes(bytes: number): string {
  if (bytes < 1000) return `${bytes} B`;
  const [unit, name] = bytes < 1e6 ? [1e3, "kB"] : bytes < 1e9 ? [1e6, "MB"] : [1e9, "GB"];
  return `${(bytes / unit).toFixed(1)} ${name}`;
}

function fillBudget(budget: [string, number][]): void {
  const total = budget.reduce((sum, [, bytes]) => sum + bytes, 0) || 1;
  const maxBytes = budget.reduce((largest, [, bytes]) => Math.max(largest, bytes), 1);
  byId("budget").replaceChildren(
    ...budget.map(([name, bytes]) => {
      const [item, bar] = [createElement("li", ""), createElement("i", "")];
      bar.style.width = `${(100 * bytes) / maxBytes}%`;
      const share = `${formatBytes(bytes)}, ${((100 * bytes) / total).toFixed(1)} %`;
      item.append(createElement("span", "", name), createElement("b", "", share), bar);
      return item;
    }),
  );
}
