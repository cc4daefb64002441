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

/** Keeps a file open until its last user unmounts. */
function keepOpen(url: string) {
  const file = fileOf(url);
  file.nUsers++;
  const release = async () => {
    if (--file.nUsers > 0) return;
    files.delete(url);
    (await file.opening).close();
  };
  return () => void setTimeout(release); // StrictMode remounts immediately
}

/** Plays a file, scaled to 1 unit around the origin. Suspends until it is open. */
export function Reel({ url, ...props }: { url: string } & Omit<ThreeElements["reelMesh"], "args">) {
  const reel = use(fileOf(url).opening);
  useEffect(() => keepOpen(url), [url]);
  const args = useMemo(() => [reel, { origin: reel.info.center }] as const, [reel]);
  const mesh = useRef<ReelMesh>(null!);
  useEffect(() => mesh.current.play(), [reel]);
  useFrame((_, delta) => mesh.current.update(delta));
  return <reelMesh ref={mesh} args={[...args]} scale={1 / reel.info.diagonal} {...props} />;
}
