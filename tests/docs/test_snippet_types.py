"""Snippets of the documentation have no errors in `mypy --strict` and strict TypeScript."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import meshreel
from samples.pages import PAGES, name_of, shares_variables, snippets
from samples.web_package import PACKAGE, built_package

pytestmark = pytest.mark.slow

SETTINGS = """[mypy]
strict = true
warn_unreachable = true
[mypy-fsspec.*,igl.*,torch.*,xatlas.*]
ignore_missing_imports = true
"""


SCRIPT_PAGES = [*PAGES, PACKAGE / "README.md"]
GLOBALS = """import type { ReelFile } from "meshreel";
import type { ReelMesh } from "meshreel/three";
import type * as THREE from "three";
declare global {
  var reel: ReelFile, mesh: ReelMesh;
  var scene: THREE.Scene, camera: THREE.Camera, renderer: THREE.WebGLRenderer, clock: THREE.Clock;
}
"""
"""What snippets use of earlier snippets, and of the page that they are part of."""

TSCONFIG = """{"compilerOptions": {
  "strict": true, "noEmit": true, "types": [], "jsx": "react-jsx", "moduleDetection": "force",
  "target": "es2022", "module": "esnext", "moduleResolution": "bundler",
  "lib": ["es2023", "dom", "dom.iterable"], "skipLibCheck": true
}}"""
"""`npm/test/types.test.mjs` checks the declarations of the package."""


def scripts_of(page):
    """Yield the extension and the text of the scripts of a page."""
    for snippet in snippets(page):
        if snippet.language == "html":
            for script in re.findall(r"<script[^>]*>(.*?)</script>", snippet.text, re.DOTALL):
                yield "ts", script
        elif snippet.language in ("js", "ts", "jsx", "tsx"):
            yield snippet.language.replace("js", "ts"), snippet.text


def test_snippets_pass_the_strict_checks_of_typescript(tmp_path):
    built_package()
    (tmp_path / "node_modules").mkdir()
    for name in ("three", "@types"):
        (tmp_path / "node_modules" / name).symlink_to(PACKAGE / "node_modules" / name)
    (tmp_path / "node_modules" / "meshreel").symlink_to(PACKAGE)
    (tmp_path / "tsconfig.json").write_text(TSCONFIG)
    (tmp_path / "globals.d.ts").write_text(GLOBALS)
    names = []
    for page in SCRIPT_PAGES:
        for number, (extension, text) in enumerate(scripts_of(page)):
            names += [f"{name_of(page).replace('/', '_')}_{number}.{extension}"]
            (tmp_path / names[-1]).write_text(text, "utf-8")
    assert sum("web.md" in name for name in names) >= 8
    compiler = PACKAGE / "node_modules" / "typescript" / "bin" / "tsc"
    command = ["node", str(compiler), "-p", "."]
    run = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=300)
    assert run.stdout == ""
    assert run.returncode == 0


def test_snippets_have_no_type_errors(tmp_path):
    pytest.importorskip("mypy", reason="mypy is not installed")
    for page in PAGES:
        name = name_of(page).removesuffix(".md").replace("/", "_").replace("-", "_")
        texts = [
            snippet.text
            for snippet in snippets(page)
            if snippet.language == "python" and not (snippet.needs or "").startswith("Blender")
        ]
        for number, text in enumerate(["\n".join(texts)] if shares_variables(page) else texts):
            (tmp_path / f"{name}_{number}.py").write_text(text, encoding="utf-8")
    files = sorted(file.name for file in tmp_path.iterdir())
    (tmp_path / "mypy.ini").write_text(SETTINGS, encoding="utf-8")
    assert len(files) > 20
    command = [sys.executable, "-m", "mypy", "--config-file", "mypy.ini", *files]
    place = Path(meshreel.__file__).parents[1]
    path = {} if place.name == "site-packages" else {"MYPYPATH": str(place)}  # mypy refuses it
    run = subprocess.run(
        command,
        cwd=tmp_path,
        env={**os.environ, **path},
        capture_output=True,
        text=True,
        check=False,
    )
    errors = [line for line in run.stdout.splitlines() if line.partition(":")[0] in files]
    assert errors == []
    assert "Found" in run.stdout or "Success" in run.stdout, run.stdout + run.stderr
