// Where the data come from: an exported page carries them or says where they are, else the server
// has them.

import { ReelFile, type TrackValues } from "meshreel";

import type { Facts, Measured, Reel } from "./facts";

/** A file inside the page, or beside it. */
type Carried = { base64: string } | { url: string };

/** What an exported page carries. */
interface Exported {
  facts: Facts;
  stream: Carried;
  /** Frames of the original, as a file of their own. */
  original?: Carried;
  texture?: Carried & { mediaType: string };
}

declare global {
  interface Window {
    MESHREEL?: Exported;
  }
}

/** Frames of the original. */
export interface Originals {
  /** Positions (V, 3) from the centre of the file. */
  frame(number: number): Promise<Float32Array>;
  /** Values of a track, as those of the file. */
  values(track: string, number: number): Promise<TrackValues>;
}

/** The file, and what is said of it. */
export async function openReel(): Promise<Reel> {
  const { MESHREEL: exported } = window;
  const facts = exported?.facts ?? ((await (await request("api/facts")).json()) as Facts);
  const file = await ReelFile.open(exported ? carried(exported.stream) : "stream.reel");
  return { ...facts, file };
}

/** Errors of all frames against the original, as far as they are measured. */
export async function loadMeasured(): Promise<Measured> {
  return (await request("api/plots")).json();
}

/** The frames of the original of a file that has one. */
export async function openOriginals({ file, original: info }: Reel): Promise<Originals> {
  const { nVerts, center } = file.info;
  const given = window.MESHREEL?.original;
  if (!given) {
    return {
      frame: async (number) => {
        const url = `api/original/${number}`;
        const positions = new Float32Array(await (await request(url)).arrayBuffer());
        if (positions.length !== 3 * nVerts) throw new Error(`${url} arrived damaged.`);
        return positions;
      },
      values: async (track, number) => {
        const url = `api/original_track/${info?.tracks.indexOf(track)}/${number}`;
        const bytes = await (await request(url)).arrayBuffer();
        const { nItems, nColumns } = file.track(track).info;
        const width = bytes.byteLength / (nItems * nColumns);
        if (width === 4) return new Float32Array(bytes);
        if (width === 8) return new Float64Array(bytes);
        throw new Error(`${url} arrived damaged.`);
      },
    };
  }
  const original = await ReelFile.open(carried(given));
  return {
    frame: async (number) =>
      Float32Array.from(await original.frame(number), (value, i) => value - center[i % 3]),
    values: (track, number) => {
      // A track that is not carried along is the same in the file.
      const isCarried = original.info.tracks.some(({ name }) => name === track);
      return (isCarried ? original : file).track(track).frame(number);
    },
  };
}

/** An image or a video to show on the mesh, where the page carries one. */
export function carriedTexture(): { url: string; kind: "image" | "video" } | null {
  const given = window.MESHREEL?.texture;
  if (!given) return null;
  const { mediaType } = given;
  const kind = mediaType.startsWith("video/") ? "video" : "image";
  if ("url" in given) return { url: given.url, kind };
  return { url: URL.createObjectURL(new Blob([bytesOf(given)], { type: mediaType })), kind };
}

function carried(given: Carried): string | Uint8Array {
  return "url" in given ? given.url : bytesOf(given);
}

function bytesOf({ base64 }: { base64: string }): Uint8Array<ArrayBuffer> {
  return Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
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

/** The reason in a refusal: JSON with an error, or plain text. */
function reasonIn(body: string): string {
  try {
    return (JSON.parse(body) as { error: string }).error;
  } catch {
    return body.slice(0, 300).trim();
  }
}
