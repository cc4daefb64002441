// The style sheet of players: a constructed one, which content policies always allow.

const CSS = `
:host {
  display: block;
  position: relative;
  width: 100%;
  aspect-ratio: 16 / 9;
  overflow: hidden;
  font: 14px/1.4 system-ui, sans-serif;
  --ink: var(--reel-color, #14181e);
  --panel: var(--reel-bar-background, #f1f3f6);
  --accent: var(--reel-accent, #1668b8);
  --alarm: #c22b1e;
  background: var(--reel-background, #fff);
}
@media (prefers-color-scheme: dark) {
  :host {
    --ink: var(--reel-color, #fff);
    --panel: var(--reel-bar-background, #1c2129);
    --accent: var(--reel-accent, #8cc8ff);
    --alarm: #ff8f85;
    background: var(--reel-background, #101418);
  }
}
:host([hidden]) { display: none; }
:host(:fullscreen) { aspect-ratio: auto; width: 100%; height: 100%; }
[hidden] { display: none !important; }
.stage, .poster, canvas { position: absolute; inset: 0; width: 100%; height: 100%; }
.stage { display: flex; flex-direction: column; container-type: inline-size; }
.picture { position: relative; flex: 1; min-height: 0; }
canvas { display: block; outline: none; }
.snapshot { pointer-events: none; }
.poster { object-fit: contain; pointer-events: none; }
canvas:focus-visible { box-shadow: inset 0 0 0 3px #1668b8, inset 0 0 0 5px #fff; }
button {
  flex: none;
  font: inherit;
  color: inherit;
  background: none;
  border: 0;
  border-radius: 6px;
  min-width: 40px;
  min-height: 40px;
  padding: 8px;
  cursor: pointer;
}
button:hover { background: #88888840; }
button:disabled, input:disabled { opacity: 0.5; cursor: default; }
button:focus-visible, input:focus-visible { outline: 2px solid var(--accent); outline-offset: -2px; }
svg { display: block; width: 24px; height: 24px; fill: currentColor; }
.bar {
  flex: none;
  display: flex;
  align-items: center;
  gap: 6px;
  box-sizing: border-box;
  height: 48px;
  padding: 4px 8px;
  color: var(--ink);
  background: var(--panel);
}
.bar input {
  flex: 1;
  min-width: 40px;
  height: 32px;
  margin: 0 4px;
  accent-color: var(--accent);
  border-radius: 6px;
  cursor: pointer;
}
.bar .text { flex: none; font-variant-numeric: tabular-nums; }
.bar select {
  flex: none;
  min-height: 36px;
  padding: 2px 4px;
  font: inherit;
  color: inherit;
  background: var(--panel);
  border: 1px solid #88888880;
  border-radius: 6px;
  cursor: pointer;
}
.bar select:focus-visible { outline: 2px solid var(--accent); outline-offset: -2px; }
.legend {
  box-sizing: border-box;
  padding: 6px 10px;
  font-size: 12px;
  line-height: 1.4;
  color: var(--ink);
  background: var(--panel);
  border-bottom: 1px solid #88888840;
}
.legend span { display: block; overflow-wrap: anywhere; }
.legend .colors { height: 10px; margin: 4px 0 2px; border-radius: 2px; forced-color-adjust: none; }
.legend .values { position: relative; display: flex; justify-content: space-between; gap: 8px; white-space: nowrap; }
.legend .tick { position: absolute; transform: translateX(-50%); }
.legend .tick::before {
  content: "";
  position: absolute;
  left: 50%;
  top: -2px;
  height: 4px;
  border-left: 1px solid;
}
.legend.strip :is(.colors, .values) { max-width: 320px; }
@container (min-width: 520px) {
  .legend:not(.strip) {
    position: absolute;
    left: 12px;
    top: 12px;
    width: clamp(110px, 34%, 180px);
    min-width: min-content;
    border: 0;
    border-radius: 6px;
    pointer-events: none;
  }
}
@container (max-width: 519px) {
  .bar:not(.detailed) :is(.step, .speed) { display: none; }
  .legend:not(.strip) { display: flex; align-items: center; gap: 8px; padding-block: 4px; white-space: nowrap; }
  .legend:not(.strip) .title { overflow: hidden; text-overflow: ellipsis; }
  .legend:not(.strip) .colors { flex: 1 0 32px; margin: 0; }
  .legend:not(.strip) .values { display: contents; }
  .legend:not(.strip) .values :first-child { order: -1; }
  .legend:not(.strip) .title { order: -2; }
  .legend:not(.strip) .tick { display: none; }
}
@container (max-width: 319px) {
  .bar:not(.detailed) { flex-wrap: wrap; gap: 2px; height: auto; padding-inline: 4px; }
  .bar:not(.detailed) .text, .legend:not(.strip) .title:has(+ :not([hidden])) { display: none; }
  .bar:not(.detailed) .time { margin: 0 2px; }
}
@container (max-width: 139px) {
  .bar:not(.detailed) .time { display: none; }
}
@container (max-width: 729px) {
  .bar.detailed { flex-wrap: wrap; gap: 0; justify-content: space-between; height: auto; }
  .bar.detailed :is(.time, .text) { order: -2; }
  .bar.detailed::before { content: ""; order: -1; width: 100%; }
}
.start {
  position: absolute;
  inset: 0;
  margin: auto;
  width: 72px;
  height: 72px;
  padding: 16px;
  border-radius: 50%;
  color: var(--ink);
  background: var(--panel);
}
.start:hover { background: var(--panel); color: var(--accent); }
.start svg { width: 40px; height: 40px; }
.waiting, .alert p { margin: 0; }
.waiting:not(:empty) {
  position: absolute;
  top: 12px;
  right: 12px;
  display: flex;
  align-items: center;
  gap: 8px;
  padding: 6px 12px;
  border-radius: 16px;
  color: var(--ink);
  background: var(--panel);
  animation: appear 0s 0.2s both;
}
.waiting:not(:empty)::before {
  content: "";
  width: 12px;
  height: 12px;
  border: 2px solid;
  border-right-color: #88888840;
  border-radius: 50%;
  animation: turn 1s linear infinite;
}
@keyframes appear { from { visibility: hidden; } }
@keyframes turn { to { rotate: 1turn; } }
.alert:not(:empty) {
  position: absolute;
  z-index: 1; /* over the legend */
  top: 12px;
  left: 12px;
  right: 12px;
  display: flex;
  flex-wrap: wrap;
  justify-content: end;
  gap: 0 12px;
  max-width: 560px;
  max-height: calc(100% - 24px);
  overflow: auto;
  box-sizing: border-box;
  margin: 0 auto;
  padding: 8px 8px 8px 16px;
  border-left: 6px solid var(--alarm);
  border-radius: 6px;
  color: var(--ink);
  background: var(--panel);
  overflow-wrap: anywhere;
}
.alert.bare { padding: 14px 16px; }
.alert p { flex: 1 1 200px; margin: auto 0; }
.alert button { position: sticky; bottom: 0; background: var(--panel); text-decoration: underline; }
.alert button:hover { color: var(--accent); }
@container (max-width: 519px) {
  .alert:not(:empty) { flex-flow: column; inset: 6px 6px auto; max-height: calc(100% - 12px); padding-block: 6px; }
  .alert p { flex: 0 1 auto; margin: 0; overflow: auto; }
  .alert button { flex: none; align-self: end; min-height: 32px; padding-block: 4px; }
}
@media (prefers-reduced-motion: reduce) {
  .waiting:not(:empty)::before { animation: none; }
}
@media (forced-colors: active) {
  .bar, .legend, .start, .waiting:not(:empty), .alert:not(:empty) { border: 1px solid; }
}
`;

let sheet: CSSStyleSheet | null = null;

/** Return the style sheet that all players share. */
export function playerStyleSheet(): CSSStyleSheet {
  if (!sheet) {
    sheet = new CSSStyleSheet();
    sheet.replaceSync(CSS);
  }
  return sheet;
}
