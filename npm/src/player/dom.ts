// Creates the DOM elements of a player.

const SVG = "http://www.w3.org/2000/svg";

/** Icons as SVG paths, filled, in a box of 24 x 24. */
const ICONS = {
  play: "M8 5v14l11-7z",
  pause: "M6 5h4v14H6zM14 5h4v14h-4z",
  previous: "M18 5v14l-9-7zM6 5h2v14H6z",
  next: "M6 5l9 7-9 7zM16 5h2v14h-2z",
  loud: "M4 9v6h4l5 4V5L8 9zM15 9a4 4 0 0 1 0 6l1.3 1.5a6 6 0 0 0 0-9z",
  muted: "M4 9v6h4l5 4V5L8 9zM15.5 8.5l6 6-1.2 1.2-6-6zM20.3 8.5l1.2 1.2-6 6-1.2-1.2z",
  full: "M5 5h6v2H7v4H5zM13 5h6v6h-2V7h-4zM5 13h2v4h4v2H5zM17 13h2v6h-6v-2h4z",
  small: "M9 4h2v7H4V9h5zM13 4h2v5h5v2h-7zM4 13h7v7H9v-5H4zM13 13h7v2h-5v5h-2z",
} as const;

/** The name of an icon. */
export type Icon = keyof typeof ICONS;

/** Create an element with a CSS class and children. */
export function createElement<Name extends keyof HTMLElementTagNameMap>(
  name: Name,
  className: string,
  ...children: (Node | string)[]
): HTMLElementTagNameMap[Name] {
  const element = document.createElement(name);
  element.className = className;
  element.append(...children);
  return element;
}

/** A button with an icon and a label. */
export class IconButton {
  readonly element: HTMLButtonElement;
  readonly #path = document.createElementNS(SVG, "path");

  constructor(className: string, icon: Icon, label: string, onClick: () => void) {
    const svg = document.createElementNS(SVG, "svg");
    svg.setAttribute("viewBox", "0 0 24 24");
    svg.setAttribute("aria-hidden", "true");
    svg.append(this.#path);
    this.element = createElement("button", className, svg);
    this.element.type = "button";
    this.element.addEventListener("click", onClick);
    this.setAction(icon, label);
  }

  /** Set the icon and the label. */
  setAction(icon: Icon, label: string): void {
    if (this.element.title === label) return;
    this.#path.setAttribute("d", ICONS[icon]);
    this.element.title = label;
    this.element.setAttribute("aria-label", label);
  }
}
