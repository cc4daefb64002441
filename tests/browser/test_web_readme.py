"""Programs in the README of the npm package pass strict TypeScript and play."""

import json
import subprocess

import numpy as np
import pytest

import meshreel
from samples.element_pages import until
from samples.page_play import assert_shown
from samples.pages import snippets
from samples.web_package import PACKAGE, THREE_PAGE, built_package, serving, three_files

pytestmark = pytest.mark.slow

PAGE = f"""<!doctype html><html lang="en">{THREE_PAGE}<body></body><script type="module">"""
PROGRAMS = [
    snippet.text for snippet in snippets(PACKAGE / "README.md") if snippet.text.startswith("import")
]
MILLIMETERS = 1000


def test_programs_pass_the_strict_checks_of_typescript(tmp_path):
    files = [tmp_path / f"program_{number}.ts" for number in range(len(PROGRAMS))]
    for file, program in zip(files, PROGRAMS, strict=True):
        file.write_text(program, "utf-8")
    built_package()
    modules = PACKAGE / "node_modules"
    paths = {
        "meshreel": [f"{PACKAGE}/dist/index.d.ts"],
        "meshreel/three": [f"{PACKAGE}/dist/three/index.d.ts"],
        "three": [f"{modules}/@types/three"],
    }
    options = {
        "strict": True,
        "noEmit": True,
        "target": "es2022",
        "module": "esnext",
        "moduleResolution": "bundler",
        "lib": ["es2023", "dom", "dom.iterable"],
        "types": [],
        "paths": paths,
        "skipLibCheck": True,  # npm/test/types.test.mjs checks the declarations of the package
    }
    project = {"compilerOptions": options, "files": [file.name for file in files]}
    (tmp_path / "tsconfig.json").write_text(json.dumps(project), "utf-8")
    command = ["node", str(modules / "typescript" / "bin" / "tsc"), "-p", str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.stdout == ""
    assert done.returncode == 0


def test_program_of_three_plays_a_model_in_millimeters_without_scroll_bars(new_page):
    [program] = [one for one in PROGRAMS if "ReelLoader" in one]
    flag = meshreel.simulate_flag(30, n_rows=12, n_columns=15)
    large = meshreel.MeshSequence(flag.vertices * np.float32(MILLIMETERS), flag.faces, fps=flag.fps)
    page = f"{PAGE}{program}\nObject.assign(window, {{ mesh }});</script></html>"
    files = {**three_files(page), "/walk.reel": meshreel.encode(large)}
    with serving(files) as (url, _):
        page = new_page(f"{url}/index.html", width=640, height=400, is_shown=False)
        until(page, "window.mesh?.frame > 2")
        sizes = "[scrollWidth, scrollHeight, clientWidth, clientHeight]"
        result = page.evaluate(f"(({{ {sizes[1:-1]} }}) => {sizes})(document.documentElement)")
        assert result == [640, 400, 640, 400]
        assert_shown(page.screenshot())
        page.close()  # while the server runs
