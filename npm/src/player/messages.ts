// What a player says: that it waits, and what is wrong.

import { made } from "./parts.js";

/** Messages over the picture. */
export class Messages {
  readonly waiting = made("p", "waiting");
  readonly alert = made("div", "alert");
  readonly #text = made("p", "");
  readonly #close = made("button", "", "Dismiss");

  constructor() {
    this.waiting.setAttribute("role", "status");
    this.alert.setAttribute("role", "alert");
    this.#close.type = "button";
    this.#close.addEventListener("click", () => this.clear());
  }

  /** Says that something is on its way, or that it is there. */
  wait(isWaiting: boolean): void {
    const text = isWaiting ? "Loading…" : "";
    if (this.waiting.textContent !== text) this.waiting.textContent = text;
  }

  /** Says what is wrong; `isFatal`: nothing can be played. */
  say(text: string, isFatal: boolean): void {
    this.#text.textContent = text;
    this.alert.classList.toggle("fatal", isFatal);
    this.alert.replaceChildren(this.#text, ...(isFatal ? [] : [this.#close]));
  }

  /** Takes back what was said. */
  clear(): void {
    this.alert.replaceChildren();
  }
}
