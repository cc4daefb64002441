// Which mesh is which, written over the views.

import { element, part } from "./page";
import type { Arrangement } from "./picture";

export class Labels {
  private shown = "";

  /**
   * At the top middle of each view; `isUpright` where views lie below each other, `lacks` where the
   * original has not the track that colours the other.
   */
  update(arrangement: Arrangement, isUpright: boolean, lacks: boolean): void {
    const key = `${arrangement} ${isUpright} ${lacks}`;
    if (key === this.shown) return;
    this.shown = key;
    const texts = {
      decoded: [],
      beside: ["decoded", lacks ? "original, which lacks these values" : "original"],
      over: ["decoded", "original, as lines"],
    }[arrangement];
    const isBelow = arrangement === "beside" && isUpright;
    part("labels").replaceChildren(
      ...texts.map((text, i) => {
        const label = element("span", text);
        if (i === 1) label.className = "original";
        const across = arrangement === "beside" ? 25 + 50 * i : 40 + 20 * i;
        label.style.left = isBelow ? "60px" : `${across}%`;
        label.style.top = isBelow ? `calc(${50 * i}% + 10px)` : "10px";
        return label;
      }),
    );
  }
}
