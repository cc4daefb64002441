// Labels of the views.

import { createElement } from "../player/dom.js";
import { byId } from "./page.js";
import type { Arrangement } from "./picture.js";

export class Labels {
  private shown = "";

  /**
   * Label each view at its top center.
   *
   * @param isPortrait - whether views are stacked vertically
   * @param lacksTrack - whether the original lacks the track that colors the decoded mesh
   */
  update(arrangement: Arrangement, isPortrait: boolean, lacksTrack: boolean): void {
    const key = `${arrangement} ${isPortrait} ${lacksTrack}`;
    if (key === this.shown) return;
    this.shown = key;
    const texts = {
      decoded: [],
      beside: ["decoded", lacksTrack ? "original, which lacks these values" : "original"],
      over: ["decoded", "original, as lines"],
    }[arrangement];
    const isBelow = arrangement === "beside" && isPortrait;
    byId("labels").replaceChildren(
      ...texts.map((text, i) => {
        const label = createElement("span", i === 1 ? "original" : "", text);
        const left = arrangement === "beside" ? 25 + 50 * i : 40 + 20 * i;
        label.style.left = isBelow ? "60px" : `${left}%`;
        label.style.top = isBelow ? `calc(${50 * i}% + 10px)` : "10px";
        return label;
      }),
    );
  }
}
