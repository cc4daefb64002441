// The parts of the page, by their id.

/** The element of an id, which index.html has. */
export function part<T extends Element = HTMLElement>(id: string): T {
  return document.getElementById(id) as unknown as T;
}

export function input(id: string): HTMLInputElement {
  return part<HTMLInputElement>(id);
}

/** Fills a list of terms with names and values. */
export function fillRows(list: HTMLElement, rows: [string, string][]): void {
  list.replaceChildren(
    ...rows.flatMap(([name, value]) => [element("dt", name), element("dd", value)]),
  );
}

export function element(tag: string, text = ""): HTMLElement {
  const made = document.createElement(tag);
  made.textContent = text;
  return made;
}

/** A group of radio buttons as one choice. */
export class Choice<T extends string> {
  private readonly buttons: HTMLInputElement[];

  constructor(
    id: string,
    value: T,
    private readonly chosen: (value: T) => void,
  ) {
    this.buttons = [...part(id).querySelectorAll("input")];
    for (const button of this.buttons) {
      button.checked = button.value === value;
      button.addEventListener("change", () => chosen(button.value as T));
    }
  }

  /** Takes the next of the values, as a key does. */
  next(): void {
    const at = this.buttons.findIndex((button) => button.checked);
    const button = this.buttons[(at + 1) % this.buttons.length];
    button.checked = true;
    this.chosen(button.value as T);
  }
}

/** Shows an error until it is closed. */
export function showError(error: unknown): void {
  const box = part("message");
  const text = error instanceof Error ? error.message : String(error);
  (box.querySelector("p") as HTMLElement).textContent = text;
  box.hidden = false;
  (box.querySelector("button") as HTMLElement).onclick = () => (box.hidden = true);
}
