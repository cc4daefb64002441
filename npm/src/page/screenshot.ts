// Saves the canvas as a PNG image, including the color bar.

import { byId } from "./page.js";

const MARGIN = 12;

/** Save the canvas, which must have been drawn in the same task. */
export function saveScreenshot(canvas: HTMLCanvasElement, name: string): void {
  const output = document.createElement("canvas");
  output.width = canvas.width;
  output.height = canvas.height;
  const context = output.getContext("2d") as CanvasRenderingContext2D;
  context.drawImage(canvas, 0, 0);
  const figure = byId("heat-bar");
  if (!figure.hidden) addBar(context, figure, canvas.width / canvas.clientWidth);
  output.toBlob((blob) => {
    if (!blob) return;
    const link = document.createElement("a");
    link.href = URL.createObjectURL(blob);
    link.download = name;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
  }, "image/png");
}

function addBar(context: CanvasRenderingContext2D, figure: HTMLElement, pixelRatio: number): void {
  const bar = figure.querySelector("canvas") as HTMLCanvasElement;
  const caption = figure.querySelector("figcaption")?.textContent ?? "";
  const [width, height] = [bar.clientWidth, bar.clientHeight];
  const style = getComputedStyle(figure);
  context.scale(pixelRatio, pixelRatio);
  context.translate(MARGIN, context.canvas.height / pixelRatio - height - 20 - MARGIN);
  context.fillStyle = style.backgroundColor;
  context.fillRect(-6, -8, Math.max(width, 240) + 12, height + 28);
  context.drawImage(bar, 0, 0, width, height);
  context.fillStyle = style.color;
  context.font = "12px system-ui, sans-serif";
  context.fillText(caption, 8, height + 12);
}
