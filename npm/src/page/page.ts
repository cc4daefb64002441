// Helpers for DOM elements.

import { createElement } from "../player/dom.js";
import { partsOf, type ReelPlayerElement } from "../player/element.js";

/** Return the element of index.html with an id. */
export function byId<T extends Element = HTMLElement>(id: string): T {
  return document.getElementById(id) as unknown as T;
}

export function inputById(id: string): HTMLInputElement {
  return byId<HTMLInputElement>(id);
}

/** Whether the system requests dark colors. */
export const darkScheme = matchMedia("(prefers-color-scheme: dark)");

/** Fill a description list with names and values. */
export function fillRows(list: HTMLElement, rows: [string, string][]): void {
  list.replaceChildren(
    ...rows.map(([name, value]) =>
      createElement("div", "", createElement("dt", "", name), createElement("dd", "", value)),
    ),
  );
}

/** A group of radio buttons. */
export class Choice<T extends string> {
  private readonly buttons: HTMLInputElement[];

  constructor(
    id: string,
    value: T,
    private readonly onChange: (value: T) => void,
  ) {
    this.buttons = [...byId(id).querySelectorAll("input")];
    for (const button of this.buttons) {
      button.checked = button.value === value;
      button.addEventListener("change", () => onChange(button.value as T));
    }
  }

  /** Select the next value. */
  next(): void {
    const at = this.buttons.findIndex((button) => button.checked);
    this.check(this.buttons[(at + 1) % this.buttons.length]);
  }

  select(value: T): void {
    for (const button of this.buttons) if (button.value === value) this.check(button);
  }

  private check(button: HTMLInputElement): void {
    button.checked = true;
    this.onChange(button.value as T);
  }
}

/** The player of the page. */
export function playerElement(): ReelPlayerElement {
  return byId<ReelPlayerElement>("viewer");
}

/** Show an error until the user closes it. */
export function showError(error: unknown): void {
  const text = error instanceof Error ? error.message : String(error);
  partsOf(playerElement()).messages.showError(text, false, false);
}
