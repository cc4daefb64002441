// Where the data come from: an exported page carries them, else the server has them.

import { Packet } from "./packet";
import type { Measured, Reel } from "./reel";

declare global {
  interface Window {
    MESHREEL?: Record<string, unknown>;
  }
}

/** Everything about the file that is not frames. */
export async function loadReel(): Promise<Reel> {
  const reel = (await loadJson("api/reel")) as Reel;
  if (!Array.isArray(reel.blocks)) throw new Error("api/reel arrived damaged: it has no blocks.");
  return reel;
}

/** Errors of all frames against the original, as far as they are measured. */
export async function loadMeasured(): Promise<Measured> {
  return (await loadJson("api/plots")) as Measured;
}

/** The packet at an address, from inside the page or from the server. */
export async function loadPacket(url: string): Promise<Packet> {
  const inline = window.MESHREEL?.[url];
  if (typeof inline === "string") return new Packet(await inflate(inline, url), url);
  return new Packet(await (await request(url)).arrayBuffer(), url);
}

async function loadJson(url: string): Promise<unknown> {
  return window.MESHREEL?.[url] ?? (await request(url)).json();
}

async function request(url: string): Promise<Response> {
  let response: Response;
  try {
    response = await fetch(url);
  } catch {
    throw new Error(
      "The meshreel server does not answer. Start `meshreel view` again and reload this page.",
    );
  }
  if (!response.ok) {
    throw new Error(`The server cannot give ${url}: ${reasonIn(await response.text())}`);
  }
  return response;
}

async function inflate(base64: string, url: string): Promise<ArrayBuffer> {
  try {
    const bytes = Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate-raw"));
    return await new Response(stream).arrayBuffer();
  } catch {
    throw new Error(`${url} is damaged inside this page. Export the page again.`);
  }
}

/** The reason in a refusal: JSON with an error, or plain text. */
function reasonIn(body: string): string {
  try {
    return (JSON.parse(body) as { error: string }).error;
  } catch {
    return body.slice(0, 300).trim();
  }
}
