// Status messages and errors of a player.

import { createElement } from "./dom.js";

/** Messages over the canvas. */
export class Messages {
  readonly waiting = createElement("p", "waiting");
  readonly alert = createElement("div", "alert");
  readonly #text = createElement("p", "");
  readonly #retry = createElement("button", "", "Try again");
  readonly #close = createElement("button", "", "Dismiss");

  /** @param onRetry - called when the user presses "Try again" */
  constructor(onRetry: () => void) {
    this.waiting.setAttribute("role", "status");
    this.alert.setAttribute("role", "alert");
    this.#retry.type = this.#close.type = "button";
    this.#retry.addEventListener("click", onRetry);
    this.#close.addEventListener("click", () => this.clearError());
  }

  /** Show or hide the loading indicator. */
  showLoading(isWaiting: boolean): void {
    const text = isWaiting ? "Loading…" : "";
    if (this.waiting.textContent !== text) this.waiting.textContent = text;
  }

  /** Show an error; `isFatal`: it cannot be dismissed; `canRetry`: show the button "Try again". */
  showError(text: string, isFatal: boolean, canRetry: boolean): void {
    this.#text.textContent = text;
    const buttons = [...(canRetry ? [this.#retry] : []), ...(isFatal ? [] : [this.#close])];
    this.alert.classList.toggle("bare", !buttons.length);
    this.alert.replaceChildren(this.#text, ...buttons);
  }

  /** Remove the error. */
  clearError(): void {
    this.alert.replaceChildren();
  }
}
