import assert from "node:assert/strict";
import { test } from "node:test";

import { loadModule } from "./three_modules.mjs";

const { parseSettings } = await loadModule("../player/settings");

function parse(attributes) {
  return parseSettings((name) => attributes[name] ?? null);
}

test("missing attributes have defaults", () => {
  assert.deepEqual(parse({}), {
    src: null,
    alt: null,
    autoplay: false,
    loop: "once",
    speed: 1,
    start: 0,
    interpolate: true,
    cameraControls: false,
    controls: false,
    up: "y",
    background: null,
    poster: null,
    texture: null,
    track: null,
    component: undefined,
    range: undefined,
    map: undefined,
    kind: undefined,
    offset: undefined,
    frameNumber: undefined,
    muted: false,
  });
});

test("all attributes are parsed", () => {
  const settings = parse({
    src: "walk.reel",
    alt: "Anna walks",
    autoplay: "",
    loop: "pingpong",
    speed: "-0.5",
    "start-frame": "12",
    interpolate: "false",
    "camera-controls": "camera-controls",
    controls: "",
    up: "z",
    background: "white",
    poster: "walk.png",
    texture: "walk",
    "texture-kind": "video",
    "texture-offset": "0.25",
    "frame-number": " 0 8  16 12 ",
    muted: "",
  });
  assert.deepEqual(settings, {
    src: "walk.reel",
    alt: "Anna walks",
    autoplay: true,
    loop: "pingpong",
    speed: -0.5,
    start: { frame: 12 },
    interpolate: false,
    cameraControls: true,
    controls: true,
    up: "z",
    background: "white",
    poster: "walk.png",
    texture: "walk",
    kind: "video",
    offset: 0.25,
    frameNumber: { x: 0, y: 8, cell: 16, bits: 12 },
    muted: true,
    track: null,
    component: undefined,
    range: undefined,
    map: undefined,
  });
});

test("attributes of tracks are parsed", () => {
  const track = { track: "u", "track-range": "2%:98%", "track-colormap": "diverging" };
  for (const [value, component] of [["2", 2], ["magnitude", "magnitude"], ["y", "y"]]) {
    const settings = parse({ ...track, "track-component": value });
    assert.deepEqual([settings.track, settings.component], ["u", component]);
    assert.deepEqual([settings.range, settings.map], ["2%:98%", "diverging"]);
  }
});

test("loop without a value repeats", () => {
  for (const loop of ["", "loop", "repeat"]) assert.equal(parse({ loop }).loop, "repeat");
});

test("invalid values are rejected", () => {
  const wrong = [
    [{ loop: "false" }, /loop must have no value, or "repeat" or "pingpong"; got loop="false"/],
    [{ autoplay: "false" }, /autoplay is a boolean attribute.*got autoplay="false"/],
    [{ speed: "fast" }, /speed must be a number; got speed="fast"/],
    [{ speed: "" }, /speed must be a number/],
    [{ "start-time": "Infinity" }, /start-time must be a number/],
    [{ "start-time": "1", "start-frame": "2" }, /start-time and start-frame cannot be combined/],
    [{ up: "x" }, /up must be "y" or "z"; got up="x"/],
    [{ interpolate: "no" }, /interpolate must be "true" or "false"/],
    [{ "texture-kind": "video" }, /texture-kind has no effect without texture/],
    [{ muted: "" }, /muted has no effect without texture/],
    [{ "track-range": "0:1" }, /track-range has no effect without track; add track/],
    [{ track: "u", texture: "a.png" }, /texture and track cannot be combined/],
    [{ track: "u", "track-colormap": "jet" }, /track-colormap must be "sequential" or "diverging"/],
    [{ texture: "a.png", "texture-kind": "film" }, /texture-kind must be "image" or "video"/],
    [{ texture: "a.mp4", "frame-number": "0 0 16" }, /frame-number must be four numbers/],
  ];
  for (const [attributes, message] of wrong) {
    assert.throws(() => parse(attributes), { name: "InvalidInputError", message });
  }
});

test("empty addresses are null", () => {
  const settings = parse({ src: "", poster: " ", texture: "" });
  assert.deepEqual([settings.src, settings.poster, settings.texture], [null, null, null]);
});
