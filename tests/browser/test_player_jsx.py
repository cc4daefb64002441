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


@pytest.fixture(scope="module", params=[18, 19])
def project(request, tmp_path_factory):
    """A folder with the package and the types of a version of React."""
    built_package()
    folder = tmp_path_factory.mktemp(f"react{request.param}")
    (folder / "package.json").write_text("{}", "utf-8")
    npm("install", f"@types/react@{request.param}", folder=folder)
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
        "paths": {"three": [f"{PACKAGE}/node_modules/@types/three"]},
        "skipLibCheck": True,
    }
    project = {"compilerOptions": options, "files": ["page.tsx"]}
    (folder / "tsconfig.json").write_text(json.dumps(project), "utf-8")
    return folder


def complaints(project, program):
    """What TypeScript says of a program."""
    (project / "page.tsx").write_text(program, "utf-8")
    compiler = PACKAGE / "node_modules" / "typescript" / "bin" / "tsc"
    command = ["node", str(compiler), "-p", str(project)]
    return subprocess.run(command, capture_output=True, text=True, timeout=120).stdout


def test_program_with_the_element_is_right(project):
    assert complaints(project, RIGHT) == ""


def test_wrong_attributes_are_errors(project):
    lines = [f"export const {name} = {tag};" for name, tag in WRONG.items()]
    said = complaints(project, "\n".join(['import "meshreel/jsx";', *lines]))
    assert re.findall(r"page\.tsx\((\d+),", said) == ["2", "3", "4"], said
