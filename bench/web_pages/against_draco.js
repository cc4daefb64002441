// The page of bench/web_against_draco.py: `bench` has what is measured.

import { DracoPlayer } from "./draco_player.js";
import { glBytes } from "./gl_memory.js";
import { ReelPlayer } from "./reel_player.js";
import { animate, draw, lookAt, renderer, scene, still } from "./stage.js";

let player;

async function bytesOf(address) {
  return (await fetch(address)).arrayBuffer();
}

let described;
let held = null;
let loader = null;

function addressOf(number) {
  return described.address.replace("NUMBER", String(number));
}

/** Tells what is to be played: `nHeld` of its files come into memory, and Draco may be warm. */
async function prepare(what, nHeld, isWarm) {
  described = what;
  lookAt(what.center, what.size);
  draw(true);
  const numbers = Array.from({ length: nHeld }, (_, number) => number);
  if (nHeld) held = await Promise.all(numbers.map((number) => bytesOf(addressOf(number))));
  if (isWarm) loader = await DracoPlayer.loader(await bytesOf(addressOf(0)));
}

/** Shows the first frame; milliseconds until its pixels are there. */
async function first() {
  const { kind, nFrames, fps } = described;
  const began = performance.now();
  if (kind === "draco") {
    loader ??= await DracoPlayer.loader();
    player = new DracoPlayer((n) => held?.[n] ?? addressOf(n), nFrames, fps, loader);
  } else {
    player = await ReelPlayer.open(held?.[0] ?? addressOf(0), renderer);
  }
  scene.add(await player.first());
  draw(true);
  return performance.now() - began;
}

/** Plays to the end; pictures of other frames than before, and seconds. */
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
