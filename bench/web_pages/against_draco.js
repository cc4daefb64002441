// The page of bench/web_against_draco.py, which calls the functions of `bench`.

import { DracoPlayer } from "./draco_player.js";
import { glBytes } from "./gl_memory.js";
import { ReelPlayer } from "./reel_player.js";
import { animate, draw, lookAt, renderer, scene, still } from "./stage.js";

let player;

async function bytesOf(address) {
  return (await fetch(address)).arrayBuffer();
}

let described;
let files = null;
let loader = null;

function addressOf(number) {
  return described.address.replace("NUMBER", String(number));
}

/** Sets the files to play, loads `nPreloaded` of them, and optionally warms up Draco. */
async function prepare(description, nPreloaded, isWarm) {
  described = description;
  lookAt(described.center, described.size);
  draw(true);
  const numbers = Array.from({ length: nPreloaded }, (_, number) => number);
  if (nPreloaded) files = await Promise.all(numbers.map((number) => bytesOf(addressOf(number))));
  if (isWarm) loader = await DracoPlayer.loader(await bytesOf(addressOf(0)));
}

/** Shows the first frame; returns the milliseconds until its pixels are drawn. */
async function first() {
  const { kind, nFrames, fps } = described;
  const start = performance.now();
  if (kind === "draco") {
    loader ??= await DracoPlayer.loader();
    player = new DracoPlayer((n) => files?.[n] ?? addressOf(n), nFrames, fps, loader);
  } else {
    player = await ReelPlayer.open(files?.[0] ?? addressOf(0), renderer);
  }
  scene.add(await player.first());
  draw(true);
  return performance.now() - start;
}

/** Plays to the end; returns the number of distinct pictures, and seconds. */
async function pass() {
  const loops = player.nLoops;
  let [shown, frame] = [0, -2];
  const intervals = await animate((delta) => {
    player.update(delta);
    if (player.frame !== frame) shown++;
    frame = player.frame;
    return player.nLoops === loops;
  });
  return { shown, seconds: intervals.reduce((sum, one) => sum + one, 0) / 1000 };
}

window.bench = { prepare, first, pass, still, glBytes };
