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
    const labels = byId("labels");
    labels.className = arrangement === "beside" && isPortrait ? "stacked" : arrangement;
    labels.replaceChildren(...texts.map((text, i) => createElement("span", i === 1 ? "original" : "", text)));
  }
}
