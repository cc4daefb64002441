import { Canvas } from "@react-three/fiber";
import { StrictMode, Suspense, useState } from "react";
import { createRoot } from "react-dom/client";
import { DoubleSide } from "three";

import { Reel } from "./reel";

const distance = 1.5 * Math.max(1, innerHeight / innerWidth);

function Page() {
  const [isShown, setShown] = useState(true);
  return (
    <>
      <label>
        <input type="checkbox" checked={isShown} onChange={() => setShown(!isShown)} /> Flag
      </label>
      <Canvas camera={{ position: [0, 0, distance], fov: 40 }}>
        <hemisphereLight args={[0xffffff, 0x667788, 1.5]} />
        <directionalLight position={[1, 2, 3]} intensity={2} />
        <Suspense>
          {isShown && (
            <Reel
              url="flag.reel"
              material-side={DoubleSide}
              onUpdate={(mesh) => Object.assign(window, { mesh })} // to try it from the console
            />
          )}
        </Suspense>
      </Canvas>
    </>
  );
}

createRoot(document.getElementById("root")!).render(
  <StrictMode>
    <Page />
  </StrictMode>,
);
