// Connects controls and keys with their actions.

import { Legend } from "../player/legend.js";
import { ComparisonPanel } from "./comparison.js";
import { Labels } from "./labels.js";
import type { Opening } from "./opening.js";
import { Choice, inputById, byId } from "./page.js";
import { Panel } from "./panel.js";
import type { Arrangement, Look, Picture, Shading } from "./picture.js";
import type { Player } from "./player.js";
import type { Reel } from "./facts.js";
import { saveScreenshot } from "./screenshot.js";
import type { Background, Stage } from "./stage.js";
import { Timeline } from "./timeline.js";
import { TrackPanel } from "./tracks/panel.js";

const PHONE = "(max-width: 720px)";

/** Connect all controls of the page. */
export function connectControls(
  reel: Reel,
  stage: Stage,
  picture: Picture,
  player: Player,
  opening: Opening,
): TrackPanel {
  const legend = new Legend();
  byId("stage").append(legend.element);
  const timeline = new Timeline(player, reel);
  const panel = new Panel(player, reel);
  const comparison = reel.original && new ComparisonPanel(player, reel.original, opening);
  const tracks = new TrackPanel(reel, picture, player);
  byId("canvas").addEventListener("dblclick", ({ clientX, clientY }) => {
    if (player.hasTrack) tracks.pick(picture.pickAt(clientX, clientY));
  });
  const actions: Actions = {
    ...timelineKeys(timeline, reel),
    ...viewKeys(reel, stage, picture, player, legend),
    "[": () => player.setModes(player.state().modes - 1),
    "]": () => player.setModes(player.state().modes + 1),
    h: () => comparison?.nextHeat(),
    t: () => tracks.next(),
    g: () => timeline.bar.toggleFullScreen(),
    p: togglePanel,
    "?": () => byId<HTMLDialogElement>("help").showModal(),
  };
  listenForKeys(actions);
  const buttons = {
    reset: "r",
    screenshot: "s",
    "panel-button": "p",
    "help-button": "?",
  };
  for (const [id, key] of Object.entries(buttons)) byId(id).addEventListener("click", actions[key]);
  const isFramed = window.self !== window.top;
  if (isFramed || (window.matchMedia(PHONE).matches && !reel.original)) togglePanel();
  const labels = new Labels();
  player.onChange = () => {
    timeline.update();
    panel.update();
    comparison?.update();
    tracks.update(player.frame, player.isPlaying);
    const modes = player.state().isFew ? panel.modesText : "";
    legend.show(comparison?.legendContent(modes) ?? tracks.legendContent);
    labels.update(picture.look.arrangement, stage.isPortrait, player.isTrackMissing);
  };
  stage.onChange = () => player.redraw();
  return tracks;
}

function timelineKeys(timeline: Timeline, reel: Reel): Actions {
  return {
    " ": () => timeline.toggle(),
    ArrowLeft: () => timeline.skip(-1),
    ArrowRight: () => timeline.skip(1),
    ShiftArrowLeft: () => timeline.skip(-10),
    ShiftArrowRight: () => timeline.skip(10),
    Home: () => timeline.seek(0),
    End: () => timeline.seek(reel.segments.info.nFrames - 1),
    "-": () => timeline.bar.changeSpeed(-1),
    "+": () => timeline.bar.changeSpeed(1),
    "=": () => timeline.bar.changeSpeed(1),
    l: () => timeline.toggleLoop(),
  };
}

/** Connect the controls of the view; returns their keys. */
function viewKeys(
  reel: Reel,
  stage: Stage,
  picture: Picture,
  player: Player,
  legend: Legend,
): Actions {
  const { look } = picture;
  const choose =
    <K extends keyof Look>(name: K) =>
    (value: Look[K]) => {
      look[name] = value;
      document.documentElement.dataset.background = look.background;
      picture.applyLook();
      player.redraw();
    };
  const shading = new Choice<Shading>("shading", look.shading, choose("shading"));
  const background = new Choice<Background>("background", look.background, choose("background"));
  const arrangement = new Choice<Arrangement>(
    "arrangement",
    look.arrangement,
    choose("arrangement"),
  );
  const up = new Choice<"y" | "z">("up", reel.up, (axis) => stage.setUp(axis));
  const wire = checkbox("wire", choose("wire"));
  const follow = checkbox("follow", (isFollowed) => picture.setFollowed(isFollowed));
  byId("own-look-row").hidden = !picture.hasFileMaterials;
  checkbox("own-look", choose("usesFileMaterials"));
  checkbox("smooth-play", (isSmooth) => player.setSmoothPlay(isSmooth));
  return {
    f: () => shading.next(),
    b: () => background.next(),
    u: () => up.next(),
    w: () => wire.click(),
    c: () => follow.click(),
    o: () => reel.original && arrangement.next(),
    r: () => stage.reset(),
    s: () => {
      player.drawNow();
      saveScreenshot(byId("canvas"), legend, `${reel.name}-${player.frame}.png`);
    },
  };
}

function checkbox(id: string, onChange: (isOn: boolean) => void): HTMLInputElement {
  const box = inputById(id);
  box.addEventListener("change", () => onChange(box.checked));
  return box;
}

function togglePanel(): void {
  const isHidden = byId("app").classList.toggle("no-panel");
  byId("panel-button").setAttribute("aria-expanded", String(!isHidden));
}

type Actions = Record<string, () => unknown>;

/** Handle keys, except those that the focused control handles. */
function listenForKeys(actions: Actions): void {
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || isHandledByControl(event)) return;
    const key = event.shiftKey && event.key.startsWith("Arrow") ? `Shift${event.key}` : event.key;
    const action = actions[key] ?? actions[key.toLowerCase()];
    if (!action) return;
    event.preventDefault();
    action();
  });
}

function isHandledByControl({ target, key }: KeyboardEvent): boolean {
  if (document.querySelector("dialog[open]")) return true;
  if (!(target instanceof HTMLElement)) return false;
  if (target instanceof HTMLSelectElement) return true;
  if (target instanceof HTMLInputElement)
    return key === " " || (!target.closest("#timeline") && isNavigationKey(key));
  return target instanceof HTMLButtonElement && (key === " " || key === "Enter");
}

function isNavigationKey(key: string): boolean {
  return key.startsWith("Arrow") || key === "Home" || key === "End";
}
