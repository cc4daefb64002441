// What went wrong, said on the page.

import { part } from "./page";

/** Shows an error until it is closed. */
export function showError(error: unknown): void {
  const box = part("message");
  const text = error instanceof Error ? error.message : String(error);
  (box.querySelector("p") as HTMLElement).textContent = text;
  box.hidden = false;
  (box.querySelector("button") as HTMLElement).onclick = () => (box.hidden = true);
}
