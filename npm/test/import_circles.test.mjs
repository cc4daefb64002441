// No module of src/ imports itself, not even for a type, through the modules that it imports.

import assert from "node:assert/strict";
import { readdirSync, readFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { test } from "node:test";
import ts from "typescript";
import { PACKAGE } from "./support/bundle.mjs";

/** Return the modules that each module of src/ imports. */
function importsOfModules() {
  const source = join(PACKAGE, "src");
  const paths = readdirSync(source, { recursive: true }).filter((path) => path.endsWith(".ts"));
  const entries = paths.map((path) => {
    const { importedFiles } = ts.preProcessFile(readFileSync(join(source, path), "utf8"), true, true);
    const names = importedFiles.map(({ fileName }) => fileName).filter((name) => name.startsWith("."));
    return [path, names.map((name) => join(dirname(path), name.replace(/\.js$/, ".ts")))];
  });
  return new Map(entries);
}

/** Return a circle of imports, as the modules on it; null if there is none. */
function findCircle(imports) {
  const done = new Set();
  const visit = (path, importers) => {
    if (importers.includes(path)) return [...importers.slice(importers.indexOf(path)), path];
    if (done.has(path)) return null;
    for (const other of imports.get(path) ?? []) {
      const circle = visit(other, [...importers, path]);
      if (circle) return circle;
    }
    done.add(path);
    return null;
  };
  for (const path of imports.keys()) {
    const circle = visit(path, []);
    if (circle) return circle;
  }
  return null;
}

test("modules do not import each other in a circle", () => {
  const imports = importsOfModules();
  assert.ok(imports.size > 90);
  assert.equal(findCircle(imports), null);
});

test("a circle is found when a module imports one of its importers", () => {
  const imports = new Map([["a", ["b", "c"]], ["b", []], ["c", ["d"]], ["d", ["b", "a"]]]);
  assert.deepEqual(findCircle(imports), ["a", "c", "d", "a"]);
});
