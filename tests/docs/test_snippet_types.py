"""Snippets of the documentation have no errors for users of `mypy --strict`."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import meshreel
from samples.pages import PAGES, name_of, shares_variables, snippets

pytest.importorskip("mypy", reason="mypy is not installed")
pytestmark = pytest.mark.slow

SETTINGS = """[mypy]
strict = true
warn_unreachable = true
[mypy-fsspec.*,igl.*,torch.*,xatlas.*]
ignore_missing_imports = true
"""


def test_snippets_have_no_type_errors(tmp_path):
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
