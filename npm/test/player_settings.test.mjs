import assert from "node:assert/strict";
import { test } from "node:test";

import { loadModule } from "./three_modules.mjs";

const { parseSettings } = await loadModule("../player/settings");

function parse(attributes) {
  return parseSettings((name) => attributes[name] ?? null);
}

const DEFAULT_CAMERA = {
  theta: 0,
  phi: (78 * Math.PI) / 180,
  distance: null,
  zoom: 1,
  target: [null, null, null],
  fieldOfView: 30,
};

test("missing attributes have defaults", () => {
  assert.deepEqual(parse({}), {
    src: null,
    alt: null,
    loading: "eager",
    autoplay: false,
    loop: false,
    speed: 1,
    start: 0,
    interpolate: true,
    cameraControls: false,
    camera: DEFAULT_CAMERA,
    autoRotate: false,
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
    muted: false,
  });
});

test("all attributes are parsed", () => {
  const settings = parse({
    src: "walk.reel",
    alt: "Anna walks",
    loading: "lazy",
    autoplay: "",
    loop: "pingpong",
    speed: "-0.5",
    "start-frame": "12",
    interpolate: "false",
    "camera-controls": "camera-controls",
    "camera-orbit": "-90deg 0.5rad 150%",
    "camera-target": "1m auto -2.5",
    "field-of-view": "45deg",
    "auto-rotate": "",
    controls: "",
    up: "z",
    background: "white",
    poster: "walk.png",
    texture: "walk",
    "texture-kind": "video",
    "texture-offset": "0.25",
    muted: "",
  });
  assert.deepEqual(settings, {
    src: "walk.reel",
    alt: "Anna walks",
    loading: "lazy",
    autoplay: true,
    loop: "pingpong",
    speed: -0.5,
    start: { frame: 12 },
    interpolate: false,
    cameraControls: true,
    camera: {
      theta: -Math.PI / 2,
      phi: 0.5,
      distance: null,
      zoom: 1.5,
      target: [1, null, -2.5],
      fieldOfView: 45,
    },
    autoRotate: true,
    controls: true,
    up: "z",
    background: "white",
    poster: "walk.png",
    texture: "walk",
    kind: "video",
    offset: 0.25,
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
  for (const loop of ["", "loop", "repeat"]) assert.equal(parse({ loop }).loop, true);
});

test("invalid values are rejected", () => {
  const wrong = [
    [{ loop: "false" }, /loop must be "loop" or "repeat" or "pingpong"; got loop="false"/],
    [{ autoplay: "false" }, /autoplay is a boolean attribute.*got autoplay="false"/],
    [{ speed: "fast" }, /speed must be a number; got speed="fast"/],
    [{ speed: "" }, /speed must be a number/],
    [{ "start-time": "Infinity" }, /start-time must be a number/],
    [{ "start-time": "1", "start-frame": "2" }, /start-time and start-frame cannot be combined/],
    [{ up: "x" }, /up must be "y" or "z"; got up="x"/],
    [{ loading: "auto" }, /loading must be "eager" or "lazy"; got loading="auto"/],
    [{ "camera-orbit": "30deg" }, /camera-orbit must be "auto", or three values such as "30deg/],
    [{ "camera-orbit": "30 75deg auto" }, /camera-orbit needs angles such as "30deg".*got "30"/],
    [{ "camera-orbit": "0deg 75deg 0m" }, /the radius of camera-orbit must be above 0; got "0m"/],
    [{ "camera-target": "0 0 x" }, /camera-target needs numbers in model units.*got "x"/],
    [{ "field-of-view": "180deg" }, /field-of-view must be above 0deg and below 180deg/],
    [{ interpolate: "no" }, /interpolate must be "true" or "false"/],
    [{ "texture-kind": "video" }, /texture-kind has no effect without texture/],
    [{ "track-range": "0:1" }, /track-range has no effect without track; add track/],
    [{ track: "u", texture: "a.png" }, /texture and track cannot be combined/],
    [{ track: "u", "track-colormap": "jet" }, /track-colormap must be "sequential" or "diverging"/],
    [{ texture: "a.png", "texture-kind": "film" }, /texture-kind must be "image" or "video"/],
  ];
  for (const [attributes, message] of wrong) {
    assert.throws(() => parse(attributes), { name: "InvalidInputError", message });
  }
});

test("empty addresses are null", () => {
  const settings = parse({ src: "", poster: " ", texture: "" });
  assert.deepEqual([settings.src, settings.poster, settings.texture], [null, null, null]);
});

test("a radius in model units is a distance", () => {
  const { camera } = parse({ "camera-orbit": "auto auto 2.5m" });
  assert.deepEqual(camera, { ...DEFAULT_CAMERA, distance: 2.5 });
});
