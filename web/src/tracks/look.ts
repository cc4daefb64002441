// How a track is shown: what the command line and the controls of the page say.

import type { Component } from "meshreel/three";

/** A track as colours; what is null is as usual. */
export interface TrackLook {
  readonly track: string;
  readonly component: string | null;
  /** "LOW:HIGH", each a number or a percentile. */
  readonly range: string | null;
  readonly colormap: "sequential" | "diverging" | null;
}

/** The range that is shown where nothing is said. */
export const USUAL_RANGE = "2%:98%";

/** A component in words, as `colorBy` takes it. */
export function componentOf(text: string): Component {
  return /^\d+$/.test(text) ? Number(text) : (text as Component);
}

/** The text with which a choice of a component is written, such as "y" of column 1. */
export function componentText(component: number | "magnitude" | "color", nColumns: number): string {
  if (typeof component !== "number") return component;
  return nColumns > 1 && nColumns <= 3 ? "xyz"[component] : String(component);
}
