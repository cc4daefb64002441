// Connects controls and keys with their actions.

import { ComparisonPanel } from "./comparison.js";
import { connectCut } from "./cut.js";
import { Labels } from "./labels.js";
import type { Opening } from "./opening.js";
import { byId, Choice, darkScheme, inputById } from "./page.js";
import { fillPanel } from "./panel.js";
import type { Arrangement, Background, Look, Picture, Shading } from "./picture.js";
import type { Player } from "./player.js";
import type { Reel } from "./facts.js";
import { saveScreenshot } from "./screenshot.js";
import { TrackPanel } from "./tracks/panel.js";

const PHONE = "(max-width: 720px)";

/** Connect all controls of the page. */
export function connectControls(
  reel: Reel,
  picture: Picture,
  player: Player,
  opening: Opening,
): TrackPanel {
  const { legend, view } = player.parts;
  fillPanel(reel);
  const comparison = reel.original && new ComparisonPanel(player, reel.original, opening);
  const tracks = new TrackPanel(reel, picture, player);
  if (reel.file.surface.cells && reel.segments.segments.length === 1) connectCut(reel, player);
  view.canvas.addEventListener("dblclick", ({ clientX, clientY }) => {
    if (player.hasTrack) tracks.pick(picture.pickAt(clientX, clientY));
  });
  const actions: Actions = {
    ...playbackKeys(player, reel),
    ...viewKeys(reel, picture, player),
    h: () => comparison?.nextHeat(),
    t: () => tracks.next(),
    p: togglePanel,
    "?": () => byId<HTMLDialogElement>("help").showModal(),
  };
  listenForKeys(actions);
  const buttons = {
    loop: "l",
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
    comparison?.update();
    tracks.update(player.frame, player.isPlaying);
    legend.show(comparison?.legendContent ?? tracks.legendContent);
    labels.update(view.canvas, picture.look.arrangement, view.isPortrait, player.isTrackMissing);
  };
  return tracks;
}

/** Return the keys of playback. */
function playbackKeys(player: Player, reel: Reel): Actions {
  const { element, parts } = player;
  const seek = (frame: number): void => void player.seek(frame).catch(player.onError);
  const skip = (count: number): void => {
    element.pause();
    seek(player.frame + count);
  };
  return {
    " ": () => player.toggle(),
    ArrowLeft: () => parts.step(-1),
    ArrowRight: () => parts.step(1),
    ShiftArrowLeft: () => skip(-10),
    ShiftArrowRight: () => skip(10),
    Home: () => seek(0),
    End: () => seek(reel.segments.info.nFrames - 1),
    "-": () => parts.bar.changeSpeed(-1),
    "+": () => parts.bar.changeSpeed(1),
    "=": () => parts.bar.changeSpeed(1),
    l: () => {
      element.loop = !element.loop;
      byId("loop").setAttribute("aria-pressed", String(element.loop));
    },
    g: () => parts.bar.toggleFullScreen(),
  };
}

/** Connect the controls of the view; returns their keys. */
function viewKeys(reel: Reel, picture: Picture, player: Player): Actions {
  const { look } = picture;
  const { element, parts } = player;
  const choose =
    <K extends keyof Look>(name: K) =>
    (value: Look[K]) => {
      look[name] = value;
      picture.applyLook();
      player.redraw();
    };
  const shading = new Choice<Shading>("shading", look.shading, choose("shading"));
  const { dataset } = document.documentElement;
  const background = new Choice<Background>("background", look.background, (value) => {
    dataset.background = value;
    choose("background")(value);
  });
  darkScheme.addEventListener("change", ({ matches }) => {
    if (dataset.background) return; // the user has chosen
    background.select(matches ? "dark" : "light");
    delete dataset.background;
  });
  const arrangement = new Choice<Arrangement>(
    "arrangement",
    look.arrangement,
    choose("arrangement"),
  );
  const up = new Choice<"y" | "z">("up", "y", (axis) => (element.up = axis));
  const wire = checkbox("wire", choose("wire"));
  const follow = checkbox("follow", (isFollowed) => parts.frame(isFollowed));
  byId("own-look-row").hidden = !picture.hasFileMaterials;
  checkbox("own-look", choose("usesFileMaterials"));
  checkbox("smooth-play", (isSmooth) => (element.interpolate = isSmooth));
  return {
    f: () => shading.next(),
    b: () => background.next(),
    u: () => up.next(),
    w: () => wire.click(),
    c: () => follow.click(),
    o: () => reel.original && arrangement.next(),
    r: () => element.resetCamera(),
    s: () => {
      parts.view.drawNow();
      saveScreenshot(parts, `${reel.name}-${player.frame}.png`);
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

/** Handle keys, except those that the focused control handles; before the player handles them. */
function listenForKeys(actions: Actions): void {
  const handle = (event: KeyboardEvent): void => {
    if (event.ctrlKey || event.metaKey || event.altKey || isHandledByControl(event)) return;
    const key = event.shiftKey && event.key.startsWith("Arrow") ? `Shift${event.key}` : event.key;
    const action = actions[key] ?? actions[key.toLowerCase()];
    if (!action) return;
    event.preventDefault();
    event.stopPropagation();
    action();
  };
  document.addEventListener("keydown", handle, { capture: true });
}

function isHandledByControl(event: KeyboardEvent): boolean {
  if (document.querySelector("dialog[open]")) return true;
  const [target] = event.composedPath();
  const { key } = event;
  if (!(target instanceof HTMLElement)) return false;
  if (target instanceof HTMLSelectElement) return true;
  if (target instanceof HTMLInputElement)
    return key === " " || (!target.closest(".bar") && isNavigationKey(key));
  return target instanceof HTMLButtonElement && (key === " " || key === "Enter");
}

function isNavigationKey(key: string): boolean {
  return key.startsWith("Arrow") || key === "Home" || key === "End";
}
