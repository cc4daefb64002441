// Loads data: exported pages embed or reference them; otherwise the server provides them.

import { ReelFile, type TrackValues } from "../index.js";
import type { ReelPlayerElement } from "../player/element.js";

import type { EmbeddedFile, EmbeddedTexture, Facts, ErrorProgress, Reel } from "./facts.js";

/** Data of an exported page. */
interface Exported {
  facts: Facts;
  stream: EmbeddedFile;
  /** Frames of the original, as a separate file. */
  original?: EmbeddedFile;
}

declare global {
  interface Window {
    MESHREEL?: Exported;
  }
}

/** Access to frames of the original. */
export interface Originals {
  /** Positions (V, 3) relative to the center of the file. */
  frame(number: number): Promise<Float32Array>;
  /** Values of a track, in the layout of the file. */
  values(track: string, number: number): Promise<TrackValues>;
}

/** Load the metadata of the file. */
export async function loadFacts(): Promise<Facts> {
  return window.MESHREEL?.facts ?? ((await request("api/facts")).json() as Promise<Facts>);
}

/** Open the file in a player, with the image or video for the mesh, if any. */
export async function openInPlayer(
  player: ReelPlayerElement,
  facts: Promise<Facts>,
): Promise<void> {
  const { MESHREEL: exported } = window;
  const source = exported ? fileSource(exported.stream) : "stream.reel";
  if (typeof source === "string") player.src = source;
  else player.srcObject = source;
  const loaded = new Promise((resolve, reject) => {
    player.addEventListener("load", resolve, { once: true });
    player.addEventListener("error", ({ error }) => reject(error as Error), { once: true });
  });
  const textured = facts.then(({ texture }) => {
    if (texture) Object.assign(player, propertiesOf(texture));
  });
  await Promise.all([loaded, textured]); // together, so that no rejection is without a handler
}

/** Load the errors of all frames, or the progress of measuring them. */
export async function loadErrorProgress(): Promise<ErrorProgress> {
  return (await request("api/plots")).json();
}

/** Open the original of a file that has one. */
export async function openOriginals({ file, original: info }: Reel): Promise<Originals> {
  const { nVerts, center } = file.info;
  const embedded = window.MESHREEL?.original;
  if (!embedded) {
    return {
      frame: async (number) => {
        const url = `api/original/${number}`;
        const positions = new Float32Array(await (await request(url)).arrayBuffer());
        if (positions.length !== 3 * nVerts) throw new Error(`${url} is damaged.`);
        return positions;
      },
      values: async (track, number) => {
        const url = `api/original_track/${info?.tracks.indexOf(track)}/${number}`;
        const bytes = await (await request(url)).arrayBuffer();
        const { nItems, nColumns } = file.track(track).info;
        const width = bytes.byteLength / (nItems * nColumns);
        if (width === 4) return new Float32Array(bytes);
        if (width === 8) return new Float64Array(bytes);
        throw new Error(`${url} is damaged.`);
      },
    };
  }
  const original = await ReelFile.open(fileSource(embedded));
  return {
    frame: async (number) =>
      Float32Array.from(await original.frame(number), (value, i) => value - center[i % 3]),
    values: (track, number) => {
      // Tracks that are identical to those of the file are not embedded.
      const isEmbedded = original.info.tracks.some(({ name }) => name === track);
      return (isEmbedded ? original : file).track(track).frame(number);
    },
  };
}

/** Return the properties of the player for an image or video. */
function propertiesOf(file: EmbeddedTexture): Partial<ReelPlayerElement> {
  const { mediaType: type } = file;
  const texture =
    "url" in file ? file.url : URL.createObjectURL(new Blob([decodeBase64(file)], { type }));
  return { texture, textureKind: type.startsWith("video/") ? "video" : "image" };
}

function fileSource(embedded: EmbeddedFile): string | Uint8Array {
  return "url" in embedded ? embedded.url : decodeBase64(embedded);
}

function decodeBase64({ base64 }: { base64: string }): Uint8Array<ArrayBuffer> {
  return Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
}

async function request(url: string): Promise<Response> {
  let response: Response;
  try {
    response = await fetch(url);
  } catch {
    throw new Error(
      "The meshreel server does not respond. Start `meshreel view` again and reload this page.",
    );
  }
  if (!response.ok) {
    throw new Error(`The server cannot provide ${url}: ${errorMessage(await response.text())}`);
  }
  return response;
}

/** Return the message of an error response: JSON with an error, or plain text. */
function errorMessage(body: string): string {
  try {
    return (JSON.parse(body) as { error: string }).error;
  } catch {
    return body.slice(0, 300).trim();
  }
}
