// Entry point of the page.

import { connectControls } from "./controls.js";
import { embeddedTexture, openReel } from "./data.js";
import type { Reel } from "./facts.js";
import { Opening } from "./opening.js";
import { byId, showError } from "./page.js";
import { Picture, type Look } from "./picture.js";
import { Player } from "./player.js";
import { Stage } from "./stage.js";
import { exposeForTests } from "./window_player.js";

async function start(): Promise<void> {
  const reel = await openReel();
  document.title = `${reel.name} – meshreel`;
  byId("name").textContent = reel.name;
  const canvas = byId<HTMLCanvasElement>("canvas");
  const stage = new Stage(canvas, reel);
  canvas.addEventListener("webglcontextlost", () =>
    showError(new Error("The browser has dropped the WebGL context of this page. Reload it.")),
  );
  const texture = embeddedTexture();
  const picture = new Picture(stage, reel, firstLook(reel), texture !== null);
  stage.setUp(reel.up);
  const player = new Player(reel, picture);
  const opening = new Opening(reel, player);
  player.onError = showError;
  const tracks = connectControls(reel, stage, picture, player, opening);
  exposeForTests(player, picture, opening, tracks);
  if (texture) {
    await picture.mesh.setTexture(texture.url, { kind: texture.kind }).catch(showError);
  }
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
ready.catch(showError);
