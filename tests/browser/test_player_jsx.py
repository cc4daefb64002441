"""The types of <reel-player> in JSX, with the types of React 18 and 19."""

import json
import re
import subprocess

import pytest

from samples.npm_projects import npm
from samples.web_package import PACKAGE, built_package

pytestmark = pytest.mark.slow

RIGHT = """
import "meshreel/jsx";
import type { ReelPlayerElement } from "meshreel/player";
import { useRef } from "react";

export function Page() {
  const player = useRef<ReelPlayerElement>(null);
  const press = () => player.current?.play();
  return (
    <reel-player
      ref={player} src="walk.reel" alt="Anna walks" className="wide" onClick={press}
      autoplay="" loop="pingpong" controls camera-controls start-time={0.5} track-range="2%:98%"
    />
  );
}
"""
WRONG = {
    "source": "<reel-player source='walk.reel' />",
    "number": "<reel-player src={3} />",
    "choice": "<reel-player up='x' />",
}


@pytest.fixture(scope="module", autouse=True)
def _package():
    built_package()


@pytest.mark.parametrize("react", [18, 19])
def test_only_the_tags_with_wrong_attributes_are_errors(react, tmp_path):
    folder = project_with(react, tmp_path)
    (folder / "right.tsx").write_text(RIGHT, "utf-8")
    lines = [f"export const {name} = {tag};" for name, tag in WRONG.items()]
    (folder / "wrong.tsx").write_text("\n".join(['import "meshreel/jsx";', *lines]), "utf-8")
    result = complaints(folder)
    assert re.findall(r"^(\S+)\((\d+),", result, re.M) == [
        ("wrong.tsx", "2"),
        ("wrong.tsx", "3"),
        ("wrong.tsx", "4"),
    ], result


def project_with(react, folder):
    """A folder with the package and the types of a version of React."""
    (folder / "package.json").write_text("{}", "utf-8")
    npm("install", f"@types/react@{react}", folder=folder)
    (folder / "node_modules" / "meshreel").symlink_to(PACKAGE)
    options = {
        "strict": True,
        "noEmit": True,
        "jsx": "react-jsx",
        "target": "es2022",
        "module": "esnext",
        "moduleResolution": "bundler",
        "preserveSymlinks": True,
        "lib": ["es2023", "dom"],
        "types": [],
        "paths": {
            "three": [f"{PACKAGE}/node_modules/@types/three"],
            "react": ["./node_modules/@types/react"],
            "react/*": ["./node_modules/@types/react/*"],
        },
        "skipLibCheck": True,
    }
    project = {"compilerOptions": options, "files": ["right.tsx", "wrong.tsx"]}
    (folder / "tsconfig.json").write_text(json.dumps(project), "utf-8")
    return folder


def complaints(project):
    """Type-check a project and return the errors."""
    compiler = PACKAGE / "node_modules" / "typescript" / "bin" / "tsc"
    command = ["node", str(compiler), "-p", str(project)]
    done = subprocess.run(command, cwd=project, capture_output=True, text=True, timeout=120)
    return done.stdout
