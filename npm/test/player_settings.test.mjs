import assert from "node:assert/strict";
import { test } from "node:test";

import { moduleOf } from "./three_modules.mjs";

const { settingsOf } = await moduleOf("../player/settings");

function said(attributes) {
  return settingsOf((name) => attributes[name] ?? null);
}

test("defaults hold when there are no attributes", () => {
  assert.deepEqual(said({}), {
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

test("every attribute is understood", () => {
  const settings = said({
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

test("a track comes with what is shown of it", () => {
  const track = { track: "u", "track-range": "2%:98%", "track-colormap": "diverging" };
  for (const [given, component] of [["2", 2], ["magnitude", "magnitude"], ["y", "y"]]) {
    const { map, range, ...found } = said({ ...track, "track-component": given });
    assert.deepEqual([found.track, found.component], ["u", component]);
    assert.deepEqual([range, map], ["2%:98%", "diverging"]);
  }
});

test("loop alone repeats", () => {
  for (const loop of ["", "loop", "repeat"]) assert.equal(said({ loop }).loop, "repeat");
});

test("what is not understood is refused in words", () => {
  const wrong = [
    [{ loop: "false" }, /loop has no value, or is "repeat" or "pingpong"; got loop="false"/],
    [{ autoplay: "false" }, /autoplay is there or not.*got autoplay="false"/],
    [{ speed: "fast" }, /speed must be a number; got speed="fast"/],
    [{ speed: "" }, /speed must be a number/],
    [{ "start-time": "Infinity" }, /start-time must be a number/],
    [{ "start-time": "1", "start-frame": "2" }, /say the same; leave one of them away/],
    [{ up: "x" }, /up is "y" or "z"; got up="x"/],
    [{ interpolate: "no" }, /interpolate is "true" or "false"/],
    [{ "texture-kind": "video" }, /texture-kind is for a texture only/],
    [{ muted: "" }, /muted is for a texture only/],
    [{ "track-range": "0:1" }, /track-range is for a track only; add track/],
    [{ track: "u", texture: "a.png" }, /texture and track both say what is on the model/],
    [{ track: "u", "track-colormap": "jet" }, /track-colormap is "sequential" or "diverging"/],
    [{ texture: "a.png", "texture-kind": "film" }, /texture-kind is "image" or "video"/],
    [{ texture: "a.mp4", "frame-number": "0 0 16" }, /frame-number is four numbers/],
  ];
  for (const [attributes, message] of wrong) {
    assert.throws(() => said(attributes), { name: "InvalidInputError", message });
  }
});

test("empty addresses are none, and not that of the page", () => {
  const settings = said({ src: "", poster: " ", texture: "" });
  assert.deepEqual([settings.src, settings.poster, settings.texture], [null, null, null]);
});
