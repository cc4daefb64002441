// For each stream of standard input, after its length: is it whole, and do all of its frames decode?

import { readFileSync } from "node:fs";

const [script, memory] = process.argv.slice(2);
const { MeshReelError, ReelFile } = await import(script);
const data = new Uint8Array(readFileSync(0));
const verdicts = [];
for (let at = 0; at < data.length;) {
  const end = at + 4 + new DataView(data.buffer, data.byteOffset + at).getUint32(0, true);
  verdicts.push(await verdict(data.slice(at + 4, end)));
  at = end;
}
console.log(JSON.stringify(verdicts));

async function verdict(bytes) {
  let reel = null;
  try {
    reel = await ReelFile.open(bytes, { memory: Number(memory) });
    const { nFrames, tracks, damage } = reel.info;
    for (let t = 0; t < nFrames; t++) await reel.frame(t);
    for (const { name } of tracks) {
      const track = reel.track(name);
      for (let t = 0; t < nFrames; t++) await track.frame(t);
    }
    return [damage === null, true];
  } catch (error) {
    if (!(error instanceof MeshReelError)) throw error;
    return [false, false];
  } finally {
    reel?.close();
  }
}
