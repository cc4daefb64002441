// The panel: file properties, sizes of its parts, and modes.

import { createElement, fillRows, inputById, byId } from "./page.js";
import type { Player } from "./player.js";
import { maxModes, type Reel } from "./facts.js";

export class Panel {
  private readonly modes = inputById("modes");
  private shownModes = 0;

  constructor(
    private readonly player: Player,
    private readonly reel: Reel,
  ) {
    const missing: [string, string][] = reel.is_whole
      ? []
      : [["end", "missing: the file is truncated"]];
    fillRows(byId("rows"), [...reel.rows, ...missing]);
    fillBudget(reel.budget);
    const hasModes = reel.file.info.method === "reel";
    for (const one of document.querySelectorAll<HTMLElement>(".of-modes")) one.hidden = !hasModes;
    this.modes.max = String(maxModes(reel));
    this.modes.addEventListener("input", () => player.setModes(Number(this.modes.value)));
  }

  update(): void {
    const { modes } = this.player.state();
    if (modes === this.shownModes) return;
    this.shownModes = modes;
    this.modes.value = String(modes);
    byId("modes-label").textContent = this.modesText;
  }

  /** Describe how many modes are shown. */
  get modesText(): string {
    const [{ modes }, most] = [this.player.state(), maxModes(this.reel)];
    return modes < most ? `first ${modes} of ${most} modes` : `all ${most} modes`;
  }
}

/** Format a size in bytes with one decimal place and a unit. */
export function formatBytes(bytes: number): string {
  if (bytes < 1000) return `${bytes} B`;
  const [unit, name] = bytes < 1e6 ? [1e3, "kB"] : bytes < 1e9 ? [1e6, "MB"] : [1e9, "GB"];
  return `${(bytes / unit).toFixed(1)} ${name}`;
}

function fillBudget(budget: [string, number][]): void {
  const total = budget.reduce((sum, [, bytes]) => sum + bytes, 0) || 1;
  const maxBytes = budget.reduce((largest, [, bytes]) => Math.max(largest, bytes), 1);
  byId("budget").replaceChildren(
    ...budget.map(([name, bytes]) => {
      const [item, bar] = [createElement("li"), createElement("i")];
      bar.style.width = `${(100 * bytes) / maxBytes}%`;
      const share = `${formatBytes(bytes)}, ${((100 * bytes) / total).toFixed(1)} %`;
      item.append(createElement("span", name), createElement("b", share), bar);
      return item;
    }),
  );
}
