// Saves the canvas as a PNG image, including the legend.

import type { PlayerParts } from "../player/element.js";

const MARGIN = 12;

/** Save the picture of a player, which must have been drawn in the same task. */
export function saveScreenshot({ view, legend }: PlayerParts, name: string): void {
  const { canvas } = view;
  const output = document.createElement("canvas");
  output.width = canvas.width;
  output.height = canvas.height;
  const context = output.getContext("2d") as CanvasRenderingContext2D;
  context.fillStyle = getComputedStyle((canvas.getRootNode() as ShadowRoot).host).backgroundColor;
  context.fillRect(0, 0, output.width, output.height);
  context.drawImage(canvas, 0, 0);
  if (!legend.element.hidden) {
    const pixelRatio = canvas.width / canvas.clientWidth;
    context.scale(pixelRatio, pixelRatio);
    context.translate(MARGIN, canvas.clientHeight - legend.element.clientHeight - MARGIN);
    legend.paint(context);
  }
  output.toBlob((blob) => {
    if (!blob) return;
    const link = document.createElement("a");
    link.href = URL.createObjectURL(blob);
    link.download = name;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
  }, "image/png");
}
