"""The packed package plays in a Vite project, built and on the development server."""

import os
import re
import signal
import subprocess
import threading
from contextlib import contextmanager
from queue import Empty, Queue

import pytest

import meshreel
from samples.npm_projects import files_below, npm, packed
from samples.page_play import PLAYED, WATCHING, assert_played, assert_shown
from samples.web_package import serving

PATIENCE_S = 60

MAIN = """\
import * as THREE from "three";
import { ReelLoader } from "meshreel/three";
const renderer = new THREE.WebGLRenderer({ alpha: true });
renderer.setSize(innerWidth, innerHeight);
document.body.replaceChildren(renderer.domElement);
const [scene, camera] = [new THREE.Scene(), new THREE.PerspectiveCamera(40, 2, 0.1, 10)];
const mesh = await new ReelLoader().loadAsync("/flag.reel");
scene.add(mesh, new THREE.AmbientLight("white", 3)).position.set(-0.8, -0.5, -2);
mesh.play();
renderer.setAnimationLoop(() => (mesh.update(1 / 60), renderer.render(scene, camera)));
"""
TRIED = "Object.assign(window, { mesh });\n"

pytestmark = pytest.mark.slow


COLORED = "async () => (await mesh.colorBy('height')).range"
"""Loads the bundled modules that decode tracks and color a mesh."""


@pytest.fixture(scope="module")
def data():
    flag = meshreel.simulate_flag(30, n_rows=20, n_columns=24)
    tracks = {"height": flag.vertices[..., 2] + 10}
    return meshreel.encode(
        meshreel.MeshSequence(flag.vertices, flag.faces, fps=flag.fps, tracks=tracks)
    )


@pytest.fixture(scope="module")
def project(data, tmp_path_factory):
    """A fresh project with the package, whose page plays a file in ten lines."""
    folder = tmp_path_factory.mktemp("vite")
    template = ("page", "--template", "vanilla-ts", "--no-interactive")
    npm("create", "vite@latest", "--", *template, folder=folder)
    page = folder / "page"
    npm("install", str(packed(folder)), "three", "@types/three", folder=page)
    assert len(MAIN.splitlines()) == 10
    (page / "src" / "main.ts").write_text(MAIN + TRIED, "utf-8")
    (page / "public" / "flag.reel").write_bytes(data)
    return page


def assert_plays(new_page, url, data):
    page = new_page(url, width=640, height=320, is_shown=False, script=WATCHING)
    result = page.evaluate(PLAYED)
    assert_played(result, data)
    assert_shown(page.screenshot())
    low, high = page.evaluate(COLORED)
    heights = meshreel.decode(data).tracks["height"].values
    assert heights.min() <= low < high <= heights.max()
    page.close()  # while the server is there


def test_built_page_plays_and_passes_type_checks(new_page, project, data):
    npm("run", "build", folder=project)  # which begins with tsc
    with serving(files_below(project / "dist")) as (url, _):
        assert_plays(new_page, f"{url}/index.html", data)


def test_the_development_server_plays(new_page, project, data):
    with developing(project) as url:
        assert_plays(new_page, url, data)


@contextmanager
def developing(project):
    """The address where `npm run dev` serves a project."""
    process = subprocess.Popen(
        ["npm", "run", "dev", "--", "--host", "127.0.0.1"],
        cwd=project,
        env={**os.environ, "NO_COLOR": "1"},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )
    addresses, said = Queue(), []

    def listen():
        for line in process.stdout:
            said.append(line)
            if match := re.search(r"http://127\.0\.0\.1:\d+/", line):
                addresses.put(match[0])

    listening = threading.Thread(target=listen)
    listening.start()
    try:
        yield addresses.get(timeout=PATIENCE_S)
    except Empty:
        pytest.fail(f"vite named no address for {PATIENCE_S} s: {''.join(said)}")
    finally:
        os.killpg(process.pid, signal.SIGTERM)
        process.wait()
        listening.join()
        process.stdout.close()
