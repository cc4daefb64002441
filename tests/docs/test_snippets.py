"""Snippets run unchanged, page by page in order, after `meshreel demo`.

Those of the README, the tutorial and the guides share a folder, as a reader may use one: what the
README wrote is there when the tutorial begins.
"""

import re
import shutil
import signal
import subprocess
import sys
import urllib.request
from functools import partial
from pathlib import Path

import pytest

from meshreel.app.cli import main
from meshreel.model import flag
from meshreel.rendering import films, stills
from samples.figures import coarse_figures
from samples.pages import PAGES, README, ROOT, name_of, parts_of, shares_variables, snippets

N_FRAMES = 60
"""Frames of the flag, enough for all snippets; the demo has 300."""

SIZE = {"n_rows": 25, "n_columns": 30}
"""Size of the flag; the demo has four times as many vertices."""

PICTURE_PX = (480, 300)
"""Default size of pictures and films, a tenth of the real one."""

STILL_PX = stills.STILL_PX
"""Real size of pictures."""

DEMO = ["meshreel", "demo"]

TOGETHER = [README, ROOT / "docs/tutorial.md", *sorted((ROOT / "docs/guides").glob("*.md"))]
GROUPS = [TOGETHER, *([page] for page in PAGES if page not in TOGETHER and snippets(page))]


def run_program(words, monkeypatch):
    """Run `meshreel` in this process; it must succeed."""
    monkeypatch.setattr(sys, "argv", words)
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 0, words


def view(words):
    """Start a player, open its page, and stop it with ctrl-C."""
    command = [sys.executable, "-m", *words, "--no-open"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, bufsize=1) as process:
        try:
            [address] = re.findall(r"plays at (http://\S+)", process.stdout.readline())
            with urllib.request.urlopen(address, timeout=60) as page:
                assert page.status == 200
            process.send_signal(signal.SIGINT)
            assert process.wait(timeout=60) == 0
        finally:
            process.kill()


def run_demo(words):
    """Run the demo with a smaller flag."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(flag, "simulate_flag", partial(flag.simulate_flag, **SIZE))
        patch.setattr(stills, "STILL_PX", STILL_PX)  # the demo draws many views
        run_program([*words, "--frames", str(N_FRAMES)], patch)


def run_line(line, demo, monkeypatch):
    for words in parts_of(line):
        if words == DEMO and not Path(demo.name).exists():
            shutil.copytree(demo, demo.name)  # the fixture ran it
        elif words[:2] == DEMO:
            run_demo(words)
        elif words[:2] == ["meshreel", "view"]:
            view(words)
        elif words[0] == "meshreel":
            run_program(words, monkeypatch)
        else:
            subprocess.run(words, check=True, timeout=600)


def run_snippet(snippet, variables, demo, monkeypatch):
    if snippet.language == "python":
        exec(compile(snippet.text, "snippet", "exec"), variables)
        return
    for line in snippet.command_lines:
        run_line(line, demo, monkeypatch)


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    """A folder in which the demo has run."""
    folder = tmp_path_factory.mktemp("demo")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        run_demo(DEMO)
    return folder / "meshreel-demo"


def test_snippets_that_do_not_run_state_their_requirements():
    skipped = [snippet for page in PAGES for snippet in snippets(page) if snippet.needs]
    assert skipped
    known = (
        r"Blender|Houdini|Maya|ParaView|LS-DYNA|solver|three\.js|npm|Dask|PyTorch|bucket|checkout|"
        r"capture|xarray|pipx|\buv\b"
    )
    for snippet in skipped:
        assert re.search(known, snippet.needs), snippet.text
    assert "js" not in {s.language for p in PAGES for s in snippets(p) if not s.needs}


@pytest.mark.slow
@pytest.mark.usefixtures("few_grid_lines")
@pytest.mark.parametrize("pages", GROUPS, ids=lambda pages: name_of(pages[0]))
def test_snippets_run_in_order(pages, demo, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for module, name in ((films, "FILM_PX"), (films, "GIF_PX"), (stills, "STILL_PX")):
        monkeypatch.setattr(module, name, PICTURE_PX)
    if not any(" ".join(DEMO) in snippet.text for snippet in snippets(pages[0])):
        shutil.copytree(demo, tmp_path / demo.name)
    for page in pages:
        main, is_shared = {"__name__": "__main__"}, shares_variables(page)
        for snippet in snippets(page):
            if snippet.language in ("bash", "python") and not snippet.needs:
                with coarse_figures():
                    run_snippet(snippet, main if is_shared else dict(main), demo, monkeypatch)
