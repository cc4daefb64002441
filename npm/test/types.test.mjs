// Strict projects compile with the published types, for each module resolution.

import assert from "node:assert/strict";
import { mkdirSync, mkdtempSync, rmSync, symlinkSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { test } from "node:test";
import ts from "typescript";

import { PACKAGE } from "./support/bundle.mjs";

/** A project that uses each entry point. TypeScript reports unused `@ts-expect-error` directives. */
const CONSUMER = `
import { ReelFile, SourceError, type BlockFields, type ReelInfo, type TrackValues } from "meshreel";
import { ReelLoader, ReelMesh } from "meshreel/three";
import "meshreel/player";
import * as THREE from "three";

export async function play(bytes: Uint8Array): Promise<ReelInfo> {
  const reel = await ReelFile.open(bytes, { worker: false });
  const positions: Float32Array | Float64Array = await reel.frame(0);
  const values: TrackValues = await reel.track("stress").frame(positions.length);
  const { fields }: BlockFields = await reel.fields(values.length);
  // @ts-expect-error The elements of an Int16Array are numbers.
  const first: string = fields[0];
  const mesh: ReelMesh = await new ReelLoader().loadAsync(first);
  const scene: THREE.Object3D = new THREE.Scene().add(mesh);
  // @ts-expect-error A mesh has no such method.
  mesh.fly(scene);
  if (!(new Error() instanceof SourceError)) mesh.play();
  return reel.info;
}
`;

const OPTIONS = {
  target: ts.ScriptTarget.ES2022,
  lib: ["lib.es2022.d.ts", "lib.dom.d.ts", "lib.dom.iterable.d.ts"],
  strict: true,
  exactOptionalPropertyTypes: true,
  noUncheckedIndexedAccess: true,
  types: [],
};

/** Type-check the project and the declarations of this package; returns the errors. */
function typeCheck(folder, module, moduleResolution) {
  const options = { ...OPTIONS, module, moduleResolution };
  const program = ts.createProgram([join(folder, "consumer.ts")], options);
  // Declarations of three.js are skipped, since checking them takes seconds.
  const files = program.getSourceFiles().filter((file) => !file.fileName.includes("/node_modules/"));
  assert.ok(files.some((file) => file.fileName.endsWith("/dist/three/gpu/gpu_backend.d.ts")));
  const errors = [
    ...program.getOptionsDiagnostics(),
    ...files.flatMap((file) => [
      ...program.getSyntacticDiagnostics(file),
      ...program.getSemanticDiagnostics(file),
    ]),
  ];
  return ts.formatDiagnostics(errors, {
    getCanonicalFileName: (name) => name,
    getCurrentDirectory: () => PACKAGE,
    getNewLine: () => "\n",
  });
}

for (const [name, module, moduleResolution] of [
  ["NodeNext", ts.ModuleKind.NodeNext, ts.ModuleResolutionKind.NodeNext],
  ["Bundler", ts.ModuleKind.ESNext, ts.ModuleResolutionKind.Bundler],
]) {
  test(`a strict project compiles with moduleResolution ${name}`, () => {
    const folder = mkdtempSync(join(tmpdir(), "meshreel-types-"));
    try {
      mkdirSync(join(folder, "node_modules"));
      symlinkSync(PACKAGE, join(folder, "node_modules/meshreel"));
      for (const other of ["three", "@types"]) {
        symlinkSync(join(PACKAGE, "node_modules", other), join(folder, "node_modules", other));
      }
      writeFileSync(join(folder, "package.json"), '{ "type": "module" }');
      writeFileSync(join(folder, "consumer.ts"), CONSUMER);
      assert.equal(typeCheck(folder, module, moduleResolution), "");
    } finally {
      rmSync(folder, { recursive: true });
    }
  });
}
