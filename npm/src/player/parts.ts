// Elements of the page that a player is made of.

const SVG = "http://www.w3.org/2000/svg";

/** Shapes of 24 x 24, filled. */
const SHAPES = {
  play: "M8 5v14l11-7z",
  pause: "M6 5h4v14H6zM14 5h4v14h-4z",
  loud: "M4 9v6h4l5 4V5L8 9zM15 9a4 4 0 0 1 0 6l1.3 1.5a6 6 0 0 0 0-9z",
  muted: "M4 9v6h4l5 4V5L8 9zM15.5 8.5l6 6-1.200 1.200-6-6zM20.3 8.5l1.200 1.200-6 6-1.200-1.200z",
  full: "M5 5h6v2H7v4H5zM13 5h6v6h-2V7h-4zM5 13h2v4h4v2H5zM17 13h2v6h-6v-2h4z",
  small: "M9 4h2v7H4V9h5zM13 4h2v5h5v2h-7zM4 13h7v7H9v-5H4zM13 13h7v2h-5v5h-2z",
} as const;

/** The name of a shape. */
export type Shape = keyof typeof SHAPES;

/** An element of a class with children. */
export function made<Name extends keyof HTMLElementTagNameMap>(
  name: Name,
  className: string,
  ...children: (Node | string)[]
): HTMLElementTagNameMap[Name] {
  const element = document.createElement(name);
  element.className = className;
  element.append(...children);
  return element;
}

/** A button with a shape, whose label and shape say what it does. */
export class ShapeButton {
  readonly element: HTMLButtonElement;
  readonly #path = document.createElementNS(SVG, "path");

  constructor(className: string, shape: Shape, label: string, onClick: () => void) {
    const picture = document.createElementNS(SVG, "svg");
    picture.setAttribute("viewBox", "0 0 24 24");
    picture.setAttribute("aria-hidden", "true");
    picture.append(this.#path);
    this.element = made("button", className, picture);
    this.element.type = "button";
    this.element.addEventListener("click", onClick);
    this.say(shape, label);
  }

  /** Changes what it does. */
  say(shape: Shape, label: string): void {
    if (this.element.title === label) return;
    this.#path.setAttribute("d", SHAPES[shape]);
    this.element.title = label;
    this.element.setAttribute("aria-label", label);
  }
}
