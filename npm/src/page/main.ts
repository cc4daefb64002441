// Entry point of the page: opens the file in the player, and adds the inspector after the first picture.

import "../player/index.js";
import { partsOf } from "../player/element.js";
import { loadFacts, openInPlayer } from "./data.js";
import { inspect } from "./inspector.js";
import { byId, playerElement, showError } from "./page.js";

async function start(): Promise<void> {
  const player = playerElement();
  const { view, bar, legend } = partsOf(player);
  const firstPicture = new Promise((resolve) => {
    for (const type of ["timeupdate", "error"]) player.addEventListener(type, resolve, { once: true });
  });
  view.camera.zoomsAlways = true;
  bar.isDetailed = true;
  legend.element.classList.add("strip");
  const loading = loadFacts();
  const [facts] = await Promise.all([loading, openInPlayer(player, loading)]);
  document.title = `${facts.name} – meshreel`;
  byId("name").textContent = facts.name;
  await firstPicture;
  await inspect(player, facts);
}

const ready = start();
window.player = { ready } as typeof window.player;
ready.catch((error: unknown) => {
  if (error !== playerElement().error) showError(error); // the player displays its own errors
});
