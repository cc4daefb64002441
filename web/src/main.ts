// Puts the page together.

import { connectControls } from "./controls";
import { loadPacket, loadReel } from "./data";
import { VertexGrid } from "./gpu/grid";
import { HeatFields } from "./heat_fields";
import { Opening } from "./opening";
import { part, showError } from "./page";
import { Picture, type Look } from "./picture";
import { Player } from "./player";
import type { Reel } from "./reel";
import { Stage } from "./stage";
import { exposeForTests } from "./window_player";

async function start(): Promise<void> {
  const reel = await loadReel();
  document.title = `${reel.name} – meshreel`;
  part("name").textContent = reel.name;
  const canvas = part<HTMLCanvasElement>("canvas");
  const stage = new Stage(canvas, reel);
  canvas.addEventListener("webglcontextlost", () =>
    showError(new Error("The graphics card has dropped this page. Reload it.")),
  );
  const packet = await loadPacket("api/faces");
  const faces = packet.array("faces", "uint32", [reel.n_faces, 3]);
  const colors = packet.shapeOf("colors");
  const ownColors = colors && packet.array("colors", "uint8", [reel.n_verts, colors[1]]);
  const grid = new VertexGrid(reel.n_verts);
  const look = firstLook(reel);
  const hasOriginal = reel.original !== null;
  const picture = new Picture(stage, grid, faces, ownColors, hasOriginal, reel.diagonal, look);
  stage.setUp(reel.up);
  const fields = new HeatFields(faces, reel.n_verts, reel.original?.diagonal ?? reel.diagonal);
  const player = new Player(reel, grid, picture, fields);
  const opening = new Opening(reel, player);
  player.failed = showError;
  connectControls(reel, stage, picture, player, opening);
  exposeForTests(player, picture, stage, opening);
  await player.seek(0);
  await opening.begin();
  if (picture.travelsFar()) part<HTMLInputElement>("follow").click();
}

function firstLook(reel: Reel): Look {
  return {
    shading: "flat",
    wire: false,
    ownColors: true,
    background: "light",
    arrangement: reel.original ? "beside" : "decoded",
    isFollowed: false,
  };
}

const ready = start();
window.player = { ready } as typeof window.player;
ready.catch(showError);
