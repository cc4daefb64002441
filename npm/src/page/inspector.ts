// What the page adds to the player: the panel, comparison, heat maps, tracks, plots and keys.

import { partsOf, type ReelPlayerElement } from "../player/element.js";
import { connectControls } from "./controls.js";
import type { Facts, Reel } from "./facts.js";
import { Opening } from "./opening.js";
import { darkScheme, inputById, showError } from "./page.js";
import { Picture, type Look } from "./picture.js";
import { Player } from "./player.js";
import { windowPlayer } from "./window_player.js";

/** Add the inspector to a player with an open file; resolves when the initial state is shown. */
export async function inspect(element: ReelPlayerElement, facts: Facts): Promise<void> {
  const parts = partsOf(element);
  const [segments, mesh] = [element.file, parts.mesh()];
  if (!segments || !mesh) throw new Error("The player was removed from the page.");
  const reel: Reel = { ...facts, segments, file: segments.first };
  const picture = new Picture(parts, mesh, reel, firstLook(reel), element.texture !== null);
  const player = new Player(element, reel, picture);
  const opening = new Opening(reel, player);
  const tracks = connectControls(reel, picture, player, opening);
  Object.assign(window.player, windowPlayer(player, picture, opening, tracks));
  inputById("follow").checked = parts.frame(null);
  await player.seek(0);
  await opening.begin();
  if (reel.colored_by) await tracks.show(reel.colored_by).catch(showError);
}

function firstLook(reel: Reel): Look {
  return {
    shading: reel.original || reel.file.surface.cells ? "flat" : "smooth",
    wire: false,
    usesFileMaterials: true,
    background: darkScheme.matches ? "dark" : "light",
    arrangement: reel.original ? "beside" : "decoded",
  };
}
