import { extend, type ThreeElement, type ThreeElements, useFrame } from "@react-three/fiber";
import { ReelFile } from "meshreel";
import { ReelMesh } from "meshreel/three";
import { use, useEffect, useMemo, useRef } from "react";

declare module "@react-three/fiber" {
  interface ThreeElements {
    reelMesh: ThreeElement<typeof ReelMesh>;
  }
}
extend({ ReelMesh });

const files = new Map<string, { opening: Promise<ReelFile>; nUsers: number }>();

function fileOf(url: string) {
  const file = files.get(url) ?? { opening: ReelFile.open(url), nUsers: 0 };
  files.set(url, file);
  return file;
}

/** Keeps a file open until the last of those that show it has gone. */
function keepOpen(url: string) {
  const file = fileOf(url);
  file.nUsers++;
  const letGo = async () => {
    if (--file.nUsers > 0) return;
    files.delete(url);
    (await file.opening).close();
  };
  return () => void setTimeout(letGo); // it may come back at once, as in StrictMode
}

/** Plays a file, 1 unit in size around the origin. Suspends until it is open. */
export function Reel({ url, ...props }: { url: string } & Omit<ThreeElements["reelMesh"], "args">) {
  const reel = use(fileOf(url).opening);
  useEffect(() => keepOpen(url), [url]);
  const args = useMemo(() => [reel, { origin: reel.info.center }] as const, [reel]);
  const mesh = useRef<ReelMesh>(null!);
  useEffect(() => mesh.current.play(), [reel]);
  useFrame((_, delta) => mesh.current.update(delta));
  return <reelMesh ref={mesh} args={[...args]} scale={1 / reel.info.diagonal} {...props} />;
}
