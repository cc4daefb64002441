// Entry point of the page.

import "../player/index.js";
import { partsOf } from "../player/element.js";
import { connectControls } from "./controls.js";
import { loadFacts, openInPlayer } from "./data.js";
import type { Reel } from "./facts.js";
import { Opening } from "./opening.js";
import { byId, playerElement, showError } from "./page.js";
import { Picture, type Look } from "./picture.js";
import { Player } from "./player.js";
import { exposeForTests } from "./window_player.js";

async function start(): Promise<void> {
  const element = playerElement();
  const parts = partsOf(element);
  parts.view.camera.zoomsAlways = true;
  parts.bar.isDetailed = true;
  parts.bar.element.before(parts.legend.element);
  const [facts] = await Promise.all([loadFacts(), openInPlayer(element)]);
  const { file: segments, mesh } = element;
  if (!segments || !mesh) throw new Error("The player was removed from the page.");
  const reel: Reel = { ...facts, segments, file: segments.first };
  document.title = `${reel.name} – meshreel`;
  byId("name").textContent = reel.name;
  const picture = new Picture(parts, mesh, reel, firstLook(reel), element.texture !== null);
  const player = new Player(element, reel, picture);
  const opening = new Opening(reel, player);
  const tracks = connectControls(reel, picture, player, opening);
  exposeForTests(player, picture, opening, tracks);
  parts.frame();
  await player.seek(0);
  await opening.begin();
  if (reel.colored_by) await tracks.show(reel.colored_by).catch(showError);
  if (picture.movesFar()) byId<HTMLInputElement>("follow").click();
}

function firstLook(reel: Reel): Look {
  return {
    shading: "flat",
    wire: false,
    usesFileMaterials: true,
    background: "light",
    arrangement: reel.original ? "beside" : "decoded",
    isFollowed: false,
  };
}

const ready = start();
window.player = { ready } as typeof window.player;
ready.catch((error: unknown) => {
  if (error !== playerElement().error) showError(error); // the player displays its own errors
});
