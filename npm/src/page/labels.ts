// Labels of the views.

import { createElement } from "../player/dom.js";
import { byId } from "./page.js";
import type { Arrangement } from "./picture.js";

/** Height of the title and the labels. */
const LABELS_PX = 62;

export class Labels {
  private shown = "";

  /**
   * Label each view at its top center, above the canvas; stacked views in their upper left corners.
   *
   * @param isPortrait - whether views are stacked vertically
   * @param lacksTrack - whether the original lacks the track that colors the decoded mesh
   */
  update(canvas: HTMLElement, arrangement: Arrangement, isPortrait: boolean, lacksTrack: boolean): void {
    const key = `${arrangement} ${isPortrait} ${lacksTrack}`;
    if (key === this.shown) return;
    this.shown = key;
    const texts = {
      decoded: [],
      beside: ["decoded", lacksTrack ? "original, which lacks these values" : "original"],
      over: ["decoded", "original, as lines"],
    }[arrangement];
    const labels = byId("labels");
    const isStacked = arrangement === "beside" && isPortrait;
    labels.className = isStacked ? "stacked" : arrangement;
    const top = isStacked || !texts.length ? 0 : LABELS_PX;
    Object.assign(canvas.style, { top: `${top}px`, height: `calc(100% - ${top}px)` });
    labels.replaceChildren(...texts.map((text, i) => createElement("span", i === 1 ? "original" : "", text)));
  }
}
