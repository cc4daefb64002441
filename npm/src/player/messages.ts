// What a player says: that it waits, and what is wrong.

import { made } from "./parts.js";

/** Messages over the picture. */
export class Messages {
  readonly waiting = made("p", "waiting");
  readonly alert = made("div", "alert");
  readonly #text = made("p", "");
  readonly #retry = made("button", "", "Try again");
  readonly #close = made("button", "", "Dismiss");

  /** @param onRetry - called when people press "Try again" */
  constructor(onRetry: () => void) {
    this.waiting.setAttribute("role", "status");
    this.alert.setAttribute("role", "alert");
    this.#retry.type = this.#close.type = "button";
    this.#retry.addEventListener("click", onRetry);
    this.#close.addEventListener("click", () => this.clear());
  }

  /** Says that something is on its way, or that it is there. */
  wait(isWaiting: boolean): void {
    const text = isWaiting ? "Loading…" : "";
    if (this.waiting.textContent !== text) this.waiting.textContent = text;
  }

  /** Shows an error; `isFatal`: nothing can be played; `canRetry`: another try may help. */
  say(text: string, isFatal: boolean, canRetry: boolean): void {
    this.#text.textContent = text;
    const buttons = [...(canRetry ? [this.#retry] : []), ...(isFatal ? [] : [this.#close])];
    this.alert.classList.toggle("bare", !buttons.length);
    this.alert.replaceChildren(this.#text, ...buttons);
  }

  /** Takes back what was said. */
  clear(): void {
    this.alert.replaceChildren();
  }
}
