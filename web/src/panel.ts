// The panel: figures of the file, where its bytes are, modes.

import { element, fillRows, input, part } from "./page";
import type { Player } from "./player";
import { mostModes, type Reel } from "./facts";

export class Panel {
  private readonly modes = input("modes");
  private shownModes = 0;

  constructor(
    private readonly player: Player,
    private readonly reel: Reel,
  ) {
    const missing: [string, string][] = reel.is_whole
      ? []
      : [["end", "missing: the file was cut off"]];
    fillRows(part("rows"), [...reel.rows, ...missing]);
    fillBudget(reel.budget);
    const hasModes = reel.file.info.method === "reel";
    for (const one of document.querySelectorAll<HTMLElement>(".of-modes")) one.hidden = !hasModes;
    this.modes.max = String(mostModes(reel));
    this.modes.addEventListener("input", () => player.setModes(Number(this.modes.value)));
  }

  update(): void {
    const { modes } = this.player.state();
    if (modes === this.shownModes) return;
    this.shownModes = modes;
    this.modes.value = String(modes);
    part("modes-label").textContent = this.modesText;
  }

  /** How many modes are shown, in words. */
  get modesText(): string {
    const [{ modes }, most] = [this.player.state(), mostModes(this.reel)];
    return modes < most ? `first ${modes} of ${most} modes` : `all ${most} modes`;
  }
}

/** Bytes with three digits that count and a unit. */
export function bytesText(bytes: number): string {
  if (bytes < 1000) return `${bytes} B`;
  const [unit, name] = bytes < 1e6 ? [1e3, "kB"] : bytes < 1e9 ? [1e6, "MB"] : [1e9, "GB"];
  return `${(bytes / unit).toFixed(1)} ${name}`;
}

function fillBudget(budget: [string, number][]): void {
  const total = budget.reduce((sum, [, bytes]) => sum + bytes, 0) || 1;
  const most = budget.reduce((largest, [, bytes]) => Math.max(largest, bytes), 1);
  part("budget").replaceChildren(
    ...budget.map(([name, bytes]) => {
      const [item, bar] = [element("li"), element("i")];
      bar.style.width = `${(100 * bytes) / most}%`;
      const share = `${bytesText(bytes)}, ${((100 * bytes) / total).toFixed(1)} %`;
      item.append(element("span", name), element("b", share), bar);
      return item;
    }),
  );
}
