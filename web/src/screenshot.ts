// The picture as a PNG file, with the colour bar where there is one.

import { part } from "./page";

const MARGIN = 12;

/** Saves the canvas, which must have been drawn in this very moment. */
export function saveScreenshot(canvas: HTMLCanvasElement, name: string): void {
  const sheet = document.createElement("canvas");
  sheet.width = canvas.width;
  sheet.height = canvas.height;
  const pen = sheet.getContext("2d") as CanvasRenderingContext2D;
  pen.drawImage(canvas, 0, 0);
  const figure = part("heat-bar");
  if (!figure.hidden) addBar(pen, figure, canvas.width / canvas.clientWidth);
  sheet.toBlob((blob) => {
    if (!blob) return;
    const link = document.createElement("a");
    link.href = URL.createObjectURL(blob);
    link.download = name;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
  }, "image/png");
}

function addBar(pen: CanvasRenderingContext2D, figure: HTMLElement, pixelRatio: number): void {
  const bar = figure.querySelector("canvas") as HTMLCanvasElement;
  const caption = figure.querySelector("figcaption")?.textContent ?? "";
  const [width, height] = [bar.clientWidth, bar.clientHeight];
  const style = getComputedStyle(figure);
  pen.scale(pixelRatio, pixelRatio);
  pen.translate(MARGIN, pen.canvas.height / pixelRatio - height - 20 - MARGIN);
  pen.fillStyle = style.backgroundColor;
  pen.fillRect(-6, -8, Math.max(width, 240) + 12, height + 28);
  pen.drawImage(bar, 0, 0, width, height);
  pen.fillStyle = style.color;
  pen.font = "12px system-ui, sans-serif";
  pen.fillText(caption, 8, height + 12);
}
