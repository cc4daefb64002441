// The controls that cut a volume mesh open.

import type { CutPlane } from "../index.js";
import { byId, Choice, inputById } from "./page.js";
import type { Reel } from "./facts.js";
import type { Player } from "./player.js";

const AXES = ["x", "y", "z"] as const;
type Axis = (typeof AXES)[number];

/** Show the controls of cuts, and connect them. */
export function connectCut({ file }: Reel, player: Player): void {
  const [place, side] = ["cut-place", "cut-side"].map(inputById);
  let axis: Axis | "none" = "none";
  let isBusy = false;
  let isStale = false;
  const apply = async (): Promise<void> => {
    isStale = isBusy;
    if (isBusy) return;
    isBusy = true;
    try {
      await player.cut(axis === "none" ? null : await planeAt(AXES.indexOf(axis)));
    } catch (error) {
      player.onError(error as Error);
    } finally {
      isBusy = false;
    }
    if (isStale) await apply(); // the slider has moved on
  };
  const rangeAlong = async (along: number): Promise<[number, number]> => {
    const positions = await file.frame(0);
    let [low, high] = [Infinity, -Infinity];
    for (let i = along; i < positions.length; i += 3) {
      low = Math.min(low, positions[i]);
      high = Math.max(high, positions[i]);
    }
    return [low, high];
  };
  const ranges: [number, number][] = []; // of each axis that was chosen
  const planeAt = async (along: number): Promise<CutPlane> => {
    const [low, high] = (ranges[along] ??= await rangeAlong(along));
    const sign = side.checked ? -1 : 1;
    const normal = AXES.map((_, i) => (i === along ? sign : 0)) as [number, number, number];
    return { normal, offset: sign * (low + (Number(place.value) / 100) * (high - low)) };
  };
  new Choice<Axis | "none">("cut", axis, (chosen) => {
    axis = chosen;
    byId("cut-options").hidden = axis === "none";
    void apply();
  });
  place.addEventListener("input", () => void apply());
  side.addEventListener("change", () => void apply());
  byId("cuts").hidden = false;
}
